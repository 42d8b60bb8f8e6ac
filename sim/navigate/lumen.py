"""The lumen that a rod is pushed through: walls, the clamp, and gates to pass."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...core.checks import size, store, within
from ...core.errors import InputError
from .curves import Arc, Point, outline, pieces_of
from .walls import COLUMNS, Walls, clearances

Array = NDArray[np.float64]

FEED = "feed"
PUSH = "push"
CORNER_RAD = 1e-6
"""Where parts meet at a smaller angle than this, the wall is smooth."""
MOST_PIECES = 4000
"""How many pieces the walls of a lumen may have: each is held against each."""


@dataclass(frozen=True, slots=True)
class Wall:
    """A wall: a name, for the results, and its arcs in order."""

    name: str
    arcs: tuple[Arc, ...]

    @property
    def closed(self) -> bool:
        """Whether its end is its beginning."""
        first = self.arcs[0]
        return math.dist((first.x_mm, first.y_mm), self.arcs[-1].at(1.0)) < 1e-7


@dataclass(frozen=True, slots=True)
class Gate:
    """A line across the lumen that the tip may pass: the mouth of a branch."""

    name: str
    from_mm: Point
    to_mm: Point


@dataclass(frozen=True, slots=True, kw_only=True)
class Lumen:
    """A planar lumen.

    Parameters
    ----------
    name : str
        What people call it.
    walls : sequence of Wall
        Rigid; the rod is as thick as its side.
    inside_mm : tuple of float
        Any point within the lumen: it tells which side of each wall the lumen is on.
    entry_mm, entry_angle_deg : tuple of float, float
        Where the rod enters, and its direction there.
    mode : {"feed", "push"}
        ``feed``: the rod slides out of a straight guide that ends at the entry.
        ``push``: a clamp holds the rod's root and moves toward the entry; what is still
        outside is free to buckle.
    gates : sequence of Gate
        Lines the tip may pass.

    Raises
    ------
    InputError
        If walls cross, or a number cannot be.
    """

    name: str
    walls: tuple[Wall, ...]
    inside_mm: Point
    entry_mm: Point = (0.0, 0.0)
    entry_angle_deg: float = 0.0
    mode: str = FEED
    gates: tuple[Gate, ...] = field(default=())

    def __post_init__(self) -> None:
        if self.mode not in (FEED, PUSH):
            raise InputError(
                f"mode of lumen {self.name!r} must be 'feed' or 'push'; instead "
                f"received {self.mode!r}"
            )
        angle = within(self.entry_angle_deg, -360.0, 360.0, "entry_angle_deg", "deg")
        store(
            self,
            walls=tuple(self.walls),
            gates=tuple(self.gates),
            entry_angle_deg=angle,
        )
        _check_size(self)
        _check_crossing(self)

    @property
    def pieces(self) -> tuple[str, ...]:
        """Name of the wall of each piece (see `walls`)."""
        return tuple(
            wall.name for wall in self.walls for _ in _pieces(wall, self.side_of(wall))
        )

    def packed(self, unit_mm: float, depth_mm: float) -> Walls:
        """Return the walls as the kernels take them, in lengths of `unit_mm`."""
        pieces = [
            piece for wall in self.walls for piece in _pieces(wall, self.side_of(wall))
        ]
        return _pack(pieces, unit_mm, depth_mm / unit_mm)

    def check_rod(self, side_mm: float) -> None:
        """Refuse a rod that cannot even enter.

        Raises
        ------
        InputError
            If the lumen is narrower than the rod, or the entry is outside or too near
            to a wall.
        """
        size(side_mm, "side_mm", "mm")
        _check_width(self, side_mm)
        chains = [
            _Piece([(arc, self.side_of(wall)) for arc in wall.arcs], wall.closed, False)
            for wall in self.walls
        ]
        walls = _pack(chains, 1.0, 1e9)
        room_mm = float(clearances(walls, np.array([self.entry_mm], dtype=float))[0])
        if room_mm < 0.5 * side_mm * (1.0 - 1e-9):
            x, y = self.entry_mm
            where = "outside the lumen" if room_mm < 0.0 else "too near to a wall"
            raise InputError(
                f"the clamp of lumen {self.name!r} must leave half the rod's side, "
                f"{0.5 * side_mm:g} mm, to every wall; instead ({x:g}, {y:g}) mm is "
                f"{where}, {room_mm:.4g} mm from it"
            )

    def rooms_mm(self, points_mm: Array) -> dict[str, Array]:
        """Return the signed distances of points from each wall, by its name.

        Parameters
        ----------
        points_mm : ndarray, shape (n, 2)
            In the lumen's frame.

        Returns
        -------
        dict of str to ndarray, shape (n,)
            In mm; negative behind the wall.
        """
        points = np.ascontiguousarray(points_mm, dtype=float)
        return {
            wall.name: clearances(
                _pack(_pieces(wall, self.side_of(wall)), 1.0, 1e9), points
            )
            for wall in self.walls
        }

    def side_of(self, wall: Wall) -> float:
        """Return +1 if the lumen is to the left of the wall, else -1."""
        chain = [(arc, 1.0) for arc in wall.arcs]
        walls = _pack([_Piece(chain, wall.closed, False)], 1.0, 1e9)
        room = clearances(walls, np.array([self.inside_mm], dtype=float))[0]
        return 1.0 if room >= 0.0 else -1.0


@dataclass(frozen=True, slots=True)
class _Piece:
    chain: list[tuple[Arc, float]]
    closed: bool
    free: bool
    """Whether its first and last ends are free: ends of an open wall."""
    free_end: bool = False


def _pieces(wall: Wall, side: float) -> list[_Piece]:
    """Cut a wall at its concave corners."""
    arcs = list(wall.arcs)
    cuts = [
        k
        for k in range(len(arcs))
        if (k > 0 or wall.closed) and side * _corner(arcs[k - 1], arcs[k]) > CORNER_RAD
    ]
    if not cuts:
        free = not wall.closed
        return [_Piece([(arc, side) for arc in arcs], wall.closed, free, free)]
    if wall.closed:
        arcs = arcs[cuts[0] :] + arcs[: cuts[0]]
        cuts = [k - cuts[0] for k in cuts] + [len(arcs)]
    else:
        cuts = [0, *cuts, len(arcs)]
    return [
        _Piece(
            [(arc, side) for arc in arcs[a:b]],
            False,
            not wall.closed and a == 0,
            not wall.closed and b == len(arcs),
        )
        for a, b in itertools.pairwise(cuts)
    ]


def _corner(before: Arc, after: Arc) -> float:
    """Return the angle by which the wall turns left between two arcs, in rad."""
    turn = after.angle_rad - before.end_angle_rad
    return math.remainder(turn, 2.0 * math.pi)


def _pack(pieces: Sequence[_Piece], unit_mm: float, depth: float) -> Walls:
    rows, first = [], [0]
    for piece in pieces:
        chain = piece.chain
        count = len(chain)
        for k, (arc, side) in enumerate(chain):
            before = chain[k - 1][0] if k > 0 or piece.closed else None
            after = chain[(k + 1) % count][0] if k + 1 < count or piece.closed else None
            start = _normal(before, arc, side)
            end = _normal(arc, after, side)
            if k == 0 and piece.free and before is None:
                start = (0.0, 0.0)
            if k + 1 == count and piece.free_end and after is None:
                end = (0.0, 0.0)
            rows.append(_row(arc, side, unit_mm, start, end))
        first.append(len(rows))
    parts = np.array(rows, dtype=np.float64).reshape(-1, COLUMNS)
    return Walls(parts, np.array(first, dtype=np.int64), depth)


def _normal(before: Arc | None, after: Arc | None, side: float) -> Point:
    """Return the mean normal, toward the lumen, where two parts meet."""
    angles = [arc.end_angle_rad for arc in [before] if arc is not None]
    angles += [arc.angle_rad for arc in [after] if arc is not None]
    return (
        -side * sum(math.sin(a) for a in angles),
        side * sum(math.cos(a) for a in angles),
    )


def _row(
    arc: Arc, side: float, unit_mm: float, start: Point, end: Point
) -> list[float]:
    (x0, y0), (xm, ym), (x1, y1) = arc.at(0.0), arc.at(0.5), arc.at(1.0)
    k = arc.curvature_per_mm
    if k == 0.0:
        kind, ax, ay, half, sense = 0.0, x0, y0, 0.0, side
        dx, dy = math.cos(arc.angle_rad), math.sin(arc.angle_rad)
        extent = arc.length_mm
    else:
        kind, extent = 1.0, 1.0 / abs(k)
        middle = arc.angle_rad + 0.5 * arc.turn_rad
        outward = math.copysign(1.0, k)
        dx, dy = outward * math.sin(middle), -outward * math.cos(middle)
        ax, ay = xm - extent * dx, ym - extent * dy
        half = math.cos(min(0.5 * abs(arc.turn_rad), math.pi))
        sense = -side * outward
    reach = max(math.dist((xm, ym), (x0, y0)), math.dist((xm, ym), (x1, y1)))
    if kind and abs(arc.turn_rad) > math.pi:
        xm, ym, reach = ax, ay, extent
    lengths = [ax, ay, dx * unit_mm, dy * unit_mm, extent]
    scaled = [value / unit_mm for value in lengths]
    ends = [value / unit_mm for value in (x0, y0, x1, y1)]
    cull = [value / unit_mm for value in (xm, ym, reach)]
    return [kind, *scaled, sense, half, *cull, *ends, *start, *end]


def _check_size(lumen: Lumen) -> None:
    pieces = sum(pieces_of(wall.arcs) for wall in lumen.walls)
    if not pieces <= MOST_PIECES:
        raise InputError(
            f"the walls of lumen {lumen.name!r} must not have more than {MOST_PIECES} "
            f"pieces, of 5 mm at most; instead they have {pieces:.3g}: take fewer "
            "points, and check that lengths are in mm"
        )


def _check_crossing(lumen: Lumen) -> None:
    drawn = [outline(wall.arcs) for wall in lumen.walls]
    for i, a in enumerate(drawn):
        for j in range(i, len(drawn)):
            where = _crossing(a, drawn[j], same=i == j)
            if where is None:
                continue
            names = f"{lumen.walls[i].name!r} and {lumen.walls[j].name!r}"
            if i == j:
                names = f"{lumen.walls[i].name!r} and itself"
            raise InputError(
                f"walls of lumen {lumen.name!r} must not cross; instead {names} cross "
                f"near ({where[0]:.4g}, {where[1]:.4g}) mm"
            )


def _crossing(a: Array, b: Array, *, same: bool) -> Point | None:
    """Return where two polylines cross within their segments, if they do."""
    p, r = a[:-1, None], (a[1:] - a[:-1])[:, None]
    q, s = b[None, :-1], (b[1:] - b[:-1])[None, :]
    det = r[..., 0] * s[..., 1] - r[..., 1] * s[..., 0]
    d = q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (d[..., 0] * s[..., 1] - d[..., 1] * s[..., 0]) / det
        u = (d[..., 0] * r[..., 1] - d[..., 1] * r[..., 0]) / det
    lengths = np.hypot(r[..., 0], r[..., 1]) * np.hypot(s[..., 0], s[..., 1])
    hit = abs(det) > 1e-9 * lengths  # else they are parallel
    hit &= (t >= 0.0) & (t <= 1.0) & (u >= 0.0) & (u <= 1.0)
    if same:
        i, j = np.indices(hit.shape)
        hit &= abs(i - j) > 1
    ends = np.concatenate([a[[0, -1]], b[[0, -1]]])
    for i, j in np.argwhere(hit):
        x, y = a[i] + t[i, j] * (a[i + 1] - a[i])
        if np.hypot(*(ends - (x, y)).T).min() > 1e-6:  # walls may meet at their ends
            return float(x), float(y)
    return None


def _check_width(lumen: Lumen, side_mm: float) -> None:
    for i, wall in enumerate(lumen.walls):
        for other in lumen.walls[i + 1 :]:
            points = outline(other.arcs, step_mm=0.02)
            for end in (wall.arcs[0].at(0.0), wall.arcs[-1].at(1.0)):
                gaps = np.hypot(*(points[[0, -1]] - end).T)
                if gaps.min() < 1e-6:  # they meet in a corner: a blind end
                    away = np.hypot(*(points - end).T) > 2.0 * side_mm
                    points = points[away]
            if not len(points):
                continue
            own = [(arc, lumen.side_of(wall)) for arc in wall.arcs]
            walls = _pack([_Piece(own, wall.closed, True, True)], 1.0, 1e9)
            width_mm = clearances(walls, points)
            k = int(np.argmin(width_mm))
            if width_mm[k] < side_mm * (1.0 - 1e-9):
                x, y = points[k]
                raise InputError(
                    f"lumen {lumen.name!r} must be wider than the rod's side, "
                    f"{side_mm:g} mm; instead it is {max(width_mm[k], 0.0):.4g} mm "
                    f"between {wall.name!r} and {other.name!r} at ({x:.4g}, {y:.4g}) mm"
                )
