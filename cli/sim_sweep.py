"""``magbend sim sweep``: the parameter studies, as figures and tables."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .console import print_json, progress, say
from .sim_case import Json, only_with, rod_of

EXAMPLE = "Example: magbend sim sweep field angle --gmc 2 --out studies"
NAMES = ("field", "angle", "stiffness", "length", "side")


def sweep(
    context: typer.Context,
    studies: Annotated[
        list[str] | None,
        typer.Argument(help="field, angle, stiffness, length, side; all by default."),
    ] = None,
    gmc: Annotated[
        int | None, typer.Option(help="Rod of Table 1, 1 to 7; 2 by default.")
    ] = None,
    specimen: Annotated[
        Path | None, typer.Option(help="Specimen file (TOML) instead.")
    ] = None,
    field_mT: Annotated[
        float, typer.Option("--field-mT", help="Flux density where it is kept, in mT.")
    ] = 50.0,
    angle_deg: Annotated[
        float, typer.Option(help="Field angle where it is kept, in deg.")
    ] = 90.0,
    values: Annotated[
        str | None, typer.Option(help="Values of one study: 10,20,30 or 20-5-5,5-5-20.")
    ] = None,
    model: Annotated[str, typer.Option(help="rod or solid.")] = "rod",
    out: Annotated[Path, typer.Option(help="Folder for figures and CSV.")] = Path(
        "sweep"
    ),
    as_json: Json = False,
) -> None:
    """Vary one quantity at a time: a figure (SVG and PDF) and a CSV each."""
    names = list(dict.fromkeys(studies or NAMES))
    unknown = [name for name in names if name not in NAMES]
    if unknown:
        raise typer.BadParameter(f"{unknown[0]!r} is none of {', '.join(NAMES)}")
    only_with(context, "--values", owner="one study: name it", holds=len(names) == 1)
    for option, study in (("--field-mT", "field"), ("--angle-deg", "angle")):
        only_with(
            context, option, owner=f"the studies that keep it, not to {study}",
            holds=names != [study],
        )  # fmt: skip
    from ..core.files import output_folder, write_text
    from ..sim import STUDIES, UniformField, draw_study, sweep_csv
    from ..sim import sweep as solve_study

    rod = rod_of(2 if gmc is None and specimen is None else gmc, specimen)
    if studies is None and len(rod.sections) != 3:
        names.remove("length")  # its default values are for three sections
    field = UniformField(flux_mT=field_mT, angle_deg=angle_deg)
    chosen = [value.strip() for value in values.split(",")] if values else []
    output_folder(out)
    solved = {}
    with progress("sweep") as tell:
        for done, name in enumerate(names, start=1):
            solved[name] = solve_study(name, rod, field, values=chosen, model=model)
            tell(done, len(names))
    title = f"{rod.name}, {field_mT:g} mT at {angle_deg:g} deg"
    rows = []
    for name, shapes in solved.items():
        write_text(out / f"{name}.csv", sweep_csv(name, shapes))
        for suffix in (".svg", ".pdf"):
            draw_study(out / f"{name}{suffix}", name, shapes, title=title)
        for shape in shapes:
            line = shape.solution.centreline
            rows.append(
                {
                    "study": name,
                    "value": shape.value,
                    "unit": STUDIES[name].unit,
                    "status": shape.solution.status,
                    "tip_mm": None if line is None else line.tip_mm,
                    "tip_angle_deg": None if line is None else line.tip_angle_deg,
                }
            )
    if as_json:
        print_json({"folder": str(out), "shapes": rows})
        return
    for row in rows:
        tip = row["tip_mm"]
        where = ""
        if isinstance(tip, tuple):
            where = f"tip ({tip[0]:8.4f}, {tip[1]:8.4f}) mm"
        say(
            f"{row['study']:10s} {row['value']:>10s} {row['unit']:8s} {where}  "
            f"{row['status']}"
        )
    say(f"wrote {', '.join(f'{name}.svg/.pdf/.csv' for name in names)} in {out}")
