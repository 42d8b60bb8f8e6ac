"""Medians and quantiles of what was found: quick, and deaf to NaN."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit

Rows = NDArray[np.floating]


@njit(cache=True)
def _median(values: Rows) -> float:
    return float(np.nanmedian(values))


@njit(cache=True)
def _quantile(values: Rows, part: float) -> float:
    return float(np.nanquantile(values, part))


@njit(cache=True)
def _quantiles(rows: Rows, part: float) -> NDArray[np.float64]:
    out = np.empty(len(rows))
    for k in range(len(rows)):
        out[k] = _quantile(rows[k], part)
    return out


# The kernels themselves, under a type for whoever is none.
median: Callable[[Rows], float] = _median
"""Return the median of a one-dimensional array, NaN left out; NaN if all are."""

quantile: Callable[[Rows, float], float] = _quantile
"""Return the value that a part of an array is below, as `median` does."""

quantiles: Callable[[Rows, float], NDArray[np.float64]] = _quantiles
"""Return the `quantile` of each row of an array, shape (k, n)."""
