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

_FAIR = 0.1
"""Weight of the penalty before the last step, in units of the data's."""


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
        tangents = np.empty((len(self.theta), 2))
        np.cos(self.theta, out=tangents[:, 0])
        np.sin(self.theta, out=tangents[:, 1])
        return tangents

    @property
    def normals(self) -> Array:
        """Unit normals to the right in the picture (y down), shape (n, 2)."""
        normals = np.empty((len(self.theta), 2))
        np.negative(np.sin(self.theta), out=normals[:, 0])
        np.cos(self.theta, out=normals[:, 1])
        return normals

    def at(self, s: Array) -> tuple[Array, Array]:
        """Return points (n, 2) and angles (n,) at any s; beyond the ends an arc."""
        s = np.ascontiguousarray(s, dtype=np.float64)
        points, theta = np.empty((len(s), 2)), np.empty(len(s))
        _evaluate(s, self.s, self.points, self.theta, self.kappa, points, theta)
        return points, theta


@njit(cache=True)
def _evaluate(
    at: Array, s: Array, points: Array, theta: Array, kappa: Array,
    out: Array, angle: Array,
) -> None:  # fmt: skip
    """Points and angles of a curve: curvature linear between stations."""
    last = s.size - 1
    step = s[1] - s[0]
    for i in range(at.size):
        inside = min(max(at[i], s[0]), s[last])
        place = (inside - s[0]) / step
        k = min(max(int(place), 0), last - 1)
        u = (place - k) * step
        slope = (kappa[k + 1] - kappa[k]) / step
        middle = theta[k] + 0.5 * u * (kappa[k] + 0.25 * slope * u)
        turned = theta[k] + u * (kappa[k] + 0.5 * slope * u)
        x, y = points[k, 0] + u * np.cos(middle), points[k, 1] + u * np.sin(middle)
        beyond = at[i] - inside
        if beyond != 0.0:
            bend = kappa[last] if beyond > 0.0 else kappa[0]
            middle = turned + 0.5 * beyond * bend
            x, y = x + beyond * np.cos(middle), y + beyond * np.sin(middle)
            turned += beyond * bend
        out[i, 0], out[i, 1], angle[i] = x, y, turned


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
    jacobian : ndarray, shape (n, p)
        Change of the normal position by the parameters: origin, then coefficients.
    basis, slopes : ndarray, shape (n, p - 1)
        theta and kappa by the coefficients.
    root : ndarray, shape (p, p)
        Matrix R with R R^T the covariance of the parameters.
    """

    curve: Curve
    residual: Array
    noise: float
    correlation: float
    freedom: float
    jacobian: Array
    basis: Array
    slopes: Array
    root: Array

    @property
    def sigma(self) -> Array:
        """Standard deviation of the normal position, shape (n,)."""
        return _deviation(self.jacobian, self.root)

    @property
    def sigma_theta(self) -> Array:
        """Standard deviation of theta, shape (n,)."""
        return _deviation(self.basis, self.root[1:])

    @property
    def sigma_kappa(self) -> Array:
        """Standard deviation of kappa, shape (n,)."""
        return _deviation(self.slopes, self.root[1:])


def _deviation(rows: Array, root: Array) -> Array:
    spread = rows @ root
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", spread, spread)))


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
    weight = weights / max(float(weights.max()), 1e-12)
    coefficients = _start(basis, theta, penalty * spacing**5)
    origin = _origin(s, points, weight, basis_mid @ coefficients)
    for turn in range(iterations):
        path = _integrate(s, origin, coefficients, basis, basis_mid, slopes)
        jacobian = _jacobian(path, basis_mid)
        system = _solve(
            jacobian, _residual(points, path, weight), weight, penalty, coefficients,
            stiffness, shared, last=turn == iterations - 1,
        )  # fmt: skip
        turned = np.array([-path.rate[0, 1], path.rate[0, 0]])
        origin = origin + system.change[0] * turned
        coefficients = coefficients + system.change[1:]
    path = _integrate(s, origin, coefficients, basis, basis_mid, slopes)
    residual = _residual(points, path, weight)
    return _with_covariance(
        path.curve, residual, weight, jacobian, system, basis, slopes
    )


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


def _start(basis: Array, theta: Array, stiff: Array) -> Array:
    """Return coefficients of a smooth curve through given angles."""
    normal = np.zeros((basis.shape[1], basis.shape[1]))
    right = np.zeros(basis.shape[1])
    _accumulate(basis, theta, normal, right)
    normal += 1e-3 * stiff
    normal.flat[:: len(right) + 1] += 1e-9
    return np.asarray(np.linalg.solve(normal, right), dtype=np.float64)


@njit(cache=True)
def _accumulate(basis: Array, theta: Array, normal: Array, right: Array) -> None:
    """Add basis^T basis and basis^T theta; at most four splines overlap."""
    stations, count = basis.shape
    first = 0
    for i in range(stations):
        while first < count - 1 and basis[i, first] == 0.0:
            first += 1
        end = min(first + 4, count)
        for j in range(first, end):
            right[j] += basis[i, j] * theta[i]
            for k in range(first, end):
                normal[j, k] += basis[i, j] * basis[i, k]


def _origin(s: Array, points: Array, weight: Array, theta_mid: Array) -> Array:
    h = s[1] - s[0]
    path = np.zeros_like(points)
    path[1:] = h * np.cumsum(
        np.column_stack([np.cos(theta_mid), np.sin(theta_mid)]), axis=0
    )
    used = weight > 0.0
    return np.asarray(np.mean((points - path)[used], axis=0))


@dataclass(frozen=True, slots=True)
class _Path:
    """A curve with what its derivatives need."""

    curve: Curve
    rate: Array
    rate_mid: Array


def _integrate(
    s: Array, origin: Array, coefficients: Array, basis: Array, basis_mid: Array,
    slopes: Array,
) -> _Path:  # fmt: skip
    theta = basis @ coefficients
    rate, points = np.empty((len(s), 2)), np.empty((len(s), 2))
    rate_mid = np.empty((len(s) - 1, 2))
    points[0] = origin
    _walk(s[1] - s[0], theta, basis_mid @ coefficients, rate, rate_mid, points)
    curve = Curve(s=s, points=points, theta=theta, kappa=slopes @ coefficients)
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


def _jacobian(path: _Path, basis_mid: Array) -> Array:
    """Change of the normal position by origin (along its normal) and coefficients."""
    step = path.curve.s[1] - path.curve.s[0]
    jacobian = np.empty((len(path.rate), basis_mid.shape[1] + 1))
    _fill_jacobian(path.rate, path.rate_mid, basis_mid, step, jacobian)
    return jacobian


@njit(cache=True)
def _fill_jacobian(
    rate: Array, rate_mid: Array, basis_mid: Array, step: float, jacobian: Array
) -> None:
    stations, count = basis_mid.shape
    along_x, along_y = np.zeros(count), np.zeros(count)
    first, end = 0, 0
    for i in range(stations + 1):
        x, y = rate[i, 0], rate[i, 1]
        jacobian[i, 0] = x * rate[0, 0] + y * rate[0, 1]
        for k in range(end):
            jacobian[i, k + 1] = x * along_y[k] - y * along_x[k]
        for k in range(end, count):
            jacobian[i, k + 1] = 0.0
        if i < stations:
            while first < count - 1 and basis_mid[i, first] == 0.0:
                first += 1
            end = min(first + 4, count)
            for k in range(first, end):
                along_x[k] -= step * rate_mid[i, 1] * basis_mid[i, k]
                along_y[k] += step * rate_mid[i, 0] * basis_mid[i, k]


def _solve(
    jacobian: Array, residual: Array, weight: Array, penalty: Array,
    coefficients: Array, strength: float | None, shared: float, *, last: bool,
) -> _System:  # fmt: skip
    """Solve for the change, with the most likely weight of the penalty (REML).

    Neighbouring residuals share pixels, so `shared` of them count as one. One
    eigenproblem serves every weight: with normal = L L^T and L^-1 P L^-T = U d U^T,
    normal + w P = (L U) (1 + w d) (L U)^T. Before the last step any fair weight does:
    it moves only the point at which the next step is taken.
    """
    weighted = jacobian * np.sqrt(weight / shared)[:, None]
    normal = weighted.T @ weighted
    right = jacobian.T @ (weight * residual / shared)
    size = len(right)
    full = np.zeros((size, size))
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
    if strength is not None:
        stiff = normal + strength * full
        root = np.asarray(np.linalg.inv(np.linalg.cholesky(stiff)), np.float64).T
        change = root @ (root.T @ (right - strength * pull))
        return _System(change, root, float(np.sum(root * (normal @ root))), shared)
    inverse = np.linalg.inv(np.linalg.cholesky(normal))
    d, u = np.linalg.eigh(inverse @ full @ inverse.T)
    d = np.maximum(d, 0.0)
    z = inverse.T @ u
    force, bend = z.T @ right, z.T @ pull
    total = float(np.sum(weight * residual**2)) / shared
    stored = float(coefficients @ pull[1:])
    count = float(np.count_nonzero(weight)) / shared
    strength = _most_likely(scale, d, force, bend, total, stored, max(count - 4.0, 1.0))
    growth = 1.0 + strength * d
    root = z / np.sqrt(growth)
    change = z @ ((force - strength * bend) / growth)
    return _System(change, root, float(np.sum(1.0 / growth)), shared)


@njit(cache=True)
def _most_likely(
    scale: float, d: Array, force: Array, bend: Array, total: float, stored: float,
    count: float,
) -> float:  # fmt: skip
    """Return the penalty weight of greatest restricted likelihood."""
    best, least = scale, np.inf
    for power in range(-36, 20):
        weight = scale * 10.0 ** (0.25 * power)
        gain, logs = 0.0, 0.0
        for k in range(d.size):
            growth = 1.0 + weight * d[k]
            gain += (force[k] - weight * bend[k]) ** 2 / growth
            logs += np.log(growth)
        left = max(total + weight * stored - gain, 1e-12 * total + 1e-30)
        score = count * np.log(left) + logs - (d.size - 4.0) * np.log(weight)
        if score < least:
            best, least = weight, score
    return best


def _with_covariance(
    curve: Curve, residual: Array, weight: Array, jacobian: Array, system: _System,
    basis: Array, slopes: Array,
) -> CurveFit:  # fmt: skip
    used = weight > 0.0
    count = int(np.count_nonzero(used))
    squares = float(weight @ residual**2)
    noise = np.sqrt(squares / max(count - system.freedom, 1.0))
    correlation = _correlation(residual, used, 24)
    return CurveFit(
        curve=curve,
        residual=np.where(used, residual, np.nan),
        noise=float(noise),
        correlation=correlation,
        freedom=system.freedom,
        jacobian=jacobian,
        basis=basis,
        slopes=slopes,
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
