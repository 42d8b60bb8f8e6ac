"""``magbend rig run|verify|scan-field|init``."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.checks import finite, positive
from ..core.errors import InputError, StoreError
from .console import print_json, progress, say
from .rig_bench import asks_flux, connect_computed, needs_twin, open_bench
from .rig_flux import require_plausible
from .rig_show import print_dry_run, print_scan, print_summary

if TYPE_CHECKING:
    from ..rig import Devices, Plan, RunControl, RunSummary

RUN_EXAMPLE = "Example: magbend rig run plan.toml --out runs/gmc2"
VERIFY_EXAMPLE = "Example: magbend rig verify runs/gmc2"
SCAN_EXAMPLE = "Example: magbend rig scan-field plan.toml --out scans/magnet"
INIT_EXAMPLE = "Example: magbend rig init bench"

PlanFile = Annotated[Path, typer.Argument(help="Plan file (TOML).")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
Twin = Annotated[
    bool, typer.Option("--twin", help="Rehearse on the computed bench; no device.")
]
Seed = Annotated[int, typer.Option(min=0, help="Which hidden truth the twin gets.")]
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
    live_port: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="Show camera and state on this port of 127.0.0.1; 0: any.",
        ),
    ] = None,
    twin: Twin = False,
    seed: Seed = 1,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Let the twin's clock go so many times as fast as the wall's; by "
            "default a run takes as long as it computes."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Carry a plan out and record it.

    At each gap: approach, settle, measure the field, photograph.

    Ctrl-C holds the stage and ends the run (again: at once); p pauses it, and so do
    the signal USR1 and magbend rig pause. What was recorded stays: --resume homes the
    stage, checks its position and takes the missing steps.
    """
    from ..rig import read_plan

    checked = read_plan(plan)
    readings_mT = _readings_mT(flux_mT, checked.gaps_mm)
    if assume_gap_mm is not None:
        finite(assume_gap_mm, "--assume-gap-mm", "mm")
    if speed is not None:
        positive(speed, "--speed")
    folder = None if dry_run else _run_folder(checked, out, resume)
    twin_seed = _twin_seed(checked, twin, seed, readings_mT)
    if speed is not None and twin_seed is None:
        raise InputError("--speed is of the twin's clock; real time has one speed")
    if readings_mT:
        require_plausible(checked, readings_mT)
    if folder is None:
        if twin_seed is not None:
            connect_computed(checked, twin_seed)
        print_dry_run(checked, as_json)
        return
    summary = _carry_out(
        checked, folder, resume, readings_mT, assume_gap_mm, twin_seed, live_port, speed
    )
    print_summary(summary, as_json)
    if summary.status != "success":
        raise typer.Exit(1)


def verify(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    as_json: Json = False,
) -> None:
    """Check that a run is whole and unaltered.

    Every file of the folder is good, altered, missing, extra, or made from an older
    input; and the steps are as the plan says.
    """
    from dataclasses import asdict

    from ..rig import check_run

    check = check_run(run)
    record = check.run
    if as_json:
        print_json(
            {
                "run": str(run),
                "problems": check.problems,
                "status": record.status if record else None,
                "steps": len(record.steps) if record else None,
                "schema": record.schema if record else None,
                "files": [asdict(one) for one in check.files],
            }
        )
    else:
        for problem in check.problems:
            say(problem)
        for warning in record.warnings if record else ():
            say(f"{run}: {warning}", err=True)
        if record and not check.problems:
            say(
                f"{run}: good, {len(record.steps)} steps, {record.status}, "
                f"{len(check.files)} files"
            )
    if check.problems:
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
    """Read the field along the stage; fit the magnet.

    The probe stands in place of the rod. Writes field.csv (gap_mm,flux_mT,sd_mT,n) and,
    with two good readings or more and a magnet in the rig file, field.svg and the
    remanence.
    """
    from ..rig import read_plan

    checked = read_plan(plan)
    gaps = tuple(_numbers(gaps_mm, "--gaps-mm")) if gaps_mm else checked.gaps_mm
    folder = out or Path("scans") / _dated_name(checked)
    readings_mT = _readings_mT(flux_mT, gaps)
    twin_seed = _twin_seed(checked, twin, seed, readings_mT)
    from ..rig import scan_field as scan

    with (
        open_bench(checked, folder, readings_mT, twin_seed, camera=False) as devices,
        progress("scan") as tell,
    ):
        _assume(devices, assume_gap_mm)
        found = scan(
            devices, gaps, folder, samples=samples, report=_report, progress=tell
        )
    print_scan(checked, found, tolerance_percent, as_json)


def init(
    folder: Annotated[Path, typer.Argument(help="Folder for the files.")] = Path(),
    twin: Annotated[
        bool, typer.Option("--twin", help="Files that run on the computed bench.")
    ] = False,
) -> None:
    """Write commented rig, plan and specimen files."""
    from ..rig import write_templates

    for path in write_templates(folder, twin=twin):
        say(str(path))


def _report(line: str) -> None:
    """Write a line above the progress bar; a leading bell is rung in a terminal."""
    terminal = sys.__stderr__
    if line.startswith("\a") and terminal is not None and terminal.isatty():
        terminal.write("\a")  # the bar's own stream would strip it
        terminal.flush()
    sys.stderr.write(line.lstrip("\a") + "\n")


def _report_twin(line: str) -> None:
    bell = "\a" if line.startswith("\a") else ""
    _report(f"{bell}twin: {line.lstrip(bell)}")


def _run_folder(plan: Plan, out: Path | None, resume: bool) -> Path:
    """Return where the run goes; refuse to touch one that is there."""
    from ..rig import is_run

    if out is None and resume:
        raise InputError(
            "--resume needs --out: name the folder of the run that is to go on"
        )
    folder = out or Path("runs") / _dated_name(plan)
    if resume and not is_run(folder):
        raise StoreError(
            f"{folder}: holds no run that could go on (there is no run.json); name the "
            f"folder of the run with --out, or leave --resume out to begin one"
        )
    if is_run(folder) and not resume:
        raise StoreError(
            f"{folder}: holds a run already; add --resume to go on with it, or name "
            f"another folder with --out"
        )
    return folder


def _twin_seed(
    plan: Plan, twin: bool, seed: int, readings_mT: dict[float, float] | None
) -> int | None:
    """Return the seed of the computed bench, or None for the real one."""
    if not (twin or needs_twin(plan)):
        return None
    if readings_mT is not None:
        raise InputError(
            "--flux-mT gives readings of a hand meter, but the computed bench has a "
            "meter of its own; leave one of the two out"
        )
    return seed


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
    if len(set(gaps_mm)) != len(gaps_mm):
        raise InputError(
            "--flux-mT gives readings by gap, and this plan visits a gap more than "
            "once; leave it out and type each reading when you are asked"
        )
    return dict(zip(gaps_mm, values, strict=True))


def _carry_out(
    plan: Plan,
    folder: Path,
    resume: bool,
    readings_mT: dict[float, float] | None,
    assume_gap_mm: float | None,
    twin_seed: int | None,
    live_port: int | None,
    speed: float | None,
) -> RunSummary:
    from ..analysis import witness_of
    from ..rig import RunControl
    from ..rig import run as carry_out
    from .keys import pausing, terminating

    control = RunControl()
    keys = not asks_flux(plan, readings_mT)
    with (
        terminating(),
        open_bench(
            plan, folder, readings_mT, twin_seed, control=control, speed=speed
        ) as devices,
        pausing(control, keys=keys),
        _watching(devices, live_port, control, twin_seed is not None) as report,
        progress(plan.model.name, plain=not keys) as tell,
    ):
        _assume(devices, assume_gap_mm)
        if twin_seed is not None:
            report("this is the computed bench: no device is opened")
        for note in devices.notes:
            report(f"note: {note}")
        return carry_out(
            plan, devices, folder, resume=resume, twin=twin_seed is not None,
            control=control, report=report, progress=tell, witness=witness_of(plan),
        )  # fmt: skip


@contextlib.contextmanager
def _watching(
    devices: Devices, port: int | None, control: RunControl, is_twin: bool
) -> Iterator[Callable[[str], None]]:
    """Yield where the run reports to; with a port, a page in the browser too.

    Every line of the computed bench says that it is one.
    """
    say = _report_twin if is_twin else _report
    if port is None:
        yield say
        return
    from ..rig import LiveStatus, Watched, live_view

    if not isinstance(devices.camera, Watched):
        raise InputError("--live-port needs a camera or stream; files are not watched")
    status = LiveStatus()

    def report(line: str) -> None:
        status.report(f"twin: {line}" if is_twin else line)
        say(line)

    now_s = devices.clock.monotonic_s
    with live_view(devices.camera, status, now_s, port=port) as address:
        _report(f"live view: {address}")
        control.state.tell(live_view=address)
        yield report


def _assume(devices: Devices, gap_mm: float | None) -> None:
    if gap_mm is not None:
        devices.stage.assume_gap(gap_mm, for_run=True)
