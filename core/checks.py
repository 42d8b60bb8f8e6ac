"""Checks of single values: reject, never clip, name quantity and unit."""

from __future__ import annotations

import math

from .errors import InputError


def finite(value: float, quantity: str, unit: str = "") -> float:
    """Return `value` as a float.

    Raises
    ------
    InputError
        If it is not a finite number.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(
            f"{quantity} must be a finite number{_in(unit)}; instead received {value!r}"
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
            f"{quantity} must be above zero{_in(unit)}; instead received {value!r}"
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
            + f"; instead received {value!r}"
        )
    return number


def _in(unit: str) -> str:
    return f" in {unit}" if unit else ""
