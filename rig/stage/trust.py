"""How far the count of a board can be trusted, and what shakes that trust."""

from __future__ import annotations

from typing import Protocol

from ..errors import PositionLostError
from .protocol import PositionState

Place = tuple[float, ...]


class Counting(Protocol):
    """A conversation with a board that counts where it is.

    Attributes
    ----------
    restarts : int
        How often the board restarted without being asked to.
    """

    restarts: int

    def machine(self) -> Place | None:
        """Return the last reported machine position of the axes, in mm."""
        ...


class PositionTrust:
    """Trust in the count of one board.

    Attributes
    ----------
    state : {"unknown", "homed", "unverified"}
        How far the position can be trusted.
    why : str
        What took the trust away, if that is known and not told elsewhere.
    way_out : str
        What gives it back.
    """

    def __init__(self, way_out: str = "home it first (magbend rig home)") -> None:
        self.why = ""
        self.way_out = way_out
        self._stood_at: Place | None = None
        self._restarts = 0
        self.state: PositionState = "unknown"

    def watch(self, session: Counting) -> None:
        """Begin with a fresh session, of which nothing is known."""
        self.lose()
        self._restarts = session.restarts
        self._stood_at = session.machine()

    def confirm(self, session: Counting) -> None:
        """Say that the position is right, here and now."""
        self.state, self.why = "homed", ""
        self._restarts = session.restarts
        self._stood_at = session.machine()

    def stands(self, session: Counting) -> None:
        """Note where the stage stands after a move or a hold."""
        self._stood_at = session.machine()

    def doubt(self, why: str = "") -> None:
        """Say that something did not end as it should."""
        if self.state == "homed":
            self.state, self.why = "unverified", why

    def lose(self, why: str = "") -> None:
        """Say that the position is lost."""
        self.state, self._stood_at, self.why = "unknown", None, why

    def refusal(self) -> PositionLostError:
        """Return the error that says why nothing moves, and the way out."""
        because = f" ({self.why})" if self.why else ""
        return PositionLostError(
            f"the position of the stage is {self.state}{because}; {self.way_out}, "
            "then move"
        )

    def note(self, session: Counting) -> None:
        """Take in whether the board restarted."""
        if session.restarts != self._restarts:
            self._restarts = session.restarts
            self.lose()

    def is_at(self, session: Counting, place: Place, slack_mm: float) -> bool:
        """Return whether the board counts this place on all axes."""
        now = session.machine()
        if now is None or len(now) != len(place):
            return False
        return all(abs(a - b) <= slack_mm for a, b in zip(now, place, strict=True))

    def require(self, session: Counting, slack_mm: float) -> None:
        """Refuse motion unless the board is homed and where it was left.

        Raises
        ------
        PositionLostError
            If the position is not known, or the board moved or restarted unseen.
        """
        stood = self._stood_at
        if self.state == "homed" and stood and not self.is_at(session, stood, slack_mm):
            self.lose()
            raise PositionLostError(
                f"the board counts {session.machine()} mm where it had stood at "
                f"{stood} mm: it restarted, or another program moved it; home it "
                "(magbend rig home)"
            )
        if self.state != "homed":
            raise self.refusal()
