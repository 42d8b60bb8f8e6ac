"""All equilibria before magnets: none missed, each confirmed, and counted."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from magbend.cli import sim as cli
from magbend.core.errors import InputError, SolverError
from magbend.sim import (
    Cuboid,
    Cylinder,
    Field,
    Support,
    Uniform,
    find_equilibria,
    gmc,
    solve,
)
from magbend.sim.check.solver import check_solve

CUBE = Cuboid(sides_mm=55.0, remanence_T=1.305)
CASES = {
    "repelled": (10.0, Field(CUBE, gap_mm=45.0), 3),
    "attracted": (-5.0, Field(CUBE, gap_mm=50.0), 1),
    "cylinder and field": (
        12.0,
        Field(
            Cylinder(diameter_mm=40.0, length_mm=30.0, remanence_T=1.3, gap_mm=35.0),
            Uniform(flux_mT=20.0, angle_deg=180.0),
        ),
        3,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_search_from_everywhere_finds_no_other(name: str) -> None:
    times, field, count = CASES[name]
    rod = replace(gmc(2), remanence_mT=20.07 * times)
    found = find_equilibria(rod, field)
    assert len(found) == count
    assert sum((-1) ** one.morse_index for one in found) == 1
    for one in found:
        start = one.centreline.s_mm, one.centreline.theta_rad
        check = check_solve(rod, field, start=start)
        assert math.dist(check.tip_mm, one.tip_mm) < 1e-6
        assert check.morse_index == one.morse_index
    tip = solve(rod, field).centreline.tip_mm
    assert min(math.dist(tip, one.tip_mm) for one in found) < 1e-8
    rng = np.random.default_rng(11)
    s = np.linspace(0.0, 30.0, 61)
    for _ in range(12):
        bend = rng.uniform(-4.0, 4.0) * s / 30.0 + rng.uniform(-1.5, 1.5) * np.sin(
            np.pi * s / 30.0
        )
        try:
            other = check_solve(rod, field, start=(s, bend), degree=10)
        except (SolverError, InputError):
            continue
        assert min(math.dist(other.tip_mm, one.tip_mm) for one in found) < 1e-3


def test_what_the_scan_cannot_take_is_refused() -> None:
    field = Field(CUBE, gap_mm=60.0)
    mixed = replace(gmc(2), sections=(
        replace(gmc(2).sections[0], remanence_mT=5.0), *gmc(2).sections[1:]
    ))  # fmt: skip
    with pytest.raises(InputError, match="one remanence_mT"):
        find_equilibria(mixed, field)
    held = Support(gravity_m_s2=(0.0, -9.8, 0.0))
    with pytest.raises(InputError, match="gravity_m_s2 must be zero"):
        find_equilibria(gmc(2), field, support=held)
    off = Field(replace(CUBE, elevation_deg=5.0), gap_mm=60.0)
    with pytest.raises(InputError, match="within the plane"):
        find_equilibria(gmc(2), off)


def test_the_command_lists_equilibria_before_a_magnet(tmp_path: Path) -> None:
    rod, magnet = tmp_path / "rod.toml", tmp_path / "magnet.toml"
    rod.write_text(
        'name = "strong"\nside_mm = 1.0\nremanence_mT = 200\n'
        "[[section]]\nlength_mm = 30\nE_MPa = 14\n"
    )
    magnet.write_text("side_mm = 55.0\nremanence_T = 1.305\n")
    options = ["equilibria", "--specimen", str(rod), "--magnet", str(magnet)]
    done = CliRunner().invoke(cli.app, [*options, "--gap-mm", "45", "--json"])
    found = json.loads(done.output)
    signs = [(-1) ** one["morse_index"] for one in found["equilibria"]]
    assert sum(signs) == 1
    assert found["count"] == len(signs)
    assert CliRunner().invoke(cli.app, options).exit_code == 2
