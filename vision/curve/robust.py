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


@njit(cache=True)
def _median(values: NDArray[np.floating]) -> float:
    return float(np.nanmedian(values))


@njit(cache=True)
def _quantile(values: NDArray[np.floating], part: float) -> float:
    return float(np.nanquantile(values, part))
