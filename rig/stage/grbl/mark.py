"""A mark on the board that a restart clears: the sign that nobody cut its power.

The feed of the modal state (``F`` in ``$G``) begins at 0 whenever the firmware starts,
and no jog changes it. A few millimetres a minute are written there when the stage is
left: slow, should another program move without saying how fast.
"""

from __future__ import annotations

import contextlib
import random
import re

from ....core.errors import StageError
from .protocol import Message
from .session import GrblSession

_SLOWEST, _FASTEST = 11, 59
_FEED = re.compile(r"\bF\s*(\d+(?:\.\d+)?)")


def read_mark(session: GrblSession) -> float | None:
    """Return the mark of a board that stands in Idle; None if it tells none."""
    with contextlib.suppress(StageError):
        for line in session.command("$G"):
            found = isinstance(line, Message) and _FEED.search(line.text)
            if found:
                return float(found.group(1))
    return None


def set_mark(session: GrblSession) -> float | None:
    """Write a new mark; return it as the board reads it back, or None."""
    mark = random.randint(_SLOWEST, _FASTEST)
    with contextlib.suppress(StageError):
        session.command(f"F{mark}")
        if read_mark(session) == float(mark):
            return float(mark)
    return None
