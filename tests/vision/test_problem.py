"""The kernels of the curve fit against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.vision.curve.fit import solve
from magbend.vision.curve.problem import moved, pose
from magbend.vision.curve.spline import Smooth, penalty_between

S = np.arange(0.0, 601.0, 4.0)
JOINTS = (200.0, 400.0)
SPACING = 30.0


@pytest.fixture(name="problem", scope="module")
def measured():
    rng = np.random.default_rng(5)
    theta = 0.4 + S / 500.0 + 0.3 * np.sin(S / 90.0)
    step = np.column_stack([np.cos(theta), np.sin(theta)])
    points = np.cumsum(4.0 * step, axis=0) + rng.normal(scale=0.03, size=(len(S), 2))
    weights = np.full(len(S), 4.0)
    weights[60:70] = 0.0
    return pose(S, points, weights, theta, spacing=SPACING, joints=JOINTS, within=0.02)


def test_the_jacobian_is_that_of_the_moved_curve(problem):
    size, step = problem.jacobian.shape[1], 1e-5
    start, theta, *_ = moved(problem, np.zeros(size))
    normals = np.column_stack([-np.sin(theta), np.cos(theta)])
    for k in range(size):
        change = np.zeros(size)
        change[k] = step
        ahead, behind = moved(problem, change)[0], moved(problem, -change)[0]
        slope = np.sum((ahead - behind) * normals, axis=1) / (2.0 * step)
        # The path is by Simpson's rule, its change by the midpoint rule.
        np.testing.assert_allclose(problem.jacobian[:, k], slope, atol=0.01 * SPACING)
    off = np.sum((problem.points - start) * normals, axis=1)
    np.testing.assert_allclose(problem.residual, np.where(problem.weight, off, 0.0))


@pytest.mark.parametrize("smooth", [Smooth(), Smooth(2, (1.5, 0.8)), Smooth(1)])
def test_the_step_and_its_deviations_are_those_of_dense_least_squares(problem, smooth):
    rows, data = problem.jacobian, problem.residual
    weight = np.diag(problem.weight / problem.shared)
    penalty = np.zeros((rows.shape[1],) * 2)
    penalty[1:, 1:], _ = penalty_between(
        problem.knots, smooth.order, np.array(smooth.ratios or ()), problem.s,
        problem.theta,
    )  # fmt: skip
    start = np.concatenate([[0.0], problem.coefficients])
    strength = 2e6
    fit = solve(problem, smooth, strength)
    normal = rows.T @ weight @ rows + strength * penalty
    right = rows.T @ weight @ data - strength * penalty @ start
    change = np.linalg.solve(normal, right)
    np.testing.assert_allclose(fit.change, change, rtol=1e-4, atol=1e-6)
    inverse = np.linalg.inv(normal)
    power = fit.noise**2 * fit.correlation / problem.shared
    np.testing.assert_allclose(
        fit.sigma**2, power * np.einsum("ij,jk,ik->i", rows, inverse, rows), rtol=1e-4
    )
    freedom = np.trace(inverse @ rows.T @ weight @ rows)
    assert fit.freedom == pytest.approx(freedom, rel=1e-5)
    used = problem.weight > 0.0
    misfit = problem.weight[used] @ fit.residual[used] ** 2 + problem.within
    count = problem.weight.sum() - fit.freedom
    assert fit.noise == pytest.approx(np.sqrt(misfit / count), rel=1e-9)


def test_the_strength_taken_is_the_likeliest(problem):
    rows, shared = problem.jacobian, problem.shared
    weight = np.diag(problem.weight / shared)
    penalty = np.zeros((rows.shape[1],) * 2)
    penalty[1:, 1:], nullity = penalty_between(
        problem.knots, 2, np.empty(0), problem.s, problem.theta
    )
    start = np.concatenate([[0.0], problem.coefficients])
    free = nullity + 1
    count = problem.weight.sum() / shared - free

    def loss(strength):
        normal = rows.T @ weight @ rows + strength * penalty
        right = rows.T @ weight @ problem.residual - strength * penalty @ start
        x = np.linalg.solve(normal, right)
        after, bent = problem.residual - rows @ x, start + x
        total = after @ weight @ after + problem.within / shared
        total += strength * bent @ penalty @ bent
        volume = np.linalg.slogdet(normal)[1]
        return count * np.log(total) + volume - (len(x) - free) * np.log(strength)

    strengths = 10.0 ** np.arange(0.0, 14.0, 0.25)
    best = strengths[np.argmin([loss(strength) for strength in strengths])]
    likeliest = solve(problem, Smooth())
    held = [solve(problem, Smooth(), best * 10.0**k).freedom for k in (0.25, -0.25)]
    assert held[0] < likeliest.freedom < held[1]
