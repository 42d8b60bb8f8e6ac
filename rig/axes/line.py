"""An axis that is set by a line of text: supplies, rotators, lock-ins."""

from __future__ import annotations

import math
import re
from typing import Any, Protocol

from ...core.errors import RigError
from ..clock import Check, Clock, go_on, wait
from ..link import Link
from ..wire_log import WireLog
from .config import AxisConfig, why_not_set

_NUMBER = re.compile(r"(?<![\w.+-])[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
"""A number that stands by itself: the 1 of ``CH1`` or ``OUT-1`` is a name's."""

_ANSWER_S = 1.0
_POLL_S = 0.1


class Axis(Protocol):
    """Something that a plan scans, open."""

    @property
    def identity(self) -> dict[str, Any]:
        """What the manifest keeps of it."""
        ...

    def set(self, value: float, *, check: Check = go_on) -> float:
        """Go to a value and return what it is then; `check` is called in waits."""
        ...

    def close(self) -> None:
        """Let the port go."""
        ...


class LineAxis:
    """A device on a serial line that takes a value and may say what it has.

    Parameters
    ----------
    config : AxisConfig
        Its table.
    clock : Clock
        Time.
    log : WireLog, optional
        Where every byte is recorded.

    Raises
    ------
    RigError
        If the port cannot be opened.
    """

    def __init__(
        self, config: AxisConfig, clock: Clock, *, log: WireLog | None = None
    ) -> None:
        self._config = config
        self._clock = clock
        self._link = Link(
            config.port, baud=config.baud, clock=clock, log=log, device=config.name
        )
        self._link.open()

    @property
    def identity(self) -> dict[str, Any]:
        """Return its table."""
        return self._config.model_dump(mode="json")

    def set(self, value: float, *, check: Check = go_on) -> float:
        """Go to a value and return what it is then.

        Raises
        ------
        RigError
            If the value lies outside its limits (nothing was sent), the device does
            not answer, or does not get there in time.
        """
        config = self._config
        why = why_not_set(config, value)
        if why:
            raise RigError(f"{config.name} {why}; nothing was sent")
        self._send(config.text(value))
        wait(self._clock, config.settle_s, check)
        if not config.read_line:
            return value
        deadline_s = self._clock.monotonic_s() + config.timeout_s
        while True:
            found = self._read(check)
            if abs(found - value) <= config.tolerance:
                return found
            if self._clock.monotonic_s() > deadline_s:
                raise RigError(
                    f"{config.name} must become {value:g} within {config.tolerance:g}; "
                    f"instead it is {found:g} after {config.timeout_s:g} s"
                )
            wait(self._clock, _POLL_S, check)

    def _read(self, check: Check) -> float:
        self._link.waiting_lines()  # late answers to what was asked before
        self._send(self._config.read_line)
        check()
        answer = self._link.read_line(_ANSWER_S)
        if answer == self._config.read_line.strip():  # a device that echoes
            answer = self._link.read_line(_ANSWER_S)
        numbers = _NUMBER.findall(answer or "")
        if len(numbers) != 1 or not math.isfinite(float(numbers[0])):
            raise RigError(
                f"{self._config.name}: the answer to {self._config.read_line!r} must "
                f"hold one number; instead received {answer!r}"
            )
        return float(numbers[0])

    def _send(self, line: str) -> None:
        self._link.write((line + self._config.line_end).encode("latin-1"))

    def close(self) -> None:
        """Let the port go."""
        self._link.close()
