"""Equilibria of the rod that shears and stretches: Newton, load continuation, index.

Dimensionless as `solid.march`. Newton's matrix comes from differences of a march of
coarse order; the zeros of its determinant along the rod give the Morse index.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import blocked, is_uniform
from ..planar.follow import solve3
from ..planar.march import jacobi
from .march import (  # fmt: skip
    END_ZONE,
    ORDER,
    SERIES,
    SIDE,
    E,
    H,
    end_zone,
    march,
    shape,
    steps_of,
)

COARSE_ORDER = 8
"""Order that brings Newton near, and is enough for its matrix."""
NEAR = 1e-4
"""Correction after which the coarse order has done its part."""
CONVERGED = 1e-9
"""Correction after which the next, by the matrix kept, is rounding."""


@njit(cache=True)
def columns(rod, field, base, clamp, load, u, X, S, b, trails, miss, D):  # type: ignore[no-untyped-def]
    """Fill `miss` and D (4, 3) rows 0, 2, 3 with d(miss)/du by differences.

    Of the coarse order. `trails` (3, n, 3) receives the derivatives of the trail, for
    the Morse index. The steps are 1e-7 of what turns the root by one.
    """
    stiff = 0.0
    for i in range(rod.shape[0]):
        stiff += rod[i, H] * math.sqrt(rod[i, E] * base[2])
    here, there = np.zeros((trails.shape[1], 3)), np.zeros((trails.shape[1], 3))
    moved = np.zeros(3)
    n = march(rod, field, base, clamp, load, u, COARSE_ORDER, X, S, b, here, miss)
    for a in range(3):
        if a > 0 and is_uniform(field):
            D[0, a] = 0.0
            D[2, a] = 1.0 if a == 1 else 0.0
            D[3, a] = 1.0 if a == 2 else 0.0
            trails[a, :, 0] = 0.0
            trails[a, :, 1] = D[2, a]
            trails[a, :, 2] = D[3, a]
            continue
        kept = u[a]
        step = 1e-7 / math.cosh(stiff) if a == 0 else 1e-7
        u[a] += step
        march(rod, field, base, clamp, load, u, COARSE_ORDER, X, S, b, there, moved)
        u[a] = kept
        D[0, a] = (moved[0] - miss[0]) / step
        D[2, a] = (moved[1] - miss[1]) / step
        D[3, a] = (moved[2] - miss[2]) / step
        for k in range(n):
            for r in range(3):
                trails[a, k, r] = (there[k, r] - here[k, r]) / step
    return n


@njit(cache=True)
def _correction(D, miss, d):  # type: ignore[no-untyped-def]
    """Set d to Newton's correction; return its size or the root's, infinite if none.

    The root's counts too: a tip angle of next to nothing may turn the root by one.
    """
    if not solve3(D, miss[0], miss[1], miss[2], d):
        return math.inf
    return max(np.max(np.abs(d)), np.max(np.abs(miss)))


@njit(cache=True)
def newton(rod, field, base, clamp, load, u, X, S, b, trails, D):  # type: ignore[no-untyped-def]
    """Iterate u to an equilibrium; return False if the iteration does not contract.

    The matrix D is kept while each correction is below a twentieth of the last. The
    first corrections are those of a coarse order.
    """
    nowhere = np.zeros((0, 3))
    miss, d = np.zeros(3), np.zeros(3)
    order, before, fresh = COARSE_ORDER, math.inf, True
    for k in range(40):
        if blocked(field, u[1], u[2], 0.0, 0.5 * rod[0, SIDE]):
            return False
        if k == 0:
            columns(rod, field, base, clamp, load, u, X, S, b, trails, miss, D)
        else:
            march(rod, field, base, clamp, load, u, order, X, S, b, nowhere, miss)
        size = _correction(D, miss, d)
        if size > 0.05 * before:
            if fresh and size > 0.5 * before:
                return False
            columns(rod, field, base, clamp, load, u, X, S, b, trails, miss, D)
            size = _correction(D, miss, d)
            order, fresh = COARSE_ORDER, True
        else:
            fresh = k == 0
        if not size < 1.0:
            return False
        for i in range(3):
            u[i] += d[i]
        before = size
        if size < CONVERGED and order == ORDER:
            return True
        if size < NEAR and order < ORDER:
            order, before = ORDER, 1.0
    return False


@njit(cache=True)
def stability(rod, field, base, clamp, load, u, X, S, b, trails, D):  # type: ignore[no-untyped-def]
    """Count the zeros of the Jacobi determinant from tip to root: the Morse index."""
    miss, J = np.zeros(3), np.zeros((4, 3))
    n = columns(rod, field, base, clamp, load, u, X, S, b, trails, miss, D)
    zeros = 0
    positive = True
    for k in range(n):
        for a in range(3):
            J[0, a] = trails[a, k, 0]
            J[2, a] = trails[a, k, 1]
            J[3, a] = trails[a, k, 2]
        if k == n - 1:
            J[:] = D
        if (jacobi(J, 3) > 0.0) != positive:
            positive = not positive
            zeros += 1
    return zeros


@njit(cache=True, inline="always")
def solve_from(rod, field, base, clamp, u, trails, D):  # type: ignore[no-untyped-def]
    """Find the equilibrium of full load, from u or by following the load from zero.

    Returns
    -------
    tuple
        Morse index (-1: none), load reached, error (dimensionless), root moment / -1.
    """
    X, S, b = np.zeros(8), np.zeros((SERIES, ORDER + 5)), np.zeros(12)
    index = -1
    if math.isfinite(u[0]) and newton(
        rod, field, base, clamp, 1.0, u, X, S, b, trails, D
    ):
        index = stability(rod, field, base, clamp, 1.0, u, X, S, b, trails, D)
    if index != 0:
        load = _follow(rod, field, base, clamp, u, X, S, b, trails, D)
        if load < 1.0:
            return -1, load, 0.0, 0.0
        index = stability(rod, field, base, clamp, 1.0, u, X, S, b, trails, D)
    miss, d = np.zeros(3), np.zeros(3)
    nowhere = np.zeros((0, 3))
    march(rod, field, base, clamp, 1.0, u, ORDER + 4, X, S, b, nowhere, miss)
    solve3(D, miss[0], miss[1], miss[2], d)
    error = abs(miss[0]) + abs(miss[1]) + abs(miss[2])
    for i in range(3):
        u[i] += d[i]
        error += abs(d[i])
    return index, 1.0, error, X[1]


@njit(cache=True, inline="always")
def _follow(rod, field, base, clamp, u, X, S, b, trails, D):  # type: ignore[no-untyped-def]
    """Follow the load from zero in u; return the load reached."""
    u[0], u[1], u[2], u[3] = 0.0, math.cos(clamp), math.sin(clamp), clamp
    here, last = u.copy(), u.copy()
    load, jump, previous = 0.0, 0.125, 0.0
    while load < 1.0:
        jump = min(jump, 1.0 - load)
        ahead = jump / previous if previous > 0.0 else 0.0
        for i in range(3):
            u[i] = here[i] + ahead * (here[i] - last[i])
        size = max(abs(u[0] - here[0]), abs(u[1] - here[1]), abs(u[2] - here[2]))
        if size < 0.3 and newton(
            rod, field, base, clamp, load + jump, u, X, S, b, trails, D
        ):
            size = max(abs(u[0] - here[0]), abs(u[1] - here[1]), abs(u[2] - here[2]))
            if size < 0.4:
                last[:] = here
                here[:] = u
                load = 1.0 if jump == 1.0 - load else load + jump
                previous = jump
                jump *= 2.0
                continue
        jump *= 0.5
        if jump < 1e-6:
            u[:] = here
            return load
    return 1.0


@njit(cache=True)
def solve_shape(rod, field, base, clamp, u, s, out):  # type: ignore[no-untyped-def]
    """Find the equilibrium (see `solve_from`) and fill `out` (4, n), if there is one.

    Parameters
    ----------
    u : ndarray, shape (4,)
        The tip to start from; not finite: start without load.
    s : ndarray, shape (n,)
        Ascending stations.
    out : ndarray, shape (4, n)
        x, y, tangent angle and its derivative.
    """
    count = rod.shape[0]
    for i in range(count):
        count += steps_of(rod, i, base)
    trails, D = np.zeros((3, count, 3)), np.zeros((4, 3))
    index, load, error, moment = solve_from(rod, field, base, clamp, u, trails, D)
    if index < 0:
        return index, load, error, moment
    shape(rod, field, base, u, s, out)
    shift = -base[1] * rod[-1, E] * moment
    end_zone(s, clamp, shift, END_ZONE * rod[-1, SIDE], out)
    margin = 0.5 * np.max(rod[:, SIDE])
    for k in range(s.shape[0]):
        if blocked(field, out[0, k], out[1, k], 0.0, margin):
            return -1, load, error, moment
    return index, load, error, moment
