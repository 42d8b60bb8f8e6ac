"""The ``[tube]`` of a lumen file."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field as Key
from pydantic import PositiveFloat

from ...core.toml import FileModel
from ..tube.tube import Point, Ring, Tube


class _Ring(FileModel):
    name: str
    at_mm: PositiveFloat


class TubeModel(FileModel):
    """A tube around a curve in space."""

    points_mm: Annotated[list[Point], Key(min_length=2)]
    radius_mm: PositiveFloat | list[PositiveFloat]
    entry_mm: Point | None = None
    direction: Point | None = None
    gate: list[_Ring] = Key(default_factory=list)

    def tube(self, name: str) -> Tube:
        """Return the tube it describes."""
        radius = self.radius_mm
        return Tube(
            name=name,
            points_mm=tuple(self.points_mm),
            radius_mm=tuple(radius) if isinstance(radius, list) else radius,
            entry_mm=self.entry_mm,
            direction=self.direction,
            gates=tuple(Ring(gate.name, gate.at_mm) for gate in self.gate),
        )
