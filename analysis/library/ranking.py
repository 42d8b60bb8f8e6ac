"""The best of many rows: by several keys in turn, or none of them beaten in all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from .conditions import parse_value

Array = NDArray[np.float64]


def best(data: Any, condition: Any, keys: Sequence[str], top: int) -> tuple[Array, int]:
    """Return (design, first key) of the first `top` rows, and how many there were."""
    kept = np.empty((0, 1 + len(keys)))
    matched = 0
    for rows in _rows(data, condition, keys):
        matched += len(rows)
        if len(kept) == top:
            rows = rows[rows[:, 1] <= kept[-1, 1]]
        elif len(rows) > top:
            rows = rows[rows[:, 1] <= np.partition(rows[:, 1], top - 1)[top - 1]]
        together = np.concatenate([kept, rows])
        kept = together[np.lexsort(together[:, :0:-1].T)][:top]
    return kept[:, :2], matched


def front(
    data: Any, condition: Any, keys: Sequence[str], top: int
) -> tuple[Array, int]:
    """Return (design, first key) of rows that no other beats in all keys."""
    if len(keys) < 2:
        raise InputError("--pareto needs two keys or more; --sort takes one")
    kept = np.empty((0, 1 + len(keys)))
    matched = 0
    for rows in _rows(data, condition, keys):
        matched += len(rows)
        rows = rows[np.all(np.isfinite(rows), axis=1)]
        kept = _unbeaten(np.concatenate([kept, rows]))
    order = np.argsort(kept[:, 1], kind="stable")[:top]
    return kept[order][:, :2], matched


def _unbeaten(rows: Array) -> Array:
    """Return the rows that no other is as good as in all keys and better in one."""
    left = rows[np.argsort(rows[:, 1:].sum(axis=1), kind="stable")]
    taken = []
    while len(left):
        # Nothing that is left has a smaller sum, so nothing beats the first.
        taken.append(left[0])
        first = left[0, 1:]
        beaten = np.all(left[:, 1:] >= first, axis=1)
        equal = np.all(left[:, 1:] == first, axis=1)
        equal[0] = False
        taken += list(left[equal])
        left = left[~beaten]
    return np.array(taken).reshape(-1, rows.shape[1])


def _rows(data: Any, condition: Any, keys: Sequence[str]) -> Iterator[Array]:
    """Give design and keys of the rows that meet the condition, falling ones negated.

    Raises
    ------
    InputError
        If a key is no number.
    """
    import pyarrow as pa

    names = data.schema.names
    columns = {"design": parse_value("design", names)}
    signs = []
    for number, key in enumerate(keys):
        plain = key.removeprefix("-")
        signs.append(-1.0 if key.startswith("-") else 1.0)
        found = parse_value(plain, names)
        if plain in names and not _is_number(data.schema.field(plain).type, pa):
            raise InputError(f"{plain!r} is no number to rank by")
        columns[f"key{number}"] = found
    scanner = data.scanner(
        columns=columns, filter=condition, batch_size=131_072, use_threads=True
    )
    for batch in scanner.to_batches():
        if batch.num_rows:
            values = [
                batch.column(i).to_numpy(zero_copy_only=False).astype(np.float64)
                for i in range(batch.num_columns)
            ]
            rows = np.column_stack(values)
            rows[:, 1:] *= signs
            yield rows


def _is_number(kind: Any, pa: Any) -> bool:
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))
