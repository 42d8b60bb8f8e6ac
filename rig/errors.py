"""What can go wrong with a stage, each with a kind of its own."""

from __future__ import annotations

from ..core.errors import StageError


class AlarmError(StageError):
    """The controller raised an alarm and refuses motion.

    Parameters
    ----------
    code : int
        The alarm's number, as the firmware gives it.
    meaning : str
        What the number means.
    remedy : str
        What to do now.
    position_kept : bool
        Whether the controller vouches for its position.
    """

    def __init__(
        self, code: int, meaning: str, remedy: str, *, position_kept: bool
    ) -> None:
        super().__init__(f"the stage raised ALARM:{code} ({meaning}); {remedy}")
        self.code = code
        self.meaning = meaning
        self.remedy = remedy
        self.position_kept = position_kept


class LinkLostError(StageError):
    """The port is gone: the stage finishes what it had been sent and stops there."""


class PositionLostError(StageError):
    """The stage does not know where it is: motion is refused until it is homed."""


class StageTimeoutError(StageError):
    """The stage did not answer, or did not arrive, in the time the move allows."""


class InterlockError(StageError):
    """A position that is refused before a byte is sent."""


class StoppedError(StageError):
    """A stop was asked for (``magbend rig stop``) while the stage moved."""


class NotStoppedError(StageError):
    """No means could be proved to have stopped the stage: cut its power."""
