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
from ..magnet.jet import JET
from .across import NEAR, PLACES
from .march import BLOCK, WIDTH, WORK, H, Z, begin, cross, loaded, pairs_of, step

SPLIT = 2
"""Pairs of steps from one look for focal points to the next: B's smallest part grows
with the third power of that distance, and must stand out from what a step leaves."""


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
def matrix(w, z, A):  # type: ignore[no-untyped-def]
    """Copy turn and shift by the tip's turn (and shift) from `z` on into `A`.

    In a uniform field, where a shift of the tip shifts the whole rod and no more, `A`
    is (3, 3), or the shifts are filled in.
    """
    n = A.shape[0]
    for a in range(n):
        for i in range(3):
            A[i, a] = w[z + 6 * i + a]
            if n > 3:
                A[3 + i, a] = w[z + 36 + 6 * i + a]


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
def _ask(m, w):  # type: ignore[no-untyped-def]
    """Set the columns that answer, from here on, to the moment and force alone."""
    if m == 3:
        for k in range(12):
            for a in range(3):
                w[Z + 6 * k + 3 + a] = 0.0
        for a in range(3):
            w[Z + 18 + 7 * a + 3] = -1.0
        return
    w[Z + BLOCK : Z + 2 * BLOCK] = 0.0
    for a in range(3):
        w[Z + BLOCK + 18 + 7 * a] = -1.0
        w[Z + BLOCK + 54 + 7 * a + 3] = -1.0


@njit(cache=True)
def _focal_points(m, w, X0, X1, B, S):  # type: ignore[no-untyped-def]
    """Count those between the look that left X_0 and the columns of now, or -1."""
    matrix(w, Z, X1)
    matrix(w, Z + 3 if m == 3 else Z + BLOCK, B)
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
    return negatives(S)


@njit(cache=True)
def morse_index(rod, field, load, n, R, r):  # type: ignore[no-untyped-def]
    """Count the focal points between tip and root: the unstable directions."""
    m = unknowns(field)
    blocks, solid = m // 3, rod.shape[1] > WIDTH
    table = np.zeros((0, PLACES, NEAR))
    w, jet, b, c = np.zeros(WORK), np.zeros(JET), np.zeros(12), np.zeros(12)
    X0, X1, B, S = (
        np.zeros((m, m)), np.zeros((m, m)), np.zeros((m, m)), np.zeros((m, m)),
    )  # fmt: skip
    index = 0
    begin(rod, field, load, R, r, 1, w, b)
    for i in range(rod.shape[0]):
        loaded(rod, i, load, w)
        count = pairs_of(rod, i, n / SPLIT)
        h = rod[i, H] / (2 * SPLIT * count)
        for _ in range(count):
            matrix(w, Z, X0)
            _ask(m, w)
            for _ in range(2 * SPLIT):
                step(h, field, solid, table, 0, 0, blocks, w, jet, b, c)
            more = _focal_points(m, w, X0, X1, B, S)
            if more < 0:
                return -1
            index += more
        if i + 1 < rod.shape[0]:
            cross(rod, field, load, i, 1, w, b)
    return index
