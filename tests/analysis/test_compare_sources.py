"""Runs beside the field of any sources, and what the report says of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from analysis_factory import GAPS_MM, write_run
from numpy.typing import NDArray
from typer.testing import CliRunner

from magbend import sim
from magbend.analysis import RunData, fit_runs, load_run
from magbend.analysis.compare.compare import compare_run
from magbend.analysis.compare.field import flux_at_tip_mT
from magbend.analysis.report.budget import tip_budget
from magbend.cli.main import app
from magbend.core.errors import InputError, SolverError

Array = NDArray[np.float64]
SEVERAL = sim.Field(
    sim.Cuboid(sides_mm=30.0, remanence_T=1.3),
    sim.Cuboid(sides_mm=12.0, remanence_T=-1.2, centre_mm=(60.0, 25.0, 0.0)),
    sim.Coil(
        diameter_mm=50.0, current_A=4.0, turns=100, centre_mm=(-40.0, 0.0, 0.0),
        axis_angle_deg=0.0,
    ),
)  # fmt: skip
PLACED = sim.Field(
    sim.Cylinder(
        diameter_mm=40.0, length_mm=30.0, remanence_T=1.3, centre_mm=(25.0, -70.0, 0.0)
    )
)


@pytest.mark.parametrize("sources", [SEVERAL, PLACED], ids=["several", "placed"])
def test_the_true_rod_before_its_sources_is_found_exact(
    tmp_path: Path, sources: sim.Field
) -> None:
    gaps_mm = GAPS_MM if sources.follows_gap else GAPS_MM[:1]
    run = load_run(write_run(tmp_path / "a", sources=sources, gaps_mm=gaps_mm))
    done = compare_run(run, sources=sources)
    for one in done.of("magnet"):
        assert one.ok
        assert one.errors.rms_mm < 1e-5
    assert max(one.errors.rms_mm for one in compare_run(run).of("magnet")) > 1e-2
    first = done.of("uniform")[0]
    here = sources.at_gap(run.steps[0].gap_mm) if sources.follows_gap else sources
    _, angle_deg = flux_at_tip_mT(here, run.specimen.length_mm)
    uniform = sim.UniformField(flux_mT=run.steps[0].flux_mT, angle_deg=angle_deg)
    alone = sim.solve(run.specimen, uniform, support=run.support)
    assert first.solution.centreline.tip_mm == pytest.approx(
        alone.centreline.tip_mm, abs=1e-9
    )
    causes = {line.cause for line in tip_budget(done)}
    assert ("gap" in causes) is sources.follows_gap
    assert "uniform instead of true field" in causes


@pytest.mark.parametrize(
    "task",
    [
        lambda run: compare_run(run, sources=PLACED),
        lambda run: fit_runs([run], sources=PLACED, judged=False),
    ],
    ids=["compare", "fit"],
)
def test_sources_that_stand_still_are_refused_where_the_gap_changed(
    tmp_path: Path, task: Callable[[RunData], object]
) -> None:
    """All steps were taken for steps in one field, without a word."""
    with pytest.raises(InputError, match="goes from 30 to 80 mm; leave centre_mm and"):
        task(load_run(write_run(tmp_path / "a", gaps_mm=(80.0, 30.0))))


def test_a_map_in_gauss_and_one_mirrored_are_told_by_the_run(tmp_path: Path) -> None:
    """Both are fields like any other: readings and photographs tell, not the map."""
    run = load_run(write_run(tmp_path / "a", sources=PLACED, gaps_mm=GAPS_MM[:1]))
    length_mm = run.specimen.length_mm

    def true_mT(points: Array) -> Array:
        return np.array([sim.flux_mT(PLACED, p, length_mm=length_mm) for p in points])

    box = [[-2.0, -16.0, -2.0], [32.0, 16.0, 2.0]]
    turn = np.array([1.0, -1.0, 1.0])
    gauss = sim.sampled_map(lambda p: 10.0 * true_mT(p), box, points=5)
    mirrored = sim.sampled_map(lambda p: turn * true_mT(turn * p), box, points=5)
    for ask in (compare_run, fit_runs):
        with pytest.raises(InputError, match=r"10 times .* Bx \(G\)"):
            ask(run if ask is compare_run else [run], sources=sim.Field(gauss))
    with pytest.raises(SolverError, match="an axis of the map is mirrored"):
        fit_runs([run], sources=sim.Field(mirrored))


def test_a_report_names_the_sources_it_was_given(tmp_path: Path) -> None:
    run = write_run(tmp_path / "a", sources=SEVERAL)
    file = tmp_path / "sources.json"
    file.write_text(json.dumps({"source": sim.tables_of(SEVERAL)}))
    page = tmp_path / "report.html"
    asked = ["analysis", "report", str(run), "--magnet", str(file), "--out", str(page)]
    done = CliRunner().invoke(app, [*asked, "--no-fit", "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["failed_steps"] == 0
    assert "cuboid, cuboid, coil" in page.read_text()
    again = CliRunner().invoke(
        app, ["analysis", "compare", str(run), "--magnet", str(file), "--json"]
    )
    rows = [row for row in json.loads(again.stdout) if row["model"] == "magnet"]
    assert max(row["rms_mm"] for row in rows) < 1e-5
