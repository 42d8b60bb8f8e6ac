"""The march of a rod that shears, stretches and feels its clamp, from the free tip.

Dimensionless as `planar.march`: lengths over L, moments over EI_ref / L, forces over
EI_ref / L^2, sigma = L - s, q = -M, P the pole load (exact here too, as long as the
magnetic force follows r': see `solid`). With N and Q the components of P along and
across the cross-section's normal t = (cos, sin)(theta), n = (-sin, cos)(theta), and the
section's compliances e (bending), t (stretch) and g (shear),

    theta' = e q (1 + alpha t N + chi (e q)^2)
    eps    = t N + alpha rho (e q)^2 / 2,    gamma = g Q
    q'     = -Q (1 + eps) + gamma N,         r' = -(1 + eps) t - gamma n

A rod is an array (n, 14), tip first, with the columns named below; `DEEP` is where off
the plane the Gauss points of its end face are, `JOINT` the turn
of the section per curvature of the softer side at the joint towards the root, in
lengths of L, `SOFT` the compliance of that softer side. The base is (turn, shift,
largest load): turn and shift per root curvature, and the load that sets the length of
the steps.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import flux_at, is_uniform

H, E, M, WX, WY, T, G, ALPHA, RHO, CHI, SIDE, DEEP, JOINT, SOFT = range(14)
WIDTH = 14
SERIES = 11
"""Series of a step: theta, q, sin, cos, theta', eps, Q, g N - eps,
alpha t N + chi (e q)^2, and the increments of x and y."""
ORDER = 14
STEP = 0.35
END_ZONE = 0.165
END_SLOPE = 3.4
"""Decay length in sides, and slope, of the axis's profile near a fixed face."""


@njit(cache=True)
def _series(h, order, X, p, S):  # type: ignore[no-untyped-def]
    """Fill the series S (11, order + 1 or more), in powers of tau / h, from X."""
    e, t, g = p[E], p[T], p[G]
    bow = 0.5 * p[ALPHA] * p[RHO] * e * e
    soften, couple = p[CHI] * e * e, p[ALPHA] * t
    px, py, wx, wy = X[4], X[5], h * X[6], h * X[7]
    S[0, 0], S[1, 0] = X[0], X[1]
    S[2, 0], S[3, 0] = math.sin(X[0]), math.cos(X[0])
    for k in range(order + 1):
        n = px * S[3, k] + py * S[2, k]
        q = py * S[3, k] - px * S[2, k]
        if k > 0:
            n += wx * S[3, k - 1] + wy * S[2, k - 1]
            q += wy * S[3, k - 1] - wx * S[2, k - 1]
        qq = 0.0
        for j in range(k + 1):
            qq += S[1, j] * S[1, k - j]
        S[5, k] = t * n + bow * qq
        S[6, k] = q
        S[7, k] = g * n - S[5, k]
        S[8, k] = couple * n + soften * qq
        z = S[1, k]
        push = -q
        for j in range(k + 1):
            z += S[1, j] * S[8, k - j]
            push += S[6, j] * S[7, k - j]
        S[4, k] = e * z
        sine = cosine = 0.0
        dx, dy = S[3, k], S[2, k]
        for j in range(k + 1):
            s, c = S[2, k - j], S[3, k - j]
            sine += S[4, j] * c
            cosine += S[4, j] * s
            dx += S[5, j] * c - g * S[6, j] * s
            dy += S[5, j] * s + g * S[6, j] * c
        f = h / (k + 1)
        S[9, k] = -f * dx
        S[10, k] = -f * dy
        if k < order:
            S[0, k + 1] = f * S[4, k]
            S[1, k + 1] = f * push
            S[2, k + 1] = f * sine
            S[3, k + 1] = -f * cosine


@njit(cache=True)
def _advance(h, order, X, S):  # type: ignore[no-untyped-def]
    """Move the state to the end of the step whose series is in S."""
    theta = q = x = y = 0.0
    for k in range(order, 0, -1):
        theta += S[0, k]
        q += S[1, k]
        x += S[9, k - 1]
        y += S[10, k - 1]
    X[0] += theta
    X[1] += q
    X[2] += x
    X[3] += y
    X[4] += h * X[6]
    X[5] += h * X[7]


@njit(cache=True)
def _load(rod, field, load, u, X, b):  # type: ignore[no-untyped-def]
    """Set the state at the tip: the traction m B / A, summed over the end face.

    Four Gauss points carry the face's mean flux and its moment about the axis. Those
    below the plane feel what those above feel.
    """
    cf, sf = math.cos(u[3]), math.sin(u[3])
    m = load * rod[0, M]
    X[:] = 0.0
    X[0] = u[0]
    if is_uniform(field):
        fx, fy = m * field[1], m * field[2]
    else:
        a = math.sqrt(rod[0, RHO])
        nx, ny = -math.sin(u[0] + u[3]) * a, math.cos(u[0] + u[3]) * a
        fx = fy = 0.0
        for side in (-1.0, 1.0):
            flux_at(field, u[1] + side * nx, u[2] + side * ny, rod[0, DEEP], b)
            fx += 0.5 * m * b[0]
            fy += 0.5 * m * b[1]
            X[1] -= 0.5 * m * side * (nx * b[1] - ny * b[0])
    X[4], X[5] = cf * fx + sf * fy, cf * fy - sf * fx


@njit(cache=True)
def _cross(rod, field, load, i, u, X, b):  # type: ignore[no-untyped-def]
    """Cross the joint from section i to i + 1: its turn, and the load where m jumps."""
    X[0] -= rod[i, JOINT] * rod[i, SOFT] * X[1]
    m = load * (rod[i + 1, M] - rod[i, M])
    if m == 0.0:
        return
    cf, sf = math.cos(u[3]), math.sin(u[3])
    x = u[1] + cf * X[2] - sf * X[3]
    y = u[2] + sf * X[2] + cf * X[3]
    flux_at(field, x, y, 0.0, b)
    X[4] += m * (cf * b[0] + sf * b[1])
    X[5] += m * (cf * b[1] - sf * b[0])


@njit(cache=True)
def steps_of(rod, i, base):  # type: ignore[no-untyped-def]
    """Return how many steps section i takes."""
    return max(1, math.ceil(rod[i, H] * math.sqrt(rod[i, E] * base[2]) / STEP))


@njit(cache=True)
def march(rod, field, base, clamp, load, u, order, X, S, b, trail, miss):  # type: ignore[no-untyped-def]
    """March to the root and write what is missed there into `miss` (3,).

    Parameters
    ----------
    rod, field, base : ndarray
        See the module's docstring; a field is as in `planar.march`.
    clamp, load : float
        Angle of the clamp in rad; factor on all loads.
    u : ndarray, shape (4,)
        Tip: angle from phi, x, y, and phi, the frame's angle.
    order : int
        Order of the series.
    X, S, b : ndarray, shapes (8,), (11, order + 1 or more), (12,)
        Work space; X holds the state at the root on return.
    trail : ndarray, shape (n, 3)
        Receives angle, x, y (of the specimen's frame) after every step.

    Returns
    -------
    int
        Number of steps, the same for all neighbouring u.
    """
    _load(rod, field, load, u, X, b)
    cf, sf = math.cos(u[3]), math.sin(u[3])
    row = 0
    for i in range(rod.shape[0]):
        X[6] = load * (cf * rod[i, WX] + sf * rod[i, WY])
        X[7] = load * (cf * rod[i, WY] - sf * rod[i, WX])
        n = steps_of(rod, i, base)
        h = rod[i, H] / n
        for _ in range(n):
            _series(h, order, X, rod[i], S)
            _advance(h, order, X, S)
            if row < trail.shape[0]:
                trail[row, 0] = X[0]
                trail[row, 1] = u[1] + cf * X[2] - sf * X[3]
                trail[row, 2] = u[2] + sf * X[2] + cf * X[3]
            row += 1
        if i + 1 < rod.shape[0]:
            _cross(rod, field, load, i, u, X, b)
    kappa = -rod[-1, E] * X[1]
    miss[0] = X[0] + u[3] + base[0] * kappa - clamp
    miss[1] = u[1] + cf * X[2] - sf * X[3] + base[1] * kappa * math.sin(clamp)
    miss[2] = u[2] + sf * X[2] + cf * X[3] - base[1] * kappa * math.cos(clamp)
    return row


@njit(cache=True)
def shape(rod, field, base, u, s, out):  # type: ignore[no-untyped-def]
    """Fill `out` (4, n): x, y, tangent angle, its derivative, at ascending stations s.

    Beyond the joint's own turn nothing is said of what happens within a side of it; at
    the root the measured profile of the clamped face is still to add (`end_zone`).
    """
    X, S, b = np.zeros(8), np.zeros((SERIES, ORDER + 5)), np.zeros(12)
    cf, sf = math.cos(u[3]), math.sin(u[3])
    _load(rod, field, 1.0, u, X, b)
    order = ORDER + 4
    k = s.shape[0] - 1
    reached = 0.0
    for i in range(rod.shape[0]):
        X[6] = cf * rod[i, WX] + sf * rod[i, WY]
        X[7] = cf * rod[i, WY] - sf * rod[i, WX]
        n = steps_of(rod, i, base)
        h = rod[i, H] / n
        for j in range(n):
            x0, y0 = X[2], X[3]
            _series(h, order, X, rod[i], S)
            _advance(h, order, X, S)
            last = i + 1 == rod.shape[0] and j + 1 == n
            while k >= 0 and (last or 1.0 - s[k] <= reached + h + 1e-13):
                r = (1.0 - s[k] - reached) / h
                theta = z = q = dq = x = y = 0.0
                for a in range(order, -1, -1):
                    theta = theta * r + S[0, a]
                    z = z * r + S[4, a]
                    dq = dq * r + q
                    q = q * r + S[6, a]
                    x = x * r + S[9, a]
                    y = y * r + S[10, a]
                x, y = x0 + r * x, y0 + r * y
                out[0, k] = u[1] + cf * x - sf * y
                out[1, k] = u[2] + sf * x + cf * y
                out[2, k] = theta + u[3] + rod[i, G] * q
                out[3, k] = -z - rod[i, G] * dq / h
                k -= 1
            reached += h
        if i + 1 < rod.shape[0]:
            _cross(rod, field, 1.0, i, u, X, b)


@njit(cache=True)
def end_zone(s, clamp, shift, width, out):  # type: ignore[no-untyped-def]
    """Add the axis's own profile near the fixed face, which decays within a side.

    From the same finite elements as the constants: the axis leaves the face at an
    angle, since the face holds its points and not their slopes.
    """
    for k in range(s.shape[0]):
        t = s[k] / width
        if t > 40.0:
            return
        decay = -shift * math.exp(-t)
        profile = decay * (1.0 + END_SLOPE * t)
        out[0, k] -= math.sin(clamp) * profile
        out[1, k] += math.cos(clamp) * profile
        out[2, k] += decay * (END_SLOPE - 1.0 - END_SLOPE * t) / width
        out[3, k] += decay * (1.0 - 2.0 * END_SLOPE + END_SLOPE * t) / width**2
