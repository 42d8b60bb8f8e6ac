"""Checks of single values: reject, never clip, name quantity and unit."""

from __future__ import annotations

import math
import operator
import reprlib
import sys
from collections.abc import Sequence
from typing import Any, SupportsFloat

from .errors import InputError


def shown(value: object) -> str:
    """Return `value` as an error message quotes it: short, whatever it is."""
    return reprlib.repr(_plain(value))


def _plain(value: object) -> object:
    """Return numpy's numbers as Python's, and all else as it is."""
    if getattr(value, "ndim", None) == 0 and hasattr(value, "item"):
        plain: object = value.item()
        return plain
    return value


def finite(value: SupportsFloat, quantity: str, unit: str = "") -> float:
    """Return `value` as a float; one too small for all its digits is zero.

    Parameters
    ----------
    value : real number
        Of Python or numpy, or an array without dimensions. Text is refused, even if
        it reads as a number.

    Raises
    ------
    InputError
        If it is not a finite number.
    """
    number = value if type(value) is float else _real(value)
    if not math.isfinite(number):
        raise InputError(
            f"{quantity} must be a finite number{_in(unit)}; instead received "
            f"{shown(value)}"
        )
    return number if abs(number) >= sys.float_info.min else 0.0


def _real(value: object) -> float:
    """Return a real number as a float, and NaN for whatever else."""
    # Of numpy's numbers complex ones would drop a part with a warning.
    value = _plain(value)
    if not hasattr(value, "__float__") or getattr(value, "ndim", 0) != 0:
        return math.nan
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def positive(value: SupportsFloat, quantity: str, unit: str = "") -> float:
    """Return `value` as a float above zero.

    Raises
    ------
    InputError
        If it is not a finite number above zero.
    """
    number = finite(value, quantity, unit)
    if number <= 0.0:
        raise InputError(
            f"{quantity} must be above zero{_in(unit)}; instead received {shown(value)}"
        )
    return number


def within(
    value: SupportsFloat, low: float, high: float, quantity: str, unit: str
) -> float:
    """Return `value` as a float between `low` and `high`, ends included.

    Raises
    ------
    InputError
        If it lies outside.
    """
    number = finite(value, quantity, unit)
    if not low <= number <= high:
        raise InputError(
            f"{quantity} must be from {low:g} to {high:g} {unit}".rstrip()
            + f"; instead received {shown(value)}"
        )
    return number


def size(value: SupportsFloat, quantity: str, unit: str) -> float:
    """Return `value` as a float above zero and within reach of the arithmetic.

    Raises
    ------
    InputError
        If it is not a finite number above zero, or not from 1e-9 to 1e9.
    """
    positive(value, quantity, unit)
    return within(value, 1e-9, 1e9, quantity, unit)


def vector(
    values: Sequence[float],
    quantity: str,
    unit: str = "",
    limit: float = math.inf,
) -> tuple[float, float, float]:
    """Return three numbers (x, y, z) as a tuple of floats.

    Parameters
    ----------
    values : sequence of three real numbers
        A tuple, a list, a numpy array.

    Raises
    ------
    InputError
        If it is not, or a number is not finite or beyond +-`limit`.
    """
    given = values.tolist() if hasattr(values, "tolist") else values
    if not isinstance(given, Sequence) or isinstance(given, (str, bytes)):
        given = ()
    if len(given) != 3:
        raise InputError(
            f"{quantity} must be three numbers (x, y, z){_in(unit)}; instead received "
            f"{shown(values)}"
        )
    x, y, z = (finite(value, quantity, unit) for value in given)
    if limit < math.inf:
        for value in (x, y, z):
            within(value, -limit, limit, quantity, unit)
    return x, y, z


def whole(value: int, low: int, high: int, quantity: str) -> int:
    """Return `value` as an int from `low` to `high`.

    Raises
    ------
    InputError
        If it is no whole number, or outside.
    """
    try:
        number = operator.index(value)
    except TypeError:
        number = low - 1
    if not low <= number <= high:
        raise InputError(
            f"{quantity} must be from {low} to {high}; instead received {shown(value)}"
        )
    return number


def listed(values: object) -> tuple[Any, ...] | None:
    """Return what a sequence holds; None for text and for what is no sequence."""
    if isinstance(values, (str, bytes)):
        return None
    try:
        return tuple(values)  # type: ignore[arg-type]
    except TypeError:
        return None


def store(record: object, **values: object) -> None:
    """Set fields of a frozen dataclass, for its `__post_init__`."""
    for name, value in values.items():
        object.__setattr__(record, name, value)


def _in(unit: str) -> str:
    return f" in {unit}" if unit else ""
