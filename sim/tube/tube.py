"""A tube around a curve in space: the lumen a rod is fed into."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import listed, size, store, vector, within
from ...core.errors import InputError
from .wall import Bore, gaps

Array = NDArray[np.float64]
Point = tuple[float, float, float]

MOST_KNOTS = 4000
"""Spans of the centre curve in the kernels."""
LONGEST_MM = 1e5
"""Most that a coordinate may be, in mm."""


@dataclass(frozen=True, slots=True)
class Ring:
    """A place along a tube that the tip may pass: its name, and where, in mm."""

    name: str
    at_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """A tube around a curve in space.

    The curve is the natural cubic spline through points, over their chord lengths; the
    radius between them rises and falls with theirs and nowhere else. Before its first
    point and after its last the tube goes on straight, as wide as it is there.

    Parameters
    ----------
    name : str
        What people call it.
    points_mm : sequence of three floats
        Along the centre curve, in mm.
    radius_mm : float or sequence of float
        Inner radius, everywhere or at each point, in mm.
    entry_mm, direction : tuple of float, optional
        Where the guide ends, out of which the rod slides, and where to: the first point
        and along the curve, if not given. Without an entry a direction is the curve's
        too.
    gates : sequence of Ring
        Places along the tube; one named ``end`` at its last point is always there.

    Raises
    ------
    InputError
        If a number cannot be, the curve turns tighter than its radius, or the tube
        meets itself.
    """

    name: str
    points_mm: tuple[Point, ...]
    radius_mm: float | tuple[float, ...]
    entry_mm: Point | None = None
    direction: Point | None = None
    gates: tuple[Ring, ...] = ()
    _bore: Bore = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        what = f"points_mm of tube {self.name!r}"
        points = [
            vector(p, what, "mm", LONGEST_MM) for p in listed(self.points_mm) or ()
        ]
        if len(points) < 2:
            raise InputError(
                f"{what} must hold at least 2 points; instead received {len(points)}"
            )
        for a, b in itertools.pairwise(points):
            if math.dist(a, b) < 1e-6:
                raise InputError(
                    f"{what} must not repeat a point in a row; instead {a} mm is there "
                    "twice"
                )
        store(self, points_mm=tuple(points), radius_mm=self._radii(len(points)))
        store(self, direction=self._towards())
        if self.direction is not None and self.entry_mm is None:
            chord = np.subtract(points[1], points[0])
            if chord @ self.direction < 0.1 * np.linalg.norm(chord):
                raise InputError(
                    f"direction of tube {self.name!r} must lead from its first point "
                    f"toward its second; instead received {self.direction}"
                )
        first = self.direction if self.entry_mm is None else None
        store(self, _bore=_bore_of(np.array(points), np.array(self.radius_mm), first))
        _check_turns(self)
        _check_apart(self)
        start, along, _ = self.at(0.0)
        entry = tuple(start) if self.entry_mm is None else self.entry_mm
        towards = self.direction or tuple(along / np.linalg.norm(along))
        entry = vector(entry, "entry_mm", "mm", LONGEST_MM)
        store(self, entry_mm=entry, direction=vector(towards, "direction"))
        gates = tuple(g for g in self.gates if g.name != "end")
        for gate in gates:
            if not 0.0 < gate.at_mm <= self.length_mm:
                raise InputError(
                    f"gate {gate.name!r} must be within tube {self.name!r}, up to "
                    f"{self.length_mm:.4g} mm along its curve; instead received "
                    f"{gate.at_mm:g} mm"
                )
        store(self, gates=(*gates, Ring("end", self.length_mm)))

    def _radii(self, count: int) -> tuple[float, ...]:
        """Return a radius for each point."""
        given = listed(self.radius_mm)
        what = f"radius_mm of tube {self.name!r}"
        if given is None:
            return (size(self.radius_mm, what, "mm"),) * count  # type: ignore[arg-type]
        if len(given) != count:
            raise InputError(
                f"{what} must be one number, or one for each of its {count} points; "
                f"instead received {len(given)}"
            )
        return tuple(size(value, what, "mm") for value in given)

    def _towards(self) -> Point | None:
        """Return the given direction with length 1, if one is given."""
        if self.direction is None:
            return None
        x, y, z = vector(self.direction, "direction")
        length = math.hypot(x, y, z)
        if length < 1e-9:
            raise InputError(
                f"direction of tube {self.name!r} must not be (0, 0, 0): give the "
                "direction in which the rod enters"
            )
        return x / length, y / length, z / length

    @property
    def length_mm(self) -> float:
        """Length of the centre curve, from first to last point."""
        return float(self._bore.knots[-1])

    def at(self, along_mm: float | Array) -> Array:
        """Return the centre curve's place, direction and curvature vector.

        Parameters
        ----------
        along_mm : float or ndarray, shape (n,)
            Along the curve.

        Returns
        -------
        ndarray, shape (3, 3) or (3, n, 3)
            In mm, 1, 1/mm.
        """
        p = np.clip(along_mm, 0.0, self.length_mm)
        k = np.clip(
            np.searchsorted(self._bore.knots, p, side="right") - 1,
            0,
            len(self._bore.spans) - 1,
        )
        z = np.asarray(p - self._bore.knots[k])[..., None]
        a, b, c, d = np.moveaxis(self._bore.spans[k, :3], -1, 0)
        return np.stack(
            [
                a + z * (b + z * (c + z * d)),
                b + z * (2 * c + 3 * z * d),
                2 * c + 6 * z * d,
            ]
        )

    def radius_at(self, along_mm: Array) -> Array:
        """Return the radius along the curve, in mm."""
        p = np.clip(along_mm, 0.0, self.length_mm)
        k = np.minimum(
            np.searchsorted(self._bore.knots, p, side="right") - 1,
            len(self._bore.spans) - 1,
        )
        z = p - self._bore.knots[k]
        a, b, c, d = self._bore.spans[k, 3].T
        return np.asarray(a + z * (b + z * (c + z * d)))

    def packed(self, unit_mm: float) -> Bore:
        """Return the tube as the kernels take it, in lengths of `unit_mm`."""
        scale = unit_mm ** np.array([-1.0, 0.0, 1.0, 2.0])
        return Bore(self._bore.knots / unit_mm, self._bore.spans * scale)

    def foot_mm(self, point_mm: Point) -> tuple[float, float]:
        """Return a point's place along the tube and its distance from the wall."""
        along = self._bore.knots
        away = np.linalg.norm(self.at(along)[0] - point_mm, axis=1)
        near = float(along[np.argmin(away)])
        gap, foot = gaps(self._bore, np.array([point_mm], dtype=float), 0.0, near)[:, 0]
        return float(foot), float(gap)

    def check_rod(self, radius_mm: float) -> None:
        """Refuse a rod that cannot even enter.

        Raises
        ------
        InputError
            If the tube is narrower than the rod, or the entry is outside, too near to
            the wall, or points out of it.
        """
        radii = np.atleast_1d(self.radius_mm)
        k = int(np.argmin(radii))
        if radii[k] < radius_mm:
            x, y, z = self.points_mm[k]
            raise InputError(
                f"tube {self.name!r} must be wider than the rod, whose radius with its "
                f"edges is {radius_mm:.4g} mm; instead its own is {radii[k]:.4g} mm at "
                f"({x:g}, {y:g}, {z:g}) mm"
            )
        entry, direction = self.entry_mm or (0, 0, 0), self.direction or (0, 0, 0)
        along_mm, gap_mm = self.foot_mm(entry)
        where = "({:g}, {:g}, {:g}) mm".format(*entry)
        inside = -1e-6 <= along_mm <= self.length_mm - 1e-6
        if gap_mm < radius_mm * (1.0 - 1e-9) or not inside:
            off = "beyond its ends" if not inside else f"{gap_mm:.4g} mm from its wall"
            raise InputError(
                f"the entry of tube {self.name!r} must be within it, with the rod's "
                f"radius of {radius_mm:.4g} mm to its wall; instead {where} is {off}"
            )
        if self.at(along_mm)[1] @ direction < 0.1:
            raise InputError(
                f"direction of tube {self.name!r} must lead into it, along its curve; "
                f"instead received ({direction[0]:g}, {direction[1]:g}, "
                f"{direction[2]:g}) at {where}"
            )


def _bore_of(points: Array, radii: Array, direction: Point | None) -> Bore:
    """Return splines over arc length, in equal spans."""
    from scipy.interpolate import CubicSpline, PchipInterpolator

    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    knots = np.concatenate([[0.0], np.cumsum(chords)])
    level = np.zeros(3)
    first: Any = (2, level) if direction is None else (1, np.array(direction))
    given = CubicSpline(knots, points, bc_type=(first, (2, level)))
    # Places along it, by Simpson's rule on 64 pieces of each chord.
    fine = np.unique(
        np.concatenate([np.linspace(a, b, 65) for a, b in itertools.pairwise(knots)])
    )
    mid = 0.5 * (fine[1:] + fine[:-1])
    speed, half = (np.linalg.norm(given(u, 1), axis=1) for u in (fine, mid))
    steps = np.diff(fine) * (speed[1:] + speed[:-1] + 4.0 * half) / 6.0
    along = np.concatenate([[0.0], np.cumsum(steps)])
    count = int(
        min(MOST_KNOTS, max(64.0, 16.0 * len(chords), 8.0 * along[-1] / radii.min()))
    )
    equal = np.linspace(0.0, along[-1], count + 1)
    u = CubicSpline(along, fine)(equal)
    ends = given(knots[[0, -1]], 1)
    ends /= np.linalg.norm(ends, axis=1)[:, None]
    curve = CubicSpline(equal, given(u), bc_type=((1, ends[0]), (1, ends[1])))
    # Level beyond both ends, and so at them.
    beyond = np.concatenate([[knots[0] - 1.0], knots, [knots[-1] + 1.0]])
    width = PchipInterpolator(beyond, np.concatenate([radii[:1], radii, radii[-1:]]))
    radius = PchipInterpolator(
        np.concatenate([[-1.0], equal, [equal[-1] + 1.0]]),
        np.concatenate([radii[:1], width(u), radii[-1:]]),
    )
    spans = np.empty((count, 4, 4))
    for power in range(4):
        spans[:, :3, power] = curve.c[3 - power]
        spans[:, 3, power] = radius.c[3 - power, 1:-1]
    return Bore(equal, spans)


def _check_turns(tube: Tube) -> None:
    """Refuse a curve that turns tighter than its radius."""
    along = np.linspace(0.0, tube.length_mm, 4 * len(tube._bore.spans) + 1)
    place, _, bend = tube.at(along)
    tight = np.linalg.norm(bend, axis=1) * tube.radius_at(along)
    k = int(np.argmax(tight))
    if tight[k] >= 1.0 - 1e-6:
        radius_mm = tube.radius_at(along)[k]
        x, y, z = place[k]
        raise InputError(
            f"the centre curve of tube {tube.name!r} must bend with a radius above the "
            f"tube's own, {radius_mm:.4g} mm; instead it is {radius_mm / tight[k]:.4g} "
            f"mm at ({x:.4g}, {y:.4g}, {z:.4g}) mm"
        )


def _check_apart(tube: Tube) -> None:
    """Refuse a tube that meets itself: near in space, but not along the curve."""
    step = 0.5 * float(np.min(tube.radius_mm))
    count = int(min(2000.0, max(8.0, tube.length_mm / step)))
    along = np.linspace(0.0, tube.length_mm, count + 1)
    place, radius = tube.at(along)[0], tube.radius_at(along)
    both = radius[:, None] + radius
    near = np.linalg.norm(place[:, None] - place, axis=2) < both - 1e-6
    near &= np.abs(along[:, None] - along) > 0.5 * math.pi * both
    if near.any():
        i, j = np.argwhere(near)[0]
        x, y, z = place[i]
        raise InputError(
            f"tube {tube.name!r} must not meet itself; instead it does at "
            f"{along[i]:.4g} and {along[j]:.4g} mm along its curve, near ({x:.4g}, "
            f"{y:.4g}, {z:.4g}) mm"
        )


def helix(
    radius_mm: float, pitch_mm: float, turns: float, points: int = 0
) -> tuple[Point, ...]:
    """Return points along a helix that leaves the origin along x.

    Parameters
    ----------
    radius_mm, pitch_mm : float
        Of the helix; a pitch of 0 is a circle.
    turns : float
        How many.
    points : int
        24 a turn if not given.
    """
    size(radius_mm, "radius_mm", "mm")
    within(turns, 0.01, 1000.0, "turns", "")
    count = points or max(4, math.ceil(24 * turns))
    angle = np.linspace(0.0, 2.0 * math.pi * turns, count + 1)
    rise = pitch_mm / (2.0 * math.pi)
    run = math.hypot(radius_mm, rise)
    c, s = radius_mm / run, rise / run
    x, y, z = radius_mm * np.sin(angle), radius_mm * (1.0 - np.cos(angle)), rise * angle
    made = np.column_stack([c * x + s * z, y, c * z - s * x])
    return tuple((float(a), float(b), float(d)) for a, b, d in made)
