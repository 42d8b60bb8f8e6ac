"""Pause and resume a run from outside: a key, a signal, or a file in its folder."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from ..clock import Check, go_on

PAUSE_FILE = "pause"
_POLL_S = 0.05

Report = Callable[[str], None]
"""Called with one line for the person at the bench."""


def quiet(_line: str) -> None:
    """Tell nobody."""


class RunControl:
    """What people can ask of a run while it goes.

    `toggle_pause` may be called from a signal handler or another thread; a file named
    ``pause`` in the run folder does the same from another terminal. The run stops at
    the next safe point: before a move, or before the photographs of a step.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder
        self._asked = threading.Event()

    @property
    def is_paused(self) -> bool:
        """Whether a pause is asked for."""
        has_file = self._folder is not None and (self._folder / PAUSE_FILE).exists()
        return self._asked.is_set() or has_file

    def toggle_pause(self) -> None:
        """Ask for a pause, or take the request back."""
        if self._asked.is_set():
            self._asked.clear()
        else:
            self._asked.set()

    def wait_while_paused(self, report: Report, *, check: Check = go_on) -> bool:
        """Wait until nobody asks for a pause; return whether there was one.

        `check` is called all the while; it may raise, to end the wait.
        """
        if not self.is_paused:
            return False
        report("\apaused: press p again, or remove the file named pause, to go on")
        tick = threading.Event()
        while self.is_paused:
            check()
            tick.wait(_POLL_S)
        report("going on")
        return True
