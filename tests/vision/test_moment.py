"""The moment passes through a joint: what that leaves free, and what it buys."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from magbend.vision.centreline_fit import fit_curve
from magbend.vision.moment import weighed_fit
from magbend.vision.spline import Smooth, design, knots_between, penalty_on_moment

JOINTS = (200.0, 400.0)
S = np.arange(0.0, 601.0, 4.0)
FINE = np.arange(0.0, 600.01, 0.25)


@pytest.mark.parametrize("order", [2, 3])
def test_a_smooth_moment_over_jumping_stiffness_costs_nothing(order):
    knots = knots_between(0.0, 600.0, 30.0, JOINTS)
    penalty, nullity = penalty_on_moment(knots, Smooth(order, (1.4, 0.5)))
    compliance = np.select([FINE < 200.0, FINE < 400.0], [1.0, 1.4], 0.7)
    moment = (1.0 - FINE / 900.0) ** (order - 1)
    basis = design(knots, FINE)
    rows = np.zeros((len(FINE), len(knots) - 4))
    for k in range(4):
        rows[np.arange(len(FINE)), basis.first + k] += basis.slope[:, k]
    # Beside a joint the spline of either side is meant: leave the joints out.
    clear = np.abs(FINE[:, None] - JOINTS).min(axis=1) > 0.5
    target = (compliance * moment)[clear]
    c = np.linalg.lstsq(rows[clear], target, rcond=None)[0]
    np.testing.assert_allclose(rows[clear] @ c, target, atol=1e-8)
    size = np.abs(c) @ np.abs(penalty) @ np.abs(c)
    assert c @ penalty @ c == pytest.approx(0.0, abs=1e-9 * size)
    power = np.linalg.eigvalsh(penalty)
    assert np.count_nonzero(power < 1e-10 * power[-1]) >= nullity - 1
    assert nullity == 1 + order + len(JOINTS)


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

    def fit(smooth):
        return fit_curve(
            S, points, np.full(len(S), 4.0), spacing=30.0, joints=JOINTS, theta=theta,
            smooth=smooth,
        )  # fmt: skip

    return fit(Smooth()), weighed_fit(fit, JOINTS, len(S) / 2.0)


def test_the_direction_at_the_clamp_gains_from_the_moment():
    def kappa(s):
        stiffness = np.select([s < 200.0, s < 400.0], [2.0, 1.5], 1.0)
        return 5e-3 * (1.0 - s / 700.0) / stiffness

    errors, deviations = [], []
    for seed in range(12):
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
