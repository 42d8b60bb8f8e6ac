"""The lanes of rods in space against rods one by one, and the field in them."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.core.jit import once
from magbend.core.magnet import Magnet
from magbend.sim import Support, solve_spatial_many
from magbend.sim.batch import space
from magbend.sim.batch.lanes import HARD
from magbend.sim.batch.space_field import bends, gradients
from magbend.sim.batch.space_lanes import solve_space_lanes
from magbend.sim.batch.space_room import BENT, HALF, LANES, LOOK, PACK, G
from magbend.sim.magnet.flux import CUBOID, flux_at
from magbend.sim.magnet.jet import JET, bend, jet_at
from magbend.sim.spatial.march import MU1, MU2
from magbend.sim.spatial.rows import solve_rods

HELD = Support(gravity_m_s2=(1.0, -2.0, -9.0), clamp_angle_deg=10.0)
TURNED = Magnet.cube(50.0, 1.3, elevation_deg=20.0, offset_mm=(4.0, 3.0, 6.0))


def draw(rng, n: int, *, flux: bool, tilted: bool, times: float = 1.0) -> dict:
    designs = {
        "length_mm": rng.uniform(5.0, 15.0, (n, 3)),
        "E_MPa": rng.uniform(8.0, 30.0, (n, 3)),
        "width_mm": rng.uniform(0.7, 1.3, n),
        "height_mm": rng.uniform(0.7, 1.3, n),
        "remanence_mT": times * rng.uniform(-25.0, 25.0, (n, 3)),
        "natural_curvature_per_mm": rng.uniform(-0.01, 0.01, n),
        "density_kg_m3": 2640.0,
    }
    if tilted:
        designs["remanence_y_mT"] = times * rng.uniform(-10.0, 10.0, (n, 3))
        designs["remanence_z_mT"] = times * rng.uniform(-10.0, 10.0, n)
    if not flux:
        return designs | {"gap_mm": rng.uniform(30.0, 90.0, n)}
    angles = {
        "angle_deg": rng.uniform(-90.0, 90.0, n),
        "elevation_deg": rng.uniform(-50.0, 50.0, n),
    }
    return designs | angles | {"flux_mT": rng.uniform(10.0, 60.0, n)}


@pytest.mark.parametrize(("times", "most"), [(1.0, 0.9), (4.0, 0.7)])
@pytest.mark.parametrize("tilted", [False, True])
@pytest.mark.parametrize("flux", [False, True])
def test_lanes_find_what_single_rods_find(flux, tilted, times, most) -> None:
    """Within both bounds, on the stable branch; and they find nearly all."""
    n = 150
    rng = np.random.default_rng([5, flux, tilted, int(times)])
    designs = draw(rng, n, flux=flux, tilted=tilted, times=times)
    magnet = None if flux else TURNED
    columns = space._columns(designs, magnet, HELD)
    rods, total_mm, margins = space._rods(columns, HELD, 0.49)
    field = None if magnet is None else space.before(magnet)
    fields, clamp = space._fields(columns, field, total_mm), space.clamp_of(HELD)
    boxes = np.tile(space._box_mm(field), (n, 1))
    tips, ones = np.empty((2, n, 7))
    outcome, expected, index = np.empty((3, n), np.int8)
    solve_space_lanes(rods, fields, clamp, margins, tips, outcome)
    solve_rods(rods, fields, clamp, margins, boxes, ones, expected, index)
    there = outcome != HARD
    assert there.mean() > most
    assert not expected[there].any()
    assert not index[there].any()
    off = np.abs(tips - ones)[there]
    bound = tips[there, 6] + ones[there, 6]
    assert np.all(off[:, :3].max(axis=1) < bound)
    assert off[:, 3:6].max() < 1e-4
    assert np.median(bound) < 1e-6


def test_gradients_in_lanes_are_those_of_the_cuboid() -> None:
    """The gradient to rounding, and its change along the magnetisation across."""
    rng = np.random.default_rng(2)
    field = np.zeros(17)
    field[:4] = CUBOID, 0.4, 0.7, 0.9
    field[[7, 11, 15]] = 1.0
    field[16] = 1.3
    w = np.zeros(PACK)
    places = rng.normal(size=(3, LANES))
    places *= rng.uniform(1.25, 4.0, LANES) / np.linalg.norm(places, axis=0)
    directors = rng.normal(size=(6, LANES))
    w[LOOK : LOOK + 6 * LANES] = directors.ravel()
    w[LOOK + 12 * LANES : LOOK + 15 * LANES] = places.ravel()
    w[HALF : HALF + 3 * LANES] = np.repeat(field[1:4], LANES)
    w[HALF + 3 * LANES : HALF + 4 * LANES] = 1.3 / (4.0 * np.pi)
    mu = rng.normal(size=(2, LANES))
    w[MU1 * LANES : (MU1 + 1) * LANES], w[MU2 * LANES : (MU2 + 1) * LANES] = mu
    gradients(w)
    bends(w)
    found = w[G : G + 5 * LANES].reshape(5, LANES)
    bent = w[BENT : BENT + 5 * LANES].reshape(5, LANES)
    for i in range(LANES):
        b, jet = np.empty(12), np.empty(JET)
        flux_at(field, *places[:, i], b)
        assert found[:, i] == pytest.approx(b[[3, 4, 5, 7, 8]], abs=1e-12)
        at = places[:, i]
        once(lambda at=at, jet=jet: jet_at(field, *at, jet, *np.empty((2, 12))))
        along = mu[0, i] * directors[:3, i] + mu[1, i] * directors[3:, i]
        change = once(lambda jet=jet, along=along: bend(jet, 8, *along))
        assert bent[:, i] == pytest.approx(change, abs=1e-10)


def test_a_rod_does_not_depend_on_its_neighbours() -> None:
    """The same digits in any order, also where neighbours are hard or missing."""
    designs = draw(np.random.default_rng(11), 45, flux=False, tilted=True)
    designs["remanence_mT"][::7] *= 40.0  # no rod for lanes
    order = np.random.default_rng(12).permutation(45)
    shuffled = {
        name: value if np.ndim(value) == 0 else value[order]
        for name, value in designs.items()
    }
    straight = solve_spatial_many(designs, magnet=TURNED, support=HELD)
    turned = solve_spatial_many(shuffled, magnet=TURNED, support=HELD)
    assert np.array_equal(straight["outcome"][order], turned["outcome"])
    for name in ("tip_x_mm", "tip_y_mm", "tip_z_mm"):
        bound = straight["error_mm"][order] + turned["error_mm"]
        apart = np.abs(straight[name][order] - turned[name])
        assert not np.any(apart > bound)
