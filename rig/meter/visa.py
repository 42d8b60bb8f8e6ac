"""A Tesla-meter on GPIB, USBTMC or a LAN, by PyVISA, behind the face of a serial port.

``port = "visa:GPIB0::12::INSTR"`` names the resource; what is said to it stands in the
meter's description as for a serial line, whose speed and parity mean nothing here. A
backend other than the system's follows an ``@``: ``visa:ASRL1::INSTR@py``.
"""

from __future__ import annotations

import contextlib
from typing import Any

from ...core.errors import MeterError

PREFIX = "visa:"
_TIMEOUT_MS = 50


class VisaPort:
    """One open VISA resource; what `SerialMeter` asks of a port.

    Parameters
    ----------
    port : str
        ``visa:`` and the name of the resource.

    Raises
    ------
    MeterError
        If PyVISA is not installed, or there is no such resource.
    """

    def __init__(self, port: str) -> None:
        try:
            import pyvisa
        except ImportError:
            raise MeterError(
                f"the port {port} needs PyVISA: pip install 'magbend[meters]'"
            ) from None
        name, _, backend = port.removeprefix(PREFIX).partition("@")
        self._silence: type[Exception] = pyvisa.errors.VisaIOError
        self._timeout_code = pyvisa.constants.StatusCode.error_timeout
        try:
            self._manager = pyvisa.ResourceManager(_library(backend))
            self._resource: Any = self._manager.open_resource(name)
        except (self._silence, ValueError, OSError) as error:
            raise MeterError(
                f"the port {port} cannot be opened: {error}; pyvisa-info lists what "
                "this machine has"
            ) from None
        self._resource.timeout = _TIMEOUT_MS
        self._buffer = b""

    @property
    def in_waiting(self) -> int:
        """Bytes that are here already."""
        return len(self._buffer)

    def write(self, data: bytes) -> int:
        """Send a message.

        Raises
        ------
        OSError
            If the instrument is gone.
        """
        try:
            self._resource.write_raw(data)
        except self._silence as error:
            raise OSError(str(error)) from None
        return len(data)

    def read(self, size: int) -> bytes:
        """Return up to `size` bytes of what the instrument says, or none in time.

        Raises
        ------
        OSError
            If the instrument is gone.
        """
        if not self._buffer:
            try:
                self._buffer = bytes(self._resource.read_raw())
            except self._silence as error:
                if getattr(error, "error_code", None) != self._timeout_code:
                    raise OSError(str(error)) from None
        data, self._buffer = self._buffer[:size], self._buffer[size:]
        return data

    def flush(self) -> None:
        """Messages are sent as they are written."""

    def reset_input_buffer(self) -> None:
        """Forget what was said before."""
        self._buffer = b""

    def close(self) -> None:
        """Let the resource go."""
        with contextlib.suppress(self._silence):
            self._resource.close()


def _library(backend: str) -> str:
    """Return what PyVISA calls a backend: ``@py``, or a file and its backend."""
    return f"@{backend}" if backend and "@" not in backend else backend
