"""Hold a shape from elsewhere against physics and itself, then believe it.

What is checked: length against the specimen (which also tells a wrong unit), the order
of the points, the clamp at the origin and along +x, theta against x and y (which also
tells degrees from radians), and the side it bends to against the field. What does not
fit is refused with the change that would make it fit; what was mended is said in notes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from ...core.centreline import Centreline
from ...core.errors import InputError
from ...core.units import unit_factor
from .order import (
    Indices,
    aligned,
    arc_length,
    chained_length,
    order_of,
    path_length,
    root_direction,
)
from .shapes import Array, RawShape

LENGTH_TOLERANCE = 0.03
"""Relative difference of length above which a shape is of another rod or unit."""

ORIGIN_TOLERANCE = 0.01
"""Distance of the first point from the clamp, as a share of the length."""

DIRECTION_TOLERANCE_DEG = 6.0
"""Of the first direction from +x."""

CUBIC_DEG = 0.02
"""What the direction of a cubic at the root errs by on rods that bend strongly."""

THETA_TOLERANCE_RAD = 0.03
"""Largest typical difference between a theta that is given and that of x and y."""

REACH = 1e9
"""Largest coordinate, in whatever unit."""

POINTS = 121
"""Points that a shape is resampled to, where it brings no arc length of its own."""

UNITS = ("mm", "m", "cm", "um", "in")


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """How the person says that the shapes of a file are to be read.

    Parameters
    ----------
    unit : str
        Of lengths, where the file does not say or says wrong.
    mm_per_px : float or None
        Scale of points in pixels.
    angles : str
        ``deg`` or ``rad`` of theta, where the file does not say or says wrong.
    flip : bool
        Mirror: y points to the other side there.
    align : bool
        Move the first point to the clamp and turn the first direction to +x.
    """

    unit: str = ""
    mm_per_px: float | None = None
    angles: str = ""
    flip: bool = False
    align: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """A shape that was believed.

    Parameters
    ----------
    line : Centreline
        In mm and rad, from clamp to tip.
    parameters : dict of str to float
        As in the file.
    notes : tuple of str
        What was mended or taken for granted, a word each.
    source : str
        File, and which shape in it.
    kept : dict of str to ndarray
        Columns of our own that stood beside points which were taken as they are.
    direction_sd_deg : float
        Of the direction that was turned to +x, from the scatter of the points; NaN
        where none was.
    """

    line: Centreline
    parameters: dict[str, float]
    notes: tuple[str, ...]
    source: str
    kept: dict[str, Array] = field(default_factory=dict)
    direction_sd_deg: float = math.nan


def judged(
    raw: RawShape,
    how: Reading | None = None,
    *,
    length_mm: float | None = None,
    side: float = 0.0,
) -> Shape:
    """Return a raw shape as a centreline in the specimen frame.

    Parameters
    ----------
    raw : RawShape
        As a reader left it.
    how : Reading, optional
        What the person said about the file.
    length_mm : float or None
        Of the specimen; None where there is none, and then the unit must be known.
    side : float
        Positive if the field bends the rod to +y, negative to -y, 0 if unknown.

    Raises
    ------
    InputError
        One sentence with the change that would make it fit.
    """
    how = how or Reading()
    notes: list[str] = list(raw.notes)
    points, factor = _in_mm(raw, how, length_mm, notes)
    order = order_of(raw, points, notes)
    raw = _ordered(raw, order)
    points = points[order]
    if how.flip:
        points = points * np.array([1.0, -1.0])
        notes.append("flipped")
    angle, angle_sd = root_direction(points)
    turn = 0.0
    if how.align:
        points, turn, angle = aligned(points, angle), -angle, 0.0
        notes.append("aligned")
    _check_origin(raw, points)
    line = _line(raw, points, factor, how, turn, notes)
    _check_length(raw, line, how, length_mm)
    _check_direction(raw, angle)
    _check_side(raw, line, side, how)
    return Shape(
        line=line, parameters=dict(raw.parameters), notes=tuple(notes),
        source=raw.source,
        direction_sd_deg=(
            math.hypot(math.degrees(angle_sd), CUBIC_DEG) if how.align else math.nan
        ),
        kept=dict(raw.kept) if len(raw.points) == len(line.s_mm) else {},
    )  # fmt: skip


def _in_mm(
    raw: RawShape, how: Reading, length_mm: float | None, notes: list[str]
) -> tuple[Array, float]:
    """Return the points in mm and what a length of the file is multiplied by."""
    if len(raw.points) < 3 or not np.all(np.isfinite(raw.points)):
        raise InputError(
            f"{raw.source}: a shape must have at least three finite points; instead "
            f"received {len(raw.points)}"
        )
    if float(np.abs(raw.points).max()) > REACH:
        raise InputError(f"{raw.source}: holds coordinates beyond {REACH:g}")
    unit = how.unit or raw.unit or ("px" if how.mm_per_px is not None else "")
    if unit in ("px", "pixel", "pixels"):
        if how.mm_per_px is None:
            raise InputError(
                f"{raw.source}: is in pixels; add --mm-per-px with the scale"
            )
        return raw.points * how.mm_per_px * np.array([1.0, -1.0]), how.mm_per_px
    if unit:
        factor = unit_factor(unit, "mm")
        if factor is None:
            raise InputError(
                f"{raw.source}: the unit of lengths must be one of {', '.join(UNITS)}; "
                f"instead received {unit!r}"
            )
        return raw.points * factor, factor
    if length_mm is None:
        raise InputError(
            f"{raw.source}: does not say the unit of x and y; add --unit mm, or name "
            "the columns x_mm and y_mm"
        )
    length = chained_length(raw.points)
    if abs(length / length_mm - 1.0) > LENGTH_TOLERANCE:
        hint = _unit_hint(length, length_mm) or (
            "; add --unit, or --mm-per-px if these are pixels (about "
            f"{length_mm / length:.2g} would fit)"
        )
        raise InputError(
            f"{raw.source}: does not say its unit, and is {length:.4g} long; the "
            f"specimen has {length_mm:g} mm{hint}"
        )
    notes.append("taken_as_mm")
    return raw.points, 1.0


def _unit_hint(length: float, length_mm: float) -> str:
    """Return the option with which a length in another unit would fit."""
    for unit in UNITS:
        factor = unit_factor(unit, "mm") or 1.0
        if abs(length * factor / length_mm - 1.0) <= LENGTH_TOLERANCE:
            return f": add --unit {unit}"
    return ""


def _ordered(raw: RawShape, order: Indices) -> RawShape:
    def some(values: Array | None) -> Array | None:
        return None if values is None else values[order]

    return replace(
        raw, points=raw.points[order], s=some(raw.s), theta=some(raw.theta),
        kappa=some(raw.kappa), material=some(raw.material),
        kept={name: values[order] for name, values in raw.kept.items()},
    )  # fmt: skip


def _check_origin(raw: RawShape, points: Array) -> None:
    away, length = float(np.hypot(*points[0])), path_length(points)
    if away > ORIGIN_TOLERANCE * length:
        raise InputError(
            f"{raw.source}: a shape must begin at the clamp (0, 0); instead it begins "
            f"at ({points[0, 0]:.4g}, {points[0, 1]:.4g}) mm: add --align to move it "
            "there and turn its first direction to +x"
        )


def _line(
    raw: RawShape, points: Array, factor: float, how: Reading, turn: float,
    notes: list[str],
) -> Centreline:  # fmt: skip
    """Return the centreline; what the file brings is kept, the rest is computed."""
    if np.any(np.hypot(*np.diff(points, axis=0).T) <= 0.0):
        raise InputError(f"{raw.source}: a shape must not repeat a point")
    s, x, y, theta, kappa = _from_points(points)
    sign = -1.0 if how.flip else 1.0
    if raw.s is None and raw.theta is None:
        return Centreline(s_mm=s, x_mm=x, y_mm=y, theta_rad=theta, kappa_per_mm=kappa)
    at = arc_length(points)
    own_s = at if raw.s is None else (raw.s - raw.s[0]) * factor
    if raw.s is not None and abs(own_s[-1] / s[-1] - 1.0) > LENGTH_TOLERANCE:
        raise InputError(
            f"{raw.source}: its arc length runs to {own_s[-1]:.4g} mm, and its points "
            f"are {s[-1]:.4g} mm of line: one of them has another unit or scale"
        )
    own_theta = np.interp(at, s, theta)
    if raw.theta is not None:
        own_theta = (
            sign * _theta(raw, raw.theta, how, sign * (own_theta - turn), notes) + turn
        )
    own_kappa = np.gradient(own_theta, own_s)
    if raw.kappa is not None:
        own_kappa = sign * raw.kappa / factor
    return Centreline(
        s_mm=own_s, x_mm=points[:, 0], y_mm=points[:, 1], theta_rad=own_theta,
        kappa_per_mm=own_kappa,
    )  # fmt: skip


def _from_points(points: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Return s, x, y, theta and kappa of the cubic spline through the points."""
    from scipy.interpolate import CubicSpline

    chord = arc_length(points)
    spline = CubicSpline(chord, points, axis=0)
    at = np.linspace(0.0, chord[-1], POINTS)
    first, second = spline(at, 1), spline(at, 2)
    speed = np.hypot(*first.T)
    s = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(at))])
    theta = np.unwrap(np.arctan2(first[:, 1], first[:, 0]))
    kappa = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
    x, y = spline(at).T
    return s, x, y, theta, kappa


def _theta(
    raw: RawShape, given: Array, how: Reading, by_points: Array, notes: list[str]
) -> Array:
    """Return theta of the file in rad, once it agrees with x and y."""
    unit = how.angles or raw.theta_unit
    factors = {"rad": 1.0, "deg": math.pi / 180.0}
    known = unit_factor(unit, "rad") if unit else None
    if unit and known is None:
        raise InputError(f"{raw.source}: theta must be in rad or deg, not {unit!r}")
    fits = {name: _away(given * factor, by_points) for name, factor in factors.items()}
    if known is not None:
        if _away(given * known, by_points) <= THETA_TOLERANCE_RAD:
            return np.asarray(given * known)
    elif min(fits.values()) <= THETA_TOLERANCE_RAD:
        best = min(fits, key=lambda name: fits[name])
        notes.append(f"theta_taken_as_{best}")
        return np.asarray(given * factors[best])
    raise InputError(
        f"{raw.source}: theta does not agree with the direction of x and y"
        + _theta_hint(given, by_points, fits)
    )


def _away(theta: Array, other: Array) -> float:
    difference = np.angle(np.exp(1j * (theta - other)))
    return float(np.sqrt(np.mean(difference**2)))


def _theta_hint(theta: Array, by_points: Array, fits: dict[str, float]) -> str:
    for name, away in fits.items():
        if away <= THETA_TOLERANCE_RAD:
            return f": it is in {name}: add --angles {name}"
    for name, factor in (("rad", 1.0), ("deg", math.pi / 180.0)):
        if _away(-theta * factor, by_points) <= THETA_TOLERANCE_RAD:
            return f": it has the other sign (in {name}); turn the sign in the file"
    return "; leave theta out, or give that of the tangent from +x"


def _check_length(
    raw: RawShape, line: Centreline, how: Reading, length_mm: float | None
) -> None:
    if length_mm is None:
        return
    if abs(line.length_mm / length_mm - 1.0) > LENGTH_TOLERANCE:
        said = unit_factor(how.unit or raw.unit or "mm", "mm") or 1.0
        raise InputError(
            f"{raw.source}: is {line.length_mm:.4g} mm long, and the specimen "
            f"{length_mm:g} mm{_unit_hint(line.length_mm / said, length_mm)}"
        )


def _check_direction(raw: RawShape, angle_rad: float) -> None:
    root_deg = math.degrees(angle_rad)
    if abs(root_deg) > DIRECTION_TOLERANCE_DEG:
        raise InputError(
            f"{raw.source}: must leave the clamp along +x; instead it leaves it at "
            f"{root_deg:.1f} deg: add --align to turn it"
        )


def _check_side(raw: RawShape, line: Centreline, side: float, how: Reading) -> None:
    y = float(line.y_mm[-1])
    if side * y < 0.0 and abs(y) > 0.02 * line.length_mm:
        change = "leave --flip out" if how.flip else "add --flip if y points down there"
        raise InputError(
            f"{raw.source}: bends to {'+' if y > 0.0 else '-'}y, and the field bends "
            f"this rod to {'+' if side > 0.0 else '-'}y: {change}, or turn the sign of "
            "the specimen's remanence"
        )
