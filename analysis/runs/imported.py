"""Shapes that another program simulated for the steps of an imported run."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...core.centreline import COLUMNS, Centreline
from ...core.errors import ConfigError, InputError, StoreError
from ...core.table import read_table

FILE = "imported.csv"
"""One row a point: step and the columns of a centreline."""


def imported_table(shapes: dict[int, Centreline]) -> str:
    """Return the text of ``imported.csv``: all digits, so that nothing is lost."""
    lines = [",".join(("step", *COLUMNS))]
    for index, line in shapes.items():
        columns = np.column_stack([getattr(line, name) for name in COLUMNS])
        lines += [
            f"{index}," + ",".join(f"{value:.17g}" for value in row) for row in columns
        ]
    return "\n".join(lines) + "\n"


def read_imported(run: Path) -> dict[int, Centreline]:
    """Return the simulated shapes of a run by step; none where it has no such file.

    Raises
    ------
    StoreError
        If the file cannot be used.
    """
    path = run / FILE
    if not path.is_file():
        return {}
    try:
        table = read_table(path, limit_MB=1024.0)
        table.require("step", *COLUMNS)
        steps = table.numbers("step")
        columns = {name: table.numbers(name) for name in COLUMNS}
        return {
            int(step): Centreline(**{n: c[steps == step] for n, c in columns.items()})
            for step in np.unique(steps)
        }
    except ConfigError as error:
        raise StoreError(str(error)) from None
    except InputError as error:
        raise StoreError(f"{path}: holds a line that cannot be used: {error}") from None
