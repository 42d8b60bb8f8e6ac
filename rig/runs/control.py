"""Pause and resume a run from outside, and tell what it does."""

from __future__ import annotations

import threading
from collections.abc import Callable

from ...core.errors import RigError
from ..clock import Check, go_on
from ..control.state import BenchState

_POLL_S = 0.05

Report = Callable[[str], None]
"""Called with one line for the person at the bench."""


def quiet(_line: str) -> None:
    """Tell nobody."""


class RunControl:
    """What people can ask of a run while it goes, and what it tells them.

    `toggle_pause` may be called from a signal handler or another thread. The run stops
    at the next safe point: before a move, or before the photographs of a step.

    Attributes
    ----------
    state : BenchState
        What the run does just now, for ``magbend rig status`` and ``watch``.
    """

    def __init__(self) -> None:
        self.state = BenchState()
        self._is_asked = False  # no Event: its lock may be held under a signal

    @property
    def is_paused(self) -> bool:
        """Whether a pause is asked for."""
        return self._is_asked

    def toggle_pause(self) -> None:
        """Ask for a pause, or take the request back."""
        self._is_asked = not self._is_asked

    def pause(self) -> str:
        """Ask for a pause; return what happens, in a sentence.

        Raises
        ------
        RigError
            If it was asked for already.
        """
        if self._is_asked:
            raise RigError("the run is paused already; magbend rig resume goes on")
        self._is_asked = True
        return "the run pauses before its next move or photograph"

    def resume(self) -> str:
        """Let the run go on; return what happens, in a sentence.

        Raises
        ------
        RigError
            If it is not paused.
        """
        if not self._is_asked:
            raise RigError("the run is not paused")
        self._is_asked = False
        return "the run goes on"

    def wait_while_paused(self, report: Report, *, check: Check = go_on) -> bool:
        """Wait until nobody asks for a pause; return whether there was one.

        `check` is called all the while; it may raise, to end the wait.
        """
        if not self.is_paused:
            return False
        before = self.state.now()["state"]
        self.state.stand_still()
        self.state.tell(state="paused")
        report("\apaused: press p again, or magbend rig resume, to go on")
        tick = threading.Event()
        while self.is_paused:
            check()
            tick.wait(_POLL_S)
        self.state.go_on()
        self.state.tell(state=before)
        report("going on")
        return True
