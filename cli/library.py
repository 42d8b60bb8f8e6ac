"""``magbend analysis library build | query``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from .analysis_import import ALIGN, FLIP, UNIT
from .console import JSON, group, print_json, progress, say

app = group(
    "library",
    "Build and search the prediction library.",
    "magbend analysis library build million.toml --out million",
)

BUILD_EXAMPLE = "Example: magbend analysis library build million.toml --out DIR"
QUERY_EXAMPLE = (
    'Example: magbend analysis library query DIR --where "tip_y_mm > 4 and side_mm < 1"'
    " --sort=-circularity --top 10 --out best.csv"
)


@app.command(epilog=BUILD_EXAMPLE)
def build(
    space: Path = typer.Argument(..., help="The design space, TOML."),
    out: Path = typer.Option(..., "--out", help="Folder of the library."),
    scheduler: str | None = typer.Option(
        None,
        "--scheduler",
        help="Dask scheduler, such as tcp://host:8786; workers must see --out. "
        "Trusted networks only: who reaches it can run programs there (--tls).",
    ),
    tls: Path | None = typer.Option(
        None, "--tls", help="Folder with ca.pem, cert.pem and key.pem for Dask."
    ),
    as_json: bool = JSON,
) -> None:
    """Solve a design space into Parquet; go on where an earlier build stopped."""
    from dataclasses import asdict

    from ..analysis import read_space
    from ..analysis.library import build as builder

    what = read_space(space)
    kept = f"{out} keeps the finished partitions; the same command goes on from there"
    with progress("designs", kept=kept) as tell:
        summary = builder.build(what, out, scheduler=scheduler, tls=tls, progress=tell)
    if as_json:
        print_json(asdict(summary))
        return
    solved, total = summary.solved_partitions, summary.partitions
    say(f"{summary.designs} designs in {total} partitions in {out}")
    say(f"{solved} partitions solved now, {total - solved} were there")
    for name in summary.repaired:
        say(f"warning: {name} was damaged and has been solved again", err=True)


@app.command(epilog=QUERY_EXAMPLE)
def query(
    library: Path = typer.Argument(..., help="Folder of the library."),
    where: str | None = typer.Option(None, "--where", help="Condition on columns."),
    ranges: list[str] = typer.Option([], "--range", help="KEY=LOW:HIGH, repeatable."),
    nearest: Path | None = typer.Option(
        None, "--nearest", help="A file with a shape; rank by distance from it."
    ),
    unit: str = UNIT,
    flip: bool = FLIP,
    align: bool = ALIGN,
    sort: list[str] = typer.Option(
        [],
        "--sort",
        help="Column or expression to rank by; --sort=-COLUMN for falling; repeatable.",
    ),
    pareto: list[str] = typer.Option(
        [],
        "--pareto",
        help="Wanted small (--pareto=-COLUMN: large); repeatable: the front of all.",
    ),
    sql: str | None = typer.Option(
        None, "--sql", help="One SELECT over the table designs, instead of the others."
    ),
    top: int = typer.Option(20, "--top", help="How many rows."),
    out: Path | None = typer.Option(None, "--out", help=".csv or .parquet."),
    as_json: bool = JSON,
) -> None:
    """Search a library: conditions, nearest shape, sort, the best few."""
    from ..analysis import Reading, ask, read_shape
    from ..analysis.library import query as searching
    from ..core.errors import InputError
    from ..core.files import output_file

    shape = None
    if nearest is not None:
        how = Reading(unit=unit, flip=flip, align=align)
        shape = read_shape(str(nearest), Path(), how).line
    if out is not None:
        output_file(out)
    if sql is not None:
        if where or ranges or sort or pareto or nearest:
            raise InputError("--sql stands alone; give its conditions in the SELECT")
        _show_sql(ask(library, sql, top=top), out, as_json)
        return
    found = searching.query(
        library, where=where, ranges=ranges, nearest=shape, sort=sort, pareto=pareto,
        top=top,
    )  # fmt: skip
    if found.missing_partitions:
        say(
            f"warning: {found.missing_partitions} partitions are not built yet; "
            "the answer covers the others",
            err=True,
        )
    if out is not None:
        searching.write_rows(found, out)
    if as_json:
        print_json(
            {
                "designs": found.designs,
                "matched": found.matched,
                "rows": found.table.to_pylist(),
            }
        )
        return
    say(f"{found.matched} of {found.designs} designs match")
    if out is None:
        _print_table(found.table.to_pylist())


def _show_sql(table: Any, out: Path | None, as_json: bool) -> None:
    from ..analysis import write_table

    if out is not None:
        write_table(table, out)
    elif as_json:
        print_json(table.to_pylist())
    else:
        _print_table(table.to_pylist())


def _print_table(rows: list[dict[str, object]]) -> None:
    if not rows:
        return
    hidden = ("x25", "y25", "x50", "y50", "x75", "y75", "a_misfit", "error")
    names = [name for name in rows[0] if not name.startswith(hidden)]
    cells = [[_cell(row[name]) for name in names] for row in rows]
    lines = zip(names, *cells, strict=True)
    widths = [max(len(cell) for cell in column) for column in lines]
    for line in [names, *cells]:
        padded = (c.rjust(w) for c, w in zip(line, widths, strict=True))
        say("  ".join(padded))


def _cell(value: object) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)
