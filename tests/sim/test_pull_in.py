"""The map of the gap at which rods are pulled in, against paths of single rods."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from magbend.cli.main import app
from magbend.core.errors import InputError
from magbend.sim import (
    Cuboid,
    Field,
    Rod,
    Section,
    Uniform,
    draw_pull_in,
    follow_path,
    pull_in_csv,
    pull_in_gaps,
    solve,
)

ROD = Rod(
    name="attracted", side_mm=0.8, remanence_mT=-110.0,
    sections=(Section(length_mm=35.0, E_MPa=12.0), Section(length_mm=20.0, E_MPa=9.0)),
)  # fmt: skip
CUBE = Field(Cuboid(sides_mm=55.0, remanence_T=1.305))
TURNED = Field(Cuboid(sides_mm=30.0, remanence_T=1.305, axis_angle_deg=20.0))


OVER = {"remanence_mT": [-150.0, -110.0], "E_MPa": [8.0, 14.0]}


def rod_of(E_MPa: float, remanence_mT: float) -> Rod:
    root, tip = ROD.sections
    parts = replace(root, E_MPa=E_MPa), replace(tip, E_MPa=tip.E_MPa * E_MPa / 12.0)
    return replace(ROD, remanence_mT=remanence_mT, sections=parts)


def test_beyond_the_gap_the_load_can_grow_and_within_it_cannot() -> None:
    found = pull_in_gaps(ROD, CUBE, OVER, range_mm=(12.0, 150.0))
    assert found.gap_mm.shape == (2, 2)
    for i, E in enumerate(OVER["E_MPa"]):
        for k, mT in enumerate(OVER["remanence_mT"]):
            rod, gap_mm = rod_of(E, mT), found.gap_mm[i, k]
            outside = solve(rod, CUBE.at_gap(gap_mm + 2e-3))
            inside = solve(rod, CUBE.at_gap(gap_mm - 2e-3))
            assert outside.status == "stable"
            assert inside.status == "pulled in: no equilibrium"


def test_the_gaps_are_the_folds_of_finer_paths() -> None:
    over = {"remanence_mT": [100.0, 150.0], "E_MPa": [8.0]}
    found = pull_in_gaps(ROD, TURNED, over, range_mm=(12.0, 150.0))
    for k, mT in enumerate(over["remanence_mT"]):
        path = follow_path(rod_of(8.0, mT), TURNED, gap_mm=(150.0, 30.0), steps=150)
        assert path.folds[-1].kind == "fold"
        assert path.folds[-1].value == pytest.approx(found.gap_mm[0, k], abs=1e-5)


def test_rods_that_are_never_or_always_pulled_in_are_told() -> None:
    over = {"remanence_mT": [-110.0], "length_mm": [5.0, 55.0]}
    found = pull_in_gaps(ROD, CUBE, over, range_mm=(20.0, 40.0))
    assert math.isnan(found.gap_mm[0, 0])
    assert math.isinf(found.gap_mm[1, 0])
    rows = list(csv.reader(pull_in_csv(found).splitlines()))
    assert rows[1:] == [["-110", "5", ""], ["-110", "55", "inf"]]
    with pytest.raises(InputError, match="at least two values"):
        draw_pull_in(Path("no.png"), found, title="no")


@pytest.mark.parametrize(
    ("field", "over", "more", "said"),
    [
        (Field(Uniform(flux_mT=5.0)), {}, {}, "must wait for its gap_mm"),
        (CUBE, {"E_MPa": [1.0]}, {}, "over must name two of"),
        (CUBE, {"E_MPa": [1.0], "diameter_mm": [1.0]}, {}, "over must name two of"),
        (CUBE, {"E_MPa": [2.0, 1.0], "side_mm": [1.0]}, {}, "E_MPa in MPa must rise"),
        (CUBE, {"E_MPa": [0.0], "side_mm": [1.0]}, {}, "E_MPa .*above zero"),
        (CUBE, {"E_MPa": [math.nan], "side_mm": [1.0]}, {}, "E_MPa"),
        (CUBE, {"E_MPa": [], "side_mm": [1.0]}, {}, "at least one value"),
        (CUBE, {"E_MPa": [1.0], "side_mm": [1.0]}, {"range_mm": (9.0, 5.0)}, "rise"),
    ],
)
def test_bad_maps_are_refused_in_one_sentence(
    field: Field, over: dict[str, list[float]], more: dict[str, object], said: str
) -> None:
    with pytest.raises(InputError, match=said) as error:
        pull_in_gaps(ROD, field, over, **more)
    assert "\n" not in str(error.value)


def test_the_command_draws_and_writes_the_map(tmp_path: Path) -> None:
    magnet = tmp_path / "magnet.toml"
    magnet.write_text("side_mm = 55.0\nremanence_T = 1.305\n", encoding="utf-8")
    options = [
        "sim", "pull-in", "--gmc", "2", "--magnet", str(magnet),
        "--over", "remanence_mT=-300:-100:3", "--over", "E_MPa=5:15:2",
        "--figure", str(tmp_path / "map.png"), "--out", str(tmp_path / "map.csv"),
    ]  # fmt: skip
    done = CliRunner().invoke(app, [*options, "--json"])
    assert done.exit_code == 0
    found = json.loads(done.stdout)
    assert np.shape(found["pull_in_gap_mm"]) == (2, 3)
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    assert len((tmp_path / "map.csv").read_text().splitlines()) == 7
    for bad in ("E_MPa", "E_MPa=1:2", "E_MPa=1:2:0"):
        wrong = [bad if one == "E_MPa=5:15:2" else one for one in options]
        assert CliRunner().invoke(app, wrong).exit_code == 2
