from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from magbend.vision.curve.fit import fit_curve
from magbend.vision.curve.spline import design, knots_between, penalty_between


def arc(length: float, turn: float, step: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    s = np.linspace(0.0, length, int(length / step) + 1)
    kappa = turn / length
    middle = np.array([200.0, 300.0])
    points = np.column_stack([np.sin(kappa * s), 1.0 - np.cos(kappa * s)]) / kappa
    return s, points + middle


def test_basis_is_that_of_scipy():
    knots = knots_between(0.0, 100.0, 7.0, np.array([30.0, 60.0]))
    s = np.linspace(0.0, 100.0, 333)
    basis = design(knots, s)
    coefficients = np.random.default_rng(0).normal(size=len(knots) - 4)
    spline = BSpline(knots, coefficients, 3)
    np.testing.assert_allclose(basis.values(coefficients), spline(s), atol=1e-13)
    smooth = (np.abs(s - 30.0) > 0.1) & (np.abs(s - 60.0) > 0.1)
    np.testing.assert_allclose(
        basis.slopes(coefficients)[smooth], spline(s, nu=1)[smooth], atol=1e-12
    )


def test_penalty_is_the_integral_of_the_third_derivative_squared():
    knots = knots_between(0.0, 50.0, 5.0, np.empty(0))
    rng = np.random.default_rng(1)
    c = rng.normal(size=len(knots) - 4)
    middle = 0.5 * (knots[3:-4] + knots[4:-3])
    third = BSpline(knots, c, 3)(middle, nu=3)
    exact = np.sum(third**2 * np.diff(knots[3:-3]))
    penalty, _ = penalty_between(knots, 2, np.empty(0), middle, 0.1 * middle)
    assert c @ penalty @ c == pytest.approx(exact, rel=1e-9)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.05, 4.4), st.booleans())
def test_arcs_come_back_exactly(turn, left):
    s, points = arc(600.0, -turn if left else turn)
    fit = fit_curve(s, points, np.ones(len(s)), spacing=20.0, iterations=3)
    assert np.abs(fit.residual).max() < 2e-3
    np.testing.assert_allclose(
        fit.curve.kappa, (-turn if left else turn) / 600.0, atol=2e-6
    )


def test_curve_is_carried_on_as_an_arc():
    s, points = arc(600.0, 1.0)
    curve = fit_curve(s[100:-100] - s[100], points[100:-100], np.ones(len(s) - 200),
                      spacing=20.0, iterations=3).curve  # fmt: skip
    beyond, theta = curve.at(np.array([-100.0, 500.0]))
    np.testing.assert_allclose(beyond, points[[0, -1]], atol=0.15)
    assert theta[1] - theta[0] == pytest.approx(1.0, abs=1e-3)


def jumping(noise: float, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points on a curve whose curvature doubles at s = 300."""
    s = np.linspace(0.0, 600.0, 601)
    fine = np.linspace(0.0, 600.0, 60001)
    kappa = np.where(fine < 300.0, 1.0, 2.0) / 600.0
    theta = np.concatenate([[0.0], np.cumsum(0.5 * (kappa[1:] + kappa[:-1])) * 0.01])
    step = np.column_stack([np.cos(theta), np.sin(theta)])
    path = np.concatenate(
        [[[0.0, 0.0]], np.cumsum(0.005 * (step[1:] + step[:-1]), axis=0)]
    )
    rng = np.random.default_rng(seed)
    normal = np.column_stack([-np.sin(theta), np.cos(theta)])[::100]
    return s, path[::100], path[::100] + noise * rng.normal(size=(601, 1)) * normal


def test_known_joint_keeps_the_jump_of_curvature():
    s, _, points = jumping(0.02, 0)
    smooth = fit_curve(s, points, np.ones(601), spacing=20.0).curve.kappa
    sharp = fit_curve(s, points, np.ones(601), spacing=20.0, joints=[300.0]).curve.kappa
    jump = 1.0 / 600.0
    assert sharp[305] - sharp[295] == pytest.approx(jump, rel=0.1)
    assert smooth[305] - smooth[295] < 0.8 * jump


@pytest.mark.parametrize("joints", [(), (300.0,)])
def test_deviations_cover_what_they_claim(joints):
    inside, inside_theta = [], []
    for seed in range(12):
        s, truth, points = jumping(0.03, seed)
        fit = fit_curve(
            s, points, np.ones(601), spacing=20.0, joints=joints, shared=1.0
        )
        off = np.sum((fit.curve.points - truth) * fit.curve.normals, axis=1)
        inside.append(np.abs(off) < fit.sigma)
        theta = np.interp(s, [0.0, 300.0, 600.0], [0.0, 0.5, 1.5])
        inside_theta.append(np.abs(fit.curve.theta - theta) < fit.sigma_theta)
    assert 0.60 < np.mean(inside) < 0.80
    assert 0.60 < np.mean(inside_theta) < 0.85


def test_gap_is_bridged_and_widens_the_deviation():
    s, points = arc(600.0, 1.2)
    weights = np.ones(len(s))
    weights[250:330] = 0.0
    points = points + np.random.default_rng(3).normal(scale=0.02, size=points.shape)
    fit = fit_curve(s, points, weights, spacing=20.0)
    assert np.isnan(fit.residual[290])
    assert fit.sigma[290] > 1.1 * fit.sigma[150]
    _, true = arc(600.0, 1.2)
    off = np.sum((fit.curve.points - true) * fit.curve.normals, axis=1)
    assert np.abs(off).max() < 0.05


def test_the_lever_tells_how_far_an_error_turns_the_root():
    s, points = arc(600.0, 1.2, step=4.0)
    weights = np.ones(len(s))
    weights[40:55] = 0.0
    theta = 1.2 * s / 600.0
    normals = np.column_stack([-np.sin(theta), np.cos(theta)])
    error = 0.05 * np.sin(s / 25.0)

    def fitted(points):
        return fit_curve(s, points, weights, spacing=30.0, theta=theta, stiffness=1e11)

    plain, moved = fitted(points), fitted(points + error[:, None] * normals)
    turned = moved.curve.theta[0] - plain.curve.theta[0]
    assert plain.lever @ error == pytest.approx(turned, rel=1e-2)
    assert not plain.lever[40:55].any()
    # A shift of the whole rod turns nothing but the little that it moves a bend.
    assert abs(plain.lever.sum()) < 1e-2 * np.abs(plain.lever).sum()
