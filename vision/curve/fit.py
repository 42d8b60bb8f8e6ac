"""A centreline as theta(s): cubic B-spline, inextensible by build, honest about itself.

The curve is p(s) = p0 + integral of (cos theta, sin theta), so its parameter is arc
length without any later correction. Measured points pull along the normal only. Knots
are dense (about one a rod width); what keeps the fit smooth is a penalty on changes of
the bending moment (`spline.Smooth`; one that changes evenly, as at the root, is left
alone), whose weight is the most likely one (restricted maximum likelihood, Wood 2011).
Joints get triple knots: theta is continuous there and the curvature may jump. The
covariance is the Bayesian one of Wahba (1983), which covers the bias of smoothing on
average, widened by the correlation seen in the residuals.

Units here are pixels and radians of the picture (y down).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from .cholesky import factor, inverse, solved, squared
from .curve import Curve
from .likelihood import penalised
from .problem import SHARED, Problem, linearised, moved, parameters, pose
from .spline import Smooth, penalty_between

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveFit:
    """A curve with the uncertainty of everything that follows from it.

    Parameters
    ----------
    curve : Curve
        The curve.
    residual : ndarray, shape (n,)
        Normal distance of the measured points; NaN where there is none.
    noise : float
        Standard deviation of a measurement.
    correlation : float
        Factor by which correlated residuals widen variances.
    freedom : float
        Effective number of parameters.
    problem : Problem
        What was fitted.
    change : ndarray, shape (p,)
        The parameters.
    covariance : ndarray, shape (p, p)
        Their covariance.
    lever : ndarray, shape (n,)
        By how much a measured point turns the root, rad per px along its normal.
    """

    curve: Curve
    residual: Array
    noise: float
    correlation: float
    freedom: float
    problem: Problem
    change: Array
    covariance: Array
    lever: Array

    @property
    def sigma(self) -> Array:
        """Standard deviation of the normal position, shape (n,)."""
        jacobian = self.problem.jacobian
        return self._deviation(np.zeros(len(jacobian), np.int64), jacobian)

    @property
    def sigma_theta(self) -> Array:
        """Standard deviation of theta, shape (n,)."""
        basis = self.problem.basis
        return self._deviation(basis.first + 1, basis.value)

    @property
    def sigma_kappa(self) -> Array:
        """Standard deviation of kappa, shape (n,)."""
        basis = self.problem.basis
        return self._deviation(basis.first + 1, basis.slope)

    def _deviation(self, first: NDArray[np.int64], rows: Array) -> Array:
        return np.asarray(_deviation(first, rows, self.covariance))


@njit(cache=True)
def _deviation(first: NDArray[np.int64], rows: Array, covariance: Array) -> Array:
    """Root of the diagonal of A C A^T; a row of A holds `rows` from `first` on.

    C is symmetric, and rows may end in zeros.
    """
    out = np.empty(first.size)
    for i in range(first.size):
        power, start, size = 0.0, first[i], rows.shape[1]
        while size > 0 and rows[i, size - 1] == 0.0:
            size -= 1
        for j in range(size):
            pulled = 0.5 * covariance[start + j, start + j] * rows[i, j]
            for k in range(j):
                pulled += covariance[start + j, start + k] * rows[i, k]
            power += 2.0 * rows[i, j] * pulled
        out[i] = np.sqrt(max(power, 0.0))
    return out


def fit_curve(
    s: Array,
    points: Array,
    weights: Array,
    *,
    spacing: float,
    joints: Sequence[float] = (),
    iterations: int = 2,
    theta: Array | None = None,
    stiffness: float | None = None,
    shared: float = SHARED,
    within: float = 0.0,
    smooth: Smooth | None = None,
) -> CurveFit:
    """Fit theta(s) to points measured near an even grid of arc length.

    Parameters
    ----------
    s : ndarray, shape (n,)
        Even grid of arc length.
    points : ndarray, shape (n, 2)
        Measured positions; only their distance along the normal counts.
    weights : ndarray, shape (n,)
        Measurements that each point is the mean of; 0 where there was none.
    spacing : float
        Distance of knots.
    joints : sequence of float
        Arc lengths where the curvature may jump.
    iterations : int
        Gauss-Newton steps.
    theta : ndarray, shape (n,), optional
        Tangent angles to start from; otherwise from the points.
    stiffness : float, optional
        Weight of the penalty, px^5 (px^3 for a moment of order 1); the most likely one
        when not given.
    shared : float
        Neighbouring measurements that count as one: the fewer, the more supple the
        curve.
    within : float
        Sum of the squares of the measurements about the means that the points are.
    smooth : Smooth, optional
        What is known of the bending moment.

    Returns
    -------
    CurveFit
        With covariances.
    """
    if theta is None:
        theta = _chord_angles(points)
    problem = pose(
        s, points, weights, theta, spacing=spacing, joints=joints, shared=shared,
        within=within,
    )  # fmt: skip
    smooth = smooth or Smooth()
    strength = math.nan if stiffness is None else stiffness
    for _ in range(iterations - 1):
        fit = solve(problem, smooth, strength, last=False)
        origin, coefficients = parameters(problem, fit.change)
        problem = linearised(problem, origin, coefficients)
    return solve(problem, smooth, strength)


def solve(
    problem: Problem, smooth: Smooth, strength: float = math.nan, *, last: bool = True
) -> CurveFit:
    """Fit a curve under a prior on the bending moment, in one step of Gauss-Newton.

    Parameters
    ----------
    problem : Problem
        The measured points, linearised.
    smooth : Smooth
        The prior.
    strength : float, optional
        Weight of the penalty; the most likely one if NaN.
    last : bool
        Whether it is the last step; before that, any fair weight will do.
    """
    ratios = np.array(smooth.ratios or (), dtype=np.float64)
    return fit_of(problem, solution(problem, smooth.order, ratios, strength, last))


class Solved(NamedTuple):
    """A fit's arrays and numbers, named as in `CurveFit`, its curve in three parts."""

    points: Array
    theta: Array
    kappa: Array
    residual: Array
    noise: float
    correlation: float
    freedom: float
    change: Array
    covariance: Array
    lever: Array


def fit_of(problem: Problem, solved: Solved) -> CurveFit:
    """Return the fit that solves a problem."""
    points, theta, kappa, residual, noise, correlation, freedom, *rest = solved
    change, covariance, lever = rest
    return CurveFit(
        curve=Curve(s=problem.s, points=points, theta=theta, kappa=kappa),
        residual=residual, noise=noise, correlation=correlation, freedom=freedom,
        problem=problem, change=change, covariance=covariance, lever=lever,
    )  # fmt: skip


def _chord_angles(points: Array) -> Array:
    step = np.gradient(points, axis=0)
    return np.unwrap(np.arctan2(step[:, 1], step[:, 0]))


@njit(cache=True)
def solution(
    problem: Problem, order: int, ratios: Array, strength: float, last: bool
) -> Solved:
    """Return what `solve` does, as kernels take it."""
    penalty, nullity = penalty_between(
        problem.knots, order, ratios, problem.s, problem.theta
    )
    total = np.sum(problem.weight * problem.residual**2) + problem.within
    strength, normal, right = penalised(
        problem.normal, problem.right, penalty, problem.coefficients, strength,
        total / problem.shared, np.sum(problem.weight) / problem.shared, nullity + 1,
        last,
    )  # fmt: skip
    half = factor(normal)
    covariance = squared(inverse(half))
    freedom = len(normal) - strength * np.sum(penalty * covariance[1:, 1:])
    change = solved(half, right)
    points, theta, kappa, residual = moved(problem, change)
    noise, correlation = _scatter(problem, residual, freedom)
    turn, basis = np.zeros(len(covariance)), problem.basis
    for j in range(4):
        turn += basis.value[0, j] * covariance[basis.first[0] + 1 + j]
    lever = np.sum(problem.jacobian * turn, axis=1) * problem.weight / problem.shared
    covariance *= noise**2 * correlation / problem.shared
    return Solved(
        points, theta, kappa, residual, noise, correlation, freedom, change, covariance,
        lever,
    )  # fmt: skip


@njit(cache=True)
def _scatter(problem: Problem, residual: Array, freedom: float) -> tuple[float, float]:
    """Return the noise of a measurement and by how much its correlation widens."""
    weight, within = problem.weight, problem.within
    used = weight > 0.0
    count, between = np.sum(weight), np.sum((weight * residual**2)[used])
    noise = np.sqrt((between + within) / max(count - freedom, 1.0))
    each = count / max(float(np.sum(used)), 1.0)
    alike = _correlation(residual, used, max(round(24.0 / each), 6))
    return noise, max(alike * each * between / max(between + within, 1e-300), 1.0)


@njit(cache=True)
def _correlation(residual: Array, used: NDArray[np.bool_], lags: int) -> float:
    """Return 1 + 2 sum of the residuals' autocorrelation, at least 1."""
    power, count = 0.0, 0
    for i in range(residual.size):
        if used[i]:
            power += residual[i] ** 2
            count += 1
    if power <= 0.0:
        return 1.0
    power /= count
    total = 1.0
    for lag in range(1, min(lags, residual.size - 2) + 1):
        product, pairs = 0.0, 0
        for i in range(lag, residual.size):
            if used[i] and used[i - lag]:
                product += residual[i] * residual[i - lag]
                pairs += 1
        if pairs < 4:
            break
        rho = product / pairs / power
        if rho < 0.02:
            break
        total += 2.0 * rho
    return total
