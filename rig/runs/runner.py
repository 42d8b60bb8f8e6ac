"""The experiment: approach in steps, settle, measure the field, photograph, record.

For each gap of the plan: move from the far side, wait until the rod is still, read the
Tesla-meter, photograph, check that the stage still stands there, and commit the step
(see `runs.folder`). Whatever happens, the stage is held and ``end.json`` says how the
run ended; if even that cannot be written, its absence says so.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from ...core.errors import MagbendError, RigError, StageError
from ...core.owned import owning_folder
from ...core.progress import Progress, silent
from ..bench.config import Plan
from ..bench.devices import Devices
from ..camera.photo_flags import photo_flags
from ..camera.protocol import brightness, encode_png, grab_median
from ..errors import StoppedError
from ..interrupts import Interrupts, StopAtOnce, interrupts
from ..meter.protocol import Flux
from ..stage.gap import MoveRecord
from .control import Report, RunControl, quiet
from .folder import RunFolder
from .manifest import make_manifest, require_same
from .read import is_run, read_run
from .records import Record, image_name
from .resume_check import verify_position
from .settle import Settled, settle
from .time_left import TimeLeft

logger = logging.getLogger(__name__)


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
    the run to stop, and the second one stops the stage at once (see `interrupts`).
    """
    for gap_mm in plan.gaps_mm:
        devices.stage.check_gap(gap_mm)
    with (
        owning_folder(out, "run", "rig run", ours=is_run),
        interrupts(devices.stage.request_stop) as received,
    ):
        manifest = make_manifest(plan, devices, twin=twin)
        is_resumed = resume and is_run(out)
        if is_resumed:
            require_same(read_run(out).manifest, manifest)
            folder = RunFolder.reopen(out, devices.log)
        else:
            folder = RunFolder.create(out, manifest, plan.text, devices.log)
        control = control or RunControl()
        _introduce(control, plan, out)
        session = _Session(plan, devices, folder, control, report, received)
        status, reason = session.carry_out(is_resumed, progress)
    return RunSummary(
        path=out, status=status, reason=reason, steps_done=len(folder.done),
        steps_total=len(plan.gaps_mm), flagged=tuple(session.flagged),
    )  # fmt: skip


class _Session:
    """One sitting at the bench: from connected devices to ``end.json``."""

    def __init__(
        self,
        plan: Plan,
        devices: Devices,
        folder: RunFolder,
        control: RunControl,
        report: Report,
        received: Interrupts,
    ) -> None:
        self.plan = plan
        self.devices = devices
        self.folder = folder
        self.control = control
        self.state = control.state
        self.report = report
        self.received = received
        self.flagged: list[str] = []
        self.reference_brightness: float | None = None

    def carry_out(self, is_resumed: bool, progress: Progress) -> tuple[str, str]:
        """Take every missing step; return status and reason of the ending."""
        status, reason = "success", "every step of the plan was taken"
        try:
            with self.received.striking():
                self._prepare(is_resumed)
                self._take_steps(progress)
        except StopAtOnce:
            status, reason = "abort", f"stopped at once by {self.received.name}"
        except (KeyboardInterrupt, StoppedError) as stop:
            status, reason = "abort", str(stop) or "stopped by the operator"
            if self.received.name:
                reason = f"stopped by {self.received.name}"
        except MagbendError as error:
            status, reason = "fail", str(error)
        except BaseException as error:
            self._end("fail", f"internal error: {type(error).__name__}: {error}")
            raise
        return self._end(status, reason)

    def _prepare(self, is_resumed: bool) -> None:
        stage = self.devices.stage
        needs_home = is_resumed and self.plan.rig.stage.homing != "manual"
        if needs_home or stage.position_state != "homed":
            self._say("homing", "homing the stage")
            stage.home()
        if is_resumed and self.folder.done:
            steps = read_run(self.folder.path).steps
            last = steps[-1]
            self.reference_brightness = steps[0].get("brightness")
            self._say("checking", f"checking the position at {last['gap_mm']:g} mm")
            check = verify_position(
                self.plan, self.devices, self.folder.path, last, check=self._check
            )
            self.folder.start_session({"position_check": check})

    def _take_steps(self, progress: Progress) -> None:
        gaps_mm = self.plan.gaps_mm
        progress(len(self.folder.done), len(gaps_mm))
        left = TimeLeft(self.plan, self.folder.done)
        self.state.expect_end(left.now_s())
        for index, gap_mm in enumerate(gaps_mm):
            if index in self.folder.done:
                continue
            record = self._take_step(index, gap_mm)
            self.flagged += [f"step {index}: {flag}" for flag in record["flags"]]
            self.state.expect_end(left.after(index))
            self.state.tell(
                gap_mm=record["gap_reached_mm"],
                flux_mT=record["flux_mT"],
                flags=record["flags"],
                picture=str(self.folder.path.resolve() / image_name(index)),
            )
            self._say("idle", _step_line(record, len(gaps_mm)))
            progress(len(self.folder.done), len(gaps_mm))

    def _take_step(self, index: int, gap_mm: float) -> Record:
        devices, plan = self.devices, self.plan
        self.state.tell(step=index + 1, state="moving")
        was_paused = self._pause()
        move = devices.stage.goto_gap(gap_mm)
        devices.camera.at_step(index, gap_mm)
        self.state.tell(state="settling", gap_mm=move.gap_mm)
        was_paused = self._pause() or was_paused
        settled = settle(devices.camera, devices.clock, plan.settle, check=self._check)
        self.state.tell(state="measuring")
        flux = devices.meter.read_flux(
            plan.model.flux.samples, gap_mm=gap_mm, check=self._check
        )
        self.state.tell(state="photographing")
        frame = grab_median(
            devices.camera, devices.clock, plan.model.photograph.frames,
            check=self._check,
        )  # fmt: skip
        self._check()
        self._require_standing(move)
        level = brightness(frame.image)
        if self.reference_brightness is None:
            self.reference_brightness = level
        flags = _step_flags(move, settled, flux) + photo_flags(
            frame.image, level, self.reference_brightness,
            plan.rig.camera.brightness_drift_percent,
        )  # fmt: skip
        record: Record = {
            "index": index,
            "gap_mm": gap_mm,
            "gap_reached_mm": move.gap_mm,
            "stage_mm": move.stage_mm,
            "approach": move.approach,
            "move_s": move.duration_s,
            **_flux_record(flux),
            "settle": {
                "status": settled.status,
                "time_s": settled.time_s,
                "difference": settled.change_percent,
                "frames": settled.frames,
            },
            "brightness": level,
            "paused": was_paused,
            "photograph_utc": frame.time_utc,
            "time_utc": devices.utc(),
            "monotonic_s": devices.clock.monotonic_s(),
            "flags": flags,
        }
        return self.folder.commit_step(
            record, {image_name(index): encode_png(frame.image)}
        )

    def _say(self, state: str, line: str) -> None:
        self.state.tell(state=state, line=line)
        self.report(line)

    def _pause(self) -> bool:
        return self.control.wait_while_paused(self.report, check=self._check)

    def _check(self) -> None:
        """End the run if somebody asks for it, or the stage says it lost itself."""
        if self.devices.stage.stop_requested():
            raise StoppedError("the run was stopped by magbend rig stop")
        self.devices.stage.listen()

    def _require_standing(self, move: MoveRecord) -> None:
        """Refuse a photograph during which the stage moved, or lost itself."""
        status = self.devices.stage.status()
        slack_mm = 2.0 * self.devices.stage.limits.step_mm
        stands = (
            status.position_state == "homed"
            and status.alarm is None
            and status.stage_mm is not None
            and abs(status.stage_mm - move.stage_mm) <= slack_mm
        )
        if not stands:
            alarm = f" (ALARM:{status.alarm})" if status.alarm else ""
            raise StageError(
                f"the stage must stand at {move.stage_mm:.3f} mm while it is "
                f"photographed; instead it reports {status.state}{alarm}, position "
                f"{status.position_state}, {status.stage_mm} mm; the step was not "
                f"recorded: look at the stage, then go on with --resume"
            )

    def _end(self, status: str, reason: str) -> tuple[str, str]:
        """Bring the stage to a stand and write the ending, whatever happens."""
        stage = self.devices.stage
        if status != "success" or stage.stop_requested():
            self._halt()
            if status == "abort" and stage.last_stop is not None:
                reason = f"{reason}: {stage.last_stop.sentence()}"
        try:
            end = self.folder.finish(status, reason)
            status, reason = end["status"], end["reason"]
        except MagbendError as error:
            # The disk refuses: the missing ending marks the run as cut off.
            logger.warning("%s", error)
            if status == "success":
                raise
        self.state.tell(status=status, reason=reason)
        if status == "abort" and self.plan.model.abort.policy == "retract":
            self._say("retracting", "retracting from the magnet")
            with _best_effort("retracting"), contextlib.suppress(KeyboardInterrupt):
                stage.abort("retract")
        return status, reason

    def _halt(self) -> None:
        """Hold the stage; a further Ctrl-C stops it at once, one more gives that up."""
        stage = self.devices.stage
        for halt in (stage.hold, stage.stop):
            try:
                with self.received.striking(), _best_effort("stopping the stage"):
                    halt()
                    return
            except KeyboardInterrupt:
                continue


def _introduce(control: RunControl, plan: Plan, out: Path) -> None:
    control.state.tell(
        name=plan.model.name, folder=str(out.resolve()), steps=len(plan.gaps_mm)
    )


@contextlib.contextmanager
def _best_effort(what: str) -> Iterator[None]:
    try:
        yield
    except RigError as error:
        logger.warning("%s failed: %s", what, error)
    except Exception:  # the ending must be written even so
        logger.exception("%s failed", what)


def _step_flags(move: MoveRecord, settled: Settled, flux: Flux) -> list[str]:
    flags = []
    if settled.status != "settled":
        flags.append("settle_timeout")
    if move.approach != "far side":
        flags.append("approach_clipped")
    if flux.status == "none":
        flags.append("no_flux")
    elif flux.status not in ("ok", "manual"):
        flags.append(f"flux_{flux.status}")
    return flags


def _flux_record(flux: Flux) -> Record:
    record = asdict(flux)
    return {
        "flux_mT": record["flux_mT"],
        "flux_sd_mT": record["sd_mT"],
        "flux_samples": record["samples"],
        "flux_status": record["status"],
        "flux_raw": list(record["raw"]),
    }


def _step_line(record: Record, total: int) -> str:
    flux_mT = record["flux_mT"]
    flux = f"{flux_mT:.2f} mT" if flux_mT is not None else record["flux_status"]
    doubts = f", {', '.join(record['flags'])}" if record["flags"] else ""
    return (
        f"step {record['index'] + 1} of {total}: gap {record['gap_mm']:g} mm, "
        f"flux {flux}, {record['settle']['status']} after "
        f"{record['settle']['time_s']:.1f} s{doubts}"
    )
