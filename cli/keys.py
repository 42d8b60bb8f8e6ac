"""Keys and signals while a run goes: p pauses, SIGUSR1 too, SIGTERM ends it kindly."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import TYPE_CHECKING

from .keyboard import END, Keyboard, has_keys

if TYPE_CHECKING:
    from ..rig import RunControl

_POLL_S = 0.1


class Terminated(KeyboardInterrupt):
    """SIGTERM, treated as Ctrl-C."""


@contextlib.contextmanager
def terminating() -> Iterator[None]:
    """Treat SIGTERM as Ctrl-C: the stage is held, the ending written, helpers end."""

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        raise Terminated

    previous = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


@contextlib.contextmanager
def answering() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM end a prompt at once: nothing else is going on."""
    with contextlib.ExitStack() as undo:
        for number in (signal.SIGINT, signal.SIGTERM):
            previous = signal.signal(number, signal.default_int_handler)
            undo.callback(signal.signal, number, previous)
        yield


@contextlib.contextmanager
def pausing(control: RunControl, *, keys: bool) -> Iterator[None]:
    """Let the signal USR1, and the key p if `keys`, pause the run and let it go on."""
    is_over = threading.Event()
    with contextlib.ExitStack() as undo:
        undo.callback(is_over.set)
        if hasattr(signal, "SIGUSR1"):
            previous = signal.signal(
                signal.SIGUSR1, lambda _number, _frame: control.toggle_pause()
            )
            undo.callback(signal.signal, signal.SIGUSR1, previous)
        if keys and has_keys() and sys.stderr.isatty():
            listener = threading.Thread(
                target=_listen,
                args=(undo.enter_context(Keyboard()), control, is_over),
                daemon=True,
                name="keys",
            )
            listener.start()
        yield


def _listen(keyboard: Keyboard, control: RunControl, is_over: threading.Event) -> None:
    while not is_over.is_set():
        key = keyboard.key(_POLL_S)
        if key in ("p", "P"):
            control.toggle_pause()
        elif key == END:
            return
