"""Readers of other programs' files: text tables, workbooks, MATLAB, Mathematica.

COMSOL's exports are text tables whose ``%`` lines hold the heads: spreadsheet format,
with or without a sweep side by side (``y (m) @ B0=0.05``), as text or CSV.
"""

from __future__ import annotations

import contextlib
import math
import re
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...core.columns import parse_number
from ...core.decode import decode_text, read_bytes
from ...core.errors import ConfigError, MissingExtraError
from ...core.table import Table, parse_table
from .shapes import KEPT, QUANTITIES, Array, Block, head_of

LIMIT_MB = 64.0
MAX_UNPACKED_MB = 512.0
MAX_NUMBERS = 20_000_000


def read_text_shapes(path: Path) -> list[Block]:
    """Read a CSV or text table, of a spreadsheet, a digitiser or COMSOL."""
    text = decode_text(read_bytes(path, LIMIT_MB), path)
    if re.search(r"^%\s*(Elements|Coordinates)\b", text, re.MULTILINE):
        raise ConfigError(
            f"{path}: is a COMSOL export by sections (coordinates, elements, data); "
            "export it again with the data format Spreadsheet"
        )
    table = parse_table(text, path, needs_heads=False)
    unit, parameters = "", {}
    for comment in table.comments:
        told = re.fullmatch(r"[Ll]ength unit:\s*(\S+)", comment)
        unit = told.group(1) if told else unit
        name, _, value = (part.strip() for part in comment.partition("="))
        number = parse_number(value)
        if name.isidentifier() and number is not None:
            parameters[name] = number
    return [replace(table_block(table, unit), parameters=parameters)]


def table_block(table: Table, unit: str = "") -> Block:
    """Return a table as a block; without heads, two to five columns have their places.

    Raises
    ------
    ConfigError
        If there are no heads and the columns are not two to five.
    """
    names = table.names or _places(str(table.path), table.width)
    columns: list[tuple[str, Array | list[str]]] = []
    for i, name in enumerate(names):
        cells = [row[i] for row in table.rows]
        first = next((cell for cell in cells if cell.strip()), "")
        if parse_number(first, decimal_comma=table.decimal_comma) is None:
            columns.append((name, cells))
        else:
            needed = head_of(name).quantity in QUANTITIES and name not in KEPT
            columns.append((name, table.column(i, blanks=not needed)))
    return Block(source=str(table.path), columns=columns, unit=unit)


def _places(source: str, width: int) -> tuple[str, ...]:
    """Heads of a table without any, by the number of its columns."""
    known = {
        2: ("x", "y"),
        3: ("s", "x", "y"),
        4: ("s", "x", "y", "theta"),
        5: ("s", "x", "y", "theta", "kappa"),
    }
    if width not in known:
        raise ConfigError(
            f"{source}: without heads a shape must have the columns x,y or s,x,y[,theta"
            f"[,kappa]]; instead it has {width}"
        )
    return known[width]


def read_mathematica(path: Path) -> list[Block]:
    """Read nested lists as Mathematica writes them: ``{{0., 0.}, {1., 2.*^-3}}``.

    A list of rows is a shape, a list of such lists several.

    Raises
    ------
    ConfigError
        If it is no list of rows of numbers.
    """
    text = decode_text(read_bytes(path, LIMIT_MB), path)
    text = re.sub(r"\(\*.*?\*\)", "", text, flags=re.DOTALL)
    text = re.sub(r"`+[\d.]*", "", text).replace("*^", "e").strip().rstrip(";")
    if not text.startswith("{"):
        text = text.partition("=")[2].strip()
    nested = _nested(path, text)
    lists = nested if nested and isinstance(nested[0], list) else []
    if lists and isinstance(lists[0][0] if lists[0] else None, list):
        named = [(f"{path}, list {i + 1}", rows) for i, rows in enumerate(lists)]
    else:
        named = [(str(path), lists)]
    return [_rows_block(source, rows) for source, rows in named]


def _nested(path: Path, text: str) -> list[Any]:
    """Parse braces, commas and numbers; nothing else is understood, or evaluated."""
    stack: list[list[Any]] = [[]]
    for token in re.findall(r"[{}]|[^{},]+", text):
        word = token.strip()
        if word == "{":
            if len(stack) > 4:
                raise ConfigError(f"{path}: has lists nested deeper than three")
            stack.append([])
        elif word == "}":
            if len(stack) < 2:
                raise ConfigError(f"{path}: has a closing brace too many")
            done = stack.pop()
            stack[-1].append(done)
        elif word:
            number = parse_number(word)
            if number is None:
                raise ConfigError(
                    f"{path}: must hold lists of numbers; instead received "
                    f"{word[:40]!r}; write N[...] of it"
                )
            stack[-1].append(number)
    if len(stack) != 1 or len(stack[0]) != 1 or not isinstance(stack[0][0], list):
        raise ConfigError(f"{path}: must hold one list of points {{{{x, y}}, ...}}")
    return stack[0][0]


def _rows_block(source: str, rows: list[Any]) -> Block:
    widths = {len(row) if isinstance(row, list) else 0 for row in rows}
    if len(widths) != 1 or not all(
        isinstance(cell, float) for row in rows for cell in row
    ):
        raise ConfigError(f"{source}: every point must have as many numbers")
    values = np.array(rows)
    names = _places(source, values.shape[1])
    return Block(
        source=source, columns=[(n, values[:, i]) for i, n in enumerate(names)]
    )


def read_matlab(path: Path) -> list[Block]:
    """Read a MATLAB file (version 5 by scipy, 7.3 by h5py, the extra ``hdf5``).

    Vectors of one length are the columns of a shape, named as in a table; a struct is
    a shape of its own; matrices of one size hold a shape a column, and vectors as long
    as they are wide its parameters.
    """
    head = read_bytes(path, LIMIT_MB)[:8]
    variables = _hdf5(path) if head.startswith(b"\x89HDF") else _version5(path)
    blocks = list(_blocks(str(path), variables))
    if not blocks:
        names = ", ".join(list(variables)[:8]) or "nothing"
        raise ConfigError(
            f"{path}: must hold x and y of a shape, as vectors x_mm, y_mm or a struct "
            f"of them; instead it holds {names}"
        )
    return blocks


def _version5(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat, whosmat

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            _check_size(path, sum(math.prod(shape) for _, shape, _ in whosmat(path)))
            content = loadmat(
                path, simplify_cells=True, verify_compressed_data_integrity=True
            )
    except ConfigError:
        raise
    except Exception as error:  # a damaged file makes the reader fail in any way
        raise ConfigError(
            f"{path}: is no MATLAB file that can be read: {error}"
        ) from None
    return {key: value for key, value in content.items() if not key.startswith("__")}


def _check_size(path: Path, numbers: int) -> None:
    if numbers > MAX_NUMBERS:
        raise ConfigError(f"{path}: holds more than {MAX_NUMBERS} numbers; part it")


def _hdf5(path: Path) -> dict[str, Any]:
    try:
        import h5py
    except ModuleNotFoundError:
        raise MissingExtraError("h5py", "hdf5", "a MATLAB 7.3 file") from None

    def content(group: Any) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name, item in group.items():
            if name.startswith("#"):
                continue
            if isinstance(item, h5py.Group):
                found[name] = content(item)
            elif isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu":
                _check_size(path, int(item.size or 0))
                found[name] = np.asarray(item, dtype=np.float64).T.squeeze()
        return found

    try:
        with h5py.File(path, "r") as file:
            return content(file)
    except (OSError, RuntimeError, KeyError) as error:
        raise ConfigError(f"{path}: cannot be read as HDF5: {error}") from None


def _blocks(source: str, variables: dict[str, Any]) -> Iterator[Block]:
    vectors: dict[str, Array] = {}
    for name, value in variables.items():
        if isinstance(value, dict):
            yield from _blocks(f"{source}, {name}", value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for i, part in enumerate(value):
                yield from _blocks(f"{source}, {name}({i + 1})", part)
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiu":
            vectors[name] = np.asarray(value, dtype=np.float64)
    for name, value in list(vectors.items()):
        if value.ndim == 2 and 2 in value.shape and name not in ("x", "y"):
            pair = value if value.shape[1] == 2 else value.T
            unit = name.partition("_")[2]
            tail = f"_{unit}" if unit else ""
            vectors |= {f"x{tail}": pair[:, 0], f"y{tail}": pair[:, 1]}
            del vectors[name]
    yield from _of_vectors(source, vectors, variables)


def _of_vectors(
    source: str, vectors: dict[str, Array], variables: dict[str, Any]
) -> Iterator[Block]:
    named = {name: value for name, value in vectors.items() if _is_y(name)}
    if not named:
        return
    size = next(iter(named.values())).shape
    if len(size) == 1:
        columns = [(n, v) for n, v in vectors.items() if v.shape == size]
        texts = [
            (n, [str(cell) for cell in v])
            for n, v in variables.items()
            if isinstance(v, np.ndarray) and v.dtype.kind in "OU" and v.shape == size
        ]
        scalars = [
            (n, np.full(size, float(v)))
            for n, v in variables.items()
            if isinstance(v, (int, float)) and not isinstance(v, bool)
        ]
        yield Block(source=source, columns=[*columns, *scalars, *texts])
        return
    rows, count = size
    for k in range(count):
        columns = []
        for name, value in vectors.items():
            if value.shape == size:
                columns.append((name, value[:, k]))
            elif value.shape == (rows,):
                columns.append((name, value))
            elif value.shape == (count,):
                columns.append((name, np.full(rows, value[k])))
        yield Block(source=f"{source}, column {k + 1}", columns=columns)


def _is_y(name: str) -> bool:
    return name in ("y", "v") or name.startswith("y_")


def read_workbook(path: Path) -> list[Block]:
    """Read every sheet of an Excel workbook that is a shape (the extra ``excel``).

    Raises
    ------
    ConfigError
        If it is no workbook, is too large unpacked, or no sheet has heads x and y.
    """
    return [table_block(table) for table in workbook_tables(path)]


def workbook_tables(path: Path) -> list[Table]:
    """Return the sheets of a workbook as tables, numbers with all their digits."""
    import zipfile

    try:
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
    except (zipfile.BadZipFile, OSError):
        raise ConfigError(f"{path}: is no Excel workbook, or is damaged") from None
    if unpacked > MAX_UNPACKED_MB * 1e6:
        raise ConfigError(
            f"{path}: unpacks to more than {MAX_UNPACKED_MB:g} MB; save it as CSV"
        )
    try:
        import openpyxl
    except ModuleNotFoundError:
        raise MissingExtraError("openpyxl", "excel", "an Excel workbook") from None
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    except Exception as error:  # it raises whatever it meets in a damaged archive
        raise ConfigError(f"{path}: is no Excel workbook: {error}") from None
    tables = []
    for sheet in book.worksheets:
        rows = [
            [_text(cell) for cell in row] for row in sheet.iter_rows(values_only=True)
        ]
        text = "\n".join("\t".join(row) for row in rows if any(row))
        if text:
            name = path.with_name(f"{path.name}, sheet {sheet.title}")
            with contextlib.suppress(ConfigError):  # a sheet of notes is no table
                tables.append(parse_table(text, name, needs_heads=False))
    book.close()
    if not tables:
        raise ConfigError(f"{path}: has no sheet with a table")
    return tables


def _text(cell: object) -> str:
    if cell is None:
        return ""
    if isinstance(cell, float):
        return repr(cell)
    return '"' + str(cell).replace('"', '""').replace("\n", " ") + '"'
