"""The Morse index of a rod in space, from the focal points of its march.

Over a step from the columns (X_0, Y_0) to X_1, with B the response of X_1 to Y alone,
the focal points are the negative eigenvalues of the symmetric matrix X_0 X_1^-1 B
(Kratz, Quadratic Functionals in Variational Analysis and Control Theory, 1995). Unlike
the sign of det X they count the double zeros of rods that may buckle in any direction.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import is_uniform
from .march import COLUMN, STATE, begin, cross, loaded, step, steps_of, workspace

SPLIT = 3
"""Steps from one look for focal points to the next: B's smallest part grows with the
third power of that distance, and must stand out from what a step leaves."""


@njit(cache=True)
def unknowns(field):  # type: ignore[no-untyped-def]
    """Return how many unknowns act on the shape: turn of the tip, and its shift."""
    return 3 if is_uniform(field) else 6


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
def matrix(Z, A):  # type: ignore[no-untyped-def]
    """Copy turn and shift at the root by the tip's turn (and shift) into `A`.

    In a uniform field, where a shift of the tip shifts the whole rod and no more, `A`
    is (3, 3), or the shifts are filled in.
    """
    n = A.shape[0]
    known = min(n, Z.shape[1])
    for a in range(n):
        for i in range(n):
            A[i, a] = 1.0 if i == a else 0.0
    for a in range(known):
        for i in range(3):
            A[i, a] = Z[i, a]
            if n > 3:
                A[3 + i, a] = Z[6 + i, a]


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
def morse_index(rod, field, load, n, R, r):  # type: ignore[no-untyped-def]
    """Count the focal points between tip and root: the unstable directions."""
    m = unknowns(field)
    y, Z = np.zeros(STATE), np.zeros((COLUMN, 2 * m))
    K, KZ, ys, Zs, b, b2, p = workspace(2 * m, rod.shape[1])
    begin(rod, field, load, R, r, y, Z, b)
    X0, X1, B, S = (
        np.zeros((m, m)), np.zeros((m, m)), np.zeros((m, m)), np.zeros((m, m)),
    )  # fmt: skip
    index = 0
    for i in range(rod.shape[0]):
        loaded(rod, i, load, p)
        count = steps_of(rod, i, n / SPLIT)
        h = rod[i, 0] / count
        for _ in range(count):
            matrix(Z, X0)
            Z[:, m:] = 0.0
            for a in range(3):
                Z[3 + a, m + a] = -1.0
                if m > 3:
                    Z[9 + a, 9 + a] = -1.0
            for _ in range(SPLIT):
                step(h / SPLIT, p, field, y, Z, K, KZ, ys, Zs, b, b2)
            matrix(Z, X1)
            matrix(Z[:, m:], B)
            if not solve6(X1, B):
                return -1
            S[:] = 0.0
            for a in range(m):
                for c in range(m):
                    for k in range(m):
                        S[a, c] += X0[a, k] * B[k, c]
            for a in range(m):
                for c in range(a):
                    S[a, c] = S[c, a] = 0.5 * (S[a, c] + S[c, a])
            index += negatives(S)
        if i + 1 < rod.shape[0]:
            cross(rod, field, load, i, y, Z[:, :m], b)
    return index
