"""Newton's matrix, factored and added to: without a library whose threads would wait.

For the few hundred unknowns of a rod these loops are as quick as LAPACK on one thread.
All matrices are symmetric, and filled below the diagonal alone.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..magnet.flux import PART

Array = NDArray[np.float64]

FIRST = 3
"""The clamp does not turn: its unknowns come first, and are left out."""
TRIES = 40
LEAST, GROWS = 1e-6, 5.0
"""Shifts tried where the matrix is not positive: near to the least that it needs, so
that what is soft stays soft."""


@njit(**PART, fastmath={"contract", "reassoc"})
def factored(H, first, last, least, L):  # type: ignore[no-untyped-def]
    """Factor rows and columns `first` to `last` of H into L; return whether it could.

    It cannot where a pivot is not above `least` times what stood there.
    """
    for i in range(first, last):
        for j in range(first, i):
            total = H[i, j]
            for k in range(first, j):
                total -= L[i, k] * L[j, k]
            L[i, j] = total / L[j, j]
        total = H[i, i]
        for k in range(first, i):
            total -= L[i, k] * L[i, k]
        if not total > least * abs(H[i, i]):
            return False
        L[i, i] = math.sqrt(total)
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def factor(H, K, trace, L):  # type: ignore[no-untyped-def]
    """Factor H + (shift + trace) diag K; return the least shift tried that let it."""
    shift = added = 0.0
    for _ in range(TRIES):
        more = shift + trace - added
        for i in range(FIRST, H.shape[0]):
            H[i, i] += more * K[i]
        added += more
        if factored(H, FIRST, H.shape[0], 0.0, L):
            break
        shift = LEAST if shift == 0.0 else GROWS * shift
    return shift


@njit(**PART)
def substitute(L, first, last, b):  # type: ignore[no-untyped-def]
    """Replace b from `first` to `last` by the solution of L L^T x = b."""
    for i in range(first, last):
        total = b[i]
        for k in range(first, i):
            total -= L[i, k] * b[k]
        b[i] = total / L[i, i]
    for i in range(last - 1, first - 1, -1):
        b[i] /= L[i, i]
        for k in range(first, i):
            b[k] -= L[i, k] * b[i]


@njit(cache=True, nogil=True, error_model="numpy")
def solve(L, b):  # type: ignore[no-untyped-def]
    """Replace b by the solution of L L^T x = b, 0 at the clamp."""
    b[:FIRST] = 0.0
    substitute(L, FIRST, b.shape[0], b)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})
def add_points(H, A, weight, width):  # type: ignore[no-untyped-def]
    """Add A^T W A of points whose places depend on the first `width` unknowns.

    Parameters
    ----------
    H : ndarray, shape (n, n)
        Changed.
    A, weight, width : ndarray, shapes (k, 3, n), (k, 3, 3), (k,)
        Of each point.
    """
    for k in range(A.shape[0]):
        for a in range(width[k]):
            for i in range(3):
                f = 0.0
                for j in range(3):
                    f += weight[k, i, j] * A[k, j, a]
                for c in range(a + 1):
                    H[a, c] += f * A[k, i, c]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})
def add_dyads(H, rows, weight, width):  # type: ignore[no-untyped-def]
    """Add the dyads of rows, shape (k, n), of `width` each, times weights."""
    for k in range(rows.shape[0]):
        for a in range(width[k]):
            f = weight[k] * rows[k, a]
            for c in range(a + 1):
                H[a, c] += f * rows[k, c]
