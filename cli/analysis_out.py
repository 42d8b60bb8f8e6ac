"""``magbend analysis figures|export|package``: what leaves for papers and programs."""

from __future__ import annotations

from pathlib import Path

import typer

from .analysis_runs import compared
from .console import JSON, print_json, progress, say
from .run_options import RUNS, UNVERIFIED, loaded_runs, tell_left_out

_NO_FIT = typer.Option(False, "--no-fit", help="Leave the fit out.")


def register(app: typer.Typer) -> None:
    """Add the commands to the group."""
    for command, example in (
        (figures, "magbend analysis figures runs/gmc2 --width-mm 88 --out figures"),
        (export, "magbend analysis export runs/gmc2 --out gmc2.mat"),
        (package, "magbend analysis package runs/* --author 'A. Name' --out paper.zip"),
    ):
        app.command(epilog=f"Example: {example}")(command)


def figures(
    runs: list[Path] = RUNS,
    out: Path = typer.Option(..., "--out", help="Folder for SVG, PDF and CSV of each."),
    width_mm: float = typer.Option(
        181.0, "--width-mm", help="181 for two columns of a journal, 88 for one."
    ),
    no_fit: bool = _NO_FIT,
    unverified: bool = UNVERIFIED,
    json: bool = JSON,
) -> None:
    """Write the figures a journal takes, with their numbers and a methods text."""
    from ..analysis import try_fit, write_figures
    from ..core.checks import within

    within(width_mm, 60.0, 400.0, "--width-mm", "mm")
    loaded, left_out = loaded_runs(runs, unverified=unverified)
    done = compared(loaded, left_out, "rod")
    fits = [None if no_fit else try_fit(run.run, run.support) for run in done]
    written = write_figures(done, out, fits=fits, width_mm=width_mm)
    if json:
        print_json({"files": [str(path) for path in written], "left_out": left_out})
        return
    for path in written:
        say(str(path))
    tell_left_out(left_out, len(done))


def export(
    runs: list[Path] = RUNS,
    out: Path = typer.Option(
        ...,
        "--out",
        help="NAME.mat, .parquet, .csv, .h5 or .nxs (NeXus), .txt (COMSOL), or a "
        "folder for the first three.",
    ),
    unverified: bool = UNVERIFIED,
) -> None:
    """Export points, steps and comparisons for other programs."""
    from ..analysis import check_export, export_runs

    loaded, left_out = loaded_runs(runs, unverified=unverified)
    check_export(out)
    done = compared(loaded, left_out, "rod")
    for path in export_runs(done, out):
        say(str(path))
    tell_left_out(left_out, len(done))


def package(
    runs: list[Path] = RUNS,
    out: Path = typer.Option(..., "--out", help="The package, NAME.zip."),
    title: str = typer.Option("", "--title", help="Of the data; the runs' if empty."),
    author: list[str] = typer.Option([], "--author", help="A name; repeatable."),
    licence: str = typer.Option(
        "", "--license", help="Name or address, such as CC-BY-4.0."
    ),
    citation: str = typer.Option("", "--citation", help="Of the paper."),
    no_fit: bool = _NO_FIT,
    unverified: bool = UNVERIFIED,
    json: bool = JSON,
) -> None:
    """Pack runs, tables and figures as an RO-Crate for a paper's supplement."""
    from ..analysis import Description, try_fit, write_package

    loaded, left_out = loaded_runs(runs, unverified=unverified)
    done = compared(loaded, left_out, "rod")
    fits = [None if no_fit else try_fit(run.run, run.support) for run in done]
    names = ", ".join(dict.fromkeys(run.run.specimen.name for run in done))
    described = Description(
        title=title or f"Bending of {names} in a magnetic field",
        authors=tuple(author),
        licence=licence,
        citation=citation,
    )
    with progress("package") as tell:
        files = write_package(done, out, described, fits=fits, progress=tell)
    if json:
        print_json({"package": str(out), "files": files, "left_out": left_out})
        return
    many = "1 run" if len(done) == 1 else f"{len(done)} runs"
    say(f"{out}: {files} files of {many}")
    tell_left_out(left_out, len(done))
