"""Lumens of constant width along straight and bent legs."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...core.checks import finite, size, within
from ...core.errors import InputError
from .curves import Arc, Point
from .lumen import FEED, Gate, Lumen, Wall


def legs_of(
    start_mm: Point, angle_deg: float, legs: Sequence[tuple[float, float]]
) -> tuple[Arc, ...]:
    """Return the path of legs: length in mm, and angle of the turn left in deg."""
    x, y, angle = *start_mm, math.radians(angle_deg)
    arcs = []
    for length_mm, turn_deg in legs:
        size(length_mm, "length_mm of a leg", "mm")
        turn = math.radians(within(turn_deg, -340.0, 340.0, "turn_deg of a leg", "deg"))
        arc = Arc(x, y, angle, float(length_mm), turn / length_mm)
        arcs.append(arc)
        (x, y), angle = arc.at(1.0), arc.end_angle_rad
    return tuple(arcs)


def channel(
    name: str,
    *,
    width_mm: float,
    legs: Sequence[tuple[float, float]],
    start_mm: Point = (0.0, 0.0),
    angle_deg: float = 0.0,
    mode: str = FEED,
) -> Lumen:
    """Return a lumen of constant width, with a gate named ``end`` at its end.

    Parameters
    ----------
    name : str
        What people call it.
    width_mm : float
        Distance of its walls, in mm.
    legs : sequence of (length_mm, turn_deg)
        Along its middle line, and the angle by which each turns left: (10, 0) is
        straight, (20, -90) turns right by a right angle over 20 mm.
    start_mm, angle_deg : tuple of float, float
        Where it begins, and its direction there; the rod enters there.
    mode : {"feed", "push"}
        See `Lumen`.

    Raises
    ------
    InputError
        If a leg bends so sharply that its inner wall has no radius left.
    """
    size(width_mm, "width_mm", "mm")
    finite(angle_deg, "angle_deg", "deg")
    path = legs_of(start_mm, angle_deg, legs)
    half_mm = 0.5 * width_mm
    for arc in path:
        if abs(arc.curvature_per_mm) * half_mm >= 1.0 - 1e-6:
            raise InputError(
                f"a leg of lumen {name!r} must bend with a radius above half its "
                f"width, {half_mm:g} mm; instead received "
                f"{1.0 / abs(arc.curvature_per_mm):g} mm"
            )
    left = Wall("left", tuple(arc.beside(half_mm) for arc in path))
    right = Wall("right", tuple(arc.beside(-half_mm) for arc in path))
    ends = left.arcs[-1].at(1.0), right.arcs[-1].at(1.0)
    return Lumen(
        name=name,
        walls=(left, right),
        inside_mm=path[0].at(0.01),
        entry_mm=start_mm,
        entry_angle_deg=angle_deg,
        mode=mode,
        gates=(Gate("end", *ends),),
    )
