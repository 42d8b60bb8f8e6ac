"""Fields from files: ``[[source]]`` tables, their kinds, and kinds of others.

Another package offers a kind by an entry point of the group ``magbend.sources``: a
function that takes the keys of its table and returns an object with
`flux_mT(points_mm)` (points in mm, shape (n, 3), to mT) and `box_mm`, two corners of
the box in which rods go. It may be plain Python: it is sampled once, and slow only then
(`magnet.map`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, PositiveFloat, ValidationError
from pydantic import Field as Key

from ..core.errors import ConfigError, InputError
from ..core.magnet import Vector
from ..core.plugins import load_plugin
from ..core.sources import Coil, Cuboid, Cylinder, Dipole, Gradient, Source, Uniform
from ..core.specimen_file import read_magnet
from ..core.toml import FileModel, read_text, read_toml, wrong_key
from .fields import Field, cuboid_of
from .magnet.map import FieldMap, read_map, sampled_map

__all__ = [
    "Coil", "Cuboid", "Cylinder", "Dipole", "FieldMap", "Gradient", "Uniform",
    "read_field", "sampled_map",
]  # fmt: skip

GROUP = "magbend.sources"


class _Posed(FileModel):
    axis_angle_deg: float = 90.0
    elevation_deg: float = 0.0
    centre_mm: Vector | None = None
    gap_mm: PositiveFloat | None = None
    offset_mm: Vector = (0.0, 0.0, 0.0)


def _three(given: object) -> object:
    """Return the sides of a cube for its one."""
    return (given,) * 3 if isinstance(given, int | float) else given


Sides = Annotated[
    tuple[PositiveFloat, PositiveFloat, PositiveFloat], BeforeValidator(_three)
]


class _Cuboid(_Posed):
    kind: Literal["cuboid"]
    side_mm: PositiveFloat | None = None
    sides_mm: Sides | None = None
    remanence_T: float


class _Cylinder(_Posed):
    kind: Literal["cylinder"]
    diameter_mm: PositiveFloat
    length_mm: PositiveFloat
    remanence_T: float


class _Dipole(_Posed):
    kind: Literal["dipole"]
    moment_A_m2: float | None = None
    remanence_T: float | None = None
    diameter_mm: float = 0.0


class _Coil(_Posed):
    kind: Literal["coil"]
    diameter_mm: PositiveFloat
    current_A: float
    turns: int = 1
    length_mm: float = 0.0
    wire_mm: float = 0.0


class _Uniform(FileModel):
    kind: Literal["uniform"]
    flux_mT: float
    angle_deg: float = 90.0
    elevation_deg: float = 0.0


class _Gradient(FileModel):
    kind: Literal["gradient"]
    gradient_mT_per_mm: tuple[Vector, Vector, Vector]
    centre_mm: Vector = (0.0, 0.0, 0.0)


class _Map(FileModel):
    kind: Literal["map"]
    file: str
    tolerance_mT: PositiveFloat | None = None


class _Other(FileModel):
    model_config = ConfigDict(extra="allow")
    kind: str


_KINDS: dict[str, tuple[type[FileModel], Any]] = {
    "cuboid": (_Cuboid, Cuboid),
    "cylinder": (_Cylinder, Cylinder),
    "dipole": (_Dipole, Dipole),
    "coil": (_Coil, Coil),
    "uniform": (_Uniform, Uniform),
    "gradient": (_Gradient, Gradient),
    "map": (_Map, None),
}


class _FieldFile(FileModel):
    source: Annotated[list[_Other], Key(min_length=1)]


def read_field(path: Path) -> Field:
    """Read a field of ``[[source]]`` tables, or a magnet file, as a field.

    Sources with neither `centre_mm` nor `gap_mm`, as the magnet of a magnet file, wait
    for the gap of the case (`Field.at_gap`).

    Raises
    ------
    ConfigError
        One sentence with file and key.
    """
    text = read_text(path)
    if "[[source]]" not in text and '"source"' not in text:
        return Field(cuboid_of(read_magnet(path)))
    tables = read_toml(path, _FieldFile).source
    return Field([_source(path, i, table) for i, table in enumerate(tables)])


def _source(path: Path, number: int, table: _Other) -> Source:
    keys = table.model_dump()
    where = f"{path}: source {number} ({table.kind})"
    model, build = _KINDS.get(table.kind, (FileModel, None))
    try:
        if table.kind not in _KINDS:
            return _other(keys)
        given = {
            key: value
            for key, value in model.model_validate(keys).model_dump().items()
            if value is not None and key != "kind"
        }
        if build is None:
            file = path.parent / given["file"]
            return read_map(file, tolerance_mT=given.get("tolerance_mT"))
        if "side_mm" in given:
            given["sides_mm"] = (given.pop("side_mm"),) * 3
        source: Source = build(**given)
    except ValidationError as error:
        raise ConfigError(f"{where}: {wrong_key(error, model)}") from None
    except (InputError, TypeError) as error:
        raise ConfigError(f"{where}: {error}") from None
    return source


def _other(keys: dict[str, Any]) -> Source:
    """Return a source of a kind that another package offers."""
    kind = keys.pop("kind")
    custom = load_plugin(GROUP, kind, own=_KINDS)(**keys)
    return sampled_map(custom.flux_mT, custom.box_mm)
