"""Bring a GRBL board to where it takes a line, and say why it may not move."""

from __future__ import annotations

from ....core.errors import StageError
from ...errors import PositionLostError, StageTimeoutError
from ..trust import PositionTrust
from .motion import stands
from .protocol import Report, alarm_text
from .session import GrblSession

_NO_RESET = "the stage does not answer a reset; cut its power"


def note(session: GrblSession, trust: PositionTrust) -> None:
    """Take in what the board has said: restarts, and alarms that lose the position."""
    trust.note(session)
    if session.alarm is not None and not alarm_text(session.alarm).position_kept:
        trust.state = "unknown"


def wait_for_report(
    session: GrblSession, trust: PositionTrust, timeout_s: float
) -> Report:
    """Return a report; a board that is deaf or silent is reset.

    Raises
    ------
    StageTimeoutError
        If it does not answer a reset either.
    """
    for _ in range(3):
        report = session.ask_place(timeout_s)
        if report is not None:
            return report
        if session.deaf:
            session.reset()
    if session.reset() and session.report is not None:
        trust.doubt()
        return session.report
    raise StageTimeoutError("the stage does not answer; look at cable and power")


def reset_standing(session: GrblSession, trust: PositionTrust) -> None:
    """Reset a board that stands: it keeps its position, and is in step again.

    Raises
    ------
    StageTimeoutError
        If it does not answer.
    """
    if not session.reset():
        trust.doubt()
        raise StageTimeoutError(_NO_RESET)
    note(session, trust)


def make_ready(session: GrblSession, trust: PositionTrust, timeout_s: float) -> None:
    """Bring the board to where it takes a line: standing, in step, not deaf.

    Raises
    ------
    StageError
        If it moves, is in check mode, or does not answer.
    """
    report = wait_for_report(session, trust, timeout_s)
    note(session, trust)
    stuck = report.state == "home"  # a running cycle answers no question
    if not (stands(report) or stuck):
        raise StageError(
            f"the stage is in {report.state}; wait for it, or stop it first "
            "(magbend rig stop)"
        )
    if report.state == "sleep":
        trust.doubt()  # its motors had been off
    waits = stuck or report.state in ("hold", "sleep", "door")
    if waits or session.deaf or not session.in_step:
        reset_standing(session, trust)
    refuse_open_door(session)
    if report.state == "check":
        raise StageError("the board is in check mode ($C); type $C to leave it")


def refuse_open_door(session: GrblSession) -> None:
    """Refuse to go on while the safety door is open.

    Raises
    ------
    StageError
        If it is.
    """
    if session.report is not None and session.report.state == "door":
        raise StageError(
            "the board is in Door: its safety door input is open, and it takes no line "
            "until that closes; close it, or tie the input off, then connect again"
        )


def require_unlocked(session: GrblSession) -> None:
    """Refuse motion while an alarm locks the board.

    Raises
    ------
    AlarmError
        If its number is known.
    PositionLostError
        If it is not.
    """
    if session.report is None or session.report.state != "alarm":
        return
    if session.alarm is not None:
        raise session.alarm_error(session.alarm)
    raise PositionLostError("the board is locked (Alarm); home it (magbend rig home)")


def require_open_switch(session: GrblSession, axis: str) -> None:
    """Refuse motion while the limit switch of the axis is closed.

    A hard limit needs a change of the pin: GRBL itself would drive on into it.

    Raises
    ------
    PositionLostError
        If it is closed.
    """
    pins = session.report.pins if session.report else ""
    if axis in pins:
        raise PositionLostError(
            f"the limit switch of {axis} is closed (Pn:{pins}); free "
            "it and home the stage"
        )
