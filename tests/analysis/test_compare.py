"""Comparisons of made-up runs against numbers known beforehand, and bad folders."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from analysis_factory import GAPS_MM, MAGNET, write_run

from magbend import sim
from magbend.analysis import load_run
from magbend.analysis.compare.compare import (
    COLUMNS,
    check_any,
    compare_run,
    comparison_table,
    uniform_rod,
    write_comparison,
)
from magbend.analysis.runs.load import find_runs
from magbend.core.errors import StoreError


def test_the_true_rod_in_the_true_field_is_found_exact(tmp_path: Path) -> None:
    done = compare_run(load_run(write_run(tmp_path / "a")))
    table = comparison_table([done])
    assert tuple(table.columns[: len(COLUMNS)]) == COLUMNS
    assert len(table) == 2 * len(GAPS_MM)
    magnet = table[table["model"] == "magnet"]
    assert (magnet["status"] == "ok").all()
    assert magnet["rms_mm"].max() < 1e-5
    assert done.magnet is not None
    assert done.magnet.remanence_T == pytest.approx(MAGNET.remanence_T, rel=1e-9)


def test_price_of_the_uniform_field_is_that_of_the_dossier(tmp_path: Path) -> None:
    """GMC 2 before a 55 mm cube of 1.305 T at 60 mm bends 11.9 % less than uniform."""
    from magbend.core.magnet import Magnet

    path = write_run(tmp_path / "a", magnet=Magnet.cube(55.0, 1.305), gaps_mm=[60.0])
    done = compare_run(load_run(path))
    uniform = done.of("uniform")[0]
    assert uniform.solution is not None
    assert uniform.solution.centreline is not None
    assert uniform.frame is not None
    assert uniform.frame.centreline is not None
    measured = uniform.frame.centreline.tip_mm[1]
    assert measured == pytest.approx(4.14947950271, abs=1e-6)
    simulated = uniform.solution.centreline.tip_mm[1]
    assert 100.0 * (measured / simulated - 1.0) == pytest.approx(-11.9, abs=0.05)


def test_a_scaled_line_has_the_errors_one_can_write_down(tmp_path: Path) -> None:
    path = write_run(tmp_path / "a")
    table = pd.read_csv(path / "centrelines.csv")
    table["y_mm"] += 0.25
    table.to_csv(path / "centrelines.csv", index=False)
    for comparison in compare_run(load_run(path)).of("magnet"):
        assert comparison.errors is not None
        for value in (
            comparison.errors.rms_mm,
            comparison.errors.max_mm,
            comparison.errors.tip_mm,
        ):
            assert value == pytest.approx(0.25, abs=1e-5)
        assert comparison.errors.tip_percent == pytest.approx(25.0 / 30.0, abs=1e-4)
        assert comparison.errors.tip_angle_deg == pytest.approx(0.0, abs=1e-6)


def _stands(path: Path, up: list[float]) -> None:
    """Write the bench's orientation into a run, as `magbend rig run` does."""
    record = json.loads((path / "run.json").read_text())
    record["rig"]["bench"] = {"up": up}
    (path / "run.json").write_text(json.dumps(record))


def test_weight_is_taken_from_the_run_unless_it_is_given(tmp_path: Path) -> None:
    heavy = replace(sim.gmc(2), density_kg_m3=2640.0)
    down = sim.Support(gravity_m_s2=(0.0, -9.80665, 0.0))
    path = write_run(tmp_path / "a", specimen=heavy, support=down)
    _stands(path, [0.0, 1.0, 0.0])
    run = load_run(path)
    assert run.support == down
    for comparison in compare_run(run).of("magnet"):
        assert comparison.errors is not None
        assert comparison.errors.rms_mm < 1e-5
    weightless = compare_run(run, support=sim.Support()).of("magnet")[0]
    assert weightless.errors is not None
    assert weightless.errors.tip_mm > 0.3
    light = write_run(tmp_path / "b")
    _stands(light, [0.0, 1.0, 0.0])
    assert load_run(light).support == sim.Support()


def test_runs_of_benches_that_stand_otherwise_are_not_fitted_as_one(
    tmp_path: Path,
) -> None:
    from magbend.analysis.fit.runs import fit_runs

    heavy = replace(sim.gmc(2), density_kg_m3=2640.0)
    paths = [write_run(tmp_path / name, specimen=heavy) for name in "ab"]
    _stands(paths[1], [0.0, 0.0, 1.0])
    with pytest.raises(StoreError, match=r"\[bench\] up"):
        fit_runs([load_run(path) for path in paths])


def test_grading_the_stiffness_makes_the_bend_more_circular(tmp_path: Path) -> None:
    for comparison in compare_run(load_run(write_run(tmp_path / "a"))).of("magnet"):
        assert comparison.simulated is not None
        assert comparison.circularity_uniform_rod == pytest.approx(0.75, abs=0.01)
        assert comparison.simulated.circularity > 0.84


def test_uniform_rod_has_the_same_tip_compliance() -> None:
    graded = sim.gmc(6)
    field = sim.UniformField(flux_mT=0.01)
    tips = []
    for rod in (graded, uniform_rod(graded)):
        line = sim.solve(rod, field).centreline
        assert line is not None
        tips.append(line.tip_mm[1])
    assert tips[0] == pytest.approx(tips[1], rel=1e-6)


def test_failed_frame_has_a_row_that_says_why(tmp_path: Path) -> None:
    path = write_run(tmp_path / "a", failed=[1])
    done = compare_run(load_run(path))
    write_comparison(path / "comparison.csv", [done])
    table = pd.read_csv(path / "comparison.csv")
    row = table[table["step"] == 1].iloc[0]
    assert row["status"] == "failed frame: no rod was found"
    assert math.isnan(row["rms_mm"])
    assert math.isnan(row["radius_measured_mm"])
    check_any([done])


def test_overload_leaves_the_magnet_model(tmp_path: Path) -> None:
    done = compare_run(load_run(write_run(tmp_path / "a", overload=[2])))
    statuses = {(c.step.index, c.model): c.status for c in done.comparisons}
    assert statuses[2, "uniform"].startswith("no field reading")
    assert statuses[2, "magnet"] == "ok"


def test_lines_of_another_specimen_are_refused(tmp_path: Path) -> None:
    short = sim.gmc(2)
    short = replace(
        short, sections=tuple(replace(s, length_mm=8.0) for s in short.sections)
    )
    path = write_run(tmp_path / "a", specimen=sim.gmc(2), truth=short)
    done = compare_run(load_run(path))
    assert all("length mismatch" in c.status for c in done.comparisons)
    with pytest.raises(StoreError, match=r"no step could be compared.*24\.00 mm"):
        check_any([done])


def test_a_thicker_rod_than_stated_raises_a_flag(tmp_path: Path) -> None:
    path = write_run(tmp_path / "a", specimen=sim.gmc(2), truth=sim.gmc(1))
    assert all(
        "width_mismatch" in c.flags for c in compare_run(load_run(path)).comparisons
    )


def test_wrong_sign_of_the_remanence_raises_a_flag(tmp_path: Path) -> None:
    wrong = replace(sim.gmc(2), remanence_mT=-20.07)
    path = write_run(tmp_path / "a", specimen=wrong, truth=sim.gmc(2))
    done = compare_run(load_run(path))
    assert all("bends_the_other_way" in c.flags for c in done.of("magnet"))


def test_single_step_run_is_compared(tmp_path: Path) -> None:
    done = compare_run(load_run(write_run(tmp_path / "a", gaps_mm=[60.0])))
    assert [c.status for c in done.comparisons] == ["ok", "ok"]


def test_run_cut_off_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    path = write_run(tmp_path / "a", end=False)
    with (path / "steps.jsonl").open("a") as file:
        file.write('{"index": 3, "gap')
    run = load_run(path)
    assert len(run.steps) == 3
    assert any("torn" in warning for warning in run.warnings)
    assert any("cut off" in warning for warning in run.warnings)


def test_missing_files_are_named_with_the_command_that_makes_them(
    tmp_path: Path,
) -> None:
    path = write_run(tmp_path / "a")
    (path / "centrelines.csv").unlink()
    with pytest.raises(StoreError, match="magbend vision extract"):
        load_run(path)
    (path / "frames.csv").unlink()
    with pytest.raises(StoreError, match="magbend vision calibrate"):
        load_run(path)
    with pytest.raises(StoreError, match="there is no such folder"):
        find_runs([tmp_path / "none"])
    with pytest.raises(StoreError, match="not a run folder"):
        find_runs([path / "images"])
    (path / "steps.jsonl").write_text("")
    with pytest.raises(StoreError, match="no finished step"):
        load_run(path)


def test_uncalibrated_lines_say_so(tmp_path: Path) -> None:
    path = write_run(tmp_path / "a")
    table = pd.read_csv(path / "centrelines.csv")
    columns = ["s_mm", "x_mm", "y_mm", "theta_rad", "kappa_per_mm", "width_mm"]
    table[columns] = np.nan
    table.to_csv(path / "centrelines.csv", index=False)
    done = compare_run(load_run(path))
    assert all(c.status.startswith("no calibration") for c in done.comparisons)


def test_spoilt_tables_are_one_sentence(tmp_path: Path) -> None:
    path = write_run(tmp_path / "a")
    (path / "centrelines.csv").write_text("image,s_mm\nstep_000.png,1\n")
    with pytest.raises(StoreError, match="must have the column"):
        load_run(path)
    (path / "centrelines.csv").write_bytes(b"\xff\xfe\x00broken")
    with pytest.raises(StoreError, match="is no text"):
        load_run(path)
    record = json.loads((path / "run.json").read_text())
    record["specimen"]["side_mm"] = -1.0
    (path / "run.json").write_text(json.dumps(record))
    with pytest.raises(StoreError, match="side_mm"):
        load_run(path)


def test_tables_are_tidy(tmp_path: Path) -> None:
    run = load_run(write_run(tmp_path / "a", failed=[0]))
    assert list(run.steps_table["frame_status"]) == ["failed", "ok", "ok"]
    points = run.points_table
    assert set(points["step"]) == {1, 2}
    assert {"run", "gap_mm", "flux_mT", "s_mm", "x_mm", "sigma_mm"} <= set(points)
    assert list(run.frames_table["status"]) == ["failed", "ok", "ok"]
