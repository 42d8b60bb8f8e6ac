"""Fields from files: ``[[source]]`` tables, their kinds, and kinds of others.

Another package offers a kind by an entry point of the group ``magbend.sources``: a
function that takes the keys of its table and returns an object with
`flux_mT(points_mm)` (points in mm, shape (n, 3), to mT) and `box_mm`, two corners of
the box in which rods go. It may be plain Python: it is sampled once, and slow only then
(`magnet.map`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
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
    "field_of_tables", "read_field", "sampled_map", "tables_of",
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
    file: str | None = None
    points_mm: list[Vector] | None = None
    flux_mT: list[Vector] | None = None
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
    "map": (_Map, FieldMap),
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
    tables = [table.model_dump() for table in read_toml(path, _FieldFile).source]
    return field_of_tables(tables, str(path), path.parent)


def field_of_tables(
    tables: Sequence[Mapping[str, Any]], where: str, folder: Path
) -> Field:
    """Return the field of ``[[source]]`` tables.

    Parameters
    ----------
    tables : sequence of mapping
        One a source, with its `kind`.
    where : str
        The file they stand in, for messages.
    folder : Path
        Where the files of maps are.

    Raises
    ------
    ConfigError
        One sentence with file and key.
    """
    return Field(
        _source(f"{where}: source {i}", folder, dict(table))
        for i, table in enumerate(tables)
    )


def tables_of(field: Field) -> list[dict[str, Any]]:
    """Return a field as ``[[source]]`` tables that need no other file.

    What JSON holds: `field_of_tables` makes the same field of them. A map, and what a
    kind of another package was sampled to, keeps its readings.
    """
    return [
        {"kind": source.kind}
        | {
            one.name: _listed(value)
            for one in fields(source)  # type: ignore[arg-type]
            if one.init and (value := getattr(source, one.name)) is not None
        }
        for source in field.sources
    ]


def _listed(value: Any) -> Any:
    """Return tuples and arrays as lists."""
    if hasattr(value, "tolist"):
        return value.tolist()
    return [_listed(one) for one in value] if isinstance(value, tuple) else value


def _source(where: str, folder: Path, keys: dict[str, Any]) -> Source:
    kind = str(keys.get("kind"))
    where = f"{where} ({kind})"
    model, build = _KINDS.get(kind, (FileModel, None))
    try:
        if build is None:
            return _other(keys)
        given = {
            key: value
            for key, value in model.model_validate(keys).model_dump().items()
            if value is not None and key != "kind"
        }
        if "file" in given:
            file = folder / given["file"]
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
