"""Taylor steps of the planar rod and of four columns of it (`planar.march`)."""

from __future__ import annotations

import math

from ...core.jit import njit
from ..magnet.flux import PART

MOST_STEPS = 1500
"""Most steps of a section; more is asked for only where an iteration runs away."""


@njit(**PART, fastmath={"contract"})
def series(h, order, X, T):  # type: ignore[no-untyped-def]
    """Expand the state X over a step of length `h`.

    Parameters
    ----------
    h : float
        Length of the step.
    order : int
        Order of the series.
    X : ndarray, shape (11,)
        The state where the step begins.
    T : ndarray, shape (4, order + 1 or more)
        Receives the series of theta, q, sin, cos in powers of tau / h.
    """
    he = h * X[6]
    px = h * X[4]
    py = h * X[5]
    wx = h * h * X[7]
    wy = h * h * X[8]
    T[0, 0] = X[0]
    T[1, 0] = X[1]
    T[2, 0] = math.sin(X[0])
    T[3, 0] = math.cos(X[0])
    for k in range(order):
        f = 1.0 / (k + 1)
        push = px * T[2, k] - py * T[3, k]
        if k > 0:
            push += wx * T[2, k - 1] - wy * T[3, k - 1]
        sine = 0.0
        cosine = 0.0
        for j in range(k + 1):
            sine += T[1, j] * T[3, k - j]
            cosine += T[1, j] * T[2, k - j]
        T[0, k + 1] = he * T[1, k] * f
        T[1, k + 1] = push * f
        T[2, k + 1] = he * sine * f
        T[3, k + 1] = -he * cosine * f


@njit(**PART, fastmath={"contract"})
def advance(h, order, X, T):  # type: ignore[no-untyped-def]
    """Move the state X to the end of the step whose `series` is in T."""
    theta = q = x = y = 0.0
    for k in range(order, 0, -1):
        f = 1.0 / k
        theta += T[0, k]
        q += T[1, k]
        x += T[3, k - 1] * f
        y += T[2, k - 1] * f
    X[0] += theta
    X[1] += q
    X[2] -= h * x
    X[3] -= h * y
    X[4] += h * X[7]
    X[5] += h * X[8]


@njit(**PART, fastmath={"contract"})
def column_step(h, order, X, T, D, C):  # type: ignore[no-untyped-def]
    """Move four columns over a step, before the state itself moves.

    Four, written out, stay in registers: a third of the time that a loop takes which
    keeps its sums in memory.

    Parameters
    ----------
    h, order, X, T
        As of `series`, which comes first.
    D : ndarray, shape (11, 4)
        Derivatives of the state.
    C : ndarray, shape (order + 1 or more, 4, 4)
        Receives their series: theta, q, and the products of theta with cos and -sin.
    """
    he = h * X[6]
    px = h * X[4]
    py = h * X[5]
    wx = h * h * X[7]
    wy = h * h * X[8]
    for a in range(4):
        C[0, 0, a] = D[0, a]
        C[0, 1, a] = D[1, a]
    for k in range(order):
        u0 = u1 = u2 = u3 = 0.0
        v0 = v1 = v2 = v3 = 0.0
        for j in range(k + 1):
            c = T[3, k - j]
            s = T[2, k - j]
            u0 += c * C[j, 0, 0]
            u1 += c * C[j, 0, 1]
            u2 += c * C[j, 0, 2]
            u3 += c * C[j, 0, 3]
            v0 -= s * C[j, 0, 0]
            v1 -= s * C[j, 0, 1]
            v2 -= s * C[j, 0, 2]
            v3 -= s * C[j, 0, 3]
        C[k, 2, 0] = u0
        C[k, 2, 1] = u1
        C[k, 2, 2] = u2
        C[k, 2, 3] = u3
        C[k, 3, 0] = v0
        C[k, 3, 1] = v1
        C[k, 3, 2] = v2
        C[k, 3, 3] = v3
        f = 1.0 / (k + 1)
        s0 = h * T[2, k]
        c0 = h * T[3, k]
        hq = h * T[1, k]
        for a in range(4):
            push = px * C[k, 2, a] - py * C[k, 3, a] + D[4, a] * s0 - D[5, a] * c0
            if k > 0:
                push += wx * C[k - 1, 2, a] - wy * C[k - 1, 3, a]
                push += h * h * (D[7, a] * T[2, k - 1] - D[8, a] * T[3, k - 1])
            C[k + 1, 0, a] = (he * C[k, 1, a] + hq * D[6, a]) * f
            C[k + 1, 1, a] = push * f
    for a in range(4):
        theta = q = x = y = 0.0
        for k in range(order, 0, -1):
            f = 1.0 / k
            theta += C[k, 0, a]
            q += C[k, 1, a]
            x += C[k - 1, 3, a] * f
            y += C[k - 1, 2, a] * f
        D[0, a] += theta
        D[1, a] += q
        D[2, a] -= h * x
        D[3, a] -= h * y
        D[4, a] += h * D[7, a]
        D[5, a] += h * D[8, a]


@njit(**PART)
def substeps(h, X, step):  # type: ignore[no-untyped-def]
    """Return how many Taylor steps a section needs.

    The series converges up to about pi / 2 in units of 1 / sqrt(e P), the distance of
    the pendulum's poles from the real axis; `step` is what one step takes, in the same
    units.
    """
    e = X[6]
    p0 = math.hypot(X[4], X[5])
    p1 = math.hypot(X[4] + h * X[7], X[5] + h * X[8])
    z = h * math.sqrt(e * max(p0, p1) + 0.25 * e * e * X[1] * X[1])
    if not z < MOST_STEPS * step:
        return MOST_STEPS
    return max(1, math.ceil(z / step))


@njit(**PART, fastmath={"contract"})
def sample(s, k, reached, h, last, order, x0, y0, phi, X, T, out):  # type: ignore[no-untyped-def]
    """Fill `out` at the stations within a step; return the next station, or -1.

    At a joint the curvature is the one of the section that begins there. Of T the sin
    and cos are integrated in place.
    """
    if k < 0 or not (last or 1.0 - s[k] <= reached + h + 1e-13):
        return k
    for a in range(order):
        f = h / (a + 1)
        T[2, a] *= f
        T[3, a] *= f
    while k >= 0 and (last or 1.0 - s[k] <= reached + h + 1e-13):
        r = (1.0 - s[k] - reached) / h
        theta = T[0, order]
        q = T[1, order]
        x = y = 0.0
        for a in range(order - 1, -1, -1):
            theta = theta * r + T[0, a]
            q = q * r + T[1, a]
            x = x * r + T[3, a]
            y = y * r + T[2, a]
        out[0, k] = x0 - r * x
        out[1, k] = y0 - r * y
        out[2, k] = theta + phi
        out[3, k] = -q * X[6]
        k -= 1
    return k
