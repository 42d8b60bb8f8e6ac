"""A centreline as theta(s): cubic B-spline, inextensible by build, honest about itself.

The curve is p(s) = p0 + integral of (cos theta, sin theta), so its parameter is arc
length without any later correction. Measured points pull along the normal only. Knots
are dense (about one a rod width); what keeps the fit smooth is a penalty on theta''
whose weight is the most likely one (restricted maximum likelihood, Wood 2011). Joints
of known place get triple knots: theta stays continuous there and the curvature may
jump. The covariance is the Bayesian one of Wahba (1983), which covers the bias of
smoothing on average, widened by the correlation seen in the residuals.

Units here are pixels and radians of the picture (y down).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

Array = NDArray[np.float64]

_DEGREE = 3
_SHARED = 3.0
"""Stations 1 px apart that carry one station's worth of information: bilinear samples
and compressed pictures make neighbours alike."""


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
        return np.sqrt(np.sum(self.normal_root**2, axis=1))

    @property
    def sigma_theta(self) -> Array:
        """Standard deviation of theta, shape (n,)."""
        return np.sqrt(np.sum(self.theta_root**2, axis=1))

    @property
    def sigma_kappa(self) -> Array:
        """Standard deviation of kappa, shape (n,)."""
        return np.sqrt(np.sum(self.kappa_root**2, axis=1))


def fit_curve(
    s: Array,
    points: Array,
    weights: Array,
    *,
    spacing: float,
    joints: Sequence[float] = (),
    iterations: int = 2,
    theta: Array | None = None,
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

    Returns
    -------
    CurveFit
        With covariances.
    """
    knots = _knots(s[0], s[-1], spacing, joints)
    middle = 0.5 * (s[1:] + s[:-1])
    basis = _design(knots, s)
    basis_mid = _design(knots, middle)
    penalty = _penalty(knots)
    if theta is None:
        theta = _chord_angles(points)
    start = (
        basis.T @ basis + 1e-3 * penalty * spacing**3 + 1e-9 * np.eye(basis.shape[1])
    )
    coefficients = np.linalg.solve(start, basis.T @ theta)
    weight = weights / max(float(weights.max()), 1e-12)
    origin = _origin(s, points, weight, basis_mid @ coefficients)
    step = s[1] - s[0]
    for _ in range(iterations):
        curve = _integrate(s, origin, coefficients, basis, basis_mid)
        jacobian = _jacobian(curve, basis, basis_mid, coefficients, step)
        residual = np.sum((points - curve.points) * curve.normals, axis=1)
        residual[weight == 0.0] = 0.0
        system = _solve(jacobian, residual, weight, penalty, coefficients)
        origin = origin + system.change[0] * curve.normals[0]
        coefficients = coefficients + system.change[1:]
    curve = _integrate(
        s, origin, coefficients, basis, basis_mid,
        kappa=np.asarray(BSpline(knots, coefficients, _DEGREE).derivative()(s)),
    )  # fmt: skip
    residual = np.sum((points - curve.points) * curve.normals, axis=1)
    residual[weight == 0.0] = np.nan
    slopes = _slope_design(knots, s, basis.shape[1])
    return _with_covariance(curve, residual, weight, jacobian, system, basis, slopes)


@dataclass(frozen=True, slots=True)
class _System:
    change: Array
    inverse_root: Array
    freedom: float


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


def _design(knots: Array, s: Array) -> Array:
    return np.asarray(BSpline.design_matrix(s, knots, _DEGREE).toarray())


def _slope_design(knots: Array, s: Array, count: int) -> Array:
    return np.asarray(BSpline(knots, np.eye(count), _DEGREE).derivative()(s))


def _penalty(knots: Array) -> Array:
    """Integral of theta''^2, exact: theta'' is linear between knots (Gauss)."""
    count = len(knots) - _DEGREE - 1
    low, high = knots[_DEGREE:-_DEGREE - 1], knots[_DEGREE + 1:-_DEGREE]  # fmt: skip
    real = high > low
    low, high = low[real], high[real]
    half, centre = 0.5 * (high - low), 0.5 * (high + low)
    second = BSpline(knots, np.eye(count), _DEGREE).derivative(2)
    total = np.zeros((count, count))
    for sign in (-1.0, 1.0):
        value = np.asarray(second(centre + sign * half / np.sqrt(3.0)))
        total += value.T @ (value * half[:, None])
    return total


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
    kappa: Array | None = None,
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
    slope = np.gradient(theta, h) if kappa is None else kappa
    return Curve(s=s, points=points, theta=theta, kappa=slope)


def _jacobian(
    curve: Curve, basis: Array, basis_mid: Array, coefficients: Array, step: float
) -> Array:
    """Change of the normal position by origin (along its normal) and coefficients."""
    mid = basis_mid @ coefficients
    along_x = np.zeros_like(basis)
    along_y = np.zeros_like(basis)
    np.cumsum(-step * np.sin(mid)[:, None] * basis_mid, axis=0, out=along_x[1:])
    np.cumsum(step * np.cos(mid)[:, None] * basis_mid, axis=0, out=along_y[1:])
    n = curve.normals
    jacobian = np.empty((len(basis), basis.shape[1] + 1))
    jacobian[:, 0] = n @ n[0]
    jacobian[:, 1:] = n[:, :1] * along_x + n[:, 1:] * along_y
    return jacobian


def _solve(
    jacobian: Array, residual: Array, weight: Array, penalty: Array, coefficients: Array
) -> _System:
    """Solve for the change, with the most likely weight of the penalty (REML).

    Neighbouring residuals share pixels, so `_SHARED` of them count as one.
    """
    weighted = jacobian * weight[:, None]
    normal = weighted.T @ jacobian / _SHARED
    right = weighted.T @ residual / _SHARED
    size = len(right)
    full = np.zeros((size, size))
    full[1:, 1:] = penalty
    bend = np.zeros(size)
    bend[1:] = coefficients
    total = float(np.sum(weight * residual**2)) / _SHARED
    count = float(np.count_nonzero(weight)) / _SHARED
    rank = size - 3
    scale = np.trace(normal) / np.trace(full)
    tiny = 1e-12 * np.trace(normal) / size * np.eye(size)
    best = (np.inf, scale)
    for strength in scale * 10.0 ** np.arange(-12.0, 3.0, 0.5):
        pull = full @ bend
        lower = np.linalg.cholesky(normal + strength * full + tiny)
        half = np.linalg.solve(lower, right - strength * pull)
        left = total + strength * float(bend @ pull) - float(half @ half)
        if left <= 0.0:
            continue
        score = max(count - 3.0, 1.0) * np.log(left) - rank * np.log(strength)
        score += 2.0 * float(np.sum(np.log(np.diag(lower))))
        if score < best[0]:
            best = (score, float(strength))
    lower = np.linalg.cholesky(normal + best[1] * full + tiny)
    root = np.linalg.inv(lower).T
    change = root @ (root.T @ (right - best[1] * full @ bend))
    freedom = float(np.sum((normal @ root) * root))
    return _System(change, root, freedom)


def _with_covariance(
    curve: Curve, residual: Array, weight: Array, jacobian: Array, system: _System,
    basis: Array, slopes: Array,
) -> CurveFit:  # fmt: skip
    used = weight > 0.0
    count = int(used.sum())
    squares = float(np.sum(weight[used] * residual[used] ** 2))
    noise = np.sqrt(squares / max(count - system.freedom, 1.0))
    correlation = _correlation(residual, weight)
    root = system.inverse_root * noise * np.sqrt(correlation / _SHARED)
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


def _correlation(residual: Array, weight: Array, lags: int = 8) -> float:
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
        if rho < 0.05:
            break
        total += 2.0 * rho
    return total
