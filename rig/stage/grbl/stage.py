"""A GRBL 1.1 board (also grblHAL, FluidNC) as a `Stage`.

Motions are absolute jogs in machine coordinates: a jog is refused as a whole when it
leaves the travel, changes no modal state, and a feed hold forgets it. Arrival is Idle
*and* the position; an ``ok`` only means queued.
"""

from __future__ import annotations

import contextlib
from typing import NoReturn

from ....core.errors import StageError
from ...errors import (
    AlarmError,
    InterlockError,
    LinkLostError,
    PositionLostError,
    StageTimeoutError,
    StoppedError,
)
from ...link import Link
from ..place import difference
from ..presence import LeftPlace
from ..protocol import Moved, StageIdentity, StageStatus
from ..serial import SerialStage, stopped
from ..stopping import StopProof
from . import audit as grbl_audit
from .connect import FoundBoard, connect_board
from .mark import set_mark
from .motion import InputClosedError, Target, await_arrival, await_homing, stands
from .protocol import SOFT_RESET, STOP_INPUTS, Report, alarm_text, jog_line
from .ready import (
    make_ready,
    note,
    refuse_open_door,
    require_open_switch,
    require_unlocked,
    reset_standing,
    wait_for_report,
)
from .session import CommandRefusedError, GrblSession
from .stopping import reset_motion, stop_motion

_HOMED_SLACK_MM = 0.02
_ASKS = 3  # one missing answer is no silence


class GrblStage(SerialStage[GrblSession]):
    """One axis of a GRBL board; made as `SerialStage` is."""

    _undisturbed = False
    _feed_mm_min: float | None = None  # of the motion that was sent last

    def _meet(self, link: Link) -> GrblSession:
        config = self._config
        session = GrblSession(
            link, self._clock, answer_timeout_s=config.answer_timeout_s
        )
        found = connect_board(session, self._clock, config)
        problem = grbl_audit.audit(found.settings, config)
        problem = problem or grbl_audit.audit_build(
            found.settings, found.details, config
        )
        if problem:
            raise StageError(f"the stage on {link.port} does not fit: {problem}")
        self._take_in(session, found, link.port)
        return session

    def _take_in(self, session: GrblSession, found: FoundBoard, port: str) -> None:
        """Keep what the board said; believe its position if nobody disturbed it."""
        config = self._config
        self._limits = grbl_audit.limits_of(
            found.settings, found.details, config, found.told_mm
        )
        self._identity = StageIdentity(
            driver="grbl",
            firmware=found.banner,
            port=port,
            details=found.details,
            settings=found.settings,
            notes=tuple(grbl_audit.notes(found.settings, config)),
        )
        self._trust.watch(session)
        self._undisturbed = found.undisturbed
        self._map_doubt, self._is_lent = "", False
        self._compare_with_measured()
        left = self._presence.recall() if self._presence else None
        if left is not None:
            self._recall(session, found, left)

    def _recall(self, session: GrblSession, found: FoundBoard, left: LeftPlace) -> None:
        """Trust the place where the stage was left, if all signs are for it."""
        tolerance_mm = self.limits.tolerance_mm
        by_hand = self._config.homing == "manual"
        change = difference(left.map, self.place_map.as_dict())
        if not found.undisturbed:
            return
        if not self._trust.is_at(session, left.machine_mm, tolerance_mm):
            self._trust.lose("the board counts another place than where it was left")
        elif found.mark != left.mark or (by_hand and left.mark is None):
            self._trust.lose("the board was restarted since the stage was left")
        else:
            self._trust.confirm(session)
            if change:
                self._trust.doubt(f"since the stage was left, {change}")

    def home(self) -> None:
        """Run the homing cycle of the board and wait for its end.

        Raises
        ------
        AlarmError
            If a switch was not found, stayed closed, or the cycle was cut off.
        StageTimeoutError
            If it does not end in time; the board is reset.
        """
        session = self._require_session()
        self._require_switches()
        self._make_ready(session)
        limit_s = self._config.home_timeout_s or self._config.busy_factor * (
            grbl_audit.homing_time_s(self.identity.settings)
        )
        self._trust.lose()
        with self._stand_if_interrupted(at_once=True):
            session.drain()
            self._require_link().write(self._config.home_command.encode() + b"\n")
            await_homing(
                session,
                self._clock,
                limit_s,
                command=self._config.home_command,
                check_stop=self._stop_homing_if_asked,
            )
        report = self._wait_for_report(session)
        if report.state != "idle":
            raise StageError(f"after homing the stage is in {report.state}, not idle")
        session.alarm = None
        self._require_counted_as_computed()
        self._trust.confirm(session)

    def _require_counted_as_computed(self) -> None:
        """Refuse a homing after which the board counts from elsewhere.

        Raises
        ------
        PositionLostError
            If it does: by its own count it would drive past the end of the axis.
        """
        homed, here = self.limits.homed_mm, self._machine_mm()
        if here is None:
            raise PositionLostError("the stage does not report its position; home it")
        slack_mm = self.limits.tolerance_mm + _HOMED_SLACK_MM
        if homed is not None and abs(here - homed) > slack_mm:
            self._trust.lose("homing did not end where it was computed to")
            raise PositionLostError(
                f"the board counts {here:.3f} mm after homing, {homed:.3f} mm was "
                "expected from its settings ($23, $27, $130): nothing moves by a count "
                "that is not understood; if this is its way, write homed_at_mm = "
                f"{here:g} into [stage] of the rig file"
            )

    def _stop_homing_if_asked(self) -> None:
        if self.stop_requested():
            raise StoppedError(stopped(self.stop()))

    def _standing_mm(self) -> float:
        session = self._require_session()
        report = self._wait_for_report(session)
        refuse_open_door(session)
        here = self._machine_mm()
        if report.state != "idle" or here is None:
            way_out = (
                "home it, or magbend rig unlock"
                if report.state == "alarm"
                else ("wait for it, or stop it first (magbend rig stop)")
            )
            raise StageError(
                f"the stage must be idle; it is in {report.state}: {way_out}"
            )
        return here

    def _ready_mm(self) -> float:
        session = self._require_session()
        self._make_ready(session)
        require_unlocked(session)
        self._trust.require(session, self.limits.tolerance_mm)
        require_open_switch(session, self._config.axis)
        here = self._machine_mm()
        if here is None:
            raise PositionLostError("the stage does not report its position; home it")
        return here

    def status(self) -> StageStatus:
        """Ask the board; no answer is the state ``silent``."""
        session = self._require_session()
        report = session.ask_place(self._config.answer_timeout_s / _ASKS)
        note(session, self._trust)
        code = session.alarm
        state = report.state if report else "silent" if code is None else "alarm"
        return StageStatus(
            state=state,  # type: ignore[arg-type]
            substate=report.substate if report else None,
            machine_mm=self._machine_mm() if report or session.deaf else None,
            position_state=self.position_state,
            feed_mm_min=report.feed if report else 0.0,
            alarm=code,
            trouble=session.alarm_error(code) if code is not None else None,
            pins=report.pins if report else "",
            raw=report.raw if report else "",
        )

    def listen(self) -> None:
        """Take in what the board says unasked; nothing is sent.

        Raises
        ------
        AlarmError, PositionLostError, LinkLostError
            If it raised an alarm, restarted, or is gone.
        """
        session = self._require_session()
        restarts = session.restarts
        session.drain()
        note(session, self._trust)
        if session.alarm is not None:
            raise session.alarm_error(session.alarm)
        session.raise_if_restarted(restarts)

    def hold(self) -> StopProof:
        """Stop and prove it (see `stopping`); forget the rest of the move.

        Raises
        ------
        StageTimeoutError
            If the stage moves even after a reset, or does not answer.
        """
        session = self._require_session()
        try:
            proof = stop_motion(
                session,
                self._clock,
                axis=self._axis,
                limits=self._limits,
                feed_mm_min=self._feed_mm_min,
            )
            state = session.report.state if session.report else ""
            if state in ("hold", "door") or not session.in_step:
                reset_standing(session, self._trust)
            return self._take_stop(session, proof)
        except StageError:
            self._trust.doubt()
            raise
        finally:
            self._stop_is_met()

    def stop(self) -> StopProof:
        """Soft-reset at once, and prove it; what was moving has lost steps.

        Raises
        ------
        StageTimeoutError
            If the stage moves all the same, or does not answer.
        """
        session = self._require_session()
        if session.report is None or not stands(session.report):
            self._trust.doubt()
        try:
            proof = reset_motion(session, self._clock, axis=self._axis)
            return self._take_stop(session, proof)
        finally:
            self._stop_is_met()

    def _take_stop(self, session: GrblSession, proof: StopProof) -> StopProof:
        """Keep the proof, and take in what it says of the place."""
        self.last_stop = proof
        note(session, self._trust)
        if proof.is_place_kept:
            self._trust.stands(session)
        else:
            self._trust.doubt()
        return proof

    def _cry_stop(self) -> None:
        self._require_session().realtime(SOFT_RESET)

    def recover(self) -> None:
        """Bring the board back: reconnect a lost link, reset an alarmed board.

        The alarm lock stays: home the stage, or unlock it.

        Raises
        ------
        StageError
            If the board does not come back.
        """
        if self._link is None or not self._link.is_open:
            self._reconnect()
            return
        session = self._require_session()
        report = session.ask_place(self._config.answer_timeout_s / _ASKS)
        if report is not None and not stands(report):
            self.hold()
        elif not session.reset():
            raise StageTimeoutError("the stage does not answer a reset; cut its power")
        note(session, self._trust)

    def _reconnect(self) -> None:
        """Open the port again; what had been known of the position is unverified."""
        before = self._trust.state
        try:
            self.connect()
        except StageError:
            self._trust.state = before
            raise
        trusted = before != "unknown" and self._undisturbed
        self._trust.state = "unverified" if trusted else "unknown"

    def unlock(self) -> None:
        """Send ``$X``; the position is ``homed`` only if the alarm kept it."""
        session = self._require_session()
        code = session.alarm
        if session.deaf or not session.in_step:
            session.reset()
        session.command("$X")
        session.alarm, session.locked_message = None, False
        kept = code is not None and alarm_text(code).position_kept
        if not kept:
            self._trust.doubt()

    def close(self) -> None:
        """Let go of the port; where a homed stage stands is remembered."""
        session, presence = self._session, self._presence
        if session and presence and self._link and self._link.is_open:
            with contextlib.suppress(StageError):
                report = session.ask_place(self._config.answer_timeout_s / _ASKS)
                note(session, self._trust)
                machine = session.machine()
                idle = report is not None and report.state == "idle"
                trusted = self.position_state == "homed" and not self._is_lent
                if trusted and idle and machine:
                    presence.remember(
                        LeftPlace(
                            machine_mm=machine,
                            map=self.place_map.as_dict(),
                            mark=set_mark(session),
                        )
                    )
        self._let_go()

    def _move_piece(self, target_mm: float, feed_mm_min: float, moved: Moved) -> None:
        session = self._require_session()
        target = self._target(target_mm, feed_mm_min)
        restarts = session.restarts
        self._feed_mm_min = feed_mm_min
        try:
            session.command(jog_line(self._config.axis, target_mm, feed_mm_min))
            await_arrival(
                session,
                self._clock,
                target,
                restarts=restarts,
                check_stop=self._hold_if_asked,
                moved=moved,
            )
        except CommandRefusedError as error:
            if error.code == "15":
                raise InterlockError(
                    f"the board refuses {target_mm:.3f} mm: it lies outside the travel "
                    "it is set to; nothing moved"
                ) from None
            raise
        except AlarmError:
            note(session, self._trust)
            session.reset()
            raise
        except PositionLostError:
            note(session, self._trust)
            raise
        except LinkLostError:
            self._trust.doubt()
            raise
        except InputClosedError as error:
            raise StoppedError(f"{error}: {self.hold().sentence()}") from None
        except StageTimeoutError as error:
            self._give_up(session, error)
        self._trust.stands(session)

    def _target(self, target_mm: float, feed_mm_min: float) -> Target:
        """Return where to, how exactly, and how long it may take."""
        start = self._machine_mm()
        distance = 0.0 if start is None else target_mm - start
        letter, report = self._config.axis, self._require_session().report
        pins = report.pins if report else ""
        return Target(
            axis=self._axis,
            start_mm=target_mm - distance,
            machine_mm=target_mm,
            tolerance_mm=self.limits.tolerance_mm,
            limit_s=self._limit_s(distance, feed_mm_min),
            switch="" if letter in pins else letter,
            stops="".join(name for name in STOP_INPUTS if name not in pins),
        )

    def _give_up(self, session: GrblSession, error: StageTimeoutError) -> NoReturn:
        """Bring the stage to a stand after a timeout, and say so."""
        self._trust.doubt()
        try:
            how = self.hold().sentence().partition(";")[0]
        except StageError as failure:
            how = str(failure)
        self._trust.doubt()
        if not session.in_step:
            with contextlib.suppress(StageError):
                session.reset()
        raise StageTimeoutError(
            f"{error}; the stage was stopped ({how}) and its position is unverified: "
            f"{self._trust.way_out}"
        ) from None

    def _make_ready(self, session: GrblSession) -> None:
        make_ready(session, self._trust, self._config.answer_timeout_s)

    def _wait_for_report(self, session: GrblSession) -> Report:
        return wait_for_report(session, self._trust, self._config.answer_timeout_s)

    @property
    def _axis(self) -> int:
        return "XYZ".index(self._config.axis)

    def _machine_mm(self) -> float | None:
        machine = self._session.machine() if self._session else None
        return machine[self._axis] if machine and len(machine) > self._axis else None
