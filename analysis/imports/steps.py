"""The table of somebody's experiment: a row a step, with the files it names."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.columns import split_unit
from ...core.door import file_below
from ...core.errors import ConfigError
from ...core.files import write_text
from ...core.table import Table, read_table
from ...core.units import unit_factor
from .readers import workbook_tables

PHOTOGRAPH = ("photograph", "photo", "picture", "image")
CENTRELINE = ("centreline", "centerline", "shape")
SIMULATED = ("simulated", "simulation", "comsol")
SPECIMEN = ("specimen", "rod")
FLUX = ("b", "field", "flux_density", "magnetic_field")
"""Heads that mean `flux` where none is called so and the unit is one of a field."""
PICTURES = frozenset(
    (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".heic", ".heif")
)
MAX_STEPS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRow:
    """One row of the table.

    Parameters
    ----------
    line : int
        Where it stands, for messages.
    gap_mm, flux_mT, flux_sd_mT : float
        NaN where the table does not say.
    photograph : Path or None
        The picture.
    centreline, simulated : str
        Files of shapes, as ``FILE`` or ``FILE @ B0=0.05``; empty where there is none.
    specimen : str
        File of the rod, where the table has several; empty where it does not say.
    others : dict of str to str
        Every other column, as it is written.
    """

    line: int
    gap_mm: float
    flux_mT: float
    flux_sd_mT: float
    photograph: Path | None
    centreline: str
    simulated: str
    specimen: str
    others: dict[str, str]


def read_steps(path: Path) -> list[StepRow]:
    """Read the table of an experiment, CSV or the first sheet of a workbook.

    Raises
    ------
    ConfigError
        If it has no column of photographs or of centrelines, a row names neither, none
        of gap and flux is there, or a photograph is missing or lies elsewhere.
    """
    is_workbook = path.suffix.lower() in (".xlsx", ".xlsm")
    table = workbook_tables(path)[0] if is_workbook else read_table(path)
    if len(table.rows) > MAX_STEPS:
        raise ConfigError(f"{path}: must have at most {MAX_STEPS} rows")
    photographs, centrelines = _files(table, PHOTOGRAPH), _files(table, CENTRELINE)
    simulated, specimens = _files(table, SIMULATED), _files(table, SPECIMEN)
    if not any(photographs) and not any(centrelines):
        heads = ", ".join(table.names[:10])
        raise ConfigError(
            f"{path}: must have a column photograph or centreline that names a file "
            f"in each row; instead it has {heads}"
        )
    table = _with_flux(table)
    columns = {name: _numbers(table, name) for name in
               ("gap_mm", "flux_mT", "flux_sd_mT")}  # fmt: skip
    others = _others(table)
    rows = []
    for i, line in enumerate(table.lines):
        rows.append(
            StepRow(
                line=line,
                photograph=_inside(path, line, photographs[i]),
                centreline=centrelines[i],
                simulated=simulated[i],
                specimen=specimens[i],
                others={name: values[i] for name, values in others.items()},
                **{name: float(column[i]) for name, column in columns.items()},
            )
        )
        _check(path, rows[-1])
    for group in by_specimen(rows).values():
        _check_together(path, group)
    return rows


def by_specimen(rows: Sequence[StepRow]) -> dict[str, list[StepRow]]:
    """Return the rows of each rod, in the order of the table."""
    found: dict[str, list[StepRow]] = {}
    for row in rows:
        found.setdefault(row.specimen, []).append(row)
    return found


def _files(table: Table, names: tuple[str, ...]) -> list[str]:
    found = [name for name in table.names if name.strip().lower() in names]
    if len(found) > 1:
        raise ConfigError(
            f"{table.path}: {' and '.join(found)} mean the same; leave one"
        )
    return [text.strip() for text in table.texts(found[0] if found else "")]


def _with_flux(table: Table) -> Table:
    """Return the table with its readings headed flux, whatever they are called."""
    if table.has("flux_mT"):
        return table
    names = list(table.names)
    for i, head in enumerate(names):
        quantity, unit = split_unit(head)
        if quantity.casefold() in FLUX and unit_factor(unit, "mT") is not None:
            names[i] = f"flux ({unit})"
    return replace(table, names=tuple(names))


def _numbers(table: Table, name: str) -> NDArray[np.float64]:
    if not table.has(name):
        return np.full(len(table.rows), math.nan)
    return table.numbers(name, blanks=True)


def _others(table: Table) -> dict[str, list[str]]:
    files = (*PHOTOGRAPH, *CENTRELINE, *SIMULATED, *SPECIMEN)
    taken = [table.find(name) for name in ("gap_mm", "flux_mT", "flux_sd_mT")]
    used = {place[0] for place in taken if place}
    return {
        name: [row[i] for row in table.rows]
        for i, name in enumerate(table.names)
        if name and i not in used and name.strip().lower() not in files
    }


def inside(table: Path, line: int, name: str) -> Path:
    """Return a file that a table names; it must lie beside the table or below.

    A table may come from a stranger, and what it names is copied into the run.

    Raises
    ------
    ConfigError
        If it lies elsewhere or is missing.
    """
    path = file_below(table.parent, name)
    if path is None:
        raise ConfigError(
            f"{table}, line {line}: there is no file {name[:200]}, which must lie in "
            "the folder of the table; copy it there"
        )
    return path


def _inside(table: Path, line: int, name: str) -> Path | None:
    return inside(table, line, name) if name else None


def _check(path: Path, row: StepRow) -> None:
    where = f"{path}, line {row.line}"
    if row.photograph is None and not row.centreline:
        raise ConfigError(f"{where}: must name a photograph or a centreline")
    if math.isnan(row.gap_mm) and math.isnan(row.flux_mT):
        raise ConfigError(f"{where}: must have a gap_mm, a flux_mT, or both")
    if not math.isnan(row.gap_mm) and not 0.0 < row.gap_mm < 1e4:
        raise ConfigError(
            f"{where}: gap_mm must be from 0 to 10000 mm; instead received "
            f"{row.gap_mm:g}"
        )
    if not math.isnan(row.flux_sd_mT) and row.flux_sd_mT < 0.0:
        raise ConfigError(f"{where}: flux_sd_mT must not be negative")
    if row.photograph is not None and row.photograph.suffix.lower() not in PICTURES:
        raise ConfigError(
            f"{where}: {row.photograph.name} is no kind of picture that is read "
            f"({', '.join(sorted(PICTURES))})"
        )


def _check_together(path: Path, rows: Sequence[StepRow]) -> None:
    """Refuse half-measured tables and fields that grow with the gap."""
    measured = [bool(row.centreline) for row in rows]
    if any(measured) and not all(measured):
        line = rows[measured.index(False)].line
        raise ConfigError(
            f"{path}, line {line}: has no centreline, and other rows have; give all "
            "or none, and extract the photographs in a run of their own"
        )
    both = sorted(
        (row.gap_mm, abs(row.flux_mT), row.line)
        for row in rows
        if not math.isnan(row.gap_mm) and not math.isnan(row.flux_mT)
    )
    for (near, more, first), (far, less, second) in itertools.pairwise(both):
        if far > near and less > 1.02 * more:
            raise ConfigError(
                f"{path}, lines {first} and {second}: the field must fall with the "
                f"gap; instead {more:g} mT at {near:g} mm and {less:g} mT at {far:g} "
                "mm; are two readings swapped?"
            )


def write_template(folder: Path) -> Path:
    """Write a commented table for a folder of photographs, for a person to fill.

    Raises
    ------
    ConfigError
        If the folder has no photographs, or a ``steps.csv`` already.
    """
    names = sorted(
        path.name for path in folder.iterdir()
        if path.suffix.lower() in PICTURES and not path.name.startswith(".")
    )  # fmt: skip
    out = folder / "steps.csv"
    if not names:
        raise ConfigError(f"{folder}: has no photographs")
    if out.exists():
        raise ConfigError(
            f"{out}: is there already; fill it and give it instead of the folder"
        )
    lines = [
        "# One row a photograph, in any order. Delete photographs that do not belong.",
        "# gap_mm: from the N face of the magnet to the undeformed tip.",
        "# flux_mT: what the Tesla-meter read there; for gauss head it flux (G).",
        "#   One of the two may stay empty.",
        "# simulated: a file with the simulated shape, as FILE or FILE @ B0=0.05; may",
        "#   stay empty. More columns (temperature, notes) are kept.",
        "photograph,gap_mm,flux_mT,simulated",
        *(f'"{name}",,,' if "," in name else f"{name},,," for name in names),
    ]
    write_text(out, "\n".join(lines) + "\n")
    return out
