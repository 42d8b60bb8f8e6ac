"""One sitting at the bench: the steps of a run that are still missing, one by one.

For each gap of the plan: move from the far side, wait until the rod is still, read the
Tesla-meter, photograph, check that the stage still stands there, and commit the step
(see `runs.folder`). Whatever happens, the stage is held and ``end.json`` says how the
run ended; if even that cannot be written, its absence says so.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator

from ...core.errors import MagbendError, RigError, StageError
from ...core.progress import Progress
from ..bench.config import Plan
from ..bench.devices import Devices
from ..bench.stops import FAR, Stop
from ..camera.photo_flags import photo_flags
from ..camera.protocol import brightness, encode_png, grab_median
from ..errors import StoppedError
from ..interrupts import Interrupts, StopAtOnce
from ..stage.gap_records import MoveRecord
from .control import Report, RunControl
from .folder import RunFolder
from .read import read_run
from .records import Record, image_name
from .resume_check import verify_position
from .settle import settle
from .step_record import flux_record, step_flags, step_line
from .time_left import TimeLeft
from .witness import FLAG, Reading, Witness, testify

logger = logging.getLogger(__name__)


class _PauseAskedError(Exception):
    """A pause is asked for while the stage moves."""


class Session:
    """One sitting at the bench: from connected devices to ``end.json``."""

    def __init__(
        self,
        plan: Plan,
        devices: Devices,
        folder: RunFolder,
        control: RunControl,
        report: Report,
        received: Interrupts,
        witness: Witness,
    ) -> None:
        self.witness = witness
        self.plan = plan
        self.devices = devices
        self.folder = folder
        self.control = control
        self.state = control.state
        self.report = report
        self.received = received
        self.flagged: list[str] = []
        self.readings: list[Reading] = []
        self.stop_before = devices.stage.last_stop
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
            self.readings = [
                (step["gap_mm"], step["flux_mT"])
                for step in steps
                if step.get("flux_mT") is not None
                and FLAG not in step["flags"]
                and step.get("kind") not in FAR
            ]
            self._say("checking", f"checking the position at {last['gap_mm']:g} mm")
            check = verify_position(
                self.plan, self.devices, self.folder.path, last, check=self._check
            )
            self.folder.start_session({"position_check": check})

    def _take_steps(self, progress: Progress) -> None:
        stops = self.plan.stops
        progress(len(self.folder.done), len(stops))
        left = TimeLeft(self.plan, self.folder.done)
        self.state.expect_end(left.now_s())
        for index, stop in enumerate(stops):
            if index in self.folder.done:
                continue
            record = self._take_step(index, stop)
            self.flagged += [f"step {index + 1}: {flag}" for flag in record["flags"]]
            self.state.expect_end(left.after(index))
            self.state.tell(
                gap_mm=record["gap_reached_mm"],
                flux_mT=record["flux_mT"],
                flags=record["flags"],
                picture=str(self.folder.path.resolve() / image_name(index)),
            )
            self._say("idle", step_line(record, len(stops)))
            progress(len(self.folder.done), len(stops))
            self._heed(record)

    def _take_step(self, index: int, stop: Stop) -> Record:
        devices, plan, gap_mm = self.devices, self.plan, stop.gap_mm
        self.state.tell(step=index + 1, state="moving")
        was_paused = self._pause()
        move, was_held = self._go_to(gap_mm)
        settings = self._set_axes(stop)
        devices.camera.at_step(index, gap_mm)
        self.state.tell(state="settling", gap_mm=move.gap_mm)
        was_paused = self._pause() or was_held or was_paused
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
        said = testify(self.witness, gap_mm, flux, self.readings)
        flags = step_flags(move, settled, flux, said) + photo_flags(
            frame.image, level, self.reference_brightness,
            plan.rig.camera.brightness_drift_percent,
        )  # fmt: skip
        record: Record = {
            "index": index,
            "kind": stop.kind,
            "turn": stop.turn,
            "settings": settings,
            "gap_mm": gap_mm,
            "gap_reached_mm": move.gap_mm,
            "stage_mm": move.stage_mm,
            "gap_at_zero_mm": devices.stage.place_map.gap_at_zero_mm,
            "direction": devices.stage.place_map.direction,
            "approach": move.approach,
            "move_s": move.duration_s,
            **flux_record(flux),
            "field": said.as_dict(),
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
        images = {image_name(index): encode_png(frame.image)}
        if plan.model.photograph.series:
            record["series"] = self._take_series(index, images)
            self._require_standing(move)
        return self.folder.commit_step(record, images)

    def _take_series(self, index: int, images: dict[str, bytes]) -> list[Record]:
        """Add single frames to the pictures of a step; return when each was taken."""
        photograph, camera = self.plan.model.photograph, self.devices.camera
        clock, taken = self.devices.clock, list[Record]()
        after_s = clock.monotonic_s()
        for number in range(photograph.series):
            frame = camera.grab_after(after_s, check=self._check)
            name = image_name(index).replace(".png", f"_s{number:03d}.png")
            images[name] = encode_png(frame.image)
            taken.append(
                {"path": name, "time_utc": frame.time_utc, "arrival_s": frame.arrival_s}
            )
            after_s = max(frame.arrival_s, after_s + photograph.interval_s)
        return taken

    def _go_to(self, gap_mm: float) -> tuple[MoveRecord, bool]:
        """Go to a gap; a pause stops the stage on its way, and it goes on after.

        Returns
        -------
        move : MoveRecord
            How it came there.
        was_paused : bool
            Whether it was stopped on its way.
        """
        was_paused = False
        while True:
            try:
                return self.devices.stage.goto_gap(gap_mm, moved=self._look), was_paused
            except _PauseAskedError:
                how = self.devices.stage.hold().sentence()
                self.report(f"pausing: {how}")
                was_paused = self._pause()

    def _set_axes(self, stop: Stop) -> dict[str, float]:
        """Set what the step asks of other axes; return what they are then."""
        return {
            name: self.devices.axes[name].set(value, check=self._check)
            for name, value in stop.settings.items()
            if name in self.devices.axes
        }

    def _rest_axes(self) -> None:
        """Leave no current on and no magnet turned: axes go to their rest."""
        for axis in self.plan.rig.axis:
            if axis.rest is not None and axis.name in self.devices.axes:
                with _best_effort(f"bringing {axis.name} to rest"):
                    self.devices.axes[axis.name].set(axis.rest)

    def _look(self, gap_mm: float) -> None:
        self.state.tell(gap_mm=gap_mm)
        if self.control.is_paused:
            raise _PauseAskedError

    def _heed(self, record: Record) -> None:
        """Take a reading in; where it disagrees do as the plan's policy says."""
        sentence = record["field"]["sentence"]
        if not sentence:
            # Far from the magnet a reading is too small to judge others by.
            if record["flux_mT"] is not None and record["kind"] not in FAR:
                self.readings.append((record["gap_mm"], record["flux_mT"]))
            return
        self.report(f"step {record['index'] + 1}: {sentence}")
        policy = self.plan.model.flux.policy
        if policy == "abort":
            raise StageError(
                f"step {record['index'] + 1} is recorded and flagged: {sentence}; look "
                "at stage, probe and magnet, then go on with --resume"
            )
        if policy == "pause" and not self.control.is_paused:
            self.control.pause()

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
            proof = stage.last_stop
            self._halt()
            if proof is self.stop_before:  # what ended the run stopped no motion
                proof = stage.last_stop
            if status == "abort" and proof and proof.sentence() not in reason:
                reason = f"{reason}: {proof.sentence()}"
        self._rest_axes()
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


@contextlib.contextmanager
def _best_effort(what: str) -> Iterator[None]:
    try:
        yield
    except RigError as error:
        logger.warning("%s failed: %s", what, error)
    except Exception:  # the ending must be written even so
        logger.exception("%s failed", what)
