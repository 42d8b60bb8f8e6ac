"""Carry a plan out and record it: begin or resume a run, and say how it ended."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ...core.owned import owning_folder
from ...core.progress import Progress, silent
from ..bench.config import Plan
from ..bench.devices import Devices
from ..interrupts import heed_interrupts
from .control import Report, RunControl, quiet
from .folder import RunFolder
from .manifest import make_manifest, require_same
from .map_check import require_same_map
from .read import is_run, read_run
from .session import Session
from .witness import NoWitness, Witness

NO_WITNESS = NoWitness()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSummary:
    """How a run, or one session of it, ended.

    Parameters
    ----------
    path : Path
        The run folder.
    status : str
        ``success``, ``abort`` (asked for) or ``fail``.
    reason : str
        One sentence.
    steps_done, steps_total : int
        Recorded and planned steps.
    flagged : tuple of str
        ``step 2: settle_timeout`` and the like.
    """

    path: Path
    status: str
    reason: str
    steps_done: int
    steps_total: int
    flagged: tuple[str, ...]


def run(
    plan: Plan,
    devices: Devices,
    out: Path,
    *,
    resume: bool = False,
    twin: bool = False,
    control: RunControl | None = None,
    witness: Witness = NO_WITNESS,
    report: Report = quiet,
    progress: Progress = silent,
) -> RunSummary:
    """Carry a plan out and record it.

    Parameters
    ----------
    plan : Plan
        From `config.read_plan`: checked against limits before this is called.
    devices : Devices
        Open and connected; they stay open.
    out : Path
        The run folder, made here.
    resume : bool
        Go on with the run in `out`: home, check the position against the last finished
        step, and take the missing steps.
    twin : bool
        Written into the manifest: the bench is computed.
    control : RunControl, optional
        How people pause the run.
    witness : Witness, optional
        Who judges the readings: `magbend.analysis.runs.witness.FieldWitness`.
    report, progress : callable
        Told what happens, and how many steps are done.

    Returns
    -------
    RunSummary
        Also of a run that was aborted or failed.

    Raises
    ------
    StoreError
        If the folder cannot be begun or resumed; nothing moved.
    StageError
        If a gap of the plan is refused; nothing moved.

    Notes
    -----
    While it runs, in the main thread, the first Ctrl-C (or SIGTERM, or SIGHUP) asks
    the run to stop, and the second one stops the stage at once (see `heed_interrupts`).
    """
    for gap_mm in plan.gaps_mm:
        devices.stage.check_gap(gap_mm)
    with (
        owning_folder(out, "run", "rig run", ours=is_run),
        heed_interrupts(devices.stage.request_stop) as received,
    ):
        manifest = make_manifest(plan, devices, twin=twin)
        is_resumed = resume and is_run(out)
        if is_resumed:
            begun = read_run(out).manifest
            require_same(begun, manifest)
            require_same_map(begun, manifest)
            folder = RunFolder.reopen(out, devices.log)
            folder.start_session({k: manifest[k] for k in ("map", "assumed_gap")})
        else:
            folder = RunFolder.create(out, manifest, plan.text, devices.log)
        control = control or RunControl()
        _introduce(control, plan, out)
        session = Session(plan, devices, folder, control, report, received, witness)
        status, reason = session.carry_out(is_resumed, progress)
    return RunSummary(
        path=out, status=status, reason=reason, steps_done=len(folder.done),
        steps_total=len(plan.gaps_mm), flagged=tuple(session.flagged),
    )  # fmt: skip


def _introduce(control: RunControl, plan: Plan, out: Path) -> None:
    control.state.tell(
        name=plan.model.name, folder=str(out.resolve()), steps=len(plan.gaps_mm)
    )
