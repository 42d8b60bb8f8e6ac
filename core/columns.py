"""A table that was read: its heads with their units, and its columns as numbers.

Heads carry their unit as ``x_mm``, ``x (m)`` or ``x [m]``; a column is asked for by the
name with the unit wanted and is converted. `table.read_table` makes them.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .checks import shown
from .errors import ConfigError
from .units import known_unit, unit_factor

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?", re.ASCII)
COMMA_NUMBER = re.compile(r"[+-]?(\d+,\d*|,\d+)([eE][+-]?\d+)?", re.ASCII)
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?", re.ASCII)
_POINTED = re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+,\d+", re.ASCII)
_PLAIN = re.compile(r"[-+0-9.eE\n]*", re.ASCII)
_HEAD_UNIT = re.compile(r"(.*?)\s*[(\[]\s*([^()\[\]]*?)\s*[)\]]\s*$")
_NOTHING = frozenset(("", "nan", "na", "n/a", "none", "null", "-", "--"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table as it was brought: heads, cells as text, and where each row stands.

    Parameters
    ----------
    path : Path
        Named in messages.
    names : tuple of str
        Heads as written; empty where the table has none.
    rows : tuple of tuple of str
        Cells, as many in each row.
    lines : tuple of int
        Line of each row in the file, from 1.
    comments : tuple of str
        Comment lines, without their sign.
    decimal_comma : bool
        Whether numbers are written 1,5.
    stray_point : str
        What made `decimal_comma` false although numbers are written so: a number 1.5
        among them, and where it stands.
    """

    path: Path
    names: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    comments: tuple[str, ...] = ()
    decimal_comma: bool = False
    stray_point: str = ""

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.names) or (len(self.rows[0]) if self.rows else 0)

    def find(self, name: str) -> tuple[int, float] | None:
        """Return the place of a column and its factor to the unit in `name`.

        Raises
        ------
        ConfigError
            If two columns answer to the name, or its head has no unit or an unknown
            one.
        """
        exact = [i for i, head in enumerate(self.names) if head == name]
        if len(exact) == 1:
            return exact[0], 1.0
        if len(exact) > 1:
            raise ConfigError(f"{self.path}: has {len(exact)} columns named {name}")
        quantity, wanted = split_unit(name)
        found = []
        for i, head in enumerate(self.names):
            own, unit = split_unit(head)
            if own.casefold() != quantity.casefold():
                continue
            factor = unit_factor(unit, wanted)
            if factor is None and known_unit(unit):
                continue  # x_px is another column than x_mm
            if factor is None:
                what = f"in {unit!r}" if unit else "without a unit"
                raise ConfigError(
                    f"{self.path}: the column {head!r} is {what}; head it {name}, or "
                    f"{quantity} with another unit in brackets"
                )
            found.append((i, factor))
        if len(found) > 1:
            heads = " and ".join(self.names[i] for i, _ in found)
            raise ConfigError(f"{self.path}: {heads} are both {quantity}; leave one")
        return found[0] if found else None

    def has(self, name: str) -> bool:
        """Return whether there is such a column, in whatever unit."""
        return self.find(name) is not None

    def require(self, *names: str, hint: str = "") -> None:
        """Refuse a table that lacks one of the columns.

        Raises
        ------
        ConfigError
            It names what is missing and what is there.
        """
        missing = [name for name in names if not self.has(name)]
        if missing:
            heads = ", ".join(self.names[:12]) or "no heads at all, only numbers"
            raise ConfigError(
                f"{self.path}: must have the column(s) {', '.join(missing)}; "
                f"instead its first line has {heads}{hint and '; ' + hint}"
            )

    def texts(self, name: str) -> list[str]:
        """Return a column as it is written; empty texts where it is missing."""
        at = self.find(name)
        return (
            [""] * len(self.rows) if at is None else [row[at[0]] for row in self.rows]
        )

    def numbers(self, name: str, *, blanks: bool = False) -> NDArray[np.float64]:
        """Return a column as finite numbers in the unit that its name ends in.

        Parameters
        ----------
        name : str
            Such as ``x_mm``; a column ``x (m)`` answers and is converted.
        blanks : bool
            Whether cells may be empty (or ``nan``); they are NaN.

        Raises
        ------
        ConfigError
            If the column is missing, or a cell is no number: with its line.
        """
        self.require(name)
        at, factor = self.find(name) or (0, 1.0)
        values = self.column(at, blanks=blanks)
        return values if factor == 1.0 else values * factor

    def column(self, at: int, *, blanks: bool = False) -> NDArray[np.float64]:
        """Return the numbers of a column by its place, as they are written.

        Raises
        ------
        ConfigError
            As `numbers`.
        """
        cells = [row[at] for row in self.rows]
        if _PLAIN.fullmatch("\n".join(cells)) and all(cells):
            try:
                values = np.array([float(cell) for cell in cells])
                if np.all(np.isfinite(values)):
                    return values
            except ValueError:
                pass  # the slow way below finds the cell
        return np.array(
            [self._number(i, at, cell, blanks) for i, cell in enumerate(cells)]
        )

    def _number(self, row: int, at: int, cell: str, blanks: bool) -> float:
        if blanks and cell.strip().lower() in _NOTHING:
            return math.nan
        value = parse_number(cell, decimal_comma=self.decimal_comma)
        if value is None:
            name = self.names[at] if self.names else f"column {at + 1}"
            raise ConfigError(
                f"{self.path}, line {self.lines[row]}: {name} must be a number; "
                f"instead received {shown(cell)}{self._cause(cell)}"
            )
        return value

    def _cause(self, cell: str) -> str:
        text = cell.strip()
        if text.lower() in _NOTHING:
            return "; leave the row out if nothing was measured there"
        if self.stray_point and COMMA_NUMBER.fullmatch(text):
            return (
                f", but {self.stray_point}: write all decimals of the file with a "
                "point, or all with a comma"
            )
        if "_" in text:
            return "; write it without an underscore"
        if THOUSANDS.fullmatch(text) and "," in text:
            return "; write thousands without a comma, and decimals with a point"
        if re.match(r"[+-]?[\d.,]+\s*[^\d\s.,eE]", text):
            return "; write the number alone, and its unit in the head"
        if _POINTED.fullmatch(text):
            return "; write thousands without a point, as 1250,5"
        if "," in text:
            return "; write decimals with a point, not a comma"
        return ""


def split_unit(head: str) -> tuple[str, str]:
    """Return quantity and unit of a head: ``("x", "mm")`` of ``x_mm`` or ``x (mm)``.

    The unit is empty where there is none.
    """
    head = head.strip()
    bracket = _HEAD_UNIT.match(head)
    if bracket and bracket.group(1):
        return bracket.group(1).strip().replace(" ", "_"), bracket.group(2)
    per = re.match(r"(.+?)_(per_\w+|kg_m3|g_cm3)$", head)
    if per:
        return per.group(1), per.group(2)
    quantity, _, unit = head.rpartition("_")
    return (quantity, unit) if quantity and known_unit(unit) else (head, "")


def parse_number(text: str, *, decimal_comma: bool = False) -> float | None:
    """Return the finite number that `text` is, None if it is none.

    Stricter than `float`: no underscores, no ``nan`` or ``inf``, ASCII digits only.
    """
    text = text.strip().replace("\u2212", "-")
    if decimal_comma and COMMA_NUMBER.fullmatch(text):
        text = text.replace(",", ".")
    if not _NUMBER.fullmatch(text):
        return None
    value = float(text.replace("d", "e").replace("D", "e"))
    return value if math.isfinite(value) else None
