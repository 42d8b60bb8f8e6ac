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

import numpy as np
from numpy.typing import NDArray

from ..core.jit import njit
from .cholesky import factor, inverse, solved
from .curve import Curve
from .likelihood import freedom_of, weighed_equations
from .spline import (
    Basis,
    Smooth,
    add_squares,
    combined,
    design,
    knots_between,
    penalty_on_moment,
)

Array = NDArray[np.float64]

SHARED = 8.0
"""Stations 1 px apart that carry one station's worth of information: bilinear samples,
compressed pictures and shade on the paper make neighbours alike."""


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
    jacobian : ndarray, shape (n, p)
        Change of the normal position by the parameters: origin, then coefficients.
    basis : Basis
        The splines whose coefficients give theta and kappa.
    root : ndarray, shape (p, p)
        Upper triangular matrix R with R R^T the covariance of the parameters.
    lever : ndarray, shape (n,)
        By how much a measured point turns the root, rad per px along its normal.
    """

    curve: Curve
    residual: Array
    noise: float
    correlation: float
    freedom: float
    jacobian: Array
    basis: Basis
    coefficients: Array
    root: Array
    lever: Array

    @property
    def sigma(self) -> Array:
        """Standard deviation of the normal position, shape (n,)."""
        first = np.zeros(len(self.jacobian), np.int64)
        return np.asarray(_deviation(first, self.jacobian, self.root))

    @property
    def sigma_theta(self) -> Array:
        """Standard deviation of theta, shape (n,)."""
        return np.asarray(_deviation(self.basis.first + 1, self.basis.value, self.root))

    @property
    def sigma_kappa(self) -> Array:
        """Standard deviation of kappa, shape (n,)."""
        return np.asarray(_deviation(self.basis.first + 1, self.basis.slope, self.root))

    def turned(self, drift: Array, reach: float) -> float:
        """Return by how much errors that neighbours share turn the root.

        Parameters
        ----------
        drift : ndarray, shape (n,)
            Standard deviation of such an error of each measured point, px.
        reach : float
            Distance over which their correlation falls by a factor e, px.

        Returns
        -------
        float
            Standard deviation of theta at the root, rad.
        """
        kept = math.exp(-float(self.curve.s[1] - self.curve.s[0]) / reach)
        return math.sqrt(_shared_power(self.lever * drift, kept))


@njit(cache=True)
def _shared_power(part: Array, kept: float) -> float:
    """Variance of the sum of parts whose correlation falls by `kept` a step."""
    total, before = 0.0, 0.0
    for x in part:
        total += x * x + 2.0 * x * before
        before = kept * (before + x)
    return max(total, 0.0)


@njit(cache=True)
def _deviation(first: NDArray[np.int64], rows: Array, root: Array) -> Array:
    """Root of the diagonal of A R R^T A^T; a row of A holds `rows` from `first` on."""
    out = np.empty(first.size)
    for i in range(first.size):
        spread = np.zeros(root.shape[1])
        for j in range(rows.shape[1]):
            row = first[i] + j
            for k in range(row, spread.size):  # R is upper triangular
                spread[k] += rows[i, j] * root[row, k]
        out[i] = np.sqrt(np.sum(spread**2))
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
    knots = knots_between(s[0], s[-1], spacing, joints)
    basis, middle = design(knots, s), design(knots, 0.5 * (s[1:] + s[:-1]))
    smooth = smooth or Smooth()
    if theta is None:
        theta = _chord_angles(points)
    penalty, nullity = penalty_on_moment(knots, smooth, s, theta)
    step = float(s[1] - s[0])
    coefficients = _start(basis, theta, penalty * spacing ** (2 * smooth.order + 1))
    start, *_ = _path(step, np.zeros(2), coefficients, basis, middle)
    origin = np.mean((points - start)[weights > 0.0], axis=0)
    for turn in range(iterations):
        path, angle, rate, rate_mid = _path(step, origin, coefficients, basis, middle)
        jacobian = _jacobian(step, rate, rate_mid, middle, len(coefficients))
        strength, normal, right, pull = weighed_equations(
            jacobian, _residual(points, path, rate, weights), weights, penalty,
            coefficients, math.nan if stiffness is None else stiffness, shared, within,
            nullity + 1, turn == iterations - 1,
        )  # fmt: skip
        half = factor(normal)
        change = solved(half, right - strength * pull)
        origin = origin + change[0] * np.array([-rate[0, 1], rate[0, 0]])
        coefficients = coefficients + change[1:]
    path, angle, rate, _ = _path(step, origin, coefficients, basis, middle)
    curve = Curve(s=s, points=path, theta=angle, kappa=basis.slopes(coefficients))
    root = inverse(half)
    return _with_covariance(
        curve, _residual(points, path, rate, weights), weights, within, shared,
        jacobian, basis, coefficients, root, float(freedom_of(root, penalty, strength)),
    )  # fmt: skip


def _chord_angles(points: Array) -> Array:
    step = np.gradient(points, axis=0)
    return np.unwrap(np.arctan2(step[:, 1], step[:, 0]))


@njit(cache=True)
def _start(basis: Basis, theta: Array, stiff: Array) -> Array:
    """Return coefficients of a smooth curve through given angles."""
    normal, right = 1e-3 * stiff, np.zeros(len(stiff))
    add_squares(basis.first, basis.value, np.ones(theta.size), normal)
    for j in range(right.size):
        normal[j, j] += 1e-9
    for i in range(theta.size):
        for j in range(4):
            right[basis.first[i] + j] += basis.value[i, j] * theta[i]
    return np.asarray(solved(factor(normal), right))


@njit(cache=True)
def _path(
    step: float, origin: Array, coefficients: Array, basis: Basis, middle: Basis
) -> tuple[Array, Array, Array, Array]:
    """Return points by Simpson's rule, angles, unit tangents there and half way."""
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
def _residual(points: Array, path: Array, rate: Array, weight: Array) -> Array:
    """Distance of the measured points along the normal; 0 where there is none."""
    out = np.zeros(weight.size)
    for i in range(weight.size):
        if weight[i] > 0.0:
            x, y = points[i, 0] - path[i, 0], points[i, 1] - path[i, 1]
            out[i] = rate[i, 0] * y - rate[i, 1] * x
    return out


@njit(cache=True)
def _jacobian(
    step: float, rate: Array, rate_mid: Array, middle: Basis, count: int
) -> Array:
    """Change of the normal position by origin (along its normal) and coefficients."""
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


def _with_covariance(
    curve: Curve, residual: Array, weight: Array, within: float, shared: float,
    jacobian: Array, basis: Basis, coefficients: Array, root: Array, freedom: float,
) -> CurveFit:  # fmt: skip
    """Widen the covariance by what the residuals of neighbours have in common."""
    used = weight > 0.0
    count, between = float(weight.sum()), float(weight @ residual**2)
    noise = np.sqrt((between + within) / max(count - freedom, 1.0))
    each = count / max(int(np.count_nonzero(used)), 1)
    alike = _correlation(residual, used, max(round(24.0 / each), 6))
    correlation = max(alike * each * between / max(between + within, 1e-300), 1.0)
    return CurveFit(
        curve=curve,
        residual=np.where(used, residual, np.nan),
        noise=float(noise),
        correlation=correlation,
        freedom=freedom,
        jacobian=jacobian,
        basis=basis,
        coefficients=coefficients,
        root=root * noise * np.sqrt(correlation / shared),
        lever=_lever(jacobian, basis, root) * weight / shared,
    )


def _lever(jacobian: Array, basis: Basis, root: Array) -> Array:
    """Return the change of theta at the root by points of unit weight."""
    first = basis.first[0] + 1
    turn = basis.value[0] @ root[first : first + 4]
    return np.asarray(jacobian @ (root @ turn))


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
