"""A quick look at the columns of a march, that says for sure of most rods: stable.

Directions become unstable where X, the root's turn and shift by the tip's, is singular
(`spatial.index`). With what a rigid rod would do divided out, X is the identity without
load; while its symmetric part is positive definite it cannot be singular.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import PART
from .march import Y, Z

MARGIN = 0.2
"""What the symmetric part must exceed: more than it changes over a pair of steps."""


@njit(**PART)
def _positive(A, n):  # type: ignore[no-untyped-def]
    """Tell whether a symmetric matrix is positive definite (Cholesky, in place)."""
    for j in range(n):
        d = A[j, j]
        for k in range(j):
            d -= A[j, k] * A[j, k]
        if not d > 0.0:
            return False
        d = math.sqrt(d)
        A[j, j] = d
        for i in range(j + 1, n):
            v = A[i, j]
            for k in range(j):
                v -= A[i, k] * A[j, k]
            A[i, j] = v / d
    return True


@njit(**PART)
def is_sure(uniform, R, r, w):  # type: ignore[no-untyped-def]
    """Tell whether the first block of columns in `w` is surely regular.

    `R` and `r` are the tip's pose, from which the march came.
    """
    M = np.empty((6, 6))
    lx, ly, lz = w[Y + 12] - r[0], w[Y + 13] - r[1], w[Y + 14] - r[2]
    for a in range(6):
        z = Z + a
        x0, x1, x2 = w[z], w[z + 6], w[z + 12]
        tx = w[Y] * x0 + w[Y + 1] * x1 + w[Y + 2] * x2
        ty = w[Y + 3] * x0 + w[Y + 4] * x1 + w[Y + 5] * x2
        tz = w[Y + 6] * x0 + w[Y + 7] * x1 + w[Y + 8] * x2
        M[0, a], M[1, a], M[2, a] = tx, ty, tz
        M[3, a] = w[z + 36] - (ty * lz - tz * ly)
        M[4, a] = w[z + 42] - (tz * lx - tx * lz)
        M[5, a] = w[z + 48] - (tx * ly - ty * lx)
    for i in range(6):
        t0, t1, t2 = M[i, 0], M[i, 1], M[i, 2]
        for j in range(3):
            M[i, j] = t0 * R[j, 0] + t1 * R[j, 1] + t2 * R[j, 2]
    n = 3 if uniform else 6
    if not uniform:
        _balance(M)
    for i in range(n):
        for j in range(i):
            M[i, j] = 0.5 * (M[i, j] + M[j, i])
        M[i, i] -= MARGIN
    return _positive(M, n)


@njit(**PART)
def _balance(M):  # type: ignore[no-untyped-def]
    """Choose the unit of shifts so that turns by shifts are as large as the reverse."""
    up = down = 0.0
    for i in range(3):
        for j in range(3):
            up += M[i, 3 + j] * M[i, 3 + j]
            down += M[3 + i, j] * M[3 + i, j]
    if up == 0.0 or down == 0.0:
        # Triangular by blocks: a unit makes what is left as small as one likes.
        scale = 1e-3 if up == 0.0 else 1e3
    else:
        scale = math.sqrt(math.sqrt(up / down))
    for i in range(3):
        for j in range(3):
            M[i, 3 + j] /= scale
            M[3 + i, j] *= scale
