"""Single keys from the terminal, by name, on POSIX systems and on Windows."""

from __future__ import annotations

import importlib
import os
import re
import select
import sys
import time
from types import TracebackType
from typing import Any

_POSIX = os.name == "posix"
_KEYS = re.compile(r"\x1b[\[O][0-9;]*([A-Za-z~])|(.)", re.DOTALL)
_ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left"}
_WINDOWS_ARROWS = {"H": "up", "P": "down", "M": "right", "K": "left"}
_WINDOWS_POLL_S = 0.02

END = "end"
"""The name of the key that says that the terminal is gone."""


def has_keys() -> bool:
    """Return whether this process has a terminal and is in its foreground.

    A process in the background that reads keys is stopped by the system.
    """
    if not sys.stdin.isatty():
        return False
    return not _POSIX or os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()


class Keyboard:
    """The keys of the terminal, without Enter; Ctrl-C keeps its meaning.

    Use it in a ``with`` block, and one thread at a time.
    """

    def __init__(self) -> None:
        self._pending: list[str] = []
        self._mode: list[Any] | None = None

    def __enter__(self) -> Keyboard:
        if _POSIX:
            import termios
            import tty

            self._mode = termios.tcgetattr(sys.stdin.fileno())
            tty.setcbreak(sys.stdin.fileno())
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        if self._mode is not None:
            import termios

            termios.tcsetattr(sys.stdin.fileno(), termios.TCSADRAIN, self._mode)

    def key(self, timeout_s: float) -> str:
        """Return the next key, or an empty text when none came in time.

        A letter is itself; arrows are ``up``, ``down``, ``left``, ``right``.
        """
        if not self._pending:
            self._pending = (_posix if _POSIX else _windows)(timeout_s)
        return self._pending.pop(0) if self._pending else ""


def _posix(timeout_s: float) -> list[str]:
    descriptor = sys.stdin.fileno()
    if not has_keys():  # sent to the background meanwhile
        time.sleep(timeout_s)
        return []
    if not select.select([descriptor], [], [], timeout_s)[0]:
        return []
    try:
        text = os.read(descriptor, 64).decode("utf-8", "replace")
    except OSError:
        text = ""
    if not text:
        return [END]
    return [letter or _ARROWS.get(escape, "") for escape, letter in _KEYS.findall(text)]


def _windows(timeout_s: float) -> list[str]:
    msvcrt = importlib.import_module("msvcrt")
    deadline_s = time.monotonic() + timeout_s
    while not msvcrt.kbhit():
        if time.monotonic() >= deadline_s:
            return []
        time.sleep(_WINDOWS_POLL_S)
    key = msvcrt.getwch()
    if key in ("\x00", "\xe0"):
        key = _WINDOWS_ARROWS.get(msvcrt.getwch(), "")
    return [key]
