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
    u, buffer = np.zeros_like(matrix), np.empty(size)
    for k in range(size):
        row, m = buffer[k:], 0
        for i in range(row.size):
            row[i] = matrix[k, k + i]
        while m + 4 <= k:  # four rows at once: the sum is loaded and stored for all
            one, two, three, four = u[m, k:], u[m + 1, k:], u[m + 2, k:], u[m + 3, k:]
            a, b, c, d = one[0], two[0], three[0], four[0]
            for i in range(row.size):
                rest = row[i] - a * one[i] - b * two[i]
                row[i] = rest - c * three[i] - d * four[i]
            m += 4
        while m < k:
            share = u[m, k]
            for i in range(row.size):
                row[i] -= share * u[m, k + i]
            m += 1
        pivot = np.sqrt(row[0]) if row[0] > 0.0 else np.nan
        for i in range(row.size):
            u[k, k + i] = row[i] / pivot
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
