"""Tesla-meter readings: those printed in the paper, and those of a CSV file."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

from ...core.table import read_table
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
    table = read_table(path)
    table.require("gap_mm", "flux_mT", hint="and optionally sd_mT")
    gaps_mm, flux_mT = table.numbers("gap_mm"), table.numbers("flux_mT")
    sd_mT = table.numbers("sd_mT").tolist() if table.has("sd_mT") else None
    return gaps_mm.tolist(), flux_mT.tolist(), sd_mT
