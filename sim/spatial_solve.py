"""Equilibria of the rod in space: Newton on the tip's pose, load continuation, index.

Dimensionless as `spatial_march`. The Morse index counts the focal points of the march:
over a step from the columns (X_0, Y_0) to X_1, with B the response of X_1 to Y alone,
it is the number of negative eigenvalues of the symmetric matrix X_0 X_1^-1 B (Kratz,
Quadratic Functionals in Variational Analysis and Control Theory, 1995). Unlike the sign
of det X it counts the double zeros of rods that may buckle in any direction.
"""

from __future__ import annotations

import math

import numpy as np

from ..core.jit import njit
from .magnet_field import inside
from .spatial_march import (
    COLUMN,
    STATE,
    begin,
    cross,
    loaded,
    march,
    step,
    steps_of,
    workspace,
)  # fmt: skip

CONVERGED = 1e-11
CHORD = 1e-2
MIN_LOAD_STEP = 1e-6


@njit(cache=True)
def solve6(A, x):  # type: ignore[no-untyped-def]
    """Solve A x = x in place, by elimination with row pivots; False if singular."""
    n = A.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if A[best, k] == 0.0 or not math.isfinite(A[best, k]):
            return False
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
            for j in range(x.shape[1]):
                x[k, j], x[best, j] = x[best, j], x[k, j]
        for i in range(k + 1, n):
            f = A[i, k] / A[k, k]
            if f != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= f * A[k, j]
                for j in range(x.shape[1]):
                    x[i, j] -= f * x[k, j]
    for j in range(x.shape[1]):
        for k in range(n - 1, -1, -1):
            v = x[k, j]
            for i in range(k + 1, n):
                v -= A[k, i] * x[i, j]
            x[k, j] = v / A[k, k]
    return True


@njit(cache=True)
def negatives(S):  # type: ignore[no-untyped-def]
    """Count the negative eigenvalues of a symmetric matrix (destroyed), zeros apart.

    Elimination with the largest diagonal pivot, or a 2 x 2 block (one negative and one
    positive) where an element off the diagonal is far larger.
    """
    n = S.shape[0]
    tiny = 1e-10 * np.max(np.abs(S))
    count = 0
    alive = np.ones(n, dtype=np.bool_)
    for _ in range(n):
        d = p = q = -1
        for i in range(n):
            if not alive[i]:
                continue
            if d < 0 or abs(S[i, i]) > abs(S[d, d]):
                d = i
            for j in range(i):
                if alive[j] and (p < 0 or abs(S[i, j]) > abs(S[p, q])):
                    p, q = i, j
        if d < 0:
            break
        if p < 0 or abs(S[d, d]) >= 0.6 * abs(S[p, q]):
            if abs(S[d, d]) <= tiny:
                break
            count += S[d, d] < 0.0
            alive[d] = False
            for i in range(n):
                if alive[i]:
                    f = S[i, d] / S[d, d]
                    for j in range(n):
                        if alive[j]:
                            S[i, j] -= f * S[d, j]
            continue
        if abs(S[p, q]) <= tiny:
            break
        count += 1
        alive[p] = alive[q] = False
        det = S[p, p] * S[q, q] - S[p, q] ** 2
        for i in range(n):
            if alive[i]:
                f = (S[i, p] * S[q, q] - S[i, q] * S[p, q]) / det
                g = (S[i, q] * S[p, p] - S[i, p] * S[p, q]) / det
                for j in range(n):
                    if alive[j]:
                        S[i, j] -= f * S[p, j] + g * S[q, j]
    return count


@njit(cache=True)
def _miss(y, Rc, x):  # type: ignore[no-untyped-def]
    """Write minus the root's turn and shift into `x`; return the trace."""
    M = np.zeros((3, 3))
    for a in range(3):
        for c in range(3):
            for i in range(3):
                M[a, c] += Rc[i, a] * y[3 * i + c]
    x[0, 0] = -0.5 * (M[2, 1] - M[1, 2])
    x[1, 0] = -0.5 * (M[0, 2] - M[2, 0])
    x[2, 0] = -0.5 * (M[1, 0] - M[0, 1])
    for i in range(3):
        x[3 + i, 0] = -y[12 + i]
    return M[0, 0] + M[1, 1] + M[2, 2]


@njit(cache=True)
def _matrix(Z, A):  # type: ignore[no-untyped-def]
    """Copy turn and shift at the root by the six unknowns into `A`."""
    for a in range(6):
        for i in range(3):
            A[i, a] = Z[i, a]
            A[3 + i, a] = Z[6 + i, a]


@njit(cache=True)
def _move(R, r, x):  # type: ignore[no-untyped-def]
    """Turn and shift the tip by the solution `x`; return its size."""
    size = 0.0
    for i in range(6):
        size = max(size, abs(x[i, 0]))
    angle = math.sqrt(x[0, 0] ** 2 + x[1, 0] ** 2 + x[2, 0] ** 2)
    s = math.sin(angle) / angle if angle > 1e-8 else 1.0
    c = (1.0 - math.cos(angle)) / angle**2 if angle > 1e-4 else 0.5
    x0, x1, x2 = x[0, 0], x[1, 0], x[2, 0]
    for i in range(3):
        e0, e1, e2 = R[i, 0], R[i, 1], R[i, 2]
        t0, t1, t2 = x1 * e2 - x2 * e1, x2 * e0 - x0 * e2, x0 * e1 - x1 * e0
        R[i, 0] = e0 - s * t0 + c * (x1 * t2 - x2 * t1)
        R[i, 1] = e1 - s * t1 + c * (x2 * t0 - x0 * t2)
        R[i, 2] = e2 - s * t2 + c * (x0 * t1 - x1 * t0)
        r[i] += x[3 + i, 0]
    return size


@njit(cache=True)
def newton(rod, field, load, n, Rc, R, r, first, y, Z, none, work, bare):  # type: ignore[no-untyped-def]
    """Iterate the tip's pose (R, r); False if the corrections do not contract."""
    A, J, x = np.zeros((6, 6)), np.zeros((6, 6)), np.zeros((6, 1))
    before = math.inf
    for k in range(24):
        if field[0] != 0.0 and inside(field[1:], r[0], r[1], r[2], 0.0):
            return False
        if before > CHORD:
            march(rod, field, load, n, R, r, y, Z, work)
            _matrix(Z, J)
        else:
            march(rod, field, load, n, R, r, y, none, bare)
        trace = _miss(y, Rc, x)
        A[:] = J
        if trace < 1.0 or not solve6(A, x):
            return False
        size = _move(R, r, x)
        if not size < CONVERGED and (
            not size < first or (k > 0 and size > 0.25 * before)
        ):
            return False
        if size < CONVERGED:
            return True
        before = size
    return False


@njit(cache=True)
def follow(rod, field, n, Rc, R, r, y, Z, none, work, bare):  # type: ignore[no-untyped-def]
    """Follow the equilibrium from no load to full load; return the load reached."""
    Rb, rb = R.copy(), r.copy()
    load, jump = 0.0, 0.125
    if not newton(rod, field, 0.0, n, Rc, R, r, 4.0, y, Z, none, work, bare):
        return 0.0
    while load < 1.0:
        jump = min(jump, 1.0 - load)
        Rb[:], rb[:] = R, r
        if newton(rod, field, load + jump, n, Rc, R, r, 0.4, y, Z, none, work, bare):
            load = 1.0 if jump == 1.0 - load else load + jump
            jump *= 2.0
            continue
        R[:], r[:] = Rb, rb
        jump *= 0.5
        if jump < MIN_LOAD_STEP:
            return load
    return 1.0


@njit(cache=True)
def morse_index(rod, field, n, R, r):  # type: ignore[no-untyped-def]
    """Count the focal points between tip and root: the unstable directions."""
    y, Z = np.zeros(STATE), np.zeros((COLUMN, 12))
    K, KZ, ys, Zs, b, b2, p = workspace(12)
    begin(rod, field, 1.0, R, r, y, Z, b)
    X0, X1 = np.zeros((6, 6)), np.zeros((6, 6))
    B, S = np.zeros((6, 6)), np.zeros((6, 6))
    index = 0
    for i in range(rod.shape[0]):
        loaded(rod, i, 1.0, p)
        count = steps_of(rod, i, n)
        h = rod[i, 0] / count
        for _ in range(count):
            _matrix(Z, X0)
            Z[:, 6:] = 0.0
            for a in range(3):
                Z[3 + a, 6 + a] = -1.0
                Z[9 + a, 9 + a] = -1.0
            step(h, p, field, y, Z, K, KZ, ys, Zs, b, b2)
            _matrix(Z, X1)
            for a in range(6):
                for c in range(3):
                    B[c, a] = Z[c, 6 + a]
                    B[3 + c, a] = Z[6 + c, 6 + a]
            if not solve6(X1, B):
                return -1
            S[:] = 0.0
            for a in range(6):
                for c in range(6):
                    for k in range(6):
                        S[a, c] += X0[a, k] * B[k, c]
            for a in range(6):
                for c in range(a):
                    S[a, c] = S[c, a] = 0.5 * (S[a, c] + S[c, a])
            index += negatives(S)
        if i + 1 < rod.shape[0]:
            cross(rod, field, 1.0, i, y, Z[:, :6], b)
    return index


@njit(cache=True)
def solve_pose(rod, field, n, Rc, R, r):  # type: ignore[no-untyped-def]
    """Find the tip's pose (R, r) at full load, from the one given or from no load.

    Returns
    -------
    tuple
        Morse index (-1: no equilibrium), load reached, error (dimensionless).
    """
    y, Z, none = np.zeros(STATE), np.zeros((COLUMN, 6)), np.zeros((COLUMN, 0))
    work, bare = workspace(6), workspace(0)
    R0, r0 = R.copy(), r.copy()
    index = -1
    if newton(rod, field, 1.0, n, Rc, R, r, 1.0, y, Z, none, work, bare):
        index = morse_index(rod, field, n, R, r)
    if index != 0:
        R[:], r[:] = R0, r0
        load = follow(rod, field, n, Rc, R, r, y, Z, none, work, bare)
        if load < 1.0:
            return -1, load, 0.0
        index = morse_index(rod, field, n, R, r)
    march(rod, field, 1.0, n, R, r, y, Z, work)
    A, x = np.zeros((6, 6)), np.zeros((6, 1))
    _matrix(Z, A)
    march(rod, field, 1.0, 2 * n, R, r, y, none, bare)
    _miss(y, Rc, x)
    error = np.sum(np.abs(x))
    solve6(A, x)
    return index, 1.0, error + _move(R, r, x) + 1e-15 * n


@njit(cache=True)
def shape(rod, field, n, R, r, s, out):  # type: ignore[no-untyped-def]
    """Fill `out` (m, 18) with the state at the ascending stations `s`, root to tip."""
    y, Z = np.zeros(STATE), np.zeros((COLUMN, 0))
    K, KZ, ys, Zs, b, b2, p = workspace(0)
    begin(rod, field, 1.0, R, r, y, Z, b)
    k = s.shape[0] - 1
    here = 0.0
    for i in range(rod.shape[0]):
        loaded(rod, i, 1.0, p)
        last = i + 1 == rod.shape[0]
        end = 1.0 if last else here + rod[i, 0]
        while True:
            while k >= 0 and 1.0 - s[k] <= here + 1e-14:
                out[k] = y
                k -= 1
            if here >= end - 1e-14:
                break
            goal = end if k < 0 else min(end, max(1.0 - s[k], here))
            count = max(1, math.ceil(n * (goal - here)))
            for _ in range(count):
                step((goal - here) / count, p, field, y, Z, K, KZ, ys, Zs, b, b2)
            here = goal
        here = end
        if not last:
            cross(rod, field, 1.0, i, y, Z, b)
    while k >= 0:
        out[k] = y
        k -= 1
