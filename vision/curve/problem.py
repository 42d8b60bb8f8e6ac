"""Measured points about a curve, and how far its parameters move it across.

The curve is p(s) = p0 + integral of (cos theta, sin theta), so its parameter is arc
length without any later correction. theta(s) is a cubic B-spline. Measured points pull
along the normal only.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from .cholesky import factor, solved
from .likelihood import equations
from .spline import (
    Basis,
    add_squares,
    combined,
    design,
    knots_between,
    penalty_between,
)

Array = NDArray[np.float64]

SHARED = 8.0
"""Stations 1 px apart that carry one station's worth of information: bilinear samples,
compressed pictures and shade on the paper make neighbours alike."""


class Problem(NamedTuple):
    """Measured points, and what moves a curve that runs near them.

    Parameters
    ----------
    s : ndarray, shape (n,)
        Even grid of arc length.
    points, weight : ndarray, shape (n, 2) and (n,)
        Measured positions, and measurements that each is the mean of.
    shared, within : float
        As in `fit_curve`.
    knots : ndarray
        Of the splines.
    basis, middle : Basis
        The splines on the grid and half way between.
    theta : ndarray, shape (n,)
        Tangent angles of the curve.
    origin, coefficients : ndarray, shape (2,) and (p - 1,)
        The curve: its first point, and the splines' coefficients of theta.
    residual : ndarray, shape (n,)
        Normal distance of the measured points; 0 where there is none.
    jacobian : ndarray, shape (n, p)
        Change of the normal position by the p parameters: the origin's shift along its
        normal, then changes of the coefficients.
    normal, right : ndarray, shape (p, p) and (p,)
        The equations of least squares, J^T W J and J^T W r.
    """

    s: Array
    points: Array
    weight: Array
    shared: float
    within: float
    knots: Array
    basis: Basis
    middle: Basis
    theta: Array
    origin: Array
    coefficients: Array
    residual: Array
    jacobian: Array
    normal: Array
    right: Array


def pose(
    s: Array, points: Array, weights: Array, theta: Array, *, spacing: float,
    joints: Sequence[float] = (), shared: float = SHARED, within: float = 0.0,
) -> Problem:  # fmt: skip
    """Return the problem about a curve with these tangent angles; see `fit_curve`."""
    places = np.asarray(joints, dtype=np.float64)
    problem: Problem = _posed(
        s, np.ascontiguousarray(points), weights, np.ascontiguousarray(theta),
        float(spacing), places, float(shared), float(within),
    )  # fmt: skip
    return problem


@njit(cache=True)
def _posed(
    s: Array, points: Array, weights: Array, theta: Array, spacing: float,
    joints: Array, shared: float, within: float,
) -> Problem:  # fmt: skip
    knots = knots_between(s[0], s[-1], spacing, joints)
    basis, middle = design(knots, s), design(knots, 0.5 * (s[1:] + s[:-1]))
    coefficients = _smoothed(knots, basis, s, theta, 1e-3 * spacing**5)
    origin = np.zeros(2)
    none, square = np.empty(0), np.empty((0, 0))
    problem = Problem(
        s, points, weights, shared, within, knots, basis, middle, theta, origin,
        coefficients, none, square, square, none,
    )  # fmt: skip
    path = _path(problem, origin, coefficients)[0]
    used = 0
    for i in range(theta.size):
        if weights[i] > 0.0:
            origin += points[i] - path[i]
            used += 1
    posed: Problem = linearised(problem, origin / used, coefficients)
    return posed


@njit(cache=True)
def _smoothed(
    knots: Array, basis: Basis, s: Array, theta: Array, stiffness: float
) -> Array:
    """Return the coefficients of a smooth curve of about the given angles."""
    straight = np.int64(2)  # a constant of Python's own would have its own version
    normal, _ = penalty_between(knots, straight, np.empty(0), s, theta)
    normal *= stiffness
    right = np.zeros(len(normal))
    add_squares(basis.first, basis.value, np.ones(theta.size), normal)
    for j in range(right.size):
        normal[j, j] += 1e-9
    for i in range(theta.size):
        for j in range(4):
            right[basis.first[i] + j] += basis.value[i, j] * theta[i]
    return np.asarray(solved(factor(normal), right))


@njit(cache=True)
def linearised(problem: Problem, origin: Array, coefficients: Array) -> Problem:
    """Return the problem about the curve with these parameters."""
    path, theta, rate, rate_mid = _path(problem, origin, coefficients)
    residual = _residual(problem, path, rate)
    jacobian = _jacobian(problem, rate, rate_mid)
    normal, right = equations(jacobian, problem.weight / problem.shared, residual)
    return Problem(
        problem.s, problem.points, problem.weight, problem.shared, problem.within,
        problem.knots, problem.basis, problem.middle, theta, origin, coefficients,
        residual, jacobian, normal, right,
    )  # fmt: skip


@njit(cache=True)
def parameters(problem: Problem, change: Array) -> tuple[Array, Array]:
    """Return origin and coefficients after a change."""
    theta = 0.0
    for j in range(4):
        k = problem.basis.first[0] + j
        theta += problem.basis.value[0, j] * problem.coefficients[k]
    normal = np.array([-np.sin(theta), np.cos(theta)])
    return problem.origin + change[0] * normal, problem.coefficients + change[1:]


@njit(cache=True)
def moved(problem: Problem, change: Array) -> tuple[Array, Array, Array, Array]:
    """Return points, theta, kappa and residuals (NaN if none) of the curve changed."""
    origin, coefficients = parameters(problem, change)
    path, theta, rate, _ = _path(problem, origin, coefficients)
    residual = _residual(problem, path, rate)
    for i in range(residual.size):
        if not problem.weight[i] > 0.0:
            residual[i] = np.nan
    basis = problem.basis
    return path, theta, combined(basis.first, basis.slope, coefficients), residual


@njit(cache=True)
def _path(
    problem: Problem, origin: Array, coefficients: Array
) -> tuple[Array, Array, Array, Array]:
    """Return points by Simpson's rule, angles, unit tangents there and half way."""
    basis, middle = problem.basis, problem.middle
    step = problem.s[1] - problem.s[0]
    theta = combined(basis.first, basis.value, coefficients)
    mid = combined(middle.first, middle.value, coefficients)
    points = np.empty((theta.size, 2))
    rate, rate_mid = np.empty((theta.size, 2)), np.empty((mid.size, 2))
    for i in range(theta.size):
        rate[i, 0], rate[i, 1] = np.cos(theta[i]), np.sin(theta[i])
    points[0] = origin
    for i in range(mid.size):
        rate_mid[i, 0], rate_mid[i, 1] = np.cos(mid[i]), np.sin(mid[i])
        for k in range(2):
            mean = (rate[i, k] + 4.0 * rate_mid[i, k] + rate[i + 1, k]) / 6.0
            points[i + 1, k] = points[i, k] + step * mean
    return points, theta, rate, rate_mid


@njit(cache=True)
def _residual(problem: Problem, path: Array, rate: Array) -> Array:
    """Distance of the measured points along the normal; 0 where there is none."""
    points, weight = problem.points, problem.weight
    out = np.zeros(weight.size)
    for i in range(weight.size):
        if weight[i] > 0.0:
            x, y = points[i, 0] - path[i, 0], points[i, 1] - path[i, 1]
            out[i] = rate[i, 0] * y - rate[i, 1] * x
    return out


@njit(cache=True)
def _jacobian(problem: Problem, rate: Array, rate_mid: Array) -> Array:
    """Change of the normal position by origin (along its normal) and coefficients."""
    middle, count = problem.middle, problem.knots.size - 4
    step = problem.s[1] - problem.s[0]
    jacobian = np.zeros((len(rate), count + 1))
    along = np.zeros((count, 2))
    end = 0
    for i in range(len(rate)):
        x, y = rate[i, 0], rate[i, 1]
        jacobian[i, 0] = x * rate[0, 0] + y * rate[0, 1]
        for k in range(end):
            jacobian[i, k + 1] = x * along[k, 1] - y * along[k, 0]
        if i < len(rate_mid):
            first = middle.first[i]
            end = first + 4
            for j in range(4):
                along[first + j, 0] -= step * rate_mid[i, 1] * middle.value[i, j]
                along[first + j, 1] += step * rate_mid[i, 0] * middle.value[i, j]
    return jacobian
