"""``magbend analysis import``: other people's photographs and shapes become a run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..core.errors import InputError
from .console import JSON, print_json, progress, say

if TYPE_CHECKING:
    from ..analysis import ImportedRun

UNIT = typer.Option("", "--unit", help="Unit of lengths in files of shapes: mm, m, um.")
SCALE = typer.Option(None, "--mm-per-px", help="Scale of shapes in pixels.")
ANGLES = typer.Option(
    "", "--angles", help="Unit of theta in files of shapes: deg, rad."
)
FLIP = typer.Option(False, "--flip", help="Mirror shapes: y points down there.")
ALIGN = typer.Option(
    False, "--align", help="Move shapes to the clamp and turn them to +x."
)


def register(app: typer.Typer) -> None:
    """Add the command to the group."""
    app.command(
        "import",
        epilog="Example: magbend analysis import photos/steps.csv "
        "--specimen gmc2.toml --magnet cube.toml --out runs/ours",
    )(import_)


def import_(
    table: Path = typer.Argument(
        ...,
        help="CSV or Excel, one row a step: photograph or centreline, gap_mm, flux_mT, "
        "simulated; or a folder of photographs, for which such a table is written.",
    ),
    specimen: Path = typer.Option(
        None, "--specimen", help="The nominal rod, TOML; or a column of the table."
    ),
    out: Path = typer.Option(None, "--out", help="The run folder that is made."),
    magnet: Path = typer.Option(None, "--magnet", help="The magnet, TOML."),
    calibration: Path = typer.Option(
        None, "--calibration", help="calibration.json of the camera; copied."
    ),
    unit: str = UNIT,
    mm_per_px: float = SCALE,
    angles: str = ANGLES,
    flip: bool = FLIP,
    align: bool = ALIGN,
    report: bool = typer.Option(
        False, "--report", help="Also measure the photographs, compare and report."
    ),
    rod_height_mm: float = typer.Option(
        None, "--rod-height-mm", help="With --report: as for vision extract."
    ),
    name: str = typer.Option("", "--name", help="Of the run; the table's if empty."),
    json: bool = JSON,
) -> None:
    """Make a run of a table of photographs or shapes, with gaps and readings."""
    from ..analysis import Reading, import_table, report_imported, write_template

    if table.is_dir():
        _template(write_template(table), as_json=json)
        return
    if out is None:
        raise InputError("the import needs --out with the run folder to make")
    done = import_table(
        table,
        out,
        specimen_file=specimen,
        magnet_file=magnet,
        calibration_file=calibration,
        how=Reading(
            unit=unit, mm_per_px=mm_per_px, angles=angles, flip=flip, align=align
        ),
        name=name,
    )
    page = ""
    if report:
        html = (done[0].path if len(done) == 1 else out) / "report.html"
        with progress("report", kept=f"{out} holds what was imported") as tell:
            page = str(
                report_imported(done, html, rod_height_mm=rod_height_mm, progress=tell)
            )
    if json:
        print_json({"runs": [_as_dict(run) for run in done], "html": page or None})
    else:
        _tell(done, out, calibration, page)


def _as_dict(run: ImportedRun) -> dict[str, Any]:
    return {
        "run": str(run.path),
        "steps": run.steps,
        "centrelines": run.centrelines,
        "simulated": run.simulated,
        "notes": list(run.notes),
    }


def _tell(
    done: list[ImportedRun], out: Path, calibration: Path | None, page: str
) -> None:
    for run in done:
        for note in run.notes:
            say(f"note: {note}", err=True)
        say(
            f"{run.path}: {run.steps} steps, {run.centrelines} centrelines, "
            f"{run.simulated} simulated shapes"
        )
    if page:
        say(page)
        return
    if all(run.centrelines for run in done):
        say(f"next: magbend analysis report {out}")
        return
    for run in done:
        file = run.path / "calibration.json" if calibration else "CALIBRATION"
        say(
            f"next: magbend vision extract {run.path} --calibration {file} "
            f"--out {run.path}"
        )


def _template(path: Path, *, as_json: bool) -> None:
    if as_json:
        print_json({"table": str(path)})
        return
    say(
        f"{path}: fill in gaps and readings, then magbend analysis import {path} "
        "--specimen S.toml --out RUN"
    )
