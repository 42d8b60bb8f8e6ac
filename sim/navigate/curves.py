"""Walls as chains of arcs and segments: polylines, circles, splines by biarcs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError

Array = NDArray[np.float64]
Point = tuple[float, float]

STRAIGHT_PER_MM = 1e-9
"""Curvature below which an arc is a segment, in 1/mm."""
SPLINE_ERROR_MM = 1e-4
"""How far the biarcs may be from their spline, in mm."""


@dataclass(frozen=True, slots=True)
class Arc:
    """An arc (or, without curvature, a segment) of a wall.

    Parameters
    ----------
    x_mm, y_mm, angle_rad : float
        Where it starts, and its direction there.
    length_mm, curvature_per_mm : float
        Signed curvature: positive turns left.
    """

    x_mm: float
    y_mm: float
    angle_rad: float
    length_mm: float
    curvature_per_mm: float = 0.0

    @property
    def turn_rad(self) -> float:
        """Angle by which it turns left."""
        return self.length_mm * self.curvature_per_mm

    @property
    def end_angle_rad(self) -> float:
        """Direction at its end."""
        return self.angle_rad + self.turn_rad

    def at(self, share: float) -> Point:
        """Return the point at a share of its length, from 0 to 1."""
        s_mm = share * self.length_mm
        half = 0.5 * s_mm * self.curvature_per_mm
        chord_mm = s_mm * (math.sin(half) / half if half else 1.0)
        angle = self.angle_rad + half
        return (
            self.x_mm + chord_mm * math.cos(angle),
            self.y_mm + chord_mm * math.sin(angle),
        )

    def beside(self, offset_mm: float) -> Arc:
        """Return the arc at a distance to the left of this one."""
        return Arc(
            self.x_mm - offset_mm * math.sin(self.angle_rad),
            self.y_mm + offset_mm * math.cos(self.angle_rad),
            self.angle_rad,
            self.length_mm - offset_mm * self.turn_rad,
            self.curvature_per_mm / (1.0 - offset_mm * self.curvature_per_mm),
        )


def from_to(start: Point, angle_rad: float, end: Point) -> Arc:
    """Return the arc that leaves `start` in a direction and meets `end`."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    chord_mm = math.hypot(dx, dy)
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    half = math.atan2(cos * dy - sin * dx, cos * dx + sin * dy)
    curvature = 2.0 * math.sin(half) / chord_mm
    if abs(curvature) < STRAIGHT_PER_MM:
        return Arc(*start, math.atan2(dy, dx), chord_mm)
    return Arc(*start, angle_rad, 2.0 * half / curvature, curvature)


def polyline(points_mm: Sequence[Point], *, closed: bool = False) -> tuple[Arc, ...]:
    """Return the segments between points."""
    ring = [*points_mm, points_mm[0]] if closed else list(points_mm)
    return tuple(
        from_to(a, math.atan2(b[1] - a[1], b[0] - a[0]), b)
        for a, b in itertools.pairwise(ring)
    )


def circle(centre_mm: Point, radius_mm: float) -> tuple[Arc, ...]:
    """Return a circle, counter-clockwise, in three arcs."""
    third = 2.0 * math.pi / 3.0
    return tuple(
        Arc(
            centre_mm[0] + radius_mm * math.cos(k * third),
            centre_mm[1] + radius_mm * math.sin(k * third),
            k * third + 0.5 * math.pi,
            radius_mm * third,
            1.0 / radius_mm,
        )
        for k in range(3)
    )


def spline(points_mm: Sequence[Point], *, closed: bool = False) -> tuple[Arc, ...]:
    """Return biarcs along the cubic spline through points, over their chord lengths.

    Two arcs that meet in a common tangent join the spline's points and tangents
    (Bolton 1975), on ever finer spans until they are within 1e-4 mm of the spline.

    Raises
    ------
    InputError
        If the spline comes to a stop, as where its points turn straight back.
    """
    from scipy.interpolate import CubicSpline

    points = np.array([*points_mm, points_mm[0]] if closed else points_mm, dtype=float)
    chords = np.hypot(*np.diff(points, axis=0).T)
    knots = np.concatenate([[0.0], np.cumsum(chords)])
    curve = CubicSpline(knots, points, bc_type="periodic" if closed else "natural")
    arcs: tuple[Arc, ...] = ()
    for cuts in (2, 4, 8, 16, 32):
        at = np.concatenate(
            [
                np.linspace(a, b, cuts, endpoint=False)
                for a, b in itertools.pairwise(knots)
            ]
            + [knots[-1:]]
        )
        velocity = curve(at, 1)
        if np.hypot(*velocity.T).min() < 1e-6:
            raise InputError(
                "the points of a spline must not turn straight back; instead it comes "
                f"to a stop near {tuple(np.round(curve(at), 3)[len(at) // 2])} mm"
            )
        arcs = _biarcs(curve(at), velocity)
        if _off(arcs, curve, at) < SPLINE_ERROR_MM:
            break
    return arcs


def _biarcs(points: Array, velocities: Array) -> tuple[Arc, ...]:
    tangents = velocities / np.hypot(*velocities.T)[:, None]
    arcs: list[Arc] = []
    for a, b, ta, tb in zip(
        points[:-1], points[1:], tangents[:-1], tangents[1:], strict=True
    ):
        v, t = b - a, ta + tb
        square, along, bent = v @ v, v @ t, 2.0 * (1.0 - ta @ tb)
        if bent < 1e-12:
            reach = square / (2.0 * along)
        else:
            reach = (math.sqrt(along**2 + bent * square) - along) / bent
        middle = 0.5 * (a + b + reach * (ta - tb))
        first = from_to(tuple(a), math.atan2(ta[1], ta[0]), tuple(middle))
        arcs += [first, from_to(tuple(middle), first.end_angle_rad, tuple(b))]
    return tuple(arcs)


def _off(arcs: tuple[Arc, ...], curve: object, at: Array) -> float:
    """Return how far the middles of the spans are from the spline, across it, in mm."""
    middle = 0.5 * (at[1:] + at[:-1])
    points, velocity = curve(middle), curve(middle, 1)  # type: ignore[operator]
    off = 0.0
    for k, (point, along) in enumerate(zip(points, velocity, strict=True)):
        tried = [arc.at(q) for arc in arcs[2 * k : 2 * k + 2] for q in (0.0, 0.5, 1.0)]
        near = min(tried, key=lambda p: math.dist(p, point))
        dx, dy = near[0] - point[0], near[1] - point[1]
        across = abs(dx * along[1] - dy * along[0]) / math.hypot(*along)
        off = max(off, across)
    return off


def pieces_of(arcs: Sequence[Arc]) -> float:
    """Return about how many points `outline` would take, without making them."""
    return sum(max(1.0, _pieces(arc, 0.25)) for arc in arcs)


def _pieces(arc: Arc, step_mm: float) -> float:
    if arc.curvature_per_mm:
        return max(abs(arc.turn_rad) / 0.05, arc.length_mm / 5.0)
    return arc.length_mm / (20.0 * step_mm)


def outline(arcs: Sequence[Arc], step_mm: float = 0.25) -> Array:
    """Return points along a wall for drawing and for tests of crossing, in mm."""
    points: list[Point] = []
    for arc in arcs:
        pieces = max(1, math.ceil(_pieces(arc, step_mm)))
        points += [arc.at(k / pieces) for k in range(pieces)]
    points.append(arcs[-1].at(1.0))
    return np.array(points)
