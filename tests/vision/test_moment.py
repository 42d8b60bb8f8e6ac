"""The moment passes through a joint: what that leaves free, and what it buys."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from magbend.vision.curve.fit import solve
from magbend.vision.curve.moment import weighed_fit
from magbend.vision.curve.problem import pose
from magbend.vision.curve.spline import Smooth, design, knots_between, penalty_between

JOINTS = (200.0, 400.0)
S = np.arange(0.0, 601.0, 4.0)
FINE = np.arange(0.0, 600.01, 0.25)


def derivative(knots, s):
    """Rows that give kappa from the coefficients of theta."""
    basis = design(knots, s)
    rows = np.zeros((len(s), len(knots) - 4))
    for k in range(4):
        rows[np.arange(len(s)), basis.first + k] += basis.slope[:, k]
    return rows


def costs(penalty, rows, target):
    """Penalty of the spline through target, and that of its parts without signs."""
    # Beside a joint the spline of either side is meant: leave the joints out.
    clear = np.abs(FINE[:, None] - JOINTS).min(axis=1) > 0.5
    c = np.linalg.lstsq(rows[clear], target[clear], rcond=None)[0]
    return c @ penalty @ c, np.abs(c) @ np.abs(penalty) @ np.abs(c)


COMPLIANCE = np.select([FINE < 200.0, FINE < 400.0], [1.0, 1.4], 0.7)


def test_a_straight_moment_over_jumping_stiffness_costs_nothing():
    knots = knots_between(0.0, 600.0, 30.0, np.array(JOINTS))
    ratios = np.array([1.4, 0.5])
    penalty, nullity = penalty_between(knots, 2, ratios, FINE, FINE / 300.0)
    target = COMPLIANCE * (1.0 - FINE / 900.0)
    cost, size = costs(penalty, derivative(knots, FINE), target)
    assert cost == pytest.approx(0.0, abs=1e-9 * size)
    power = np.linalg.eigvalsh(penalty)
    assert np.count_nonzero(power < 1e-10 * power[-1]) >= nullity - 1
    assert nullity == 3 + len(JOINTS)


def elastica(force, kappa_root, compliance=COMPLIANCE):
    """Angle and curvature of a rod under one force: (kappa / compliance)' = F . n."""
    theta, moment, angles, moments = 0.0, kappa_root, [], []
    step = FINE[1] - FINE[0]
    for factor in compliance:
        angles.append(theta)
        moments.append(moment)
        middle = theta + 0.5 * step * factor * moment
        theta += step * factor * moment
        moment += step * (-force[0] * np.sin(middle) + force[1] * np.cos(middle))
    return np.array(angles), compliance * np.array(moments)


@pytest.mark.parametrize("force", [(2e-5, 0.0), (0.0, -6e-6), (1e-5, 5e-6)])
def test_the_moment_of_one_force_costs_next_to_nothing(force):
    theta, kappa = elastica(force, 5e-3)
    knots = knots_between(0.0, 600.0, 10.0, np.array(JOINTS))
    penalty, nullity = penalty_between(knots, 1, np.array([1.4, 0.5]), FINE, theta)
    assert nullity == 4 + len(JOINTS)
    power = np.linalg.eigvalsh(penalty)
    assert power[0] > -1e-12 * power[-1]
    cost, size = costs(penalty, derivative(knots, FINE), kappa)
    whole = np.sum(np.gradient(kappa / COMPLIANCE, FINE) ** 2) * (FINE[1] - FINE[0])
    # What is left is the spline's: within a piece its M' runs straight.
    # Below zero by no more than its own sum is rounded, on any processor.
    assert -1e-13 * size < cost < 1e-3 * whole


def test_a_straight_rod_bears_forces_across_it_only():
    knots = knots_between(0.0, 600.0, 30.0, np.empty(0))
    penalty, _ = penalty_between(knots, 1, np.empty(0), FINE, 0.0 * FINE)
    rows = derivative(knots, FINE)
    straight = np.linalg.lstsq(rows, 1.0 - FINE / 900.0, rcond=None)[0]
    parabola = np.linalg.lstsq(rows, FINE**2, rcond=None)[0]
    assert straight @ penalty @ straight == pytest.approx(0.0, abs=1e-9)
    # M' = 2 s less its mean, squared, by the trapezoidal rule over pieces of 30.
    exact = (600.0**2 / 3.0 + 2.0 * 30.0**2 / 3.0) * 600.0
    assert parabola @ penalty @ parabola == pytest.approx(exact, rel=1e-6)


def measured(kappa, rng):
    """Points on a rod of this curvature, with noise as photographs have it."""
    theta = cumulative_trapezoid(kappa(FINE), FINE, initial=0.0)
    tangent = np.column_stack([np.cos(theta), np.sin(theta)])
    path = cumulative_trapezoid(tangent, FINE, axis=0, initial=0.0)
    points = path[::16]
    normals = np.column_stack([-np.sin(theta), np.cos(theta)])[::16]
    wobble = np.convolve(rng.normal(size=len(S) + 1), [0.7, 0.7], mode="valid")
    return points + 0.04 * wobble[:, None] * normals, theta[::16]


def fits(kappa, seed):
    points, theta = measured(kappa, np.random.default_rng(seed))
    weights = np.full(len(S), 4.0)
    problem = pose(S, points, weights, theta, spacing=30.0, joints=JOINTS)
    return solve(problem, Smooth()), weighed_fit(problem, JOINTS, len(S) / 2.0)


def test_the_direction_at_the_clamp_gains_from_the_moment():
    def kappa(s):
        stiffness = np.select([s < 200.0, s < 400.0], [2.0, 1.5], 1.0)
        return 5e-3 * (1.0 - s / 700.0) / stiffness

    errors, deviations = [], []
    for seed in range(24):
        free, best = fits(kappa, seed)
        errors.append((free.curve.theta[0], best.curve.theta[0]))
        deviations.append((free.sigma_theta[0], best.sigma_theta[0]))
    alone, tied = np.sqrt(np.mean(np.square(errors), axis=0))
    assert tied < 0.85 * alone
    claimed, less = np.median(deviations, axis=0)
    assert less < 0.85 * claimed


def test_a_moment_with_a_kink_is_left_free():
    def kappa(s):
        return 2e-3 + 4e-5 * np.abs(s - 200.0) * (s < 400.0)

    for seed in range(4):
        free, best = fits(kappa, seed)
        np.testing.assert_allclose(best.curve.theta, free.curve.theta, atol=1e-4)
        assert best.sigma_theta[0] == pytest.approx(free.sigma_theta[0], rel=0.05)


def test_the_root_of_an_elastica_is_not_turned():
    _, kappa = elastica((-2e-5, -1e-5), 4.5e-3)
    turned = []
    for seed in range(16):
        free, best = fits(lambda s: np.interp(s, FINE, kappa), seed)
        turned.append((free.curve.theta[0], best.curve.theta[0]))
    alone, forced = np.sqrt(np.mean(np.square(turned), axis=0))
    assert forced < 0.5 * alone
