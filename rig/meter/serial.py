"""A Tesla-meter on a serial port, driven by its description.

One reading is one whole reply: what was in the buffer before is thrown away, a reply
without its terminator is no reply, and a stream is joined at a terminator, so that a
torn first line is never taken for a small number.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

import serial

from ...core.errors import MeterError
from ..clock import Check, go_on
from ..ports import SERIAL_ERRORS, check_port, register_twin_urls, why_not_open
from . import visa
from .description import MeterDescription
from .parse import parse_multiplier, parse_reply, parse_unit
from .protocol import Flux, Sample, combine

logger = logging.getLogger(__name__)

_SLICE_S = 0.05
_LONGEST_REPLY = 4096

WireTap = Callable[[str, bytes], None]
"""Called with ``">>"`` (sent) or ``"<<"`` (received) and the bytes."""


class SerialMeter:
    """A Tesla-meter, open on its port.

    Parameters
    ----------
    description : MeterDescription
        How it speaks.
    port : str
        Device name or pyserial URL.
    zero_mT : float
        Reading at zero field, taken off every reading.
    sign : int
        1, or -1 if the probe is mounted the other way round.
    tap : callable, optional
        Told every byte.

    Raises
    ------
    MeterError
        If the port cannot be opened, or the meter does not tell its unit.
    """

    def __init__(
        self,
        description: MeterDescription,
        port: str,
        *,
        zero_mT: float = 0.0,
        sign: int = 1,
        tap: WireTap | None = None,
    ) -> None:
        self._description = description
        self._port = port
        self._zero_mT = zero_mT
        self._sign = sign
        self._tap = tap
        self._last_s = 0.0
        self._buffer = b""
        self._check: Check = go_on
        self._device: Any = self._open()
        try:
            for command in description.setup:
                self._send(command)
            self._replies = {c: self._ask(c) for c in description.identify}
            self._unit = self._ask_unit()
        except BaseException:
            self.close()
            raise

    @property
    def identity(self) -> dict[str, Any]:
        """Return model, port, unit, zero offset and what the meter says of itself."""
        return {
            "driver": self._description.name,
            "port": self._port,
            "unit": self._unit or "in each reply",
            "zero_mT": self._zero_mT,
            "sign": self._sign,
            "replies": self._replies,
        }

    def read_flux(self, samples: int, *, gap_mm: float, check: Check = go_on) -> Flux:
        """Return the flux density now, from `samples` new readings.

        `check` is called while it waits for them.

        Raises
        ------
        MeterError
            If the port is lost, or the unit was changed to one that is not known.
        """
        del gap_mm
        self._check = check
        self._unit = self._ask_unit(self._unit)
        readings: list[Sample] = []
        for _ in range(samples):
            readings.append(self._sample())
            if [r.outcome for r in readings] == ["silent", "silent"]:
                break  # it is not there: do not wait for the others
        if self._unit is not None and readings[-1].outcome == "ok":
            unit = self._ask_unit(self._unit)
            if unit != self._unit:
                self._unit = unit
                return Flux(status="unit", raw=tuple(r.raw for r in readings))
        return combine(readings, zero_mT=self._zero_mT, sign=self._sign)

    def close(self) -> None:
        """Let the port go."""
        try:
            self._device.close()
        except SERIAL_ERRORS as error:
            logger.warning("%s: %s", self._port, error)

    def _open(self) -> Any:
        if self._port.startswith(visa.PREFIX):
            return visa.VisaPort(self._port)
        line = self._description.line
        register_twin_urls()
        try:
            check_port(self._port)
            device = serial.serial_for_url(
                self._port, do_not_open=True, baudrate=line.baud, bytesize=line.bits,
                parity=line.parity, stopbits=line.stop_bits, timeout=_SLICE_S,
                write_timeout=2.0,
            )  # fmt: skip
            if line.dtr is not None:
                device.dtr = line.dtr
            if not self._port.count("://"):
                device.exclusive = True
            device.open()
        except SERIAL_ERRORS as error:
            raise MeterError(
                f"{self._description.name}: {why_not_open(self._port, error)}"
            ) from None
        return device

    def _ask_unit(self, known: str | None = None) -> str | None:
        unit = self._description.unit
        if unit.source == "fixed":
            return unit.name
        if unit.source == "reply":
            return None
        reply = self._ask(unit.command)
        if reply is None and known is not None:
            return known
        if reply is None:
            raise MeterError(
                f"{self._description.name}: the meter on {self._port} must tell its "
                f"unit; instead it did not answer {unit.command!r} in "
                f"{self._description.read.timeout_s:g} s; check power, cable and the "
                f"line settings of its description"
            )
        return parse_unit(self._description, reply)

    def _sample(self) -> Sample:
        read, multiplier = self._description.read, self._description.multiplier
        if read.mode == "frame":
            return self._frame()
        if read.mode == "stream":
            self._flush()
            if self._line() is None:
                return self._no_line()
            reply = self._line()
            return self._parsed(reply, 1.0)
        if multiplier.command:
            return self._with_prefix(multiplier.command)
        reply = self._ask(read.command)
        return self._parsed(reply, 1.0)

    def _with_prefix(self, question: str) -> Sample:
        """Return a reading whose prefix is asked for before and after it."""
        before = self._ask(question, may_be_empty=True)
        reply = self._ask(self._description.read.command)
        after = self._ask(question, may_be_empty=True)
        if reply is None or before is None or after is None:
            return self._no_line()
        if before != after:
            return Sample(outcome="garbled", raw=f"{before} {reply} {after}")
        return self._parsed(reply, parse_multiplier(self._description, before))

    def _no_line(self) -> Sample:
        """Return what an answer without its end is: cut short, or none at all."""
        raw = self._buffer.decode("latin-1")
        return Sample(outcome="torn" if raw else "silent", raw=raw)

    def _parsed(self, reply: str | None, multiplier: float) -> Sample:
        if reply is None:
            return self._no_line()
        return parse_reply(
            self._description, reply, unit=self._unit, multiplier=multiplier
        )

    def _frame(self) -> Sample:
        """Return the next whole frame that matches; frames of other displays pass."""
        read = self._description.read
        start, end = (
            read.frame_start.encode("latin-1"),
            read.frame_end.encode("latin-1"),
        )
        length = read.frame_bytes or 0
        self._flush()
        deadline_s = time.monotonic() + read.timeout_s
        data = b""
        seen = ""
        while time.monotonic() < deadline_s:
            data += self._receive()
            while (at := data.find(start)) >= 0 and len(data) - at >= length:
                frame = data[at : at + length]
                if not frame.endswith(end) or start in frame[len(start) :]:
                    data = data[at + len(start) :]
                    continue
                data = data[at + length :]
                seen = frame[len(start) : length - len(end)].decode("latin-1")
                sample = self._parsed(seen, 1.0)
                if sample.outcome != "garbled":
                    return sample
        if seen:
            return Sample(outcome="garbled", raw=seen)
        raw = data.decode("latin-1")
        return Sample(outcome="torn" if raw else "silent", raw=raw)

    def _ask(self, command: str, *, may_be_empty: bool = False) -> str | None:
        self._flush()
        self._send(command)
        return self._line(may_be_empty=may_be_empty)

    def _send(self, command: str) -> None:
        read = self._description.read
        wait_s = self._last_s + read.pause_s - time.monotonic()
        if wait_s > 0.0:
            time.sleep(wait_s)
        data = (command + read.command_end).encode("latin-1")
        try:
            self._device.write(data)
            self._device.flush()
        except SERIAL_ERRORS as error:
            raise self._lost(error) from None
        self._last_s = time.monotonic()
        self._told(">>", data)

    def _line(self, *, may_be_empty: bool = False) -> str | None:
        """Return the next whole line, or None when the time is up.

        Empty lines are passed over, unless an empty line is an answer.
        """
        read = self._description.read
        end = read.reply_end.encode("latin-1")
        deadline_s = time.monotonic() + read.timeout_s
        while time.monotonic() < deadline_s:
            while end in self._buffer:
                line, _, self._buffer = self._buffer.partition(end)
                text = line.decode("latin-1").strip("\r\n\0 ")
                if text or may_be_empty:
                    self._last_s = time.monotonic()
                    return text
            if len(self._buffer) > _LONGEST_REPLY:
                break
            self._buffer += self._receive()
        return None

    def _receive(self) -> bytes:
        """Return what is there, or wait one slice for a first byte."""
        self._check()
        try:
            data = bytes(self._device.read(max(self._device.in_waiting, 1)))
        except SERIAL_ERRORS as error:
            raise self._lost(error) from None
        if data:
            self._told("<<", data)
        return data

    def _flush(self) -> None:
        self._buffer = b""
        try:
            self._device.reset_input_buffer()
        except SERIAL_ERRORS as error:
            raise self._lost(error) from None

    def _lost(self, error: Exception) -> MeterError:
        return MeterError(
            f"{self._description.name}: the port {self._port} was lost: {error}"
        )

    def _told(self, direction: str, data: bytes) -> None:
        if self._tap is not None:
            self._tap(direction, data)
