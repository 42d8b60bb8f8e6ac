"""A centreline as theta(s): cubic B-spline, inextensible by build, honest about itself.

The curve is p(s) = p0 + integral of (cos theta, sin theta), so its parameter is arc
length without any later correction. Measured points pull along the normal only. Knots
are dense (about one a rod width); what keeps the fit smooth is a penalty on
theta''' (a curvature that changes evenly, as at the root, is left alone), whose weight
is the most likely one (restricted maximum likelihood, Wood 2011). Joints of known place
get triple knots: theta stays continuous there and the curvature may jump. The
covariance is the Bayesian one of Wahba (1983), which covers the bias of smoothing on
average, widened by the correlation seen in the residuals.

Units here are pixels and radians of the picture (y down).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.jit import njit
from .curve import Curve
from .spline import Basis, add_squares, design, knots_between, penalty_on_bends

Array = NDArray[np.float64]

SHARED = 8.0
"""Stations 1 px apart that carry one station's worth of information: bilinear samples,
compressed pictures and shade on the paper make neighbours alike."""

_FAIR = 0.1
"""Weight of the penalty before the last step, in units of the data's."""


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
    """

    curve: Curve
    residual: Array
    noise: float
    correlation: float
    freedom: float
    jacobian: Array
    basis: Basis
    root: Array

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
        Weight of the penalty, px^5; the most likely one when not given.
    shared : float
        Neighbouring measurements that count as one: the fewer, the more supple the
        curve.
    within : float
        Sum of the squares of the measurements about the means that the points are.

    Returns
    -------
    CurveFit
        With covariances.
    """
    knots = knots_between(s[0], s[-1], spacing, joints)
    basis, middle = design(knots, s), design(knots, 0.5 * (s[1:] + s[:-1]))
    penalty = penalty_on_bends(knots)
    if theta is None:
        theta = _chord_angles(points)
    coefficients = _start(basis, theta, penalty * spacing**5)
    path = _integrate(s, np.zeros(2), coefficients, basis, middle)
    origin = np.mean((points - path.curve.points)[weights > 0.0], axis=0)
    for turn in range(iterations):
        path = _integrate(s, origin, coefficients, basis, middle)
        jacobian = _jacobian(path, middle, len(coefficients))
        system = _solve(
            jacobian, _residual(points, path, weights), weights, penalty, coefficients,
            stiffness, shared, within, last=turn == iterations - 1,
        )  # fmt: skip
        turned = np.array([-path.rate[0, 1], path.rate[0, 0]])
        origin = origin + system.change[0] * turned
        coefficients = coefficients + system.change[1:]
    path = _integrate(s, origin, coefficients, basis, middle)
    residual = _residual(points, path, weights)
    return _with_covariance(
        path.curve, residual, weights, within, jacobian, system, basis
    )


@dataclass(frozen=True, slots=True)
class _System:
    change: Array
    inverse_root: Array
    freedom: float
    shared: float


def _chord_angles(points: Array) -> Array:
    step = np.gradient(points, axis=0)
    return np.unwrap(np.arctan2(step[:, 1], step[:, 0]))


def _start(basis: Basis, theta: Array, stiff: Array) -> Array:
    """Return coefficients of a smooth curve through given angles."""
    normal, right = 1e-3 * stiff, np.zeros(len(stiff))
    normal.flat[:: len(right) + 1] += 1e-9
    add_squares(basis.first, basis.value, np.ones(len(theta)), normal)
    for k in range(4):
        np.add.at(right, basis.first + k, basis.value[:, k] * theta)
    return np.asarray(np.linalg.solve(normal, right), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class _Path:
    """A curve with what its derivatives need."""

    curve: Curve
    rate: Array
    rate_mid: Array


def _integrate(
    s: Array, origin: Array, coefficients: Array, basis: Basis, middle: Basis
) -> _Path:
    theta = basis.values(coefficients)
    rate, points = np.empty((len(s), 2)), np.empty((len(s), 2))
    rate_mid = np.empty((len(s) - 1, 2))
    points[0] = origin
    _walk(s[1] - s[0], theta, middle.values(coefficients), rate, rate_mid, points)
    curve = Curve(s=s, points=points, theta=theta, kappa=basis.slopes(coefficients))
    return _Path(curve, rate, rate_mid)


@njit(cache=True)
def _walk(
    step: float, theta: Array, mid: Array, rate: Array, rate_mid: Array, points: Array
) -> None:
    """Fill unit tangents, and points by Simpson's rule on each interval."""
    h = step / 6.0
    rate[0, 0], rate[0, 1] = np.cos(theta[0]), np.sin(theta[0])
    for i in range(mid.size):
        rate_mid[i, 0], rate_mid[i, 1] = np.cos(mid[i]), np.sin(mid[i])
        rate[i + 1, 0], rate[i + 1, 1] = np.cos(theta[i + 1]), np.sin(theta[i + 1])
        for k in range(2):
            mean = rate[i, k] + 4.0 * rate_mid[i, k] + rate[i + 1, k]
            points[i + 1, k] = points[i, k] + h * mean


def _residual(points: Array, path: _Path, weight: Array) -> Array:
    """Distance of the measured points along the normal; 0 where there is none."""
    away = points - path.curve.points
    across = path.rate[:, 0] * away[:, 1] - path.rate[:, 1] * away[:, 0]
    return np.where(weight == 0.0, 0.0, across)


def _jacobian(path: _Path, middle: Basis, count: int) -> Array:
    """Change of the normal position by origin (along its normal) and coefficients."""
    jacobian = np.zeros((len(path.rate), count + 1))
    step = path.curve.s[1] - path.curve.s[0]
    _fill_jacobian(path.rate, path.rate_mid, middle.first, middle.value, step, jacobian)
    return jacobian


@njit(cache=True)
def _fill_jacobian(
    rate: Array, rate_mid: Array, first: NDArray[np.int64], value: Array, step: float,
    jacobian: Array,
) -> None:  # fmt: skip
    along = np.zeros((jacobian.shape[1] - 1, 2))
    end = 0
    for i in range(len(rate)):
        x, y = rate[i, 0], rate[i, 1]
        jacobian[i, 0] = x * rate[0, 0] + y * rate[0, 1]
        for k in range(end):
            jacobian[i, k + 1] = x * along[k, 1] - y * along[k, 0]
        if i < first.size:
            end = first[i] + 4
            for j in range(4):
                along[first[i] + j, 0] -= step * rate_mid[i, 1] * value[i, j]
                along[first[i] + j, 1] += step * rate_mid[i, 0] * value[i, j]


@njit(cache=True)
def _normal_equations(
    jacobian: Array, weight: Array, residual: Array, normal: Array, right: Array
) -> None:
    """Add J^T W J and J^T W r; a row of J ends in zeros."""
    for i in range(weight.size):
        end = right.size
        while end > 0 and jacobian[i, end - 1] == 0.0:
            end -= 1
        for j in range(end):
            share = weight[i] * jacobian[i, j]
            right[j] += share * residual[i]
            for k in range(j + 1):
                normal[j, k] += share * jacobian[i, k]
    for j in range(right.size):
        for k in range(j):
            normal[k, j] = normal[j, k]


def _solve(
    jacobian: Array, residual: Array, weight: Array, penalty: Array,
    coefficients: Array, strength: float | None, shared: float, within: float, *,
    last: bool,
) -> _System:  # fmt: skip
    """Solve for the change, with the most likely weight of the penalty (REML).

    Neighbouring residuals share pixels, so `shared` of them count as one. Before the
    last step any fair weight does: it moves only the point at which the next step is
    taken.
    """
    size = jacobian.shape[1]
    normal, right, full = np.zeros((size, size)), np.zeros(size), np.zeros((size, size))
    _normal_equations(jacobian, weight / shared, residual, normal, right)
    full[1:, 1:] = penalty
    pull = np.zeros(size)
    pull[1:] = penalty @ coefficients
    scale = float(np.trace(normal) / np.trace(full))
    # Parts of the rod without data must not make the matrix singular.
    ridge = 1e-11 * float(np.trace(normal)) / size
    normal.flat[:: size + 1] += ridge
    normal += 1e-9 * scale * full
    if not last:
        fair = _FAIR * scale if strength is None else strength
        change = np.linalg.solve(normal + fair * full, right - fair * pull)
        return _System(np.asarray(change, dtype=np.float64), full, 0.0, shared)
    if strength is None:
        total = (float(weight @ residual**2) + within) / shared
        stored = float(coefficients @ pull[1:])
        count = max(float(weight.sum()) / shared - 4.0, 1.0)
        strength = _most_likely(scale, normal, full, right, pull, total, stored, count)
    stiff = normal + strength * full
    root = np.asarray(np.linalg.inv(np.linalg.cholesky(stiff)), np.float64).T
    change = root @ (root.T @ (right - strength * pull))
    return _System(change, root, float(np.sum(root * (normal @ root))), shared)


@njit(cache=True)
def _most_likely(
    scale: float, normal: Array, penalty: Array, right: Array, pull: Array,
    total: float, stored: float, count: float,
) -> float:  # fmt: skip
    """Return the penalty weight of greatest restricted likelihood.

    It is looked for over 14 decades, and then in quarters of a decade about the best.
    """
    best, least = 0, np.inf
    for turn in range(2):
        centre = best
        for k in range(14) if turn == 0 else range(-3, 4):
            power = 4 * k - 36 if turn == 0 else centre + k
            weight = scale * 10.0 ** (0.25 * power)
            gain, logs = _eliminated(normal + weight * penalty, right - weight * pull)
            left = max(total + weight * stored - gain, 1e-12 * total + 1e-30)
            score = count * np.log(left) + logs - (len(right) - 4.0) * np.log(weight)
            if score < least:
                best, least = power, score
    return float(scale * 10.0 ** (0.25 * best))


@njit(cache=True)
def _eliminated(matrix: Array, right: Array) -> tuple[float, float]:
    """Return right^T matrix^-1 right, and the logarithm of the determinant.

    Cholesky's method, in place: the matrices are too small for a library's threads.
    """
    size = right.size
    gain, logs = 0.0, 0.0
    for k in range(size):
        pivot = matrix[k, k]
        if not pivot > 0.0:
            return 0.0, np.inf
        gain += right[k] ** 2 / pivot
        logs += np.log(pivot)
        for j in range(k + 1, size):
            share = matrix[k, j] / pivot
            right[j] -= share * right[k]
            for i in range(j, size):
                matrix[j, i] -= share * matrix[k, i]
    return gain, logs


def _with_covariance(
    curve: Curve, residual: Array, weight: Array, within: float, jacobian: Array,
    system: _System, basis: Basis,
) -> CurveFit:  # fmt: skip
    """Widen the covariance by what the residuals of neighbours have in common."""
    used = weight > 0.0
    count, between = float(weight.sum()), float(weight @ residual**2)
    noise = np.sqrt((between + within) / max(count - system.freedom, 1.0))
    each = count / max(int(np.count_nonzero(used)), 1)
    alike = _correlation(residual, used, max(round(24.0 / each), 6))
    correlation = max(alike * each * between / max(between + within, 1e-300), 1.0)
    return CurveFit(
        curve=curve,
        residual=np.where(used, residual, np.nan),
        noise=float(noise),
        correlation=correlation,
        freedom=system.freedom,
        jacobian=jacobian,
        basis=basis,
        root=system.inverse_root * noise * np.sqrt(correlation / system.shared),
    )


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
