"""A serial line to a controller: one owner, whole lines, every byte on record.

The thread that opens the port owns it: only it may read and write lines. Real-time
bytes (feed hold, soft reset) may come from any thread, since one byte cannot be torn.
Time is the clock's, so that the same code runs on hardware and on the twin.
"""

from __future__ import annotations

import contextlib
import threading
from typing import Any

from ..core.errors import StageError
from .clock import Clock
from .errors import LinkLostError
from .ports import SERIAL_ERRORS, check_port, register_twin_urls, why_not_open
from .wire_log import WireLog

_SLICE_S = 0.02
_MAX_LINE = 4096


class Link:
    """One open serial port that speaks lines.

    Parameters
    ----------
    port : str
        Device name or pyserial URL.
    baud : int
        Speed.
    clock : Clock
        Time for all waits.
    log : WireLog, optional
        Where every byte is recorded.
    device : str
        Name in the log.
    dtr : bool or None
        Level of DTR on opening; None leaves it to the system. Many boards restart
        when it changes.
    """

    def __init__(
        self,
        port: str,
        *,
        baud: int,
        clock: Clock,
        log: WireLog | None = None,
        device: str = "stage",
        dtr: bool | None = None,
    ) -> None:
        self.port = port
        self._baud = baud
        self._clock = clock
        self._log = log
        self._device = device
        self._dtr = dtr
        self._serial: Any = None
        self._owner = 0
        self._buffer = bytearray()
        self._unlogged = bytearray()

    @property
    def is_open(self) -> bool:
        """Whether the port is open."""
        return self._serial is not None

    def open(self) -> None:
        """Open the port for this thread alone.

        Raises
        ------
        StageError
            If there is no such port, or another program holds it.
        """
        import serial

        register_twin_urls()
        try:
            check_port(self.port)
            options: dict[str, Any] = {"do_not_open": True, "timeout": _SLICE_S}
            port = serial.serial_for_url(
                self.port, self._baud, write_timeout=2.0, exclusive=True, **options
            )
            if self._dtr is not None:
                port.dtr = self._dtr
            port.open()
        except SERIAL_ERRORS as error:
            raise StageError(why_not_open(self.port, error)) from None
        self._serial = port
        self._owner = threading.get_ident()
        self._buffer.clear()
        self._unlogged.clear()
        self._remark(f"opened {self.port} at {self._baud}")

    def write(self, data: bytes) -> None:
        """Send bytes; only the owner may.

        Raises
        ------
        LinkLostError
            If the device is gone.
        StageError
            If another thread than the owner calls.
        """
        self._require_owner()
        self._send(data)

    def write_realtime(self, byte: bytes) -> None:
        """Send one real-time byte, from any thread.

        Raises
        ------
        LinkLostError
            If the device is gone.
        """
        self._send(byte)

    def read_line(self, timeout_s: float) -> str | None:
        """Return the next whole line without its end, or None when time is up.

        A line that has not ended stays in the buffer, also of a device that never ends
        one; empty lines are skipped.

        Raises
        ------
        LinkLostError
            If the device is gone.
        """
        self._require_owner()
        deadline_s = self._clock.monotonic_s() + timeout_s
        while (line := self._take_line()) is None:
            is_late = self._clock.monotonic_s() >= deadline_s
            self._receive()  # once more when late: what has come counts
            if is_late and b"\n" not in self._buffer:
                return None
        return line

    def waiting_lines(self) -> list[str]:
        """Return the whole lines that are already here, at once.

        Raises
        ------
        LinkLostError
            If the device is gone.
        """
        self._require_owner()
        if self._waiting():
            self._receive()
        return list(iter(self._take_line, None))

    def close(self) -> None:
        """Close the port; never raises."""
        port, self._serial = self._serial, None
        if port is not None:
            self._log_received(whole=False)
            with contextlib.suppress(*SERIAL_ERRORS):
                port.close()
            self._remark(f"closed {self.port}")

    def _send(self, data: bytes) -> None:
        port = self._require_open()
        self._log_received(whole=False)
        if self._log:
            self._log.record(self._device, ">>", data)
        try:
            port.write(data)
        except SERIAL_ERRORS as error:
            raise self._lost(error) from None

    def _receive(self) -> None:
        port = self._require_open()
        try:
            data = port.read(1)
            if data:
                data += port.read(port.in_waiting)
        except SERIAL_ERRORS as error:
            raise self._lost(error) from None
        self._buffer += data
        self._unlogged += data
        self._log_received(whole=True)

    def _log_received(self, *, whole: bool) -> None:
        """Record what came in, whole lines only or all of it."""
        end = self._unlogged.rfind(b"\n") + 1 if whole else len(self._unlogged)
        pieces = bytes(self._unlogged[:end]).splitlines(keepends=True)
        del self._unlogged[:end]
        for piece in pieces:
            if self._log:
                self._log.record(self._device, "<<", piece)

    def _waiting(self) -> bool:
        try:
            return bool(self._require_open().in_waiting)
        except SERIAL_ERRORS as error:
            raise self._lost(error) from None

    def _take_line(self) -> str | None:
        while True:
            end = self._buffer.find(b"\n")
            if end < 0:
                if len(self._buffer) > _MAX_LINE:
                    self._buffer.clear()
                return None
            line = bytes(self._buffer[:end]).strip(b"\r\0 ")
            del self._buffer[: end + 1]
            if line:
                return line.decode("latin-1")

    def _lost(self, error: Exception) -> LinkLostError:
        self._remark(f"link lost: {error}")
        self.close()
        return LinkLostError(
            f"link lost: the stage on {self.port} is gone; it finishes the move it had "
            "been sent and stops; plug it in, then reconnect and home it"
        )

    def _require_open(self) -> Any:
        if self._serial is None:
            raise LinkLostError(f"link lost: the port {self.port} is not open")
        return self._serial

    def _require_owner(self) -> None:
        if self._serial is not None and threading.get_ident() != self._owner:
            raise StageError(
                f"the port {self.port} belongs to the thread that opened it; "
                "another thread may only send real-time bytes"
            )

    def _remark(self, text: str) -> None:
        if self._log:
            self._log.record(self._device, "--", text)
