"""A Tesla-meter behind a pyserial port: ``twinmeter://`` speaks the Lake Shore 425.

``serial.serial_for_url("twinmeter://?flux_mT=38.0")`` opens one that reads 38 mT. The
query keys are those of `TwinMeterPort.from_url_options`. It answers a question the
moment it is complete, byte for byte as the real meter: 7 bits, CR LF, no unit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from urllib.parse import parse_qs, urlsplit

import serial

_TESLA_PER_CODE = {"1": 1e-4, "2": 1.0, "3": 1e-4, "4": 1.25663706e-6}


class TwinMeterPort(serial.SerialBase):
    """The port object that pyserial hands out for ``twinmeter://``.

    Options of the address: ``flux_mT`` (what it reads), ``unit`` (1 G, 2 T, 3 Oe,
    4 A/m), ``range_mT`` (beyond it the reply is OL), ``silent=1``.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._options: dict[str, str] = {}
        self._received = b""
        self._reply = b""
        super().__init__(*args, **kwargs)

    def open(self) -> None:
        """Read the address; nothing can be missing."""
        query = parse_qs(urlsplit(str(self.portstr)).query)
        self._options = {key: values[-1] for key, values in query.items()}
        self.is_open = True

    def close(self) -> None:
        """Close the port."""
        self.is_open = False

    @property
    def in_waiting(self) -> int:
        """Number of bytes that can be read at once."""
        return len(self._reply)

    def read(self, size: int = 1) -> bytes:
        """Return up to `size` bytes of the reply; never waits."""
        data, self._reply = self._reply[:size], self._reply[size:]
        return data

    def write(self, data: Any) -> int:
        """Take bytes; a complete line is answered."""
        self._received += bytes(data)
        while b"\n" in self._received:
            line, _, self._received = self._received.partition(b"\n")
            self._reply += self._answer(line.strip().decode("ascii", "replace"))
        return len(data)

    def flush(self) -> None:
        """Do nothing: a write is complete at once."""

    def reset_input_buffer(self) -> None:
        """Forget what was not read."""
        self._reply = b""

    def reset_output_buffer(self) -> None:
        """Forget an incomplete line."""
        self._received = b""

    def _answer(self, command: str) -> bytes:
        if self._options.get("silent") == "1":
            return b""
        answers: dict[str, Callable[[], str]] = {
            "*IDN?": lambda: "LSCI,MODEL425,0,1.0",
            "UNIT?": lambda: self._options.get("unit", "2"),
            "RANGE?": lambda: "3",
            "TYPE?": lambda: "40",
            "RDGMODE?": lambda: "1,1,1",
            "RDGFIELD?": self._reading,
        }
        answer = answers.get(command)
        return f"{answer()}\r\n".encode("ascii") if answer else b""

    def _reading(self) -> str:
        flux_mT = float(self._options.get("flux_mT", "0"))
        if abs(flux_mT) > float(self._options.get("range_mT", "350")):
            return "OL"
        value = flux_mT * 1e-3 / _TESLA_PER_CODE[self._options.get("unit", "2")]
        return f"{value:+.4E}"

    def _reconfigure_port(self, force_reconfigure: bool = False) -> None:
        """Do nothing: there is no line."""

    def _update_dtr_state(self) -> None:
        """Do nothing."""

    def _update_rts_state(self) -> None:
        """Do nothing."""


Serial = TwinMeterPort
"""The name that pyserial looks for."""
