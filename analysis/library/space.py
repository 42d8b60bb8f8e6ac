"""The design space: a TOML file, and the design that each index stands for.

A *grid* takes every combination of the listed values (of moduli and lengths, those that
can be made); a *sobol* space fills its ranges evenly with a given number of designs. In
both, design i is the same on every machine, so that any part can be solved anywhere.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, ConfigDict, Field, PlainSerializer, WithJsonSchema

from ... import sim
from ...core.errors import ConfigError
from ...core.magnet import Magnet
from ...core.specimen_file import MagnetModel
from ...core.toml import FileModel, read_toml
from ...sim import Designs
from ..shapes.feasible import falling_moduli, fitting_lengths

Array = NDArray[np.float64]
LARGEST_GRID = 10_000_000
"""Combinations of moduli, or of lengths, that a grid may list."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """The values of one parameter: a list, or a range for Sobol points."""

    values: tuple[float, ...] = ()
    low: float
    high: float

    @property
    def is_range(self) -> bool:
        """Whether it is a range without a count."""
        return not self.values

    def pick(self, u: Array) -> Array:
        """Return values for coordinates from 0 to 1."""
        if self.is_range:
            spread: Array = self.low + u * (self.high - self.low)
            return spread
        index = np.minimum((u * len(self.values)).astype(int), len(self.values) - 1)
        listed: Array = np.array(self.values)[index]
        return listed


MOST_VALUES = 1_000_000
STRONGEST_MT = 30_000.0


def _parse_axis(value: Any) -> Axis:
    if isinstance(value, Axis):
        return value
    if isinstance(value, dict):
        unknown = set(value) - {"from", "to", "count"}
        if unknown or not {"from", "to"} <= set(value):
            raise ValueError("a range must be {from = , to = , count = }")
        low, high = _number(value["from"]), _number(value["to"])
        if low > high:
            raise ValueError(f"a range must rise, but {low:g} is above {high:g}")
        if "count" not in value:
            return Axis(low=low, high=high)
        count = value["count"]
        if not isinstance(count, int) or count < 1 or (count == 1 and low < high):
            raise ValueError("count must be a whole number of at least 2")
        if count > MOST_VALUES:
            raise ValueError(
                f"count must be at most {MOST_VALUES}: use method = 'sobol' for more"
            )
        values = [float(f"{v:.12g}") for v in np.linspace(low, high, count)]
    elif isinstance(value, list):
        if not value:
            raise ValueError("a list must hold at least one value")
        values = [_number(item) for item in value]
        if len(set(values)) < len(values):
            raise ValueError("a list must not repeat a value")
    else:
        values = [_number(value)]
    return Axis(values=tuple(values), low=min(values), high=max(values))


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError("must be a number, a list of numbers, or {from = , to = }")  # noqa: TRY004
    if not math.isfinite(value):
        raise ValueError("must be finite")
    return float(value)


def _axis_dict(axis: Axis) -> Any:
    return list(axis.values) if axis.values else {"from": axis.low, "to": axis.high}


def _positive_axis(axis: Axis) -> Axis:
    if axis.low <= 0.0:
        raise ValueError(f"must be above zero, but reaches {axis.low:g}")
    return axis


_AS_TYPED = WithJsonSchema(
    {
        "anyOf": [
            {"type": "number"},
            {"type": "array", "items": {"type": "number"}, "minItems": 1},
            {
                "type": "object",
                "properties": {
                    "from": {"type": "number"},
                    "to": {"type": "number"},
                    "count": {"type": "integer", "minimum": 1},
                },
                "required": ["from", "to"],
                "additionalProperties": False,
            },
        ]
    }
)
AnyAxis = Annotated[
    Axis, BeforeValidator(_parse_axis), PlainSerializer(_axis_dict), _AS_TYPED
]
PositiveAxis = Annotated[
    Axis,
    BeforeValidator(lambda value: _positive_axis(_parse_axis(value))),
    PlainSerializer(_axis_dict),
    _AS_TYPED,
]
ONE_ANGLE = Axis(values=(90.0,), low=90.0, high=90.0)
ONE_PLACE = Axis(values=(0.0,), low=0.0, high=0.0)


class SpaceSection(FileModel):
    """One ``[[section]]`` of a space, root first."""

    length_mm: PositiveAxis
    E_MPa: PositiveAxis


class Space(FileModel):
    """A design space file."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        ignored_types=(cached_property,),
    )

    name: str
    method: Literal["grid", "sobol"] = "grid"
    designs: int | None = Field(default=None, ge=1, le=2**40)
    seed: int = Field(default=0, ge=0)
    partition_rows: int = Field(default=131_072, ge=1024, le=4_194_304)
    falling_E: bool = True
    total_length_mm: float | None = Field(default=None, gt=0.0)
    side_mm: PositiveAxis
    remanence_mT: AnyAxis
    flux_mT: AnyAxis | None = None
    angle_deg: AnyAxis = ONE_ANGLE
    gap_mm: PositiveAxis | None = None
    magnet: MagnetModel | None = None
    source: list[dict[str, Any]] | None = Field(default=None, min_length=1)
    descriptors: tuple[str, ...] = ()
    section: list[SpaceSection] = Field(min_length=1)

    def model_post_init(self, _context: object) -> None:
        """Check what single keys cannot show.

        Raises
        ------
        ValueError
            One sentence, which the reader of the file passes on.
        """
        if self.source is not None and (self.flux_mT or self.magnet) is not None:
            raise ValueError(
                "give one of flux_mT (a uniform field), [magnet] and [[source]]"
            )
        if self.source is None and (self.flux_mT is None) == (self.gap_mm is None):
            raise ValueError("give either flux_mT (a uniform field) or gap_mm")
        if self.source is None and (self.gap_mm is None) != (self.magnet is None):
            raise ValueError("gap_mm and [magnet], or [[source]], belong together")
        if self.method == "sobol" and self.designs is None:
            raise ValueError("a sobol space must say how many designs = N")
        if self.method == "grid" and self.designs is not None:
            raise ValueError("designs belongs to method = 'sobol'; a grid has its own")
        if self.method == "grid":
            for name, axis in self._named_axes():
                if axis.is_range:
                    raise ValueError(f"{name}: a range in a grid must have a count")
        flux = self.flux_mT
        if flux is not None and max(-flux.low, flux.high) > STRONGEST_MT:
            raise ValueError(f"flux_mT must be within {STRONGEST_MT:g} mT")
        _check_lengths(self)
        _check_falling(self)

    def _named_axes(self) -> list[tuple[str, Axis]]:
        named = [
            *(("section: length_mm", section.length_mm) for section in self.section),
            *(("section: E_MPa", section.E_MPa) for section in self.section),
            ("side_mm", self.side_mm),
            ("remanence_mT", self.remanence_mT),
            ("angle_deg", self.angle_deg),
            ("flux_mT", self.flux_mT),
            ("gap_mm", self.gap_mm),
        ]  # fmt: skip
        return [(name, axis) for name, axis in named if axis is not None]

    @cached_property
    def length_rows(self) -> Array:
        """Unit lengths that a grid combines, shape (m, sections), in mm."""
        rows = _product([s.length_mm for s in self.section], "lengths")
        if self.total_length_mm is None:
            return rows
        fitting: Array = rows[np.abs(rows.sum(axis=1) - self.total_length_mm) < 1e-9]
        return fitting

    @cached_property
    def modulus_rows(self) -> Array:
        """Moduli that a grid combines, shape (m, sections), in MPa."""
        rows = _product([s.E_MPa for s in self.section], "moduli")
        if not self.falling_E:
            return rows
        falling: Array = rows[np.all(np.diff(rows, axis=1) <= 0.0, axis=1)]
        return falling

    @cached_property
    def sources(self) -> Magnet | sim.Field | None:
        """What bends the rods, if it is no uniform field."""
        if self.source is not None:
            return sim.field_of_tables(self.source, self.name, Path())
        return None if self.magnet is None else self.magnet.magnet()

    @property
    def load_axis(self) -> Axis:
        """The axis of the load: flux or gap; one value where sources have places."""
        axis = self.flux_mT if self.flux_mT is not None else self.gap_mm
        return axis or ONE_PLACE

    @property
    def shape(self) -> tuple[int, ...]:
        """Counts of a grid: lengths, moduli, side, remanence, angle, load."""
        axes = (self.side_mm, self.remanence_mT, self.angle_deg, self.load_axis)
        counts = [len(axis.values) for axis in axes]
        return (len(self.length_rows), len(self.modulus_rows), *counts)

    @property
    def size(self) -> int:
        """Number of designs."""
        return self.designs if self.designs is not None else math.prod(self.shape)

    def rows(self, start: int, stop: int) -> Designs:
        """Return designs `start` to `stop` - 1."""
        if self.method == "grid":
            return self._grid_rows(start, stop)
        return self._sobol_rows(start, stop)

    def _grid_rows(self, start: int, stop: int) -> Designs:
        index = np.unravel_index(np.arange(start, stop), self.shape)
        axes = (self.side_mm, self.remanence_mT, self.angle_deg, self.load_axis)
        side, remanence, angle, load = (
            np.array(axis.values)[i] for axis, i in zip(axes, index[2:], strict=True)
        )
        return self._designs(
            self.length_rows[index[0]], self.modulus_rows[index[1]],
            side, remanence, angle, load,
        )  # fmt: skip

    def _sobol_rows(self, start: int, stop: int) -> Designs:
        k = len(self.section)
        u = points_of_blocks(2 * k + 4, start, stop, self.seed)
        lengths = _sobol_lengths(self, u[:, :k])
        moduli = _sobol_moduli(self, u[:, k : 2 * k])
        axes = (self.side_mm, self.remanence_mT, self.angle_deg, self.load_axis)
        rest = (axis.pick(u[:, 2 * k + i]) for i, axis in enumerate(axes))
        return self._designs(lengths, moduli, *rest)

    def _designs(
        self,
        length: Array,
        E: Array,
        side: Array,
        rem: Array,
        angle: Array,
        load: Array,
    ) -> Designs:
        uniform = self.flux_mT is not None
        return Designs(
            length_mm=length,
            E_MPa=E,
            side_mm=side,
            remanence_mT=rem,
            angle_deg=angle,
            flux_mT=load if uniform else None,
            gap_mm=None if self.gap_mm is None else load,
            magnet=self.sources,
        )


def read_space(path: Path) -> Space:
    """Read a space file.

    Raises
    ------
    ConfigError
        One sentence with file, line and key.
    """
    space = read_toml(path, Space)
    if space.source is None:
        return space
    field = sim.field_of_tables(space.source, str(path), path.parent)
    if not field.in_plane:
        raise ConfigError(
            f"{path}: [[source]]: the sources of a library must bend rods within their "
            "plane (elevation_deg and z of 0)"
        )
    if field.follows_gap != (space.gap_mm is not None):
        raise ConfigError(
            f"{path}: gap_mm belongs to sources that have neither centre_mm nor gap_mm "
            "of their own, and they to it"
        )
    # A library explains itself: the readings of a map are in it, not beside it.
    return space.model_copy(update={"source": sim.tables_of(field)})


BLOCK = 1 << 14
"""Points of a Sobol sequence that are drawn at once (`points_of_blocks`)."""


def sobol_points(dimension: int, start: int, stop: int, seed: int) -> Array:
    """Return points `start` to `stop` - 1 of a scrambled Sobol sequence."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(dimension, rng=np.random.default_rng(seed))
    if start > 0:
        sequence.fast_forward(start)
        points = sequence.random(stop - start)
    else:  # a first draw of a power of two keeps the sequence balanced (and silent)
        points = sequence.random(1 << (stop - 1).bit_length())
    return np.asarray(points[: stop - start], dtype=np.float64)


def points_of_blocks(dimension: int, start: int, stop: int, seed: int) -> Array:
    """Return what `sobol_points` does, for callers that go on from piece to piece.

    To begin a sequence takes as long as to draw thousands of points of it.
    """
    blocks = range(start // BLOCK, (stop - 1) // BLOCK + 1)
    return np.concatenate(
        [
            _block(dimension, block, seed)[max(0, start - at) : stop - at]
            for block in blocks
            for at in (block * BLOCK,)
        ]
    )


@lru_cache(maxsize=16)
def _block(dimension: int, block: int, seed: int) -> Array:
    return sobol_points(dimension, block * BLOCK, (block + 1) * BLOCK, seed)


def _product(axes: list[Axis], what: str) -> Array:
    if math.prod(len(axis.values) for axis in axes) > LARGEST_GRID:
        raise ConfigError(
            f"a grid must have at most {LARGEST_GRID} combinations of {what}; "
            "use method = 'sobol'"
        )
    return np.array(list(itertools.product(*(axis.values for axis in axes))))


def _sobol_lengths(space: Space, u: Array) -> Array:
    axes = [section.length_mm for section in space.section]
    if space.total_length_mm is None:
        return np.stack([axis.pick(c) for axis, c in zip(axes, u.T, strict=True)], 1)
    low, high = (np.array([getattr(a, end) for a in axes]) for end in ("low", "high"))
    total = np.full(len(u), space.total_length_mm)
    return fitting_lengths(u[:, :-1], low, high, total)


def _sobol_moduli(space: Space, u: Array) -> Array:
    axes = [section.E_MPa for section in space.section]
    if not space.falling_E or not all(axis.is_range for axis in axes):
        return np.stack([axis.pick(c) for axis, c in zip(axes, u.T, strict=True)], 1)
    low, high = (np.array([getattr(a, end) for a in axes]) for end in ("low", "high"))
    return falling_moduli(u, low, high)


def _check_lengths(space: Space) -> None:
    total = space.total_length_mm
    if total is None:
        return
    axes = [section.length_mm for section in space.section]
    low, high = sum(a.low for a in axes), sum(a.high for a in axes)
    if not low - 1e-9 <= total <= high + 1e-9:
        raise ValueError(
            f"the lengths do not add up: the sections give {low:g} to {high:g} mm, "
            f"total_length_mm is {total:g}"
        )
    if space.method == "grid" and len(space.length_rows) == 0:
        raise ValueError(
            f"the lengths do not add up: no combination gives {total:g} mm"
        )
    if space.method == "sobol" and not all(a.is_range or a.low == a.high for a in axes):
        raise ValueError(
            "with total_length_mm, a sobol space needs lengths as ranges {from, to}"
        )


def _check_falling(space: Space) -> None:
    if not space.falling_E:
        return
    axes = [section.E_MPa for section in space.section]
    for before, after in itertools.pairwise(axes):
        if before.high < after.low:
            raise ValueError(
                "the space is empty: E_MPa must fall from root to tip, but "
                f"{after.low:g} MPa follows at most {before.high:g} MPa "
                "(falling_E = false allows it)"
            )
    lists = [not axis.is_range and axis.low < axis.high for axis in axes]
    if space.method == "sobol" and any(lists):
        raise ValueError(
            "with falling_E, a sobol space needs E_MPa as ranges {from, to}"
        )
    if space.method == "grid" and len(space.modulus_rows) == 0:
        raise ValueError("the space is empty: no combination of E_MPa falls")


def input_columns(designs: Designs) -> dict[str, NDArray]:
    """Return the columns of a library that say what was solved."""
    columns: dict[str, NDArray] = {}
    for i in range(designs.length_mm.shape[1]):
        columns[f"length{i + 1}_mm"] = designs.length_mm[:, i]
    for i in range(designs.E_MPa.shape[1]):
        columns[f"E{i + 1}_MPa"] = designs.E_MPa[:, i]
    columns["side_mm"] = designs.side_mm
    columns["remanence_mT"] = designs.remanence_mT
    if designs.flux_mT is not None:
        columns["angle_deg"] = designs.angle_deg
        columns["flux_mT"] = designs.flux_mT
    elif designs.gap_mm is not None:
        columns["gap_mm"] = designs.gap_mm
    return columns
