"""Ctrl-C as a request: asked for at once, met at the next safe point.

An exception raised by a signal handler strikes between any two instructions: inside a
lock, half-way through a reply, in a generator that is dead ever after. So the first
signal only asks, and every wait of the rig looks at the request ten times a second. A
second one, from somebody who will not wait, does raise, where a block allows it.
"""

from __future__ import annotations

import contextlib
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType

_SAME_PRESS_S = 0.3


class StopAtOnce(KeyboardInterrupt):
    """A second Ctrl-C: no slowing down any more."""


class Interrupts:
    """What Ctrl-C, SIGTERM and a closed terminal ask for; made by `heed_interrupts`.

    Attributes
    ----------
    name : str
        The first that came: ``Ctrl-C``, ``SIGTERM`` or ``SIGHUP``; empty before.
    """

    def __init__(self, ask: Callable[[], None]) -> None:
        self._ask = ask
        self._last_s = -math.inf
        self._may_strike = False
        self.name = ""

    @contextlib.contextmanager
    def striking(self) -> Iterator[None]:
        """Let a second signal raise `StopAtOnce` in this block, once."""
        self._may_strike = True
        try:
            yield
        finally:
            self._may_strike = False

    def receive(self, number: int, _frame: FrameType | None) -> None:
        """Handle a signal: ask, or strike if it was asked before."""
        now_s = time.monotonic()
        # Terminals and the programs between deliver one press of Ctrl-C twice.
        if now_s - self._last_s < _SAME_PRESS_S:
            return
        self._last_s = now_s
        if not self.name:
            is_key = number == signal.SIGINT
            self.name = "Ctrl-C" if is_key else signal.Signals(number).name
            self._ask()
        elif self._may_strike:
            self._may_strike = False
            raise StopAtOnce


@contextlib.contextmanager
def heed_interrupts(ask: Callable[[], None]) -> Iterator[Interrupts]:
    """Turn the first Ctrl-C, SIGTERM or SIGHUP of this block into a call of `ask`.

    Parameters
    ----------
    ask : callable
        Called in the signal handler: it may set a flag and nothing more.

    Yields
    ------
    Interrupts
        What came. Outside the main thread signals do not arrive and nothing comes.
    """
    received = Interrupts(ask)
    if threading.current_thread() is not threading.main_thread():
        yield received
        return
    names = ("SIGINT", "SIGTERM", "SIGHUP")
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    with contextlib.ExitStack() as undo:
        for number in numbers:
            previous = signal.getsignal(number)
            if previous is not signal.SIG_IGN:  # nohup and background jobs mean it
                signal.signal(number, received.receive)
                undo.callback(signal.signal, number, previous)
        yield received
