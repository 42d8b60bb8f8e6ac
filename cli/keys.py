"""Keys and signals while a run goes: p pauses, SIGUSR1 too, SIGTERM ends it kindly."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..rig.control import RunControl

_POLL_S = 0.1


@contextlib.contextmanager
def terminating() -> Iterator[None]:
    """Treat SIGTERM as Ctrl-C, so that the stage is held and the ending written."""

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    previous = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


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
        if keys and sys.stdin.isatty() and sys.stderr.isatty():
            undo.enter_context(_single_keys())
            threading.Thread(
                target=_listen, args=(control, is_over), daemon=True, name="keys"
            ).start()
        yield


@contextlib.contextmanager
def _single_keys() -> Iterator[None]:
    """Read keys without Enter; Ctrl-C keeps its meaning."""
    if os.name != "posix":
        yield
        return
    import termios
    import tty

    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor)
    try:
        yield
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _listen(control: RunControl, is_over: threading.Event) -> None:
    while not is_over.is_set():
        if _key(_POLL_S) in ("p", "P"):
            control.toggle_pause()


def _key(timeout_s: float) -> str:
    if os.name == "posix":
        import select

        ready, _, _ = select.select([sys.stdin], [], [], timeout_s)
        return os.read(sys.stdin.fileno(), 1).decode("latin-1") if ready else ""
    import msvcrt
    import time

    time.sleep(timeout_s)
    return msvcrt.getwch() if msvcrt.kbhit() else ""  # type: ignore[attr-defined,no-any-return]
