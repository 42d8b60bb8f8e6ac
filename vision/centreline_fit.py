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
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DEGREE = 3
SHARED = 8.0
"""Stations 1 px apart that carry one station's worth of information: bilinear samples,
compressed pictures and shade on the paper make neighbours alike."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """A fitted curve on an even grid of arc length.

    Parameters
    ----------
    s : ndarray, shape (n,)
        Arc length.
    points : ndarray, shape (n, 2)
        Position (x, y).
    theta, kappa : ndarray, shape (n,)
        Tangent angle, unwrapped, and its derivative.
    """

    s: Array
    points: Array
    theta: Array
    kappa: Array

    @property
    def tangents(self) -> Array:
        """Unit tangents, shape (n, 2)."""
        return np.column_stack([np.cos(self.theta), np.sin(self.theta)])

    @property
    def normals(self) -> Array:
        """Unit normals to the right in the picture (y down), shape (n, 2)."""
        return np.column_stack([-np.sin(self.theta), np.cos(self.theta)])

    def at(self, s: Array) -> tuple[Array, Array]:
        """Return points (n, 2) and angles (n,) at any s; beyond the ends an arc."""
        s = np.asarray(s, dtype=np.float64)
        inside = np.clip(s, self.s[0], self.s[-1])
        step = self.s[1] - self.s[0]
        place = (inside - self.s[0]) / step
        k = np.clip(place.astype(np.int64), 0, len(self.s) - 2)
        u = (place - k) * step
        base, kappa = self.theta[k], self.kappa[k]
        slope = (self.kappa[k + 1] - kappa) / step
        theta = base + u * (kappa + 0.5 * slope * u)
        middle = base + 0.5 * u * (kappa + 0.25 * slope * u)
        points = self.points[k] + u[:, None] * np.column_stack(
            [np.cos(middle), np.sin(middle)]
        )
        beyond = s - inside
        if np.any(beyond != 0.0):
            bend = np.where(beyond > 0.0, self._end_kappa(-1), self._end_kappa(0))
            turned = theta + 0.5 * beyond * bend
            points = points + beyond[:, None] * np.column_stack(
                [np.cos(turned), np.sin(turned)]
            )
            theta = theta + beyond * bend
        return points, theta

    def _end_kappa(self, end: int) -> float:
        return float(self.kappa[end])


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
        Standard deviation of a point.
    correlation : float
        Factor by which correlated residuals widen variances.
    freedom : float
        Effective number of parameters.
    normal_root, theta_root, kappa_root : ndarray, shape (n, p)
        Matrices R with covariance R R^T, of the normal position, theta and kappa.
    """

    curve: Curve
    residual: Array
    noise: float
    correlation: float
    freedom: float
    normal_root: Array
    theta_root: Array
    kappa_root: Array

    @property
    def sigma(self) -> Array:
        """Standard deviation of the normal position, shape (n,)."""
        return np.asarray(np.sqrt(np.sum(self.normal_root**2, axis=1)))

    @property
    def sigma_theta(self) -> Array:
        """Standard deviation of theta, shape (n,)."""
        return np.asarray(np.sqrt(np.sum(self.theta_root**2, axis=1)))

    @property
    def sigma_kappa(self) -> Array:
        """Standard deviation of kappa, shape (n,)."""
        return np.asarray(np.sqrt(np.sum(self.kappa_root**2, axis=1)))


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
) -> CurveFit:
    """Fit theta(s) to points measured near an even grid of arc length.

    Parameters
    ----------
    s : ndarray, shape (n,)
        Even grid of arc length.
    points : ndarray, shape (n, 2)
        Measured positions; only their distance along the normal counts.
    weights : ndarray, shape (n,)
        0 where nothing was measured.
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
        Neighbouring stations that count as one: the fewer, the more supple the curve.

    Returns
    -------
    CurveFit
        With covariances.
    """
    knots = _knots(s[0], s[-1], spacing, joints)
    basis, slopes = _design(knots, s)
    basis_mid, _ = _design(knots, 0.5 * (s[1:] + s[:-1]))
    bends = _bends(knots)
    penalty = bends.T @ bends
    if theta is None:
        theta = _chord_angles(points)
    start = basis.T @ basis + 1e-3 * penalty * spacing**5
    start += 1e-9 * np.eye(basis.shape[1])
    coefficients: Array = np.asarray(
        np.linalg.solve(start, basis.T @ theta), dtype=np.float64
    )
    weight = weights / max(float(weights.max()), 1e-12)
    origin = _origin(s, points, weight, basis_mid @ coefficients)
    for _ in range(iterations):
        curve = _integrate(s, origin, coefficients, basis, basis_mid, slopes)
        jacobian = _jacobian(curve, basis_mid, coefficients)
        residual = np.sum((points - curve.points) * curve.normals, axis=1)
        residual[weight == 0.0] = 0.0
        system = _solve(
            jacobian, residual, weight, penalty, coefficients, stiffness, shared
        )
        origin = origin + system.change[0] * curve.normals[0]
        coefficients = coefficients + system.change[1:]
    curve = _integrate(s, origin, coefficients, basis, basis_mid, slopes)
    residual = np.sum((points - curve.points) * curve.normals, axis=1)
    residual[weight == 0.0] = np.nan
    return _with_covariance(curve, residual, weight, jacobian, system, basis, slopes)


@dataclass(frozen=True, slots=True)
class _System:
    change: Array
    inverse_root: Array
    freedom: float
    shared: float


def _knots(first: float, last: float, spacing: float, joints: Sequence[float]) -> Array:
    inner = [joint for joint in joints if first + spacing < joint < last - spacing]
    ends = [first, *sorted(inner), last]
    pieces: list[Array] = [np.full(_DEGREE, first)]
    for low, high in pairwise(ends):
        count = max(round((high - low) / spacing), 2)
        pieces.append(np.linspace(low, high, count + 1)[:-1])
        if high != last:
            pieces.append(np.full(_DEGREE - 1, high))
    pieces.append(np.full(_DEGREE + 1, last))
    return np.concatenate(pieces)


def _design(knots: Array, s: Array) -> tuple[Array, Array]:
    """Return the cubic B-splines and their derivatives at s, each (n, count)."""
    basis = np.zeros((len(s), len(knots) - _DEGREE - 1))
    slopes = np.zeros_like(basis)
    _fill_basis(knots, s, basis, slopes)
    return basis, slopes


@njit(cache=True)
def _fill_basis(knots: Array, s: Array, basis: Array, slopes: Array) -> None:
    """Cox and de Boor's recurrence; s must not fall."""
    count = basis.shape[1]
    value = np.zeros(4)
    lower = np.zeros(4)
    k = 3
    for i in range(s.size):
        x = s[i]
        while k < count - 1 and x >= knots[k + 1]:
            k += 1
        value[:] = 0.0
        value[3] = 1.0
        for degree in range(1, 4):
            if degree == 3:
                lower[:] = value
            for j in range(3 - degree, 4):
                left = k - 3 + j
                total = 0.0
                span = knots[left + degree] - knots[left]
                if j > 3 - degree and span > 0.0:
                    total += (x - knots[left]) / span * value[j]
                span = knots[left + degree + 1] - knots[left + 1]
                if j < 3 and span > 0.0:
                    total += (knots[left + degree + 1] - x) / span * value[j + 1]
                value[j] = total
        for j in range(4):
            left = k - 3 + j
            basis[i, left] = value[j]
            rate = 0.0
            span = knots[left + 3] - knots[left]
            if j > 0 and span > 0.0:
                rate += lower[j] / span
            span = knots[left + 4] - knots[left + 1]
            if j < 3 and span > 0.0:
                rate -= lower[j + 1] / span
            slopes[i, left] = 3.0 * rate


def _bends(knots: Array) -> Array:
    """Return B with |B c|^2 the integral of theta'''^2, constant between knots."""
    low, high = knots[_DEGREE:-_DEGREE - 1], knots[_DEGREE + 1:-_DEGREE]  # fmt: skip
    real = high > low
    low, length = low[real], (high - low)[real]
    # Second differences of theta' at points well inside, where no knot is in doubt.
    inner = low[:, None] + length[:, None] * np.array([0.1, 0.5, 0.9])
    _, slopes = _design(knots, inner.ravel())
    first, middle, last = slopes.reshape(len(low), 3, -1).transpose(1, 0, 2)
    bend = (first - 2.0 * middle + last) / (0.4 * length[:, None]) ** 2
    return np.asarray(bend * np.sqrt(length)[:, None])


def _chord_angles(points: Array) -> Array:
    step = np.gradient(points, axis=0)
    return np.unwrap(np.arctan2(step[:, 1], step[:, 0]))


def _origin(s: Array, points: Array, weight: Array, theta_mid: Array) -> Array:
    h = s[1] - s[0]
    path = np.zeros_like(points)
    path[1:] = h * np.cumsum(
        np.column_stack([np.cos(theta_mid), np.sin(theta_mid)]), axis=0
    )
    used = weight > 0.0
    return np.asarray(np.mean((points - path)[used], axis=0))


def _integrate(
    s: Array, origin: Array, coefficients: Array, basis: Array, basis_mid: Array,
    slopes: Array,
) -> Curve:  # fmt: skip
    theta = basis @ coefficients
    mid = basis_mid @ coefficients
    h = s[1] - s[0]
    # Simpson's rule on each interval: ends and middle.
    rate = np.column_stack([np.cos(theta), np.sin(theta)])
    rate_mid = np.column_stack([np.cos(mid), np.sin(mid)])
    points = np.empty((len(s), 2))
    points[0] = origin
    points[1:] = origin + np.cumsum(
        h / 6.0 * (rate[:-1] + 4.0 * rate_mid + rate[1:]), axis=0
    )
    return Curve(s=s, points=points, theta=theta, kappa=slopes @ coefficients)


def _jacobian(curve: Curve, basis_mid: Array, coefficients: Array) -> Array:
    """Change of the normal position by origin (along its normal) and coefficients."""
    step = curve.s[1] - curve.s[0]
    jacobian = np.empty((len(curve.s), basis_mid.shape[1] + 1))
    _fill_jacobian(basis_mid @ coefficients, curve.normals, basis_mid, step, jacobian)
    return jacobian


@njit(cache=True)
def _fill_jacobian(
    mid: Array, normals: Array, basis_mid: Array, step: float, jacobian: Array
) -> None:
    stations, count = basis_mid.shape
    along = np.zeros((count, 2))
    for i in range(stations + 1):
        jacobian[i, 0] = normals[i, 0] * normals[0, 0] + normals[i, 1] * normals[0, 1]
        for k in range(count):
            jacobian[i, k + 1] = (
                normals[i, 0] * along[k, 0] + normals[i, 1] * along[k, 1]
            )
        if i < stations:
            x, y = -step * np.sin(mid[i]), step * np.cos(mid[i])
            for k in range(count):
                value = basis_mid[i, k]
                if value != 0.0:
                    along[k, 0] += x * value
                    along[k, 1] += y * value


def _solve(
    jacobian: Array, residual: Array, weight: Array, penalty: Array,
    coefficients: Array, strength: float | None, shared: float,
) -> _System:  # fmt: skip
    """Solve for the change, with the most likely weight of the penalty (REML).

    Neighbouring residuals share pixels, so `shared` of them count as one. One
    eigenproblem serves every weight: with normal = L L^T and L^-1 P L^-T = U d U^T,
    normal + w P = (L U) (1 + w d) (L U)^T.
    """
    weighted = jacobian * weight[:, None]
    normal = weighted.T @ jacobian / shared
    right = weighted.T @ residual / shared
    size = len(right)
    full = np.zeros((size, size))
    full[1:, 1:] = penalty
    pull = np.zeros(size)
    pull[1:] = penalty @ coefficients
    scale = float(np.trace(normal) / np.trace(full))
    lower = np.linalg.cholesky(normal + 1e-9 * scale * full + _ridge(normal))
    inverse = np.linalg.inv(lower)
    d, u = np.linalg.eigh(inverse @ full @ inverse.T)
    d = np.maximum(d, 0.0)
    z = inverse.T @ u
    force, bend = z.T @ right, z.T @ pull
    if strength is None:
        total = float(np.sum(weight * residual**2)) / shared
        stored = float(coefficients @ pull[1:])
        count = float(np.count_nonzero(weight)) / shared
        strength = _most_likely(
            scale, d, force, bend, total, stored, max(count - 4.0, 1.0)
        )
    growth = 1.0 + strength * d
    root = z / np.sqrt(growth)
    change = z @ ((force - strength * bend) / growth)
    return _System(change, root, float(np.sum(1.0 / growth)), shared)


def _ridge(normal: Array) -> Array:
    """Keep parts of the rod without data from making the matrix singular."""
    size = len(normal)
    return np.asarray(1e-11 * np.trace(normal) / size * np.eye(size))


def _most_likely(
    scale: float, d: Array, force: Array, bend: Array, total: float, stored: float,
    count: float,
) -> float:  # fmt: skip
    """Return the penalty weight of greatest restricted likelihood."""
    weights = scale * 10.0 ** np.arange(-9.0, 5.0, 0.25)
    growth = 1.0 + weights[:, None] * d
    gain = np.sum((force - weights[:, None] * bend) ** 2 / growth, axis=1)
    left = np.maximum(total + weights * stored - gain, 1e-12 * total + 1e-30)
    score = count * np.log(left) + np.sum(np.log(growth), axis=1)
    score -= (len(d) - 4.0) * np.log(weights)
    return float(weights[int(np.argmin(score))])


def _with_covariance(
    curve: Curve, residual: Array, weight: Array, jacobian: Array, system: _System,
    basis: Array, slopes: Array,
) -> CurveFit:  # fmt: skip
    used = weight > 0.0
    count = int(used.sum())
    squares = float(np.sum(weight[used] * residual[used] ** 2))
    noise = np.sqrt(squares / max(count - system.freedom, 1.0))
    correlation = _correlation(residual, weight)
    root = system.inverse_root * noise * np.sqrt(correlation / system.shared)
    return CurveFit(
        curve=curve,
        residual=residual,
        noise=float(noise),
        correlation=correlation,
        freedom=system.freedom,
        normal_root=jacobian @ root,
        theta_root=basis @ root[1:],
        kappa_root=slopes @ root[1:],
    )


def _correlation(residual: Array, weight: Array, lags: int = 24) -> float:
    """Return 1 + 2 sum of the residuals' autocorrelation, at least 1."""
    value = np.where(weight > 0.0, np.nan_to_num(residual), 0.0)
    used = (weight > 0.0).astype(np.float64)
    power = float(value @ value) / max(float(used.sum()), 1.0)
    if power <= 0.0:
        return 1.0
    total = 1.0
    for lag in range(1, min(lags, len(value) - 2) + 1):
        pairs = float(used[lag:] @ used[:-lag])
        if pairs < 4.0:
            break
        rho = float(value[lag:] @ value[:-lag]) / pairs / power
        if rho < 0.02:
            break
        total += 2.0 * rho
    return total
