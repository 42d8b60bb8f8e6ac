"""Distances, circle, circularity and parabola against values found by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magbend.analysis.compare import metrics
from magbend.core.centreline import Centreline
from magbend.core.errors import InputError


def arc(radius_mm: float, length_mm: float = 30.0, n: int = 61) -> Centreline:
    s = np.linspace(0.0, length_mm, n)
    theta = s / radius_mm
    return Centreline(
        s_mm=s,
        x_mm=radius_mm * np.sin(theta),
        y_mm=radius_mm * (1.0 - np.cos(theta)),
        theta_rad=theta,
        kappa_per_mm=np.full(n, 1.0 / radius_mm),
    )


def straight(length_mm: float = 30.0, n: int = 61, *, up_mm: float = 0.0) -> Centreline:
    s = np.linspace(0.0, length_mm, n)
    zero = np.zeros(n)
    return Centreline(
        s_mm=s, x_mm=s, y_mm=zero + up_mm, theta_rad=zero, kappa_per_mm=zero
    )


def test_a_shift_is_the_same_distance_everywhere() -> None:
    errors = metrics.shape_errors(straight(up_mm=0.3), straight())
    for value in (errors.rms_mm, errors.max_mm, errors.tip_mm, errors.frechet_mm):
        assert value == pytest.approx(0.3, rel=1e-8)
    assert errors.tip_percent == pytest.approx(1.0)
    assert errors.tip_angle_deg == 0.0


def test_arc_against_straight_rod_by_hand() -> None:
    radius, length = 40.0, 30.0
    errors = metrics.shape_errors(arc(radius), straight())
    theta = length / radius
    tip = math.hypot(radius * math.sin(theta) - length, radius * (1 - math.cos(theta)))
    assert errors.tip_mm == pytest.approx(tip)
    assert errors.max_mm == pytest.approx(tip)
    assert errors.tip_angle_deg == pytest.approx(math.degrees(theta))
    s = np.linspace(0, length, 61)
    d2 = (radius * np.sin(s / radius) - s) ** 2 + (
        radius * (1 - np.cos(s / radius))
    ) ** 2
    assert errors.rms_mm == pytest.approx(math.sqrt(d2.mean()))


def test_sampling_of_the_two_lines_need_not_agree() -> None:
    errors = metrics.shape_errors(arc(35.0, n=47), arc(35.0, n=61))
    assert errors.max_mm < 1e-6
    # The polylines cut the arcs by their sagittas h^2 / (8 R), at most.
    assert errors.frechet_mm < (30 / 46) ** 2 / (8 * 35.0)


def test_a_longer_measured_rod_is_compared_over_the_common_length() -> None:
    errors = metrics.shape_errors(straight(31.0, 63), straight(30.0))
    assert errors.s_mm[-1] <= 30.0
    assert errors.rms_mm == pytest.approx(0.0, abs=1e-12)
    assert errors.tip_mm == pytest.approx(1.0)


def test_no_common_arc_length_is_refused() -> None:
    s = np.linspace(40.0, 50.0, 5)
    far = Centreline(s_mm=s, x_mm=s, y_mm=0 * s, theta_rad=0 * s, kappa_per_mm=0 * s)
    with pytest.raises(InputError, match="share arc length"):
        metrics.shape_errors(far, straight())


@given(
    radius=st.floats(5.0, 2000.0),
    span=st.floats(0.05, 5.0),
    turn=st.floats(-math.pi, math.pi),
    x=st.floats(-50, 50),
)
def test_circle_is_found_from_any_arc(
    radius: float, span: float, turn: float, x: float
) -> None:
    angle = turn + np.linspace(0, span, 40)
    points = np.column_stack([x + radius * np.cos(angle), radius * np.sin(angle)])
    circle = metrics.fit_circle(points)
    assert circle.radius_mm == pytest.approx(radius, rel=1e-6)
    assert circle.rms_mm < 1e-8 * radius


def test_circle_minimises_the_geometric_distance() -> None:
    points = arc(40.0).points_mm + np.random.default_rng(1).normal(0, 0.05, (61, 2))
    circle = metrics.fit_circle(points)

    def cost(a: float, b: float, r: float) -> float:
        return float(np.sum((np.hypot(*(points - (a, b)).T) - r) ** 2))

    best = cost(*circle.centre_mm, circle.radius_mm)
    for delta in np.vstack([np.eye(3), -np.eye(3)]) * 1e-3:
        a, b, r = np.array([*circle.centre_mm, circle.radius_mm]) + delta
        assert cost(a, b, r) > best


def test_straight_rod_has_an_infinite_radius_and_no_circularity() -> None:
    line = straight()
    assert metrics.fit_circle(line.points_mm).radius_mm == math.inf
    assert math.isnan(metrics.circularity(line.s_mm, line.kappa_per_mm))


def test_circularity_by_hand() -> None:
    s = np.linspace(0.0, 30.0, 3001)
    assert metrics.circularity(s, np.full_like(s, 0.02)) == pytest.approx(1.0)
    assert metrics.circularity(s, 0.1 * (1 - s / 30)) == pytest.approx(0.75, rel=1e-6)
    assert metrics.circularity(s, np.sin(2 * np.pi * s / 30)) == pytest.approx(0.0)


def test_parabola_is_recovered_and_its_misfit_measured() -> None:
    x = np.linspace(0, 30, 61)
    a, misfit = metrics.quadratic_fit(np.column_stack([x, 0.005 * x**2]))
    assert (a, misfit) == (pytest.approx(0.005), pytest.approx(0.0, abs=1e-12))
    a, misfit = metrics.quadratic_fit(np.array([[1.0, 1.0], [1.0, 3.0]]))
    assert (a, misfit) == (pytest.approx(2.0), pytest.approx(1.0))


def test_frechet_distance_by_hand() -> None:
    line = np.array([[0.0, 0.0], [10.0, 0.0]])
    # A spike of height 3: its point is 3 away from the line, wherever one waits.
    spike = np.array([[0.0, 0.0], [5.0, 3.0], [10.0, 0.0]])
    assert metrics.frechet_mm(line, spike) == pytest.approx(3.0)
    # Going back from 8 to 2 costs half the way, though both curves cover one segment:
    # the Hausdorff distance is zero.
    back = np.array([[0.0, 0.0], [8.0, 0.0], [2.0, 0.0], [10.0, 0.0]])
    assert metrics.frechet_mm(line, back) == pytest.approx(3.0)
    assert metrics.frechet_mm(line, line[::-1]) == pytest.approx(10.0)


@given(st.integers(0, 10_000))
def test_frechet_lies_between_hausdorff_and_pointwise_maximum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, q = np.cumsum(rng.normal(size=(2, 12, 2)), axis=1)
    distance = metrics.frechet_mm(p, q)
    assert distance <= np.hypot(*(p - q).T).max() * (1 + 1e-9)
    assert distance >= max(math.dist(p[0], q[0]), math.dist(p[-1], q[-1])) - 1e-12
    assert distance == pytest.approx(metrics.frechet_mm(q, p), rel=1e-7)
