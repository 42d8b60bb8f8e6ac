"""Lumens and poses from TOML files."""

from __future__ import annotations

import itertools
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field as Key
from pydantic import PositiveFloat

from ...core.errors import ConfigError, InputError
from ...core.toml import FileModel, read_toml
from ..tube.tube import Tube
from .channels import channel
from .curves import Arc, Point, circle, polyline, spline
from .lumen import FEED, Gate, Lumen, Wall
from .tube_file import TubeModel


class _Leg(FileModel):
    straight_mm: PositiveFloat | None = None
    radius_mm: PositiveFloat | None = None
    turn_deg: float | None = None

    def pair(self) -> tuple[float, float]:
        """Return length in mm and turn in deg."""
        if self.straight_mm is not None and self.radius_mm is None:
            return self.straight_mm, 0.0
        if self.radius_mm is None or not self.turn_deg or self.straight_mm is not None:
            raise InputError(
                "each leg must have straight_mm, or radius_mm and a turn_deg that is "
                "not 0"
            )
        return self.radius_mm * abs(self.turn_deg) * 3.141592653589793 / 180.0, (
            self.turn_deg
        )


class _Channel(FileModel):
    width_mm: PositiveFloat
    start_mm: Point = (0.0, 0.0)
    angle_deg: float = 0.0
    leg: Annotated[list[_Leg], Key(min_length=1)]


class _Wall(FileModel):
    name: str
    kind: Literal["polyline", "spline", "circle"] = "polyline"
    points_mm: list[Point] | None = None
    closed: bool = False
    centre_mm: Point | None = None
    radius_mm: PositiveFloat | None = None

    def arcs(self) -> tuple[Arc, ...]:
        """Return the wall's arcs."""
        if self.kind == "circle":
            if self.centre_mm is None or self.radius_mm is None:
                raise InputError(
                    f"wall {self.name!r}: a circle must have centre_mm and radius_mm"
                )
            return circle(self.centre_mm, self.radius_mm)
        points = self.points_mm or []
        least = 3 if self.closed or self.kind == "spline" else 2
        if len(points) < least:
            raise InputError(
                f"wall {self.name!r}: points_mm must hold at least {least} points; "
                f"instead received {len(points)}"
            )
        if any(a == b for a, b in itertools.pairwise(points)):
            raise InputError(
                f"wall {self.name!r}: points_mm must not repeat a point in a row"
            )
        draw = polyline if self.kind == "polyline" else spline
        return draw(points, closed=self.closed)


class _Entry(FileModel):
    x_mm: float = 0.0
    y_mm: float = 0.0
    angle_deg: float = 0.0


class _Gate(FileModel):
    name: str
    from_mm: Point
    to_mm: Point


class LumenModel(FileModel):
    """A lumen file."""

    name: str
    mode: Literal["feed", "push"] = "feed"
    channel: _Channel | None = None
    tube: TubeModel | None = None
    wall: list[_Wall] = Key(default_factory=list)
    inside_mm: Point | None = None
    entry: _Entry | None = None
    gate: list[_Gate] = Key(default_factory=list)

    def lumen(self) -> Lumen | Tube:
        """Return the lumen it describes."""
        if self.tube is not None:
            return self._tube(self.tube)
        gates = tuple(Gate(g.name, g.from_mm, g.to_mm) for g in self.gate)
        walls = tuple(Wall(wall.name, wall.arcs()) for wall in self.wall)
        entry = self.entry or _Entry()
        if self.channel is None:
            if not walls:
                raise InputError(
                    "a lumen must have a [channel], a [tube] or at least one [[wall]]"
                )
            return Lumen(
                name=self.name,
                walls=walls,
                inside_mm=self.inside_mm or _between(walls, (entry.x_mm, entry.y_mm)),
                entry_mm=(entry.x_mm, entry.y_mm),
                entry_angle_deg=entry.angle_deg,
                mode=self.mode,
                gates=gates,
            )
        if self.entry or self.inside_mm:
            raise InputError(
                "a [channel] has its entry at start_mm: leave [entry] and inside_mm out"
            )
        made = channel(
            self.name,
            width_mm=self.channel.width_mm,
            legs=[leg.pair() for leg in self.channel.leg],
            start_mm=self.channel.start_mm,
            angle_deg=self.channel.angle_deg,
            mode=self.mode,
        )
        return Lumen(
            name=self.name,
            walls=made.walls + walls,
            inside_mm=made.inside_mm,
            entry_mm=made.entry_mm,
            entry_angle_deg=made.entry_angle_deg,
            mode=self.mode,
            gates=made.gates + gates,
        )

    def _tube(self, tube: TubeModel) -> Tube:
        planar = self.channel or self.wall or self.inside_mm or self.entry or self.gate
        if planar or self.mode != FEED:
            raise InputError(
                "a [tube] must stand alone, and is fed: leave out mode, [channel], "
                "[[wall]], inside_mm and [entry], and name its gates in [[tube.gate]]"
            )
        return tube.tube(self.name)


def _between(walls: tuple[Wall, ...], entry_mm: Point) -> Point:
    """Return a point inside: between where the first two open walls begin."""
    starts = [wall.arcs[0].at(0.0) for wall in walls if not wall.closed]
    if len(starts) < 2:
        return entry_mm
    (ax, ay), (bx, by) = starts[:2]
    return 0.5 * (ax + bx), 0.5 * (ay + by)


class _Pose(FileModel):
    insertion_mm: float
    flux_mT: float | None = None
    angle_deg: float | None = None
    gap_mm: PositiveFloat | None = None
    axis_angle_deg: float | None = None
    elevation_deg: float | None = None


class _Poses(FileModel):
    pose: Annotated[list[_Pose], Key(min_length=1)]


def read_lumen(path: Path) -> Lumen | Tube:
    """Read a lumen file: walls in the plane, or a tube in space.

    Raises
    ------
    ConfigError
        One sentence with file, and line and key where it can be told.
    """
    model = read_toml(path, LumenModel)
    try:
        return model.lumen()
    except ConfigError:
        raise
    except InputError as error:
        raise ConfigError(f"{path}: {error}") from None


def lumen_of(text: str) -> Lumen:
    """Return the planar lumen of the text of a lumen file, as a run keeps it.

    Raises
    ------
    ConfigError
        If it is none.
    """
    try:
        lumen = LumenModel.model_validate(tomllib.loads(text)).lumen()
    except (ValueError, InputError) as error:
        first = str(error).splitlines()[0]
        raise ConfigError(
            f"the lumen of the plan cannot be used ({first}); magbend sim navigate "
            "with its file says more"
        ) from None
    if not isinstance(lumen, Lumen):
        raise ConfigError(
            f"the lumen of a plan must be planar; instead received tube {lumen.name!r}"
        )
    return lumen


def read_poses(path: Path) -> list[dict[str, Any]]:
    """Read ``[[pose]]`` tables: what `poses.moving` takes.

    Raises
    ------
    ConfigError
        One sentence with file, line and key.
    """
    return [pose.model_dump(exclude_none=True) for pose in read_toml(path, _Poses).pose]
