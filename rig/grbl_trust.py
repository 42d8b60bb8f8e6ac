"""How far the position of a GRBL board can be trusted, and what shakes that trust."""

from __future__ import annotations

from .grbl_protocol import Triple, alarm_text
from .grbl_session import GrblSession
from .stage import PositionLostError, PositionState


class PositionTrust:
    """Trust in the count of one board.

    Parameters
    ----------
    axis : str
        ``X``, ``Y`` or ``Z``.

    Attributes
    ----------
    state : {"unknown", "homed", "unverified"}
        How far the position can be trusted.
    """

    def __init__(self, axis: str) -> None:
        self._axis = axis
        self._stood_at: Triple | None = None
        self._restarts = 0
        self.state: PositionState = "unknown"

    def watch(self, session: GrblSession) -> None:
        """Begin with a fresh session, of which nothing is known."""
        self.lose()
        self._restarts = session.restarts
        self._stood_at = session.machine()

    def confirm(self, session: GrblSession) -> None:
        """Say that the position is right, here and now."""
        self.state = "homed"
        self._restarts = session.restarts
        self._stood_at = session.machine()

    def stands(self, session: GrblSession) -> None:
        """Note where the stage stands after a move or a hold."""
        self._stood_at = session.machine()

    def doubt(self) -> None:
        """Say that something did not end as it should."""
        if self.state == "homed":
            self.state = "unverified"

    def lose(self) -> None:
        """Say that the position is lost."""
        self.state, self._stood_at = "unknown", None

    def note(self, session: GrblSession) -> None:
        """Take in what the board has said: restarts and alarms."""
        if session.restarts != self._restarts:
            self._restarts = session.restarts
            self.lose()
        if session.alarm is not None and not alarm_text(session.alarm).position_kept:
            self.state = "unknown"

    def is_at(self, session: GrblSession, place: Triple, step_mm: float) -> bool:
        """Return whether the board counts this place on all axes."""
        now = session.machine()
        if now is None or len(now) != len(place):
            return False
        slack = 1.5 * step_mm
        return all(abs(a - b) <= slack for a, b in zip(now, place, strict=True))

    def require(self, session: GrblSession, step_mm: float) -> None:
        """Refuse motion unless the board is where it was left, homed and free.

        Raises
        ------
        AlarmError
            If an alarm locks it.
        PositionLostError
            If the position is not known, the board moved or restarted unseen, or the
            limit switch of the axis is closed.
        """
        report = session.report
        if report and report.state == "alarm":
            if session.alarm is not None:
                raise session.alarm_error(session.alarm)
            raise PositionLostError(
                "the board is locked (Alarm); home it (magbend rig home)"
            )
        stood = self._stood_at
        if self.state == "homed" and stood and not self.is_at(session, stood, step_mm):
            self.lose()
            raise PositionLostError(
                f"the board counts {session.machine()} mm where it had stood at "
                f"{stood} mm: it restarted, or another program moved it; home it "
                "(magbend rig home)"
            )
        if self.state != "homed":
            raise PositionLostError(
                f"the position of the stage is {self.state}; home it first "
                "(magbend rig home), then move"
            )
        if report and self._axis in report.pins:
            raise PositionLostError(
                f"the limit switch of {self._axis} is closed (Pn:{report.pins}); free "
                "it and home the stage"
            )
