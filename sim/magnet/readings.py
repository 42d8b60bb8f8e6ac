"""Tesla-meter readings: those printed in the paper, and those of a CSV file."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

from ...core.errors import ConfigError
from ...core.units import T_from_mT, mT_from_T
from .fit import axis_share


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedReading:
    """A reading of the paper with the remanence printed beside it."""

    gap_mm: float
    flux_mT: float
    printed_T: float

    @property
    def flux_needed_mT(self) -> float:
        """The reading that the printed remanence would need, in mT."""
        return mT_from_T(self.printed_T * float(axis_share(self.gap_mm)))

    @property
    def remanence_T(self) -> float:
        """What the reading gives for the paper's cube, in T."""
        return T_from_mT(self.flux_mT) / float(axis_share(self.gap_mm))


def paper_readings() -> tuple[PrintedReading, ...]:
    """Return the paper's three readings (55 mm cube)."""
    path = Path(__file__).with_name("paper_readings.csv")
    with path.open(encoding="utf-8", newline="") as file:
        return tuple(
            PrintedReading(**{key: float(value) for key, value in row.items()})
            for row in csv.DictReader(file)
        )


def read_readings(path: Path) -> tuple[list[float], list[float], list[float] | None]:
    """Read a CSV of readings: gap_mm, flux_mT and, optionally, sd_mT.

    Raises
    ------
    ConfigError
        If the file is missing, lacks a column, has no row or holds something else than
        numbers: with file and line.
    """
    from ...core.toml import read_text

    rows = list(csv.DictReader(read_text(path).splitlines(), skipinitialspace=True))
    if not rows:
        raise ConfigError(f"{path}: must hold at least one reading; it holds none")
    for line, row in enumerate(rows, start=2):
        if None in row:
            raise ConfigError(
                f"{path}, line {line}: has more values than the header has columns; "
                "write decimals with a point, not a comma"
            )
    columns: dict[str, list[float]] = {}
    names = [str(name).strip() for name in rows[0]]
    for name in ("gap_mm", "flux_mT"):
        if name not in names:
            raise ConfigError(
                f"{path}: must have the columns gap_mm,flux_mT and optionally sd_mT; "
                f"instead received {','.join(names)}"
            )
    for name in ("gap_mm", "flux_mT", "sd_mT"):
        if name in names:
            columns[name] = [
                _number(row.get(name), path, line, name)
                for line, row in enumerate(rows, start=2)
            ]
    return columns["gap_mm"], columns["flux_mT"], columns.get("sd_mT")


def _number(text: str | None, path: Path, line: int, name: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ConfigError(
            f"{path}, line {line}: {name} must be a number; instead received {text!r}"
        )
    return value
