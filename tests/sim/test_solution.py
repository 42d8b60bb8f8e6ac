"""What a solution says besides its shape: how it ends, where it buckles, the sag."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from magbend.core.magnet import Magnet
from magbend.sim import (
    MagnetField,
    Rod,
    Section,
    Support,
    UniformField,
    find_equilibria,
    gmc,
    solve,
    solve_spatial,
)

ATTRACTED = Rod(
    name="attracted", side_mm=0.8, remanence_mT=-110.0,
    sections=(Section(length_mm=55.0, E_MPa=12.0),),
)  # fmt: skip
CUBE = Magnet.cube(55.0, 1.305)


def test_a_pulled_in_rod_tells_where_and_when_it_touches() -> None:
    found = solve(ATTRACTED, MagnetField(magnet=CUBE, gap_mm=43.5))
    end = found.ending
    assert end.kind == "contact"
    assert end.load == found.load_limit
    x, y = end.place_mm
    assert y == pytest.approx(-43.5 + 0.4, abs=1e-3)  # half its side off the face
    assert 55.0 - 27.5 < x < 55.0 + 27.5
    before = replace(ATTRACTED, remanence_mT=-110.0 * (end.load - 1e-4))
    assert solve(before, MagnetField(magnet=CUBE, gap_mm=43.5)).status == "stable"


def test_a_pulled_in_rod_tells_its_fold() -> None:
    rod = replace(gmc(2), remanence_mT=-400.0)
    rod = replace(rod, sections=tuple(replace(s, E_MPa=20.0) for s in rod.sections))
    found = solve(rod, MagnetField(magnet=CUBE, gap_mm=24.0))
    assert found.status == "pulled in: no equilibrium"
    end = found.ending
    assert math.hypot(*end.turning) > 0.5
    assert end.turning[1] < 0.0  # toward the magnet


@pytest.mark.parametrize("gap_mm", [20.0, 24.0])
def test_a_rod_in_space_ends_where_it_does_in_the_plane(gap_mm: float) -> None:
    field = MagnetField(magnet=CUBE, gap_mm=gap_mm)
    rod = replace(gmc(2), remanence_mT=-400.0)
    plane, space = solve(rod, field).ending, solve_spatial(rod, field).ending
    assert space.kind == plane.kind
    assert space.load == pytest.approx(plane.load, abs=1e-4)
    assert space.place_mm == pytest.approx((*plane.place_mm, 0.0), abs=0.3)
    tilted = replace(rod, remanence_z_mT=20.0)
    end = solve(tilted, field).ending
    assert end.kind == plane.kind
    assert len(end.place_mm) == len(end.turning) == 3


def test_the_straight_rod_against_the_field_names_its_buckled_shapes() -> None:
    field = UniformField(flux_mT=420.0, angle_deg=180.0)
    found = solve(gmc(2), field)
    assert found.status == "unstable"
    stable = [one for one in find_equilibria(gmc(2), field) if one.morse_index == 0]
    assert len(found.buckled_tips_mm) == len(stable) == 2
    for tip in found.buckled_tips_mm:
        assert min(math.dist(tip, one.tip_mm) for one in stable) < 1e-9
    below = solve(gmc(2), UniformField(flux_mT=50.0, angle_deg=180.0))
    assert below.buckled_tips_mm == ()


@pytest.mark.parametrize("lean", [1e-2, 1e-5, 1e-8])
def test_nearly_against_the_field_the_rod_buckles_the_way_it_leans(lean: float) -> None:
    """In space anywhere on a circle: a rod as stiff in all directions may turn."""
    (x, y), _ = solve(
        gmc(2), UniformField(flux_mT=420.0, angle_deg=180.0)
    ).buckled_tips_mm
    found = solve(
        gmc(2), UniformField(flux_mT=420.0, angle_deg=180.0 - math.degrees(lean))
    )
    assert found.status == "stable"
    assert found.centreline.tip_mm == pytest.approx((x, y), abs=30.0 * lean + 1e-6)
    across = 420.0 * lean * np.array([math.cos(1.0), math.sin(1.0)])
    space = solve_spatial(gmc(2), (-420.0, *across))
    assert space.status == "stable"
    expected = x, y * math.cos(1.0), y * math.sin(1.0)
    assert tuple(space.r_mm[-1]) == pytest.approx(expected, abs=30.0 * lean + 1e-5)


def test_the_sag_is_that_of_the_shape_in_space() -> None:
    rod = replace(gmc(2), density_kg_m3=2640.0)
    held = Support(gravity_m_s2=(0.0, 0.0, -9.80665))
    found = solve(rod, UniformField(flux_mT=50.0), support=held)
    space = solve_spatial(rod, UniformField(flux_mT=50.0), support=held)
    np.testing.assert_array_equal(found.z_mm, space.r_mm[:, 2])
    np.testing.assert_array_equal(found.points_mm[:, 2], found.z_mm)
    assert 1.5 < found.sag_mm < 1.8
    flat = solve(rod, UniformField(flux_mT=50.0))
    assert flat.z_mm is None
    assert flat.sag_mm == 0.0
    assert not np.any(flat.points_mm[:, 2])
