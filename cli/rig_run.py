"""``magbend rig run|verify|scan-field|init``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import InputError, RigError, StoreError
from .console import print_json, progress
from .rig_bench import needs_twin, open_bench

if TYPE_CHECKING:
    from ..rig.config import Plan
    from ..rig.devices import Devices
    from ..rig.runner import RunSummary
    from ..rig.scan_field import FieldScan

RUN_EXAMPLE = "Example: magbend rig run plan.toml --out runs/gmc2"
VERIFY_EXAMPLE = "Example: magbend rig verify runs/gmc2"
SCAN_EXAMPLE = "Example: magbend rig scan-field plan.toml --out scans/magnet"
INIT_EXAMPLE = "Example: magbend rig init bench"

PlanFile = Annotated[Path, typer.Argument(help="Plan file (TOML).")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
Twin = Annotated[
    bool, typer.Option("--twin", help="Rehearse on the computed bench; no device.")
]
Seed = Annotated[int, typer.Option(help="Which hidden truth the twin gets.")]
Manual = Annotated[
    str,
    typer.Option(
        "--flux-mT", help="Readings of a hand meter, one a gap: 38,50,66 (in mT)."
    ),
]
AssumeGap = Annotated[
    float | None,
    typer.Option(help="Your word that the stage stands at this gap (manual homing)."),
]


def register(app: typer.Typer) -> None:
    """Add the commands of this module to the group ``rig``."""
    app.command("run", epilog=RUN_EXAMPLE)(run)
    app.command("verify", epilog=VERIFY_EXAMPLE)(verify)
    app.command("scan-field", epilog=SCAN_EXAMPLE)(scan_field)
    app.command("init", epilog=INIT_EXAMPLE)(init)


def run(
    plan: PlanFile,
    out: Annotated[
        Path | None, typer.Option(help="Run folder; by default runs/<date>_<name>.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the run in --out.")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print what would happen; move nothing.")
    ] = False,
    flux_mT: Manual = "",
    assume_gap_mm: AssumeGap = None,
    twin: Twin = False,
    seed: Seed = 1,
    as_json: Json = False,
) -> None:
    """Carry a plan out: approach, settle, measure the field, photograph, record.

    Ctrl-C holds the stage and ends the run (again: at once); p pauses it, and so does
    the signal USR1 or a file named pause in the run folder. What was recorded stays:
    --resume homes the stage, checks its position and takes the missing steps.
    """
    from ..rig.config import read_plan

    checked = read_plan(plan)
    if dry_run:
        _print_dry_run(checked, as_json)
        return
    folder = _run_folder(checked, out, resume)
    readings_mT = _readings_mT(flux_mT, checked.gaps_mm)
    summary = _carry_out(
        checked, folder, resume, readings_mT, assume_gap_mm, twin, seed
    )
    _print_summary(summary, as_json)
    if summary.status != "success":
        raise typer.Exit(1)


def verify(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    as_json: Json = False,
) -> None:
    """Check that every file of a run is present and unaltered."""
    from ..rig.read_run import read_run
    from ..rig.verify import verify_run

    problems = verify_run(run)
    record = None if problems else read_run(run)
    if as_json:
        print_json(
            {
                "run": str(run),
                "problems": problems,
                "status": record.status if record else None,
                "steps": len(record.steps) if record else None,
            }
        )
    else:
        for problem in problems:
            typer.echo(problem)
        if record:
            typer.echo(f"{run}: good, {len(record.steps)} steps, {record.status}")
    if problems:
        raise typer.Exit(1)


def scan_field(
    plan: PlanFile,
    out: Annotated[
        Path | None, typer.Option(help="Folder; by default scans/<date>_<name>.")
    ] = None,
    gaps_mm: Annotated[
        str, typer.Option(help="Other gaps than the plan's, far to near: 100,90,80.")
    ] = "",
    samples: Annotated[int, typer.Option(min=1, help="Readings at each gap.")] = 20,
    tolerance_percent: Annotated[
        float, typer.Option(help="How far a reading may be off the magnet, in percent.")
    ] = 1.0,
    flux_mT: Manual = "",
    assume_gap_mm: AssumeGap = None,
    twin: Twin = False,
    seed: Seed = 1,
    as_json: Json = False,
) -> None:
    """Read the field along the stage, the probe in place of the rod; fit the magnet.

    Writes field.csv (gap_mm,flux_mT,sd_mT,n) and, with two good readings or more and a
    magnet in the rig file, field.svg and the remanence.
    """
    from ..rig.config import read_plan

    checked = read_plan(plan)
    gaps = tuple(_numbers(gaps_mm, "--gaps-mm")) if gaps_mm else checked.gaps_mm
    folder = out or Path("scans") / _dated_name(checked)
    readings_mT = _readings_mT(flux_mT, gaps)
    is_twin = twin or needs_twin(checked)
    from ..rig.scan_field import scan_field as scan

    with (
        open_bench(
            checked, folder, readings_mT, seed if is_twin else None, camera=False
        ) as devices,
        progress("scan") as tell,
    ):
        _assume(devices, assume_gap_mm)
        found = scan(
            devices, gaps, folder, samples=samples, report=_report, progress=tell
        )
    _print_scan(checked, found, tolerance_percent, as_json)


def init(
    folder: Annotated[Path, typer.Argument(help="Folder for the files.")] = Path(),
    twin: Annotated[
        bool, typer.Option("--twin", help="Files that run on the computed bench.")
    ] = False,
) -> None:
    """Write a commented rig, plan and specimen file to begin with."""
    from ..rig.template import write_templates

    for path in write_templates(folder, twin=twin):
        typer.echo(str(path))


def _report(line: str) -> None:
    typer.echo(line, err=True)


def _run_folder(plan: Plan, out: Path | None, resume: bool) -> Path:
    """Return where the run goes; refuse to touch one that is there."""
    from ..rig.read_run import is_run

    if out is None and resume:
        raise InputError(
            "--resume needs --out: name the folder of the run that is to go on"
        )
    folder = out or Path("runs") / _dated_name(plan)
    if is_run(folder) and not resume:
        raise StoreError(
            f"{folder}: holds a run already; add --resume to go on with it, or name "
            f"another folder with --out"
        )
    return folder


def _dated_name(plan: Plan) -> str:
    import re
    from datetime import datetime

    name = re.sub(r"[^\w.-]+", "-", plan.model.name).strip("-") or "run"
    return f"{datetime.now().astimezone():%Y-%m-%d}_{name}"


def _numbers(text: str, option: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            f"{option} must be numbers with commas between them, such as 38,50,66; "
            f"instead received {text!r}"
        ) from None


def _readings_mT(text: str, gaps_mm: tuple[float, ...]) -> dict[float, float] | None:
    if not text:
        return None
    values = _numbers(text, "--flux-mT")
    if len(values) != len(gaps_mm):
        raise InputError(
            f"--flux-mT must give one reading a gap ({len(gaps_mm)}); instead received "
            f"{len(values)}"
        )
    return dict(zip(gaps_mm, values, strict=True))


def _carry_out(
    plan: Plan,
    folder: Path,
    resume: bool,
    readings_mT: dict[float, float] | None,
    assume_gap_mm: float | None,
    twin: bool,
    seed: int,
) -> RunSummary:
    from ..rig.control import RunControl
    from ..rig.runner import run as carry_out
    from .keys import pausing, terminating

    control = RunControl(folder)
    is_twin = twin or needs_twin(plan)
    with (
        terminating(),
        open_bench(plan, folder, readings_mT, seed if is_twin else None) as devices,
        pausing(control),
        progress(plan.model.name) as tell,
    ):
        _assume(devices, assume_gap_mm)
        return carry_out(
            plan, devices, folder, resume=resume, twin=is_twin, control=control,
            report=_report, progress=tell,
        )  # fmt: skip


def _assume(devices: Devices, gap_mm: float | None) -> None:
    if gap_mm is not None:
        devices.stage.assume_gap(gap_mm)


def _print_dry_run(plan: Plan, as_json: bool) -> None:
    from ..rig.dry_run import homing_s, plan_steps

    steps = plan_steps(plan)
    previews: dict[int, Any] = {}
    if plan.rig.magnet is not None:
        from ..analysis.plan_preview import preview_plan

        magnet = plan.rig.magnet.magnet()
        found = preview_plan(plan.specimen, magnet, plan.gaps_mm)
        previews = dict(enumerate(found))
    total_s = homing_s(plan) + sum(step.time_s for step in steps)
    rows = []
    for step in steps:
        preview = previews.get(step.index)
        tip = preview.tip_mm if preview else None
        rows.append(
            {
                "index": step.index,
                "gap_mm": step.gap_mm,
                "stage_mm": step.stage_mm,
                "move_mm": step.move_mm,
                "time_s": step.time_s,
                "predicted_flux_mT": preview.flux_mT if preview else None,
                "predicted_tip_x_mm": tip[0] if tip else None,
                "predicted_tip_y_mm": tip[1] if tip else None,
                "predicted_status": preview.status if preview else None,
            }
        )
    if as_json:
        print_json({"name": plan.model.name, "total_s": total_s, "steps": rows})
        return
    typer.echo(f"{plan.model.name}: {plan.specimen.name} on {plan.rig.name}")
    typer.echo("step  gap mm  stage mm  move mm   time s  flux mT  tip x, y mm")
    for row in rows:
        typer.echo(_dry_line(row))
    typer.echo(
        f"about {total_s / 60.0:.0f} min with homing; every gap is inside the limits; "
        f"nothing was moved"
    )


def _dry_line(row: dict[str, Any]) -> str:
    line = (
        f"{row['index'] + 1:4d} {row['gap_mm']:7.2f} {row['stage_mm']:9.2f} "
        f"{row['move_mm']:8.2f} {row['time_s']:8.1f}"
    )
    if row["predicted_flux_mT"] is None:
        return line + "        -  (no [magnet] in the rig file)"
    line += f" {row['predicted_flux_mT']:8.2f}"
    if row["predicted_tip_x_mm"] is None:
        return line + f"  {row['predicted_status']}"
    tip = f"  {row['predicted_tip_x_mm']:.2f}, {row['predicted_tip_y_mm']:.2f}"
    doubt = row["predicted_status"]
    return line + tip + (f"  ({doubt})" if doubt != "stable" else "")


def _print_summary(summary: RunSummary, as_json: bool) -> None:
    if as_json:
        print_json(
            {
                "run": str(summary.path),
                "status": summary.status,
                "reason": summary.reason,
                "steps_done": summary.steps_done,
                "steps_total": summary.steps_total,
                "flagged": list(summary.flagged),
            }
        )
        return
    if summary.status == "success":
        typer.echo(str(summary.path))
        return
    typer.echo(
        f"magbend: {summary.status}: {' '.join(summary.reason.split())} "
        f"({summary.steps_done} of {summary.steps_total} steps are recorded in "
        f"{summary.path}; go on with --resume --out {summary.path})",
        err=True,
    )


def _print_scan(
    plan: Plan, found: FieldScan, tolerance_percent: float, as_json: bool
) -> None:
    data: dict[str, Any] = {
        "field": str(found.path),
        "readings": len(found.gaps_mm),
        "skipped": list(found.skipped),
    }
    lines = [str(found.path), *(f"no reading at {line}" for line in found.skipped)]
    if plan.rig.magnet is not None and len(found.gaps_mm) >= 2:
        from ..analysis.field_scan import judge_scan

        judged = judge_scan(
            found.path, found.gaps_mm, found.flux_mT, found.sd_mT,
            plan.rig.magnet.magnet(), tolerance_percent=tolerance_percent,
        )  # fmt: skip
        data["magnet"] = judged.as_dict()
        lines += judged.lines()
    if as_json:
        print_json(data)
    else:
        typer.echo("\n".join(lines))
    if not found.gaps_mm:
        raise RigError(
            "not one gap has a reading; check the range of the meter and its port"
        )
