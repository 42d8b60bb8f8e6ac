"""The conversation with a GRBL board: one line in flight, and what is known of it.

Replies carry no number, so order is everything. After any anomaly (an alarm, a reply
that did not come) the two sides are out of step; a soft reset at standstill brings
them back: replies count anew from the banner.
"""

from __future__ import annotations

import logging
import re

from ....core.errors import StageError
from ...clock import Clock
from ...errors import AlarmError, PositionLostError, StageTimeoutError
from ...link import Link
from .protocol import (
    SOFT_RESET,
    STATUS,
    Alarm,
    Banner,
    Line,
    Message,
    Ok,
    Other,
    Refusal,
    Report,
    Triple,
    alarm_text,
    error_text,
    machine_position,
    parse_line,
)

# FluidNC: "INFO: Axis X (0.000,180.000)"
_AXIS_RANGE = re.compile(r"Axis ([XYZ]) \((-?[\d.]+),\s*(-?[\d.]+)\)")

logger = logging.getLogger(__name__)

_RESET_TRIES = 8
_BANNER_S = 2.5
_PATIENCE = 10.0
_OFFSET_EVERY = 30
_SILENT_ASKS = 3
_DEAF_ALARMS = (1, 2)


class CommandRefusedError(StageError):
    """The board answered ``error:N``."""

    def __init__(self, line: str, code: str) -> None:
        super().__init__(
            f"the stage refused {line!r}: error:{code}, {error_text(code)}"
        )
        self.code = code


class GrblSession:
    """Talk to one board over an open link.

    Attributes
    ----------
    report : Report or None
        The last report.
    alarm : int or None
        The alarm that locks the board, if its number is known.
    restarts : int
        Banners that nobody had asked for.
    in_step : bool
        Whether replies can be matched with lines.
    ranges : dict
        What the board told of the travel of its axes, by letter, in mm.
    """

    def __init__(self, link: Link, clock: Clock, *, answer_timeout_s: float) -> None:
        self._link = link
        self._clock = clock
        self._answer_timeout_s = answer_timeout_s
        self._offset: Triple | None = None
        self._reset_pending = False
        self.report: Report | None = None
        self.alarm: int | None = None
        self.restarts = 0
        self.banner = self._own_banner = ""
        self.in_step = True
        self.locked_message = False
        self.ranges: dict[str, tuple[float, float]] = {}

    @property
    def deaf(self) -> bool:
        """Whether the board listens to nothing but a reset (ALARM:1 and 2)."""
        return self.alarm in _DEAF_ALARMS and not self.locked_message

    def machine(self) -> Triple | None:
        """Return the last reported machine position of all axes."""
        if self.report is None:
            return None
        return machine_position(self.report, self._offset)

    def realtime(self, byte: bytes) -> None:
        """Send one real-time byte; it waits for nothing."""
        self._link.write_realtime(byte)

    def pump(self, timeout_s: float) -> Line | None:
        """Read and note one line; None when time is up."""
        text = self._link.read_line(timeout_s)
        return None if text is None else self._note(parse_line(text))

    def drain(self) -> None:
        """Note everything that is already here; stray ``ok``s fall away."""
        for text in self._link.waiting_lines():
            self._note(parse_line(text))

    def command(self, line: str, *, timeout_s: float | None = None) -> list[Line]:
        """Send one line and return what came before its ``ok``.

        Raises
        ------
        CommandRefusedError
            The board answered ``error:N``.
        AlarmError
            It raised an alarm instead.
        PositionLostError
            It restarted instead.
        StageTimeoutError
            It did not answer; the conversation is out of step.
        """
        self.drain()
        limit_s = self._answer_timeout_s if timeout_s is None else timeout_s
        self.in_step = False  # until the reply is here
        self._link.write(line.encode("ascii") + b"\n")
        end_s = self._clock.monotonic_s() + _PATIENCE * limit_s
        restarts, lines = self.restarts, list[Line]()
        while (left_s := end_s - self._clock.monotonic_s()) > 0.0:
            # A board that still talks is not late: each line gives it time anew.
            answer = self.pump(min(limit_s, left_s))
            if answer is None:
                break
            if isinstance(answer, Ok):
                self.in_step = True
                return lines
            if isinstance(answer, Refusal):
                self.in_step = True
                raise CommandRefusedError(line, answer.code)
            if isinstance(answer, Alarm):
                raise self.alarm_error(answer.code)
            self.raise_if_restarted(restarts)
            lines.append(answer)
        raise StageTimeoutError(
            f"the stage did not answer {line!r} within {limit_s:.0f} s"
        )

    def raise_if_restarted(self, restarts: int) -> None:
        """Raise if the board restarted since `restarts` was noted.

        Raises
        ------
        PositionLostError
            As it says.
        """
        if self.restarts != restarts:
            raise PositionLostError(
                "the board restarted by itself (power, reset button or a loose cable); "
                "its position is lost; home it (magbend rig home)"
            )

    @staticmethod
    def alarm_error(code: int) -> AlarmError:
        """Return the error of an alarm number, with meaning and remedy."""
        text = alarm_text(code)
        return AlarmError(
            code, text.meaning, text.remedy, position_kept=text.position_kept
        )

    def ask(self, timeout_s: float = 1.0) -> Report | None:
        """Send ``?`` and return the report, or None: one missing answer is no fault."""
        self.drain()
        self._link.write_realtime(STATUS)
        deadline_s = self._clock.monotonic_s() + timeout_s
        while (left_s := deadline_s - self._clock.monotonic_s()) > 0.0:
            line = self.pump(left_s)
            if line is None or isinstance(line, (Report, Alarm, Banner)):
                return line if isinstance(line, Report) else None
        return None

    def ask_place(self, timeout_s: float) -> Report | None:
        """Ask until the machine position is known.

        A board that reports WPos tells its offset in some reports only: every tenth at
        rest, every thirtieth in motion. Three missing answers in a row are a silence.
        """
        report, missing = None, 0
        for _ in range(_OFFSET_EVERY):
            report = self.ask(timeout_s)
            missing = 0 if report else missing + 1
            if (
                self.deaf
                or missing == _SILENT_ASKS
                or (report and self.machine() is not None)
            ):
                break
        return report

    def reset(self, *, tries: int = _RESET_TRIES) -> bool:
        """Soft-reset until the banner comes; replies count anew from there.

        In Idle, Hold:0 and Alarm the board keeps its position. A reset in the half
        second after ALARM:1 or 2 is swallowed, so it is repeated, at once when the
        board asks for it.

        Parameters
        ----------
        tries : int
            How often it is sent at most.

        Returns
        -------
        bool
            Whether the banner came.
        """
        self._reset_pending = True
        try:
            return any(self._reset_once() for _ in range(tries))
        finally:
            self._reset_pending = False

    def _reset_once(self) -> bool:
        self._link.write_realtime(SOFT_RESET)
        said: list[str] = []
        deadline_s = self._clock.monotonic_s() + _BANNER_S
        while (left_s := deadline_s - self._clock.monotonic_s()) > 0.0:
            line = self.pump(left_s)
            if isinstance(line, Banner):
                self.in_step = True
                self.ask()  # also reads the lock message that follows the banner
                return True
            if isinstance(line, Message) and "Reset to continue" in line.text:
                return False
            if isinstance(line, Other):
                said.append(line.text)
        return self._has_own_words(said)

    def _has_own_words(self, said: list[str]) -> bool:
        """Take what followed a reset for a start-up line, if a report follows it.

        Its words are the maker's choice; what counts is that it answers as GRBL 1.1.
        """
        report = self.ask() if said else None
        if report is None or report.state not in ("idle", "alarm"):
            return False
        self.banner = self._own_banner = said[-1]
        self._offset, self.in_step = None, True
        return True

    def _note(self, line: Line) -> Line:
        if isinstance(line, Report):
            self.report = line
            self._offset = line.offset or self._offset
            if line.state not in ("alarm", "home"):
                self.alarm, self.locked_message = None, False
        elif isinstance(line, Alarm):
            logger.warning("stage: ALARM:%d", line.code)
            self.alarm, self.in_step, self.locked_message = line.code, False, False
        elif isinstance(line, Banner):
            self.banner, self._offset = line.text, None
            self.in_step = True
            if not self._reset_pending:
                self.restarts += 1
        elif isinstance(line, Other) and line.text == self._own_banner:
            return self._note(Banner(line.text))
        elif isinstance(line, Message):
            self._note_message(line.text)
        return line

    def _note_message(self, text: str) -> None:
        if "unlock" in text:
            self.locked_message = "to unlock" in text
        axis = _AXIS_RANGE.search(text)
        if axis:
            low, high = sorted((float(axis.group(2)), float(axis.group(3))))
            self.ranges[axis.group(1)] = (low, high)
