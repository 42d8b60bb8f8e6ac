"""Medians and quantiles of what was found: quick, and deaf to NaN."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit


def median(values: NDArray[np.floating]) -> float:
    """Return the median of a one-dimensional array, NaN left out; NaN if all are."""
    return float(_median(values))


def quantile(values: NDArray[np.floating], part: float) -> float:
    """Return the value that a part of an array is below, as `median` does."""
    return float(_quantile(values, part))


def quantiles(rows: NDArray[np.floating], part: float) -> NDArray[np.float64]:
    """Return the `quantile` of each row of an array, shape (k, n)."""
    return np.asarray(_quantiles(rows, part))


@njit(cache=True)
def _median(values: NDArray[np.floating]) -> float:
    return float(np.nanmedian(values))


@njit(cache=True)
def _quantile(values: NDArray[np.floating], part: float) -> float:
    return float(np.nanquantile(values, part))


@njit(cache=True)
def _quantiles(rows: NDArray[np.floating], part: float) -> NDArray[np.float64]:
    out = np.empty(len(rows))
    for k in range(len(rows)):
        out[k] = _quantile(rows[k], part)
    return out
