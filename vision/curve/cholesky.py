"""Small symmetric systems, solved by Cholesky's method in our own kernels.

With some forty unknowns, waking the threads of a linear algebra library costs more than
the sums.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit

Array = NDArray[np.float64]


@njit(cache=True)
def factor(matrix: Array) -> Array:
    """Return the upper triangular U with U^T U = matrix; NaN if there is none."""
    size = len(matrix)
    u = matrix.copy()
    for k in range(size):
        pivot = np.sqrt(u[k, k]) if u[k, k] > 0.0 else np.nan
        for i in range(k, size):
            u[k, i] /= pivot
        for j in range(k + 1, size):
            share = u[k, j]
            u[j, k] = 0.0
            for i in range(j, size):
                u[j, i] -= share * u[k, i]
    return u


@njit(cache=True)
def solved_half(u: Array, right: Array) -> Array:
    """Return x of U^T x = right."""
    x = right.copy()
    for k in range(x.size):
        x[k] /= u[k, k]
        for i in range(k + 1, x.size):
            x[i] -= u[k, i] * x[k]
    return x


@njit(cache=True)
def solved(u: Array, right: Array) -> Array:
    """Return x of U^T U x = right."""
    x = np.asarray(solved_half(u, right))
    for k in range(x.size - 1, -1, -1):
        for i in range(k + 1, x.size):
            x[k] -= u[k, i] * x[i]
        x[k] /= u[k, k]
    return x


@njit(cache=True)
def inverse(u: Array) -> Array:
    """Return the inverse of U, which is upper triangular too."""
    size = len(u)
    out = np.zeros_like(u)
    for k in range(size - 1, -1, -1):
        out[k, k] = 1.0 / u[k, k]
        for j in range(k + 1, size):
            share = u[k, j] * out[k, k]
            for i in range(j, size):
                out[k, i] -= share * out[j, i]
    return out


@njit(cache=True)
def squared(u: Array) -> Array:
    """Return U U^T of an upper triangular U."""
    size = len(u)
    out = np.empty_like(u)
    for i in range(size):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, size):
                total += u[i, k] * u[j, k]
            out[i, j] = out[j, i] = total
    return out
