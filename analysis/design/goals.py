"""What a design shall do: a bending radius, a tip, a tip angle, or a whole curve.

A goal turns solved shapes into residuals that vanish where it is met, and into the
achieved value in its own unit. The bending radius is that of the least-squares circle
through the whole centreline (`metrics.fit_circle`).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.checks import finite, size, within
from ...core.errors import InputError
from ...core.table import read_table
from ..shapes import descriptors

Array = NDArray[np.float64]

HIT_PERCENT = 0.5
HIT_MM = 0.05
"""What counts as a hit: of a radius or angle in percent, of a tip or curve in mm."""
LEAST_DEG = 0.001
"""The least tip angle that can be asked for, in deg; a straight rod has less."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A wanted shape.

    Parameters
    ----------
    kind : {"radius", "angle", "tip", "curve"}
    wanted : tuple of float
        Radius in mm; tip angle in degrees; tip (x, y) in mm; nothing for a curve.
    curve_mm : ndarray, shape (61, 2), or None
        Points of the curve at equal shares of its arc length, from clamp to tip.
    """

    kind: str
    wanted: tuple[float, ...] = ()
    curve_mm: Array | None = None

    @property
    def words(self) -> str:
        """The goal in words."""
        if self.kind == "radius":
            return f"a bending radius of {self.wanted[0]:g} mm"
        if self.kind == "angle":
            return f"a tip angle of {self.wanted[0]:g} deg"
        if self.kind == "tip":
            return f"a tip at ({self.wanted[0]:g}, {self.wanted[1]:g}) mm"
        return "the wanted curve"


def radius_goal(radius_mm: float) -> Goal:
    """Return the goal of a bending radius."""
    return Goal(kind="radius", wanted=(size(radius_mm, "radius_mm", "mm"),))


def angle_goal(tip_angle_deg: float) -> Goal:
    """Return the goal of a tip angle."""
    angle = within(tip_angle_deg, -180.0, 180.0, "tip_angle_deg", "deg")
    if abs(angle) < LEAST_DEG:
        raise InputError(
            f"tip_angle_deg must be {LEAST_DEG:g} deg or more, either way; instead "
            f"received {angle:g}, which any straight rod has"
        )
    return Goal(kind="angle", wanted=(angle,))


def tip_goal(x_mm: float, y_mm: float) -> Goal:
    """Return the goal of a tip position in the specimen frame."""
    wanted = (finite(x_mm, "tip x_mm", "mm"), finite(y_mm, "tip y_mm", "mm"))
    return Goal(kind="tip", wanted=wanted)


def curve_goal(points_mm: Array, *, align: bool = False) -> Goal:
    """Return the goal of a whole curve.

    Parameters
    ----------
    points_mm : ndarray, shape (n, 2)
        At least three points in order, from clamp to tip.
    align : bool
        Move the first point to the origin and turn the first direction to +x, for a
        curve that was drawn in another frame.

    Raises
    ------
    InputError
        If it is no curve, or does not begin at the origin and `align` is false.
    """
    points = np.asarray(points_mm, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3:
        raise InputError("a curve must have at least three points (x, y) in mm")
    if not np.all(np.isfinite(points)):
        raise InputError("a curve must be finite; instead received NaN or infinity")
    steps = np.hypot(*np.diff(points, axis=0).T)
    if np.any(steps <= 0.0):
        raise InputError("a curve must not repeat a point")
    length = float(steps.sum())
    if align:
        points = _aligned(points, steps)
    elif np.hypot(*points[0]) > 0.02 * length:
        raise InputError(
            "a curve must begin at the clamp (0, 0) in mm; instead received "
            f"({points[0, 0]:g}, {points[0, 1]:g})"
        )
    from scipy.interpolate import PchipInterpolator

    s = np.concatenate([[0.0], np.cumsum(steps)])
    smooth = PchipInterpolator(s, points, axis=0)
    return Goal(kind="curve", curve_mm=smooth(np.linspace(0.0, length, 61)))


def _aligned(points: Array, steps: Array) -> Array:
    # The root tangent from a parabola over the first third, steadier than one step.
    n = max(3, len(points) // 3)
    s = np.concatenate([[0.0], np.cumsum(steps)])[:n]
    moved = points - points[0]
    basis = np.column_stack([s, s * s])
    slope = np.linalg.lstsq(basis, moved[:n], rcond=None)[0][0]
    slope /= np.hypot(*slope)
    turn = np.array([[slope[0], slope[1]], [-slope[1], slope[0]]])
    turned: Array = moved @ turn.T
    return turned


def curve_length_mm(goal: Goal) -> float | None:
    """Return the arc length of a wanted curve, None for other goals."""
    if goal.curve_mm is None:
        return None
    return float(np.hypot(*np.diff(goal.curve_mm, axis=0).T).sum())


def residuals(goal: Goal, shapes: Array) -> Array:
    """Return what a search drives to zero, shape (n, m); infinite without a shape."""
    if goal.kind == "radius":
        radius = descriptors.describe(shapes)[:, 3]
        r = goal.wanted[0] / radius[:, None] - 1.0
    elif goal.kind == "angle":
        r = np.degrees(shapes[:, -1, 3:4]) / goal.wanted[0] - 1.0
    elif goal.kind == "tip":
        r = (shapes[:, -1, 1:3] - np.array(goal.wanted)) / shapes[:, -1, :1]
    else:
        if goal.curve_mm is None:
            raise InputError("a curve goal must have a curve")
        step = (shapes.shape[1] - 1) // 20
        away = shapes[:, step::step, 1:3] - goal.curve_mm[step::step]
        r = away.reshape(len(shapes), -1) / shapes[:, -1, :1] / np.sqrt(20.0)
    return np.where(np.isfinite(r), r, 1e3)


def achieved(goal: Goal, shapes: Array) -> Array:
    """Return the achieved value of each shape, in the goal's own unit.

    Radius in mm, angle in degrees; for a tip or curve the (root mean square) distance
    from it in mm.
    """
    if goal.kind == "radius":
        radius: Array = descriptors.describe(shapes)[:, 3]
        return radius
    if goal.kind == "angle":
        angle: Array = np.degrees(shapes[:, -1, 3])
        return angle
    if goal.kind == "tip":
        distance: Array = np.hypot(*(shapes[:, -1, 1:3] - np.array(goal.wanted)).T)
        return distance
    if goal.curve_mm is None:
        raise InputError("a curve goal must have a curve")
    away = shapes[:, :, 1:3] - goal.curve_mm
    rms: Array = np.sqrt(np.mean(np.sum(away**2, axis=2), axis=1))
    return rms


def error_of(goal: Goal, value: float) -> float:
    """Return the error of an achieved value: in percent, or in mm for tip and curve."""
    if goal.kind in ("radius", "angle"):
        return abs(value / goal.wanted[0] - 1.0) * 100.0
    return value


def hit_limit(goal: Goal) -> float:
    """Return the largest error that counts as a hit."""
    return HIT_PERCENT if goal.kind in ("radius", "angle") else HIT_MM


def shape_points(line: Centreline) -> Array:
    """Return a solved centreline as one row of shapes, shape (1, n, 5)."""
    columns = (line.s_mm, line.x_mm, line.y_mm, line.theta_rad, line.kappa_per_mm)
    return np.stack(columns, axis=1)[None]


def read_points(path: Path, columns: tuple[str, str]) -> Array:
    """Read two columns of a CSV table, shape (n, 2).

    Raises
    ------
    ConfigError
        If the file is missing, lacks a column or holds something else than numbers.
    """
    table = read_table(path)
    table.require(*columns)
    return np.column_stack([table.numbers(name) for name in columns])
