"""``magbend analysis lumen``: a run in a printed channel, measured and compared."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import print_json, say

if TYPE_CHECKING:
    from ..analysis import InLumen

EXAMPLE = "Example: magbend analysis lumen runs/fork --friction 0.1"


def lumen(
    run: Annotated[Path, typer.Argument(help="Run folder; its plan has a [lumen].")],
    calibration: Annotated[
        Path | None, typer.Option(help="By default calibration.json in the run.")
    ] = None,
    bare: Annotated[
        Path | None,
        typer.Option(help="The empty channel; by default bare.png in the run."),
    ] = None,
    friction: Annotated[
        float, typer.Option(help="Coefficient of friction, for the simulation.")
    ] = 0.0,
    wall_sd_mm: Annotated[
        float, typer.Option(help="How far the printed walls may be off their file.")
    ] = 0.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Measure a rod in a printed channel, flag its contacts, compare with simulation.

    The channel is found in the picture of it without the rod, and divided out.
    """
    from ..analysis import lumen_table, measure_in_lumen
    from ..core.checks import within

    found = measure_in_lumen(
        run,
        calibration=calibration,
        bare=bare,
        friction=within(friction, 0.0, 2.0, "--friction", ""),
        wall_sd_mm=within(wall_sd_mm, 0.0, 10.0, "--wall-sd-mm", "mm"),
    )
    rows = lumen_table(found)
    if as_json:
        placed = found.placed
        print_json(
            {
                "x_mm": placed.pose.x_mm,
                "y_mm": placed.pose.y_mm,
                "angle_deg": placed.pose.angle_deg,
                "sd_mm": placed.sd_mm,
                "sd_deg": placed.sd_deg,
                "gates": found.gates,
                "steps": rows.where(rows.notna(), None).to_dict("records"),
            }
        )
        return
    _print(run, found)


def _print(folder: Path, found: InLumen) -> None:
    placed = found.placed
    say(
        f"{found.run.specimen.name} in {found.lumen.name}, whose place is known to "
        f"{placed.sd_mm:.3f} mm and {placed.sd_deg:.3f} deg"
    )
    for step in found.run.steps:
        fed_mm = step.settings.get("insertion_mm", 0.0)
        here, held = found.fed.get(step.image), found.agreements.get(step.image)
        if here is None:
            frame = found.run.frames.get(step.image)
            say(f"  {fed_mm:6.2f} mm in: {frame.reason if frame else 'not measured'}")
            continue
        line = "no contact" if not here.touches else ", ".join(
            f"{touch.wall} at {touch.at_mm:.1f} mm" for touch in here.touches
        )  # fmt: skip
        if held is None:
            line += "; the simulated rod does not come so far"
        else:
            line += (
                f"; {held.rms_mm:.3f} mm from the simulated rod, its tip "
                f"{held.tip_mm:.3f} mm; contacts {held.found} of "
                f"{held.found + held.missed}, {held.extra} more"
            )
        say(f"  {fed_mm:6.2f} mm in: {line}")
    if found.lumen.gates:
        say(f"  the tip passed: {', '.join(found.gates) or 'no gate'}")
    say(
        f"wrote {folder}/frames.csv, centrelines.csv, lumen.csv and lumen.png", err=True
    )
