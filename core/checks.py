"""Checks of single values: reject, never clip, name quantity and unit."""

from __future__ import annotations

import math
import operator
import reprlib
from collections.abc import Sequence

from .errors import InputError


def shown(value: object) -> str:
    """Return `value` as an error message quotes it: short, whatever it is."""
    return reprlib.repr(value)


def finite(value: float, quantity: str, unit: str = "") -> float:
    """Return `value` as a float.

    Raises
    ------
    InputError
        If it is not a finite number.
    """
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(
            f"{quantity} must be a finite number{_in(unit)}; instead received "
            f"{shown(value)}"
        )
    return number


def positive(value: float, quantity: str, unit: str = "") -> float:
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


def within(value: float, low: float, high: float, quantity: str, unit: str) -> float:
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


def size(value: float, quantity: str, unit: str) -> float:
    """Return `value` as a float above zero and within reach of the arithmetic.

    Raises
    ------
    InputError
        If it is not a finite number above zero, or not from 1e-9 to 1e9.
    """
    positive(value, quantity, unit)
    return within(value, 1e-9, 1e9, quantity, unit)


def vector(
    values: Sequence[float], quantity: str, unit: str = "", limit: float = math.inf
) -> None:
    """Refuse what is not three finite numbers (x, y, z).

    Raises
    ------
    InputError
        If it is not, or a number is beyond +-`limit`.
    """
    if not isinstance(values, (tuple, list)) or len(values) != 3:
        raise InputError(
            f"{quantity} must be three numbers (x, y, z){_in(unit)}; instead received "
            f"{shown(values)}"
        )
    for value in values:
        finite(value, quantity, unit)
        if limit < math.inf:
            within(value, -limit, limit, quantity, unit)


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


def _in(unit: str) -> str:
    return f" in {unit}" if unit else ""
