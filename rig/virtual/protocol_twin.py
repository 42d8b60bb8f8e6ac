"""``twin://NAME``: a virtual board behind pyserial's own interface.

``twin://NAME`` is a board that a program has registered with `register_board`.
``twin://PATH.json`` (or ``twin://`` with no name) is a board of its own: a path keeps
settings and position between programs, as a powered board would. ``?board=`` says which
firmware it plays (grbl, grblhal, fluidnc, marlin), ``?speed=`` how fast its time runs.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from serial import PortNotOpenError, SerialBase, SerialException

from ...core.errors import StageError
from ..clock import Clock, ScaledClock, SystemClock
from .board.file import Board, load_board, save_board

_SLICE_S = 0.005
_BOARDS: dict[str, tuple[Board, Clock]] = {}


def register_board(name: str, board: Board, clock: Clock) -> str:
    """Give a board a name; return the URL of its port.

    Parameters
    ----------
    name : str
        Letters, digits, dots and dashes.
    board : Board
        The board.
    clock : Clock
        The clock that moves it: hand the same one to the driver.
    """
    _BOARDS[name] = (board, clock)
    return f"twin://{name}"


def forget_board(name: str) -> None:
    """Take a name back."""
    _BOARDS.pop(name, None)


class Serial(SerialBase):
    """The port of a virtual board, as pyserial shows a port."""

    def __init__(self, *args: Any, **options: Any) -> None:
        self._board: Board | None = None
        self._clock: Clock = SystemClock()
        self._start_s = 0.0
        self._pending = bytearray()
        self._state_file: Path | None = None
        super().__init__(*args, **options)

    def open(self) -> None:
        """Open the port; opening restarts a board with `restart_on_open`."""
        if self.is_open:
            raise SerialException("Port is already open.")
        parts = urlsplit(self.portstr or "twin://")
        name = f"{parts.netloc}{parts.path}"
        if name in _BOARDS:
            self._board, self._clock = _BOARDS[name]
        else:
            self._board = self._own_board(name, parse_qs(parts.query))
        if not self._board.plugged:
            self._board = None
            raise SerialException(f"could not open port {self.portstr}: unplugged")
        if self._board.port_taken:
            self._board = None
            raise SerialException("Could not exclusively lock port: it is busy")
        self._board.port_taken = True
        self._start_s = self._clock.monotonic_s() - self._board.now_s
        self._board.read()
        if self._board.restart_on_open:
            self._board.power_cycle(boot_s=1.6)
        self.is_open = True

    def close(self) -> None:
        """Close the port."""
        if self._board is not None:
            self._board.port_taken = False
            self._save()
        self._board = None
        self.is_open = False

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read now."""
        self._catch_up()
        return len(self._pending)

    def read(self, size: int = 1) -> bytes:
        """Read up to `size` bytes, waiting as long as the timeout says."""
        left_s = self.timeout if self.timeout is not None else 1e9
        while True:
            self._catch_up()
            if self._pending or left_s <= 0.0:
                data = bytes(self._pending[:size])
                del self._pending[:size]
                return data
            wait_s = min(_SLICE_S, left_s)
            self._clock.sleep(wait_s)
            left_s -= wait_s

    def write(self, data: Any, /) -> int:
        """Send bytes to the board."""
        self._catch_up().receive(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Nothing waits on this side."""

    def reset_input_buffer(self) -> None:
        """Throw away what has been received."""
        self._catch_up()
        self._pending.clear()

    def reset_output_buffer(self) -> None:
        """Nothing waits on this side."""

    def _catch_up(self) -> Board:
        if not self.is_open or self._board is None:
            raise PortNotOpenError
        now_s = self._clock.monotonic_s() - self._start_s
        self._board.advance(max(now_s - self._board.now_s, 0.0))
        if not self._board.plugged:
            raise SerialException(
                "device reports readiness to read but returned no data "
                "(device disconnected or multiple access on port?)"
            )
        self._pending += self._board.read()
        return self._board

    def _own_board(self, name: str, query: dict[str, list[str]]) -> Board:
        speed = float(query.get("speed", ["1"])[0])
        self._clock = SystemClock() if speed == 1.0 else ScaledClock(speed)
        if name and not name.endswith(".json"):
            raise SerialException(f"there is no virtual board named {name}")
        self._state_file = Path(name) if name else None
        try:
            return load_board(self._state_file, query.get("board", ["grbl"])[0])
        except StageError as error:
            raise SerialException(str(error)) from None

    def _save(self) -> None:
        if self._state_file is not None and self._board is not None:
            save_board(self._board, self._state_file)

    def _reconfigure_port(self, *_: Any, **__: Any) -> None:
        """Baud and parity mean nothing to a virtual port."""

    _update_rts_state: Callable[[Any], None] = _reconfigure_port
    _update_dtr_state: Callable[[Any], None] = _reconfigure_port
    _update_break_state: Callable[[Any], None] = _reconfigure_port
