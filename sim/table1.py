"""The seven rods of the paper: its Table 1, and the sides it measured afterwards."""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

from ..core.checks import whole
from ..core.specimen import Section, Specimen


def gmc(number: int, *, remeasured: bool = False) -> Specimen:
    """Return a rod of the paper's Table 1.

    Parameters
    ----------
    number : {1, 2, 3, 4, 5, 6, 7}
        GMC number.
    remeasured : bool
        Take the sides measured on the finished rods (0.80, 0.97, 1.30 mm) instead of
        those of the moulds (0.75, 1.0, 1.25 mm).

    Returns
    -------
    Specimen
        Its remanence is the "magnetisation" of the paper, positive from root to tip;
        the paper states neither the sign nor a density.

    Raises
    ------
    InputError
        If there is no such rod.

    Examples
    --------
    >>> gmc(2).length_mm
    30.0
    """
    row = whole(number, 1, 7, "GMC number") - 1
    return _table()[row][bool(remeasured)]


@cache
def _table() -> tuple[tuple[Specimen, Specimen], ...]:
    path = Path(__file__).with_name("table1.csv")
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return tuple(
        (
            _specimen(row, f"GMC {row['gmc']}", row["side_mm"]),
            _specimen(row, f"GMC {row['gmc']} remeasured", row["remeasured_side_mm"]),
        )
        for row in rows
    )


def _specimen(row: dict[str, str], name: str, side_mm: str) -> Specimen:
    pairs = zip(row["length_mm"].split(), row["E_MPa"].split(), strict=True)
    return Specimen(
        name=name,
        side_mm=float(side_mm),
        remanence_mT=float(row["remanence_mT"]),
        sections=tuple(
            Section(length_mm=float(length), E_MPa=float(modulus))
            for length, modulus in pairs
        ),
    )
