"""A GRBL 1.1 board (also grblHAL, FluidNC) as a `Stage`.

Motions are absolute jogs in machine coordinates: a jog is refused as a whole when it
leaves the travel, changes no modal state, and a feed hold forgets it. They are sent in
pieces, so that a stage whose host dies runs on for one short piece at most. Arrival is
Idle *and* the position; an ``ok`` only means queued.
"""

from __future__ import annotations

import contextlib
import logging
import math
from collections.abc import Iterator

from ..core.errors import StageError
from . import grbl_audit
from .clock import Clock
from .grbl_connect import FoundBoard, connect_board
from .grbl_motion import Target, await_arrival, await_homing, await_stand, stands
from .grbl_protocol import (
    FEED_HOLD,
    SOFT_RESET,
    Report,
    alarm_text,
    jog_line,
)
from .grbl_session import CommandRefusedError, GrblSession
from .grbl_trust import PositionTrust
from .link import Link, WireLog
from .ports import resolve_port
from .presence import Presence
from .stage import (
    AlarmError,
    InterlockError,
    LinkLostError,
    Moved,
    PositionLostError,
    PositionState,
    StageIdentity,
    StageLimits,
    StageStatus,
    StageTimeoutError,
    StoppedError,
    unheard,
)
from .stage_config import StageConfig

logger = logging.getLogger(__name__)

_MARGIN_S = 5.0


class GrblStage:
    """One axis of a GRBL board.

    Parameters
    ----------
    config : StageConfig
        Table ``[stage]`` of the rig file.
    clock : Clock
        Time.
    log : WireLog, optional
        Where every byte is recorded.
    """

    def __init__(
        self, config: StageConfig, clock: Clock, *, log: WireLog | None = None
    ) -> None:
        self._config = config
        self._clock = clock
        self._log = log
        self._axis = "XYZ".index(config.axis)
        self._link: Link | None = None
        self._session: GrblSession | None = None
        self._presence: Presence | None = None
        self._identity: StageIdentity | None = None
        self._limits: StageLimits | None = None
        self._trust = PositionTrust(config.axis)
        self._undisturbed = False

    @property
    def position_state(self) -> PositionState:
        """How far the position can be trusted."""
        return self._trust.state

    @property
    def identity(self) -> StageIdentity:
        """Who answers, with all settings."""
        if self._identity is None:
            raise StageError("the stage is not connected")
        return self._identity

    @property
    def limits(self) -> StageLimits:
        """What the board is set to."""
        if self._limits is None:
            raise StageError("the stage is not connected")
        return self._limits

    def connect(self) -> None:
        """Open the port, find out who answers, refuse what does not fit.

        Raises
        ------
        StageError
            If the port cannot be opened, nobody answers as GRBL, or a setting does not
            fit the rig file: the sentence names the setting.
        """
        self._disconnect()
        self._trust.lose()
        port = resolve_port(self._config.port)
        session = self._open(port)
        try:
            found = connect_board(session, self._clock, self._config)
            problem = grbl_audit.audit(found.settings, self._config)
            problem = problem or grbl_audit.audit_build(found.details, self._config)
            if problem:
                raise StageError(f"the stage on {port} does not fit: {problem}")
        except BaseException:
            self._disconnect()
            raise
        self._session = session
        self._take_in(session, found, port)

    def _open(self, port: str) -> GrblSession:
        config = self._config
        self._link = Link(
            port, baud=config.baud, clock=self._clock, log=self._log, dtr=config.dtr
        )
        self._link.open()
        self._presence = Presence(port)
        self._presence.claim()
        timeout_s = config.answer_timeout_s
        return GrblSession(self._link, self._clock, answer_timeout_s=timeout_s)

    def _take_in(self, session: GrblSession, found: FoundBoard, port: str) -> None:
        """Keep what the board said; believe its position if nobody disturbed it."""
        self._limits = grbl_audit.limits_of(found.settings, self._config)
        self._identity = StageIdentity(
            driver="grbl",
            firmware=found.banner,
            port=port,
            details=found.details,
            settings=found.settings,
            notes=tuple(grbl_audit.notes(found.settings)),
        )
        self._trust.watch(session)
        self._undisturbed = found.undisturbed
        left_at = self._presence.recall() if self._presence else None
        where = left_at if found.undisturbed else None
        if where and self._trust.is_at(session, where, self._limits.step_mm):
            self._trust.confirm(session)

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
        if self._config.homing != "switches":
            raise StageError(
                'the rig file says homing = "manual": bring the stage to a known gap '
                "and say which: magbend rig set-gap GAP"
            )
        self._make_ready(session)
        limit_s = self._config.home_timeout_s or self._config.busy_factor * (
            grbl_audit.homing_time_s(self.identity.settings)
        )
        self._trust.lose()
        with self._stop_if_interrupted():
            session.drain()
            self._require_link().write(self._config.home_command.encode() + b"\n")
            await_homing(
                session,
                self._clock,
                limit_s,
                command=self._config.home_command,
                check_stop=lambda: self._raise_if_stop_asked(at_once=True),
            )
        report = self._wait_for_report(session)
        if report.state != "idle":
            raise StageError(f"after homing the stage is in {report.state}, not idle")
        session.alarm = None
        self._trust.confirm(session)

    def assume_homed(self, machine_mm: float) -> None:
        """Take the operator's word that the board's count is right.

        Raises
        ------
        StageError
            If the stage is not idle, counts otherwise, or has switches and was not
            homed by them.
        """
        session = self._require_session()
        report = self._wait_for_report(session)
        here = self._machine_mm()
        if report.state != "idle" or here is None:
            raise StageError(f"the stage must be idle; it is in {report.state}")
        if abs(here - machine_mm) > self.limits.step_mm:
            raise StageError(
                f"the board counts {here:.3f} mm, not {machine_mm:.3f} mm: it moved"
            )
        if self._config.homing == "switches" and self._trust.state != "homed":
            raise PositionLostError(
                f"the position of the stage is {self._trust.state}; it has switches: "
                "home it first (magbend rig home)"
            )
        self._trust.confirm(session)

    def move_to(
        self, machine_mm: float, *, feed_mm_min: float, moved: Moved = unheard
    ) -> None:
        """Go there in pieces and return when the stage stands there.

        Raises
        ------
        PositionLostError
            If the stage is not homed, or the board restarted.
        InterlockError
            If the target lies outside the travel; nothing was sent.
        AlarmError, StageTimeoutError, LinkLostError, StoppedError
            As they say; the stage stands, or finishes one short piece.
        """
        session = self._require_session()
        self._check_travel(machine_mm)
        self._make_ready(session)
        self._trust.require(session, self.limits.step_mm)
        here = self._machine_mm()
        if here is None:
            raise PositionLostError("the stage does not report its position; home it")
        distance = machine_mm - here
        if abs(distance) <= self.limits.step_mm / 2.0:
            return
        pieces = math.ceil(abs(distance) / self._config.piece_mm)
        with self._stop_if_interrupted():
            for piece in range(1, pieces + 1):
                self._raise_if_stop_asked()
                target = here + distance * piece / pieces
                self._move_piece(session, target, feed_mm_min, moved)

    def status(self) -> StageStatus:
        """Ask the board; no answer is the state ``silent``."""
        session = self._require_session()
        report = session.ask()
        self._trust.note(session)
        code = session.alarm
        state = report.state if report else "silent" if code is None else "alarm"
        return StageStatus(
            state=state,  # type: ignore[arg-type]
            substate=report.substate if report else None,
            machine_mm=self._machine_mm() if report or session.deaf else None,
            position_state=self._trust.state,
            feed_mm_min=report.feed if report else 0.0,
            alarm=code,
            trouble=session.alarm_error(code) if code is not None else None,
            pins=report.pins if report else "",
            raw=report.raw if report else "",
        )

    def stop_requested(self) -> bool:
        """Return whether another process asks this one to stop the stage."""
        return self._presence is not None and self._presence.stop_asked()

    def request_stop(self) -> None:
        """Ask the thread that moves the stage to hold; safe from any thread."""
        if self._presence is not None:
            self._presence.ask_to_stop()

    def hold(self) -> None:
        """Feed hold, wait for standstill, forget the rest; the position stays good.

        Raises
        ------
        StageTimeoutError
            If the board does not say that it stands; it is reset, and the position is
            ``unverified``.
        """
        session = self._require_session()
        session.realtime(FEED_HOLD)
        try:
            self._hold(session)
        finally:
            if self._presence:
                self._presence.clear_stop()

    def _hold(self, session: GrblSession) -> None:
        feed = self.limits.max_feed_mm_min / 60.0
        limit_s = _MARGIN_S + self._config.busy_factor * (
            feed / self.limits.acceleration_mm_s2
        )
        report = await_stand(session, self._clock, limit_s)
        if report is not None:
            if report.state == "hold" or not session.in_step:
                self._reset_standing(session)
            self._trust.stands(session)
            return
        if not session.deaf:
            self._trust.doubt()
        session.reset()
        raise StageTimeoutError(
            "the stage did not come to a stop that it could report; it was reset; "
            "home it (magbend rig home)"
        )

    def stop(self) -> None:
        """Soft-reset at once; what was moving has lost steps."""
        session = self._require_session()
        moving = session.report is None or not stands(session.report)
        if moving:
            self._trust.doubt()
        if self._presence:
            self._presence.clear_stop()
        self._reset_standing(session)

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
        report = session.ask()
        moving = report is not None and not stands(report)
        if moving:
            self.hold()
        elif not session.reset():
            raise StageTimeoutError("the stage does not answer a reset; cut its power")
        self._trust.note(session)

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
                report = session.ask()
                self._trust.note(session)
                machine = session.machine()
                idle = report is not None and report.state == "idle"
                if self._trust.state == "homed" and idle and machine:
                    presence.remember(machine)
        self._disconnect()

    def _move_piece(
        self,
        session: GrblSession,
        target_mm: float,
        feed_mm_min: float,
        moved: Moved,
    ) -> None:
        target = self._target(target_mm, feed_mm_min)
        restarts = session.restarts
        try:
            session.command(jog_line(self._config.axis, target_mm, feed_mm_min))
            await_arrival(
                session,
                self._clock,
                target,
                restarts=restarts,
                check_stop=self._raise_if_stop_asked,
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
            self._trust.note(session)
            session.reset()
            raise
        except PositionLostError:
            self._trust.note(session)
            raise
        except LinkLostError:
            self._trust.doubt()
            raise
        except StageTimeoutError as error:
            self._give_up(error)
        self._trust.stands(session)

    def _target(self, target_mm: float, feed_mm_min: float) -> Target:
        """Return where to, how exactly, and how long it may take."""
        start = self._machine_mm()
        distance = 0.0 if start is None else abs(target_mm - start)
        usual_s = self.limits.duration_s(distance, feed_mm_min)
        return Target(
            axis=self._axis,
            machine_mm=target_mm,
            tolerance_mm=1.01 * self.limits.step_mm,
            limit_s=_MARGIN_S + self._config.busy_factor * usual_s,
        )

    def _give_up(self, error: StageTimeoutError) -> None:
        """Bring the stage to a stand after a timeout, and say so."""
        with contextlib.suppress(StageError):
            self.hold()
        self._trust.doubt()
        session = self._session
        if session is not None and not session.in_step:
            with contextlib.suppress(StageError):
                session.reset()
        raise StageTimeoutError(
            f"{error}; the stage was stopped and its position is unverified: home it"
        ) from None

    def _raise_if_stop_asked(self, *, at_once: bool = False) -> None:
        if not self.stop_requested():
            return
        if at_once:
            self.stop()
        else:
            self.hold()
        raise StoppedError("the stage was stopped by magbend rig stop")

    @contextlib.contextmanager
    def _stop_if_interrupted(self) -> Iterator[None]:
        """On Ctrl-C: hold first, so that the position stays; a second one resets."""
        try:
            yield
        except KeyboardInterrupt:
            session = self._require_session()
            homing = session.report is not None and self._trust.state == "unknown"
            try:
                if homing:
                    self.stop()
                else:
                    self.hold()
            except KeyboardInterrupt:
                with contextlib.suppress(StageError):
                    session.realtime(SOFT_RESET)
                self._trust.doubt()
            except StageError as error:
                logger.warning("stage: %s", error)
            raise

    def _make_ready(self, session: GrblSession) -> None:
        """Bring the board to where it takes a line: standing, in step, not deaf."""
        report = self._wait_for_report(session)
        self._trust.note(session)
        stuck = report.state == "home"  # a running cycle answers no question
        if not (stands(report) or stuck):
            raise StageError(
                f"the stage is in {report.state}; wait for it, or stop it first "
                "(magbend rig stop)"
            )
        if report.state == "sleep":
            self._trust.doubt()  # its motors had been off
        waits = stuck or report.state in ("hold", "sleep")
        if waits or session.deaf or not session.in_step:
            self._reset_standing(session)
        if report.state == "check":
            raise StageError("the board is in check mode ($C); type $C to leave it")

    def _wait_for_report(self, session: GrblSession) -> Report:
        for _ in range(3):
            report = session.ask(self._config.answer_timeout_s)
            if report is not None:
                return report
            if session.deaf:
                session.reset()
        if session.reset() and session.report is not None:
            self._trust.doubt()
            return session.report
        raise StageTimeoutError("the stage does not answer; look at cable and power")

    def _reset_standing(self, session: GrblSession) -> None:
        if not session.reset():
            self._trust.doubt()
            raise StageTimeoutError("the stage does not answer a reset; cut its power")
        self._trust.note(session)

    def _check_travel(self, machine_mm: float) -> None:
        travel = self.limits.travel_mm
        slack = self.limits.step_mm / 2.0
        if travel and not travel[0] - slack <= machine_mm <= travel[1] + slack:
            raise InterlockError(
                f"machine position must be from {travel[0]:g} to {travel[1]:g} mm; "
                f"instead received {machine_mm:g} mm; nothing was sent"
            )

    def _machine_mm(self) -> float | None:
        machine = self._session.machine() if self._session else None
        return machine[self._axis] if machine and len(machine) > self._axis else None

    def _require_session(self) -> GrblSession:
        if self._session is None:
            raise StageError("the stage is not connected")
        return self._session

    def _require_link(self) -> Link:
        if self._link is None:
            raise StageError("the stage is not connected")
        return self._link

    def _disconnect(self) -> None:
        if self._link:
            self._link.close()
        if self._presence:
            self._presence.release()
        self._link = self._session = self._presence = None
