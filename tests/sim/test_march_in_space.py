"""The march of a rod in space: columns, the field along it, what is surely stable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from magbend.core.jit import once
from magbend.sim import Cuboid, Field, Rod, Section, Support, Uniform
from magbend.sim.magnet.jet import JET, jet_at
from magbend.sim.scaling import field_array
from magbend.sim.spatial.index import morse_index
from magbend.sim.spatial.march import BLOCK, STATE, Y, Z
from magbend.sim.spatial.newton import (
    STILL,
    newton,
    room,
    run,
    solve_pose,
    unloaded,
)
from magbend.sim.spatial.rod import SpatialRod, clamp_of, rod_table

SUPPORT = Support(gravity_m_s2=(0.0, -3.0, -9.0))
CUBOID = Cuboid(
    sides_mm=(20.0, 30.0, 40.0), remanence_T=1.3, gap_mm=20.0, axis_angle_deg=33.0,
    elevation_deg=20.0, offset_mm=(1.0, 2.0, 3.0),
)  # fmt: skip
ROD = Rod(
    name="tilted", side_mm=1.0, remanence_mT=30.0, remanence_y_mT=12.0,
    remanence_z_mT=-9.0, natural_curvature_per_mm=0.01, density_kg_m3=2600.0,
    sections=(Section(length_mm=14.0, E_MPa=9.0), Section(length_mm=16.0, E_MPa=6.0)),
)  # fmt: skip


def table(rod: Rod) -> np.ndarray:
    return rod_table(SpatialRod.from_specimen(rod), SUPPORT)


def test_third_derivatives_of_a_cuboid() -> None:
    """The closed form against differences, as a sum of sources takes them."""
    one = field_array(Field(CUBOID), 30.0)
    two = field_array(Field(CUBOID, Uniform(flux_mT=0.0)), 30.0)
    rng = np.random.default_rng(3)
    for place in rng.normal(size=(16, 3)):
        at = one[4:7] + 1.5 * place / np.linalg.norm(place)
        jets = np.empty((2, JET))
        for field, jet in zip((one, two), jets, strict=True):
            once(lambda f=field, j=jet, r=at: jet_at(f, *r, j, *np.empty((2, 12))))
        size = np.abs(jets[0, 8:]).max()
        assert jets[0, :8] == pytest.approx(jets[1, :8], abs=1e-12)
        assert jets[0, 8:] == pytest.approx(jets[1, 8:], abs=1e-6 * size)


def test_columns_are_derivatives_of_the_march() -> None:
    rod, field, n = table(ROD), field_array(Field(CUBOID), 30.0), 40.0
    R = np.linalg.qr(np.array([[0.1, -0.3, 1.0], [1.0, 0.2, 0.1], [0.1, 1.0, 0.3]]))[0]
    R *= np.linalg.det(R)
    r, h = np.array([0.9, 0.2, -0.1]), 1e-6
    held = room(rod, field, n)

    def state(x: np.ndarray) -> np.ndarray:
        held[3][0] = 0.0  # the field itself, not a table of it
        turned = R @ (np.eye(3) + np.cross(np.eye(3), x[:3]))
        run(rod, field, 1.0, n, turned, r + x[3:], True, np.inf, held)
        return held[0][0][Y : Y + STATE].copy()

    state(np.zeros(6))
    columns = held[0][0][Z : Z + BLOCK].reshape(12, 6).copy()
    for a, x in enumerate(h * np.eye(6)):
        slope = (state(x) - state(-x)) / (2.0 * h)
        assert slope[9:] == pytest.approx(columns[3:, a], rel=1e-6, abs=1e-6)


def test_the_field_along_a_curve_is_the_field() -> None:
    """A march in the table of its own curve ends where one in the field does."""
    rod, field, clamp = table(ROD), field_array(Field(CUBOID), 30.0), clamp_of(SUPPORT)
    misses = []
    for n in (20.0, 40.0):
        held, ends = room(rod, field, n), []
        for _ in range(2):
            run(rod, field, 1.0, n, clamp, clamp[:, 2].copy(), False, np.inf, held)
            ends.append(held[0][0][Y : Y + STATE].copy())
        misses.append(np.abs(ends[1] - ends[0]).max())
    assert 0.0 < misses[1] < 3e-8
    assert misses[0] > 40.0 * misses[1]


def test_the_last_march_leaves_its_table_to_that_for_the_shape() -> None:
    """The field along the curve is looked up once for both, at no loss."""
    away = Field(replace(CUBOID, gap_mm=60.0))
    rod, field, n, clamp = table(ROD), field_array(away, 30.0), 20.0, clamp_of(SUPPORT)
    R, r, held = np.empty((3, 3)), np.empty(3), room(rod, field, 2.0 * n)
    index, load, _ = once(
        lambda: solve_pose(rod, field, n, clamp, R, r, 1e-9, held), patience=1_000_000
    )
    assert (index, load) == (0, 1.0)
    assert held[3][2] <= STILL
    ends = []
    for moved in (0.0, np.inf):
        run(rod, field, 1.0, 2.0 * n, R, r, False, moved, held)
        ends.append(held[0][0][Y : Y + STATE].copy())
    assert ends[0] == pytest.approx(ends[1], abs=1e-11)


def test_what_is_surely_stable_has_no_focal_point() -> None:
    """And most stable rods are surely so, among loads that leave some unstable."""
    rng, clamp = np.random.default_rng(8), clamp_of(SUPPORT)
    counted, sure_ones = 0, 0
    for _ in range(100):
        rod = table(ROD)
        rod[:, 4:7] = rng.uniform(-1.0, 1.0, 3) * rng.uniform(5.0, 120.0)
        flux = 1e-3 * rng.uniform(5.0, 60.0)
        field = np.zeros(17)
        field[1:4] = flux * rng.normal(size=3)
        R, r, J = np.empty((3, 3)), np.empty(3), np.zeros((6, 6))
        held = room(rod, field, 80.0)
        unloaded(rod, field, 20.0, clamp, R, r, held)
        start = morse_index(rod, field, 1.0, 80.0, R, r)
        found, first, last = newton(
            rod, field, 1.0, 40.0, clamp, R, r, 1.0, 1e-9, J, held
        )
        assert not (first and start)
        if found:
            index = morse_index(rod, field, 1.0, 80.0, R, r)
            assert not (last and index)
            counted += index == 0
            sure_ones += last
    assert counted > 20
    assert sure_ones > 0.8 * counted
