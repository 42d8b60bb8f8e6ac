"""Values that a page sends: checked where they come in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..core.checks import finite
from ..core.errors import InputError

Arguments = Mapping[str, Any]
Outcome = dict[str, Any]


def number(arguments: Arguments, name: str, unit: str) -> float:
    """Return a number of the arguments.

    Raises
    ------
    InputError
        If it is missing or not finite.
    """
    value = arguments.get(name)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(
            f"{name} must be a number in {unit}; instead received {value!r}"
        )
    return finite(value, name, unit)
