"""A virtual board on a pseudo-terminal: any program can talk to it (Linux, macOS)."""

from __future__ import annotations

import contextlib
import os
import select
import threading

from ...core.errors import StageError
from ..clock import Clock
from .board.file import Board

_SLICE_S = 0.005


class PtyBoard:
    """Serve a board on a pseudo-terminal from a thread; use it in a ``with`` block.

    Attributes
    ----------
    port : str
        Name of the port to open, such as ``/dev/pts/3``.

    Raises
    ------
    StageError
        If the system has no pseudo-terminals.
    """

    def __init__(self, board: Board, clock: Clock) -> None:
        if not hasattr(os, "openpty"):
            raise StageError("this system has no pseudo-terminals; use twin:// instead")
        import tty

        self._board = board
        self._clock = clock
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        self._slave = slave  # kept open: a port that is closed must not hang up
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> PtyBoard:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()

    def unplug(self) -> None:
        """Take the device away, as a pulled cable does."""
        if not self._ended.is_set():
            self._ended.set()
            self._thread.join()
            for descriptor in (self._slave, self._master):
                with contextlib.suppress(OSError):
                    os.close(descriptor)

    def _serve(self) -> None:
        board, start_s = self._board, self._clock.monotonic_s() - self._board.now_s
        while not self._ended.is_set():
            ready, _, _ = select.select([self._master], [], [], _SLICE_S)
            now_s = self._clock.monotonic_s() - start_s
            board.advance(max(now_s - board.now_s, 0.0))
            with contextlib.suppress(OSError):
                if ready:
                    board.receive(os.read(self._master, 4096))
                output = board.read()
                if output:
                    os.write(self._master, output)
