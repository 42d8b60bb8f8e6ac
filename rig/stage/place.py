"""The map from a board's millimetres to gaps, with all that it rests on.

A remembered position is worth nothing without it: another zero, another number of steps
a millimetre or another board turns the same count into another gap. So it travels with
every remembered place and every run, and whatever differs is named.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

_AXES = "XYZ"
_SHARED = ("3", "13", "22", "23", "27")
_OF_AXIS = (100, 110, 120, 130)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceMap:
    """``gap_mm = gap_at_zero_mm + direction * machine_mm``, on one board.

    Attributes
    ----------
    gap_at_zero_mm : float or None
        None on a bench whose gap was never measured.
    direction : {1, -1}
        Whether the gap grows or falls with the board's count.
    axis : str
        The letter of the axis.
    step_mm : float
        One motor step.
    travel_mm : tuple of float or None
        What the board may count.
    firmware : str
        What it calls itself.
    settings : mapping
        Its ``$`` settings that a place depends on.
    """

    gap_at_zero_mm: float | None
    direction: int
    axis: str
    step_mm: float
    travel_mm: tuple[float, float] | None
    firmware: str
    settings: Mapping[str, str] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Return it as files keep it."""
        travel = None if self.travel_mm is None else list(self.travel_mm)
        return {
            "gap_at_zero_mm": self.gap_at_zero_mm,
            "direction": self.direction,
            "axis": self.axis,
            "step_mm": self.step_mm,
            "travel_mm": travel,
            "firmware": self.firmware,
            "settings": dict(self.settings),
        }


def settings_that_matter(settings: Mapping[str, str], axis: str) -> dict[str, str]:
    """Return the ``$`` settings on which a place of the axis depends."""
    index = _AXES.index(axis)
    names = [*_SHARED, *(str(base + index) for base in _OF_AXIS)]
    return {f"${name}": settings[name] for name in names if name in settings}


def firmware_name(banner: str, details: tuple[str, ...]) -> str:
    """Return what a board calls itself: its version if told, else its banner."""
    return next((text for text in details if text.startswith("VER:")), banner)


def difference(then: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Return what differs between two maps in words, or nothing.

    Parameters
    ----------
    then, now : mapping
        As `PlaceMap.as_dict` gives them; what only one of them has is not compared.
    """
    for name in then.keys() & now.keys():
        one, other = then[name], now[name]
        if isinstance(one, Mapping) and isinstance(other, Mapping):
            inner = difference(one, other)
            if inner:
                return inner
        elif not _same(one, other):
            return f"{name} was {_shown(one)} and is now {_shown(other)}"
    return ""


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, (list, tuple)) and isinstance(other, (list, tuple)):
        return len(one) == len(other) and all(map(_same, one, other))
    try:
        return math.isclose(float(one), float(other), rel_tol=1e-6, abs_tol=1e-6)
    except (TypeError, ValueError):
        return bool(one == other)


def _shown(value: Any) -> str:
    if value is None:
        return "not known"
    if isinstance(value, (list, tuple)):
        return " to ".join(_shown(part) for part in value)
    return f"{value:g}" if isinstance(value, float) else f"{value}"
