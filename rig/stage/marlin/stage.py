"""A board that speaks Marlin's dialect as a `Stage`; GRBL is the first choice.

Marlin cannot slow down on request without losing steps: a hold lets the short piece
that runs come to its end, a stop (``M410``) loses the position.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from typing import NoReturn

from ....core.errors import StageError
from ...errors import (
    LinkLostError,
    NotStoppedError,
    PositionLostError,
    StageTimeoutError,
    StoppedError,
)
from ...link import Link
from ..config import StageConfig
from ..protocol import Moved, StageIdentity, StageLimits, StageStatus
from ..serial import MARGIN_S, SerialStage, stopped
from ..stopping import StopProof
from .session import LineRefusedError, MarlinSession, MarlinSetup, read_setup

_HOME_S = 120.0
_PIECE_S = 0.75
_STILL_S = 0.1


class MarlinStage(SerialStage[MarlinSession]):
    """One axis of a Marlin board; made as `SerialStage` is."""

    _piece_s = MARGIN_S  # how long the piece that runs may take

    def _meet(self, link: Link) -> MarlinSession:
        config = self._config
        session = MarlinSession(
            link, self._clock, answer_timeout_s=config.answer_timeout_s
        )
        firmware, lines = _question(session, config.boot_s)
        setup = read_setup(lines, config.axis)
        problem = _audit(setup, config)
        if problem:
            raise StageError(f"the stage on {link.port} does not fit: {problem}")
        self._limits = StageLimits(
            step_mm=1.0 / setup.steps_per_mm,
            max_feed_mm_min=60.0 * setup.max_feed_mm_s,
            acceleration_mm_s2=setup.acceleration_mm_s2,
            travel_mm=setup.travel_mm,
        )
        self._identity = StageIdentity(
            driver="marlin", firmware=firmware, port=link.port, details=tuple(lines)
        )
        self._trust.watch(session)
        self._map_doubt, self._is_lent = "", False
        self._compare_with_measured()
        return session

    def home(self) -> None:
        """Home this axis alone (``G28``) and wait for the end."""
        session = self._require_session()
        self._require_switches()
        self._trust.lose()
        limit_s = self._config.home_timeout_s or _HOME_S
        with self._stand_if_interrupted(at_once=True):
            session.make_ready()
            lines = session.command(
                f"G28 {self._config.axis}",
                timeout_s=limit_s,
                check=self._stop_homing_if_asked,
            )
        failed = next((text for text in lines if "fail" in text.lower()), None)
        if failed:
            raise StageError(f"homing failed: {failed}")
        self._machine_mm()
        self._trust.confirm(session)

    def _stop_homing_if_asked(self) -> None:
        if self.stop_requested():
            raise StoppedError(stopped(self.stop()))

    def _standing_mm(self) -> float:
        return self._known_mm()

    def _ready_mm(self) -> float:
        session = self._require_session()
        here = self._known_mm()
        self._note(session)
        self._trust.require(session, self.limits.tolerance_mm)
        return here

    def status(self) -> StageStatus:
        """Ask for the position; no answer is the state ``silent``."""
        session = self._require_session()
        here, trouble = None, None
        try:
            here = self._machine_mm()
        except LinkLostError:
            raise
        except StageError as error:
            trouble = error
        self._note(session)
        lost = isinstance(trouble, PositionLostError)
        return StageStatus(
            state="idle" if trouble is None else "alarm" if lost else "silent",
            machine_mm=here,
            position_state=self.position_state,
            trouble=trouble if lost else None,
        )

    def listen(self) -> None:
        """Take in what the board says unasked; nothing is sent.

        Raises
        ------
        PositionLostError, LinkLostError
            If it restarted or was halted, or is gone.
        """
        session = self._require_session()
        restarts = session.restarts
        session.drain()
        self._note(session)
        if session.restarts != restarts or session.halted:
            raise PositionLostError(
                "the board restarted or was halted; home it (magbend rig home)"
            )

    def hold(self) -> StopProof:
        """Let the short piece that runs come to its end; the position stays good.

        Raises
        ------
        StageTimeoutError
            If it cannot be proved to stand, even after ``M410``.
        """
        session, start_s = self._require_session(), self._clock.monotonic_s()
        from_mm, idle = session.place_mm, not self._is_under_way
        try:
            session.command("M400", timeout_s=self._piece_s)
            here = self._machine_mm()
        except StageTimeoutError as error:
            return self._stop_hard(f"end of the piece: {error}")
        self._trust.stands(session)
        run_out = None if here is None or from_mm is None else abs(here - from_mm)
        self.last_stop = StopProof(
            means="nothing" if idle else "end of the piece",
            stood_s=self._clock.monotonic_s() - start_s,
            machine_mm=here,
            run_out_mm=run_out,
        )
        self._stop_is_met()
        return self.last_stop

    def stop(self) -> StopProof:
        """``M410``: stop at once, steps are lost.

        Raises
        ------
        StageTimeoutError
            If it cannot be proved to stand.
        """
        return self._stop_hard("")

    def _stop_hard(self, lack: str) -> StopProof:
        start_s = self._clock.monotonic_s()
        self._trust.doubt()
        self._cry_stop()
        try:
            first = self._machine_mm()
            self._clock.sleep(_STILL_S)
            here = self._machine_mm()
        except StageTimeoutError:
            first = here = None
        if here is None or here != first:
            self._stop_is_met()
            raise NotStoppedError(
                "the stage could not be proved to stand, even after M410: cut the "
                "power of its motors"
            )
        self.last_stop = StopProof(
            means="reset",
            tried=(lack,) if lack else (),
            stood_s=self._clock.monotonic_s() - start_s,
            machine_mm=here,
            is_place_kept=False,
        )
        self._stop_is_met()
        return self.last_stop

    def _cry_stop(self) -> None:
        self._require_session().interrupt("M410")

    def recover(self) -> None:
        """Connect again; the stage must be homed then."""
        self.connect()

    def unlock(self) -> None:
        """Connect again: a halted Marlin must be restarted."""
        self.connect()

    def _move_piece(self, target_mm: float, feed_mm_min: float, moved: Moved) -> None:
        session, axis = self._require_session(), self._config.axis
        start = session.place_mm
        distance = 0.0 if start is None else target_mm - start
        self._piece_s = self._limit_s(distance, feed_mm_min)
        try:
            session.command(f"G1 {axis}{target_mm:.3f} F{feed_mm_min:.1f}")
            session.command("M400", timeout_s=self._piece_s)
            here = self._machine_mm()
        except PositionLostError:
            self._trust.lose()
            raise
        except LinkLostError:
            self._trust.doubt()
            raise
        except StageTimeoutError as error:
            self._give_up(error)
        if here is None or not self._is_at(target_mm, here):
            self._trust.doubt()
            raise StageTimeoutError(
                f"the stage stopped at {here} mm instead of {target_mm:.3f} mm"
            )
        self._trust.stands(session)
        moved(target_mm)

    def _give_up(self, error: StageTimeoutError) -> NoReturn:
        """Stop what did not end in time, and say what that took."""
        try:
            how = self.stop().sentence().partition(";")[0]
        except StageError as failure:
            how = str(failure)
        raise StageTimeoutError(
            f"{error}; the stage was stopped ({how}) and its position is unverified: "
            "home it"
        ) from None

    def _longest_piece_mm(self, feed_mm_min: float) -> float:
        # A piece cannot be cut short: a stop must wait for its end.
        return min(self._config.piece_mm, feed_mm_min / 60.0 * _PIECE_S)

    def _note(self, session: MarlinSession) -> None:
        self._trust.note(session)
        if session.halted:
            self._trust.lose()

    def _machine_mm(self) -> float | None:
        return self._require_session().ask_place(self._config.axis, self.limits.step_mm)

    def _known_mm(self) -> float:
        """Return where the board stands, ready to be sent elsewhere by its count."""
        session = self._require_session()
        session.make_ready()
        here, planned = self._machine_mm(), session.planned_mm
        if here is None:
            raise PositionLostError("the stage does not report its position; home it")
        if planned is not None and not self._is_at(planned, here):
            raise StageError(
                f"the board counts {here:.3f} mm where its coordinates say "
                f"{planned:.3f} mm: it moves, or they are offset by G92 or M206; wait, "
                "or clear the offset (G92.1, M206 X0 Y0 Z0)"
            )
        return here

    def _is_at(self, target_mm: float, here_mm: float) -> bool:
        # The board rounds to whole steps and reports two decimals.
        return abs(here_mm - target_mm) <= 1.01 * self.limits.step_mm + 0.01


def _question(session: MarlinSession, boot_s: float) -> tuple[str, list[str]]:
    """Wait for the board, then ask for firmware, settings and end stops."""
    session.listen(min(boot_s, 2.5), boot_s)
    for attempt in range(3):
        try:
            lines = session.command("M115")
            break
        except StageTimeoutError:
            if attempt == 2:
                raise StageTimeoutError(
                    "nobody answers M115 as Marlin does: look at cable, port and baud"
                ) from None
    firmware = next((text for text in lines if "FIRMWARE_NAME" in text), "")
    if not firmware:
        raise StageError("the board answers, but not with Marlin's FIRMWARE_NAME")
    with contextlib.suppress(LineRefusedError):  # a build that knows no inches
        session.command("G21")  # where an earlier program left inches, M503 tells them
    settings = session.command("M503")
    with contextlib.suppress(LineRefusedError):  # a build without soft end stops
        settings += session.command("M211")
    return firmware, settings


def _audit(setup: MarlinSetup, config: StageConfig) -> str | None:
    rows: Sequence[tuple[str, float, float | None]] = (
        ("M92 (steps/mm)", setup.steps_per_mm, config.steps_per_mm),
        ("M203 (max. feed in mm/min)", 60.0 * setup.max_feed_mm_s,
         config.max_feed_mm_min),
        ("M201 (acceleration in mm/s2)", setup.acceleration_mm_s2,
         config.acceleration_mm_s2),
    )  # fmt: skip
    for name, found, wanted in rows:
        if wanted is not None and not math.isclose(found, wanted, rel_tol=1e-4):
            return f"{name} is {found:g}, the rig file says {wanted:g}"
    return None
