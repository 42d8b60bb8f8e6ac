"""The one reader of tables that a person brings: spreadsheets, instruments, our own.

It parses, never splits: any encoding (`decode`), a ``sep=`` line, comma, semicolon, tab
or spaces, quotes, decimal commas, comment lines (``#``, ``%``; the last before the
numbers may hold the heads), blank rows, a row of units below the heads. What cannot be
read is refused with line and cause. `columns.Table` gives the columns in any unit.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from .columns import COMMA_NUMBER, THOUSANDS, Table, parse_number, split_unit
from .decode import decode_text, read_bytes
from .errors import ConfigError
from .units import known_unit

__all__ = ["Table", "parse_table", "read_table"]

MAX_COLUMNS = 4096
MAX_ROWS = 4_000_000
MAX_CELL = 100_000


def read_table(
    path: Path, *, comments: str = "#%", limit_MB: float = 64.0, rows: bool = True
) -> Table:
    """Read a table.

    Parameters
    ----------
    path : Path
        A CSV or another text table.
    comments : str
        Signs that begin a comment line; none for tables that may begin a row with one.
    limit_MB : float
        A longer file is refused.
    rows : bool
        Whether a table without a row below its heads is refused.

    Raises
    ------
    ConfigError
        If it is missing, too long, no text, has no row, or rows of other lengths than
        the heads: with line and cause.
    """
    text = decode_text(read_bytes(path, limit_MB), path)
    return parse_table(text, path, comments=comments, needs_rows=rows)


def parse_table(
    text: str,
    path: Path,
    *,
    comments: str = "#%",
    needs_rows: bool = True,
    needs_heads: bool = True,
) -> Table:
    """Read the text of a table; `read_table` says how.

    Without `needs_heads` a table of numbers alone is one without names.
    """
    lines = re.split(r"\r\n|\n|\r", text)
    kept, said, separator = _without_comments(lines, comments)
    if not kept:
        raise ConfigError(f"{path}: must hold a table; it holds no row")
    separator = separator or _separator(kept, lines)
    cells = _without_title(list(_cells(lines, kept, separator, path)))
    names = _heads(cells[0][1], [lines[i] for i in said], separator)
    if names is cells[0][1]:
        del cells[0]
    if needs_heads and not names:
        raise ConfigError(
            f"{path}: the first line must name the columns, with their units; instead "
            f"received {','.join(cells[0][1][:6])}"
        )
    while names and not names[-1].strip():
        names = names[:-1]
    names, cells = _units_below([name.strip() for name in names], cells)
    width = len(names) or len(cells[0][1])
    rows = [(n, _fitted(row, width, n, path, separator)) for n, row in cells]
    rows = [(n, row) for n, row in rows if any(cell.strip() for cell in row)]
    if needs_rows and not rows:
        raise ConfigError(f"{path}: must hold at least one row below its heads")
    decimal_comma = separator != "," and _has_decimal_commas(rows, separator)
    stray = _stray_point(rows, names) if decimal_comma else ""
    return Table(
        path=path,
        names=tuple(names),
        rows=tuple(row for _, row in rows),
        lines=tuple(n for n, _ in rows),
        comments=tuple(lines[i].strip()[1:].strip() for i in said),
        decimal_comma=decimal_comma and not stray,
        stray_point=stray,
    )


def _without_comments(
    lines: Sequence[str], signs: str
) -> tuple[list[int], list[int], str]:
    """Return the indices of table lines and of comments, and what ``sep=`` says."""
    kept: list[int] = []
    said: list[int] = []
    separator = ""
    for i, line in enumerate(lines):
        text = line.strip()
        if not text:
            continue
        told = re.fullmatch(r'"?sep=(.|\\t)"?', text) if not kept else None
        if told:
            separator = "\t" if told.group(1) == "\\t" else told.group(1)
        elif signs and text[0] in signs:
            said.append(i)
        else:
            kept.append(i)
    return kept, said, separator


def _separator(kept: Sequence[int], lines: Sequence[str]) -> str:
    bare = re.sub(r'"[^"]*"', "", lines[kept[0]])
    bare = re.sub(r"[(\[][^()\[\]]*[)\]]", "", bare)  # units such as (1/mm; signed)
    for separator in ("\t", ";", ","):
        if separator in bare:
            return separator
    # One head that is a name of its own needs no separator; numbers may be in spaces.
    return " " if len(bare.split()) > 1 else ","


def _cells(
    lines: Sequence[str], kept: Sequence[int], separator: str, path: Path
) -> Iterator[tuple[int, list[str]]]:
    """Yield line number and cells of each row."""
    at = 0

    def feed() -> Iterator[str]:
        nonlocal at
        for i in kept:
            at = i + 1
            yield _joined_units(lines[i].strip()) if separator == " " else lines[i]

    csv.field_size_limit(MAX_CELL)
    reader = csv.reader(feed(), delimiter=separator, skipinitialspace=True)
    try:
        for count, row in enumerate(reader):
            if len(row) > MAX_COLUMNS or count > MAX_ROWS:
                raise ConfigError(
                    f"{path}, line {at}: a table must have at most {MAX_COLUMNS} "
                    f"columns and {MAX_ROWS} rows"
                )
            yield at, row
    except csv.Error as error:
        raise ConfigError(f"{path}, line {at}: cannot be read: {error}") from None


def _joined_units(text: str) -> str:
    """Join a head and its unit in a table separated by spaces: ``x (mm)``."""
    return re.sub(r"(\S) +([(\[][^()\[\]\s]*[)\]])", r"\1\2", text)


def _heads(first: list[str], comments: Sequence[str], separator: str) -> list[str]:
    """Return the heads: the first row, the last comment that fits it, or none."""
    is_data = all(
        parse_number(cell, decimal_comma=separator != ",") is not None
        for cell in first
        if cell.strip()
    )
    if not is_data:
        return first
    for comment in reversed(comments):
        for names in _splits(comment.strip()[1:].strip(), separator):
            if len(names) == len(first) and not any(
                parse_number(name) is not None for name in names
            ):
                return names
    return []


def _splits(comment: str, separator: str) -> Iterator[list[str]]:
    if separator != " ":
        yield next(
            csv.reader([comment], delimiter=separator, skipinitialspace=True), []
        )
    yield re.split(r"\s{2,}|\t", comment)
    yield _joined_units(comment).split()
    yield next(csv.reader([comment], skipinitialspace=True), [])


def _without_title(cells: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """Return the rows without a title above the heads: words, and fewer than those."""

    def words(row: list[str]) -> list[str]:
        return [cell for cell in row if cell.strip()]

    while len(cells) > 2:
        title, heads = words(cells[0][1]), words(cells[1][1])
        below = len(words(cells[2][1]))
        is_title = len(title) < len(heads) == below
        numbers = [parse_number(cell) for cell in [*title, *heads]]
        if not is_title or any(number is not None for number in numbers):
            break
        del cells[0]
    return cells


def _units_below(
    names: list[str], cells: list[tuple[int, list[str]]]
) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Put a row of units below the heads into the heads."""
    if not names or not cells:
        return names, cells
    units = [cell.strip().strip("()[]") for cell in cells[0][1]]
    named = [unit for unit in units if unit]
    if not named or len(units) > len(names) or not all(map(known_unit, named)):
        return names, cells
    units += [""] * (len(names) - len(units))
    headed = [
        f"{n} ({u})" if u and split_unit(n)[1] != u else n
        for n, u in zip(names, units, strict=True)
    ]
    return headed, cells[1:]


def _fitted(
    row: list[str], width: int, line: int, path: Path, separator: str
) -> tuple[str, ...]:
    """Return a row as long as the heads; only empty cells may hang over."""
    if len(row) > width and not any(cell.strip() for cell in row[width:]):
        row = row[:width]
    if not any(cell.strip() for cell in row):
        return ("",) * width
    if len(row) > width:
        cause = (
            "; write decimals with a point, not a comma, or separate by semicolons"
            if separator == ","
            else ""
        )
        raise ConfigError(
            f"{path}, line {line}: has more values than the header has columns "
            f"({len(row)} and {width}){cause}"
        )
    if len(row) < width:
        raise ConfigError(
            f"{path}, line {line}: has {len(row)} of the {width} values that the "
            "header names; it is cut off or has lost a separator"
        )
    return tuple(row)


def _has_decimal_commas(
    rows: Sequence[tuple[int, tuple[str, ...]]], separator: str
) -> bool:
    """Return whether commas are decimal, and not only thousands."""
    with_comma = [
        cell.strip() for _, row in rows for cell in row
        if "," in cell and COMMA_NUMBER.fullmatch(cell.strip())
    ]  # fmt: skip
    if not with_comma:
        return False
    if all(THOUSANDS.fullmatch(cell) for cell in with_comma):
        return separator == ";" and not _stray_point(rows, [])
    return True


def _stray_point(
    rows: Sequence[tuple[int, tuple[str, ...]]], names: Sequence[str]
) -> str:
    """Return the first decimal with a point, and where it stands; empty if none."""
    for line, row in rows:
        for at, cell in enumerate(row):
            if re.fullmatch(r"[+-]?\d*\.\d+", cell.strip()):
                column = names[at] if at < len(names) else f"column {at + 1}"
                return f"line {line} has {cell.strip()} in {column}"
    return ""
