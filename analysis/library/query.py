"""Search a library: conditions, nearest shape, sort, top; Arrow does the scanning.

Two passes: the first reads only the columns that decide (with the conditions pushed
down to the row groups' statistics) and keeps the best few; the second fetches all
columns of these.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.errors import InputError, StoreError
from ...core.files import write_bytes
from ...core.notebook import Tabular, axes_or_new
from ..compare.metrics import position_at
from . import ranking
from .build import (
    MANIFEST,
    ROW_GROUP,
    STATIONS,
    partition_path,
    read_manifest,
    refuse_extra,
    require_pyarrow,
)
from .conditions import all_of, parse_range, parse_where
from .ledger import SPACE_KEY

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_BOOLE = {25: 32.0 / 90.0, 50: 12.0 / 90.0, 75: 32.0 / 90.0, 100: 7.0 / 90.0}
"""Boole's weights: the mean of a squared distance that vanishes at the clamp."""
_FETCH_LIMIT = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Found(Tabular):
    """What a query found.

    Parameters
    ----------
    table : pyarrow.Table
        The rows, best first; with ``distance_mm`` where a shape was asked for.
    matched : int
        How many rows met the conditions.
    designs, missing_partitions : int
        Designs of the whole library, and partitions that are not there (yet).
    """

    table: Any
    matched: int
    designs: int
    missing_partitions: int

    def to_dataframe(self) -> pd.DataFrame:
        """Return the rows as a pandas table."""
        frame: pd.DataFrame = self.table.to_pandas()
        return frame

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw where the tips of the rows found lie; return the axes."""
        ax = axes_or_new(ax, "tip x (mm)", "tip y (mm)")
        rows = self.to_dataframe()
        ax.plot(rows["tip_x_mm"], rows["tip_y_mm"], "o", markersize=3)
        return ax


def query(
    library: Path,
    *,
    where: str | None = None,
    ranges: Sequence[str] = (),
    nearest: Centreline | None = None,
    sort: str | Sequence[str] | None = None,
    pareto: Sequence[str] = (),
    top: int = 20,
) -> Found:
    """Search a library.

    Parameters
    ----------
    library : Path
        Folder of a build.
    where, ranges : str, sequence of str
        See `conditions`; all must hold.
    nearest : Centreline, optional
        Rank by the root mean square distance of corresponding points (equal shares of
        the arc length) from this shape, ``distance_mm``.
    sort : str or sequence of str, optional
        Expressions to rank by (see `conditions`), rising; with a leading ``-`` falling.
        The second decides where the first is equal, and so on.
    pareto : sequence of str
        Expressions of which each is wanted small, or with a leading ``-`` large: only
        designs that no other beats in all of them, ranked by the first.
    top : int
        How many rows to return.

    Raises
    ------
    StoreError
        If the folder is no library, or a partition is damaged.
    InputError
        If a condition, a column or `top` cannot be.
    """
    require_pyarrow()
    keys = [sort] if isinstance(sort, str) else list(sort or ())
    if sum((nearest is not None, bool(keys), bool(pareto))) > 1:
        raise InputError("give one of --nearest, --sort and --pareto, not several")
    if not 1 <= top <= _FETCH_LIMIT:
        raise InputError(f"--top must be from 1 to {_FETCH_LIMIT}; received {top}")
    data, manifest, missing = open_library(library)
    columns = data.schema.names
    conditions = [parse_range(text, columns) for text in ranges]
    if where:
        conditions.append(parse_where(where, columns))
    condition = all_of(conditions)
    with _damage_named(library, data):
        if nearest is not None:
            ranked, matched = _rank_nearest(data, condition, nearest, top)
        elif keys:
            ranked, matched = ranking.best(data, condition, keys, top)
        elif pareto:
            ranked, matched = ranking.front(data, condition, pareto, top)
        else:
            ranked, matched = _first(data, condition, top)
        table = _fetch(library, manifest, data, ranked)
    table = _with_total(table)
    if nearest is not None:
        table = table.append_column("distance_mm", [ranked[:, 1]])
    return Found(
        table=table,
        matched=matched,
        designs=int(manifest["designs"]),
        missing_partitions=missing,
    )


def write_rows(found: Found, path: Path) -> None:
    """Write the rows as ``.csv`` or ``.parquet``, whole or not at all."""
    write_table(found.table, path)


def write_table(table: Any, path: Path) -> None:
    """Write an Arrow table as ``.csv`` or ``.parquet``, whole or not at all.

    Raises
    ------
    InputError
        If the suffix is neither.
    """
    import io

    import pyarrow as pa
    import pyarrow.csv as pc
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    if path.suffix == ".csv":
        at = table.schema.get_field_index("status")
        if at >= 0:
            table = table.set_column(at, "status", table.column(at).cast(pa.string()))
        pc.write_csv(table, buffer, pc.WriteOptions(quoting_style="needed"))
    elif path.suffix == ".parquet":
        pq.write_table(table, buffer)
    else:
        raise InputError(f"--out must end in .csv or .parquet; received {path.name}")
    write_bytes(path, buffer.getvalue())


def open_library(library: Path) -> tuple[Any, dict[str, Any], int]:
    """Return the data set, the manifest, and how many partitions are missing."""
    import pyarrow as pa
    import pyarrow.dataset as ds

    manifest = read_manifest(library)
    parts = sorted(str(path) for path in library.glob("part-*.parquet"))
    if not parts:
        raise StoreError(f"{library}: holds no finished partition yet; build it first")
    refuse_extra(library, int(manifest["partitions"]))
    _refuse_foreign(library, parts, manifest["digest"])
    options = ds.ParquetFragmentScanOptions(page_checksum_verification=True)
    form = ds.ParquetFileFormat(default_fragment_scan_options=options)
    try:
        data = ds.dataset(parts, format=form)
    except (pa.ArrowException, OSError):
        raise StoreError(_damaged(library, parts)) from None
    return data, manifest, int(manifest["partitions"]) - len(parts)


def _refuse_foreign(library: Path, parts: Sequence[str], digest: str) -> None:
    """Refuse partitions of another space; those of before say nothing about theirs."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    for part in parts:
        if not Path(part).is_file():
            raise StoreError(f"{part}: is no file")
        try:
            noted = (pq.read_schema(part).metadata or {}).get(SPACE_KEY)
        except (pa.ArrowException, OSError):
            continue  # named with all that are damaged
        if noted is not None and noted.decode("ascii", "replace") != digest:
            raise StoreError(
                f"{library}: {Path(part).name} is of another space; delete it and "
                f"build the library again: only what is missing is solved"
            )


@contextlib.contextmanager
def _damage_named(library: Path, data: Any) -> Iterator[None]:
    """Turn Arrow's errors into the name of the damaged partition."""
    import pyarrow as pa

    try:
        yield
    except pa.ArrowNotImplementedError as error:
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"the condition compares unlike things: {reason}") from None
    except (pa.ArrowException, OSError):
        raise StoreError(_damaged(library, data.files)) from None


def _damaged(library: Path, parts: Sequence[str]) -> str:
    import pyarrow as pa
    import pyarrow.parquet as pq

    bad = []
    for part in parts:
        try:
            with pq.ParquetFile(part, page_checksum_verification=True) as file:
                for batch in file.iter_batches():
                    del batch
        except (pa.ArrowException, OSError):
            bad.append(Path(part).name)
    names = ", ".join(bad) or "a partition"
    return (
        f"{library}: {names} damaged; delete it and run `magbend analysis library "
        f"build` with the same {MANIFEST}: only what is missing is solved again"
    )


def _batches(data: Any, columns: list[str], condition: Any) -> Iterator[Any]:
    scanner = data.scanner(
        columns=columns, filter=condition, batch_size=131_072, use_threads=True
    )
    yield from scanner.to_batches()


def _first(data: Any, condition: Any, top: int) -> tuple[Array, int]:
    rows = data.scanner(columns=["design"], filter=condition).head(top)
    ids = rows.column("design").to_numpy()
    matched = data.count_rows(filter=condition)
    return np.column_stack([ids, np.zeros(len(ids))]), int(matched)


def _with_total(table: Any) -> Any:
    """Return the table with the length of the whole rod."""
    lengths = [name for name in table.column_names if name.startswith("length")]
    if not lengths or "total_length_mm" in table.column_names:
        return table
    total = np.sum([table.column(name).to_numpy() for name in lengths], axis=0)
    return table.append_column("total_length_mm", [total])


def _rank_nearest(
    data: Any, condition: Any, target: Centreline, top: int
) -> tuple[Array, int]:
    stations = [*STATIONS, 100]
    s_mm = np.array(stations) / 100.0 * target.length_mm + target.s_mm[0]
    x, y = position_at(target, s_mm)
    names = [
        ("tip_x_mm", "tip_y_mm") if p == 100 else (f"x{p}_mm", f"y{p}_mm")
        for p in stations
    ]

    def key(batch: Any) -> Array:
        square = np.zeros(batch.num_rows, dtype=np.float32)
        for percent, (nx, ny), tx, ty in zip(stations, names, x, y, strict=True):
            dx = batch.column(nx).to_numpy() - np.float32(tx)
            dy = batch.column(ny).to_numpy() - np.float32(ty)
            square += np.float32(_BOOLE[percent]) * (dx * dx + dy * dy)
        return np.sqrt(square).astype(np.float64)

    flat = ["design", *(name for pair in names for name in pair)]
    return _best(_batches(data, flat, condition), key, top)


def _best(batches: Iterator[Any], key: Any, top: int) -> tuple[Array, int]:
    """Return (design, key) of the `top` smallest keys, and the number of rows seen."""
    best = np.empty((0, 2))
    worst, matched = np.inf, 0
    for batch in batches:
        matched += batch.num_rows
        if batch.num_rows == 0:
            continue
        values = key(batch)
        good = np.flatnonzero(values < worst)
        if len(good) == 0:
            continue
        if len(good) > top:
            good = good[np.argpartition(values[good], top - 1)[:top]]
        ids = batch.column("design").to_numpy()[good]
        best = np.concatenate([best, np.column_stack([ids, values[good]])])
        best = best[np.argsort(best[:, 1], kind="stable")[:top]]
        if len(best) == top:
            worst = best[-1, 1]
    return best, matched


def _fetch(library: Path, manifest: dict[str, Any], data: Any, ranked: Array) -> Any:
    """Return all columns of designs, in their order; a design's place is its number."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    designs = ranked[:, 0].astype(np.int64)
    if len(designs) == 0:
        return data.schema.empty_table()
    per_part = int(manifest["space"]["partition_rows"])
    part, row = np.divmod(designs, per_part)
    group, row = np.divmod(row, ROW_GROUP)
    tables, places = [], []
    for index in np.unique(part):
        path = partition_path(library, int(index))
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            for number in np.unique(group[part == index]):
                at = np.flatnonzero((part == index) & (group == number))
                rows = file.read_row_group(int(number)).take(pa.array(row[at]))
                tables.append(rows)
                places.append(at)
    table = pa.concat_tables(tables)
    return table.take(pa.array(np.argsort(np.concatenate(places))))
