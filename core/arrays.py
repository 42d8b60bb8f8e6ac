"""Checks of arrays: reject, never clip, name quantity and unit."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import finite, shown
from .errors import InputError


def real_array(values: ArrayLike, quantity: str, unit: str = "") -> NDArray[np.float64]:
    """Return `values` as a contiguous array of finite floats, of any shape.

    Parameters
    ----------
    values : array_like
        Real numbers; text is refused, even if it reads as numbers.

    Raises
    ------
    InputError
        If it is no array of finite real numbers.
    """
    of, colon, name = quantity.rpartition(": ")
    each = f"{of}{colon}every {name}"
    try:
        given = np.asarray(values)
    except (ValueError, TypeError):  # rows of unequal length
        given = np.array("")
    if given.dtype.kind == "O":  # a list with None, or integers beyond 64 bits
        numbers = [finite(value, each, unit) for value in given.flat]
        given = np.array(numbers, dtype=np.float64).reshape(given.shape)
    if given.dtype.kind not in "fiu":
        raise InputError(
            f"{quantity} must be an array of numbers{f' in {unit}' if unit else ''}; "
            f"instead received {shown(values)}"
        )
    bad = ~np.isfinite(given)
    if np.any(bad):
        finite(given[bad].flat[0], each, unit)
    return np.ascontiguousarray(given, dtype=np.float64).reshape(given.shape)
