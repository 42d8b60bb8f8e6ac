"""SQL over a library (DuckDB), for what conditions and one sort key cannot say.

The library is the table ``designs``: its columns, and ``total_length_mm``. A query
reads nothing else and writes nothing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...core.errors import InputError, MissingExtraError
from .query import open_library


def ask(library: Path, sql: str, *, top: int = 1000) -> Any:
    """Return the rows of one SELECT, as an Arrow table of at most `top` rows.

    Parameters
    ----------
    library : Path
        Folder of a build.
    sql : str
        One SELECT over the table ``designs``.
    top : int
        More rows than these are not returned.

    Raises
    ------
    InputError
        If it is no single SELECT, or DuckDB cannot run it.
    MissingExtraError
        If DuckDB is not installed.
    """
    try:
        import duckdb
    except ImportError:
        raise MissingExtraError("duckdb", "library", "SQL over a library") from None
    data, _, _ = open_library(library)
    lengths = [name for name in data.schema.names if name.startswith("length")]
    with duckdb.connect(":memory:") as connection:
        connection.register("raw", data)
        connection.execute(
            f"CREATE VIEW designs AS SELECT *, {' + '.join(lengths)} AS "
            "total_length_mm FROM raw"
        )
        connection.execute("SET enable_external_access = false")
        connection.execute("SET lock_configuration = true")
        try:
            statements = connection.extract_statements(sql)
            if [one.type for one in statements] != [duckdb.StatementType.SELECT]:
                raise InputError(
                    "--sql must be one SELECT over the table designs; instead "
                    f"received {sql!r}"
                )
            return connection.sql(statements[0].query).to_arrow_table().slice(0, top)
        except duckdb.Error as error:
            reason = " ".join(str(error).split())[:200]
            raise InputError(f"--sql cannot be run: {reason}") from None
