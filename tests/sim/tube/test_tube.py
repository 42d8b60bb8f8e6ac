"""Tubes: their splines, how far a point is from the wall, what cannot be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from magbend.core.errors import InputError
from magbend.sim.tube import Ring, Tube, helix
from magbend.sim.tube.wall import gaps

STRAIGHT = ((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (20.0, 0.0, 0.0))


def tube(**given) -> Tube:
    return Tube(**({"name": "t", "points_mm": STRAIGHT, "radius_mm": 2.0} | given))


def test_the_curve_is_measured_by_its_arc_length():
    made = tube(points_mm=helix(10.0, 12.0, 1.25, points=120))
    assert made.length_mm == pytest.approx(1.25 * math.hypot(20 * math.pi, 12), 1e-4)
    _, towards, bend = made.at(np.linspace(0.0, made.length_mm, 400))
    assert np.linalg.norm(towards, axis=1) == pytest.approx(1.0, abs=1e-6)
    rise = 12.0 / (2 * math.pi)
    middle = np.linalg.norm(bend, axis=1)[100:300]
    assert middle == pytest.approx(10.0 / (100.0 + rise**2), rel=2e-3)


def test_a_radius_stays_between_its_neighbours_and_is_level_beyond_the_ends():
    made = tube(radius_mm=(2.0, 1.0, 3.0))
    radius = made.radius_at(np.linspace(0.0, 20.0, 401))
    assert (np.diff(radius[:200]) <= 1e-12).all()
    assert (np.diff(radius[200:]) >= -1e-12).all()
    points = np.array([[-3.0, 0.5, 0.0], [0.0, 0.5, 0.0], [23.0, 0.0, 0.5]])
    assert gaps(made._bore, points, 0.2, 0.0)[0] == pytest.approx([1.3, 1.3, 2.3])


def test_the_gap_is_the_radius_less_the_distance_from_the_nearest_point():
    made = tube(points_mm=helix(8.0, 20.0, 1.0), radius_mm=2.0)
    along = np.linspace(0.0, made.length_mm, 20001)
    place = made.at(along)[0]
    rng = np.random.default_rng(5)
    for p in rng.uniform(3.0, made.length_mm - 3.0, 10):
        point = made.at(p)[0] + rng.uniform(-1.0, 1.0, 3)
        away = np.linalg.norm(place - point, axis=1)
        gap, foot = gaps(made._bore, point[None], 0.5, p)[:, 0]
        assert gap == pytest.approx(1.5 - away.min(), abs=1e-5)
        assert foot == pytest.approx(along[away.argmin()], abs=3e-3)


def test_a_direction_without_an_entry_is_the_curves():
    made = tube(points_mm=helix(10.0, 12.0, 1.0), direction=(2.0, 0.0, 0.0))
    assert made.at(0.0)[1] == pytest.approx((1.0, 0.0, 0.0), abs=1e-9)
    assert made.direction == (1.0, 0.0, 0.0)
    loose = tube(points_mm=helix(10.0, 12.0, 1.0))
    assert loose.direction == pytest.approx((1.0, 0.0, 0.0), abs=0.1)


def test_a_gate_at_the_end_is_always_there():
    assert tube(gates=(Ring("half", 10.0),)).gates == (
        Ring("half", 10.0),
        Ring("end", 20.0),
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"points_mm": ((0, 0, 0),)}, "at least 2 points; instead received 1"),
        ({"points_mm": ((0, 0, 0), (0, 0, 0))}, "must not repeat a point in a row"),
        ({"points_mm": ((0, 0, 0), (1, 2))}, r"three numbers \(x, y, z\) in mm"),
        ({"points_mm": ((0, 0, 0), (math.nan, 2, 1))}, "must be a finite number"),
        ({"radius_mm": (1.0, 2.0)}, "one for each of its 3 points; instead received 2"),
        ({"radius_mm": 0.0}, "must be above zero in mm"),
        ({"radius_mm": (2.0, 0.4, 2.0)}, r"own is 0.4 mm at \(10, 0, 0\) mm"),
        ({"points_mm": helix(1.5, 4.0, 2.0)}, "bend with a radius above the tube's"),
        ({"points_mm": helix(10.0, 3.0, 1.5)}, "must not meet itself"),
        ({"entry_mm": (5.0, 1.8, 0.0)}, "is 0.2 mm from its wall"),
        ({"entry_mm": (5.0, 9.0, 0.0)}, "is -7 mm from its wall"),
        ({"entry_mm": (-3.0, 0.0, 0.0)}, "is beyond its ends"),
        ({"entry_mm": (5, 0, 0), "direction": (0, 1, 0)}, "must lead into it"),
        ({"direction": (-1.0, 0.0, 0.0)}, "must lead from its first point toward"),
        ({"gates": (Ring("far", 30.0),)}, "up to 20 mm along its curve"),
        ({"direction": (0.0, 0.0, 0.0)}, r"must not be \(0, 0, 0\)"),
    ],
)
def test_what_cannot_be_is_said_in_a_sentence(given, said):
    with pytest.raises(InputError, match=said):
        tube(**given).check_rod(0.5)
