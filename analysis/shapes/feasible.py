"""What can be made: maps of the unit cube onto falling moduli and fitting lengths.

Each map is onto and continuous, so that a search or a Sobol sequence in the cube never
leaves what can be made.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def falling_moduli(u: Array, low: Array, high: Array) -> Array:
    """Return moduli that do not rise from root to tip.

    Parameters
    ----------
    u : ndarray, shape (n, k)
        Coordinates from 0 to 1.
    low, high : ndarray, shape (k,)
        Range of each section, root first.

    Returns
    -------
    ndarray, shape (n, k)
        In the units of `low`; each modulus lies in its range and, where the ranges
        leave room for that, not above the one before.
    """
    E = np.empty_like(u)
    top = np.full(len(u), np.inf)
    for i in range(u.shape[1]):
        # Leave room below for the sections that follow.
        bottom = max(low[i], *low[i:])
        ceiling = np.maximum(np.minimum(high[i], top), bottom)
        E[:, i] = bottom + u[:, i] * (ceiling - bottom)
        top = E[:, i]
    return E


def fitting_lengths(u: Array, low: Array, high: Array, total_mm: Array) -> Array:
    """Return unit lengths that add up to a total.

    Parameters
    ----------
    u : ndarray, shape (n, k - 1)
        Coordinates from 0 to 1; the last section takes what is left.
    low, high : ndarray, shape (k,)
        Range of each section in mm, root first.
    total_mm : ndarray, shape (n,)
        Within the sums of `low` and `high`.

    Returns
    -------
    ndarray, shape (n, k)
    """
    n, k = len(u), len(low)
    lengths = np.empty((n, k))
    left = np.array(total_mm, dtype=np.float64)
    for i in range(k - 1):
        bottom = np.maximum(low[i], left - high[i + 1 :].sum())
        ceiling = np.minimum(high[i], left - low[i + 1 :].sum())
        lengths[:, i] = bottom + u[:, i] * (ceiling - bottom)
        left -= lengths[:, i]
    lengths[:, -1] = left
    return lengths
