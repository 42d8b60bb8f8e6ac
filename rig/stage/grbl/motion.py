"""Waiting for a GRBL board to arrive, to stand, or to end its homing cycle.

Arrival is Idle *and* the position; one missing answer is no fault; every wait has an
end that follows from the motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

from ....core.errors import StageError
from ...clock import Clock
from ...errors import StageTimeoutError
from ..protocol import Moved
from .protocol import STOP_INPUTS, Alarm, Ok, Refusal, Report
from .session import CommandRefusedError, GrblSession

POLL_S = 0.1
_STALL_S = 1.5
_ASTRAY_MM = 0.2
_SILENCE_S = 8.0
_CLOSED = 2
"""Reports in a row that call an input closed: one may be noise."""
_STANDING = ("idle", "alarm", "check", "sleep")


class InputClosedError(StageError):
    """Somebody asked for a stop at the board itself: a button, the safety door."""


def stands(report: Report) -> bool:
    """Return whether nothing moves: any state at rest, a completed hold, a door open.

    Of a safety door 0 and 1 are standing (closed again, open), 2 and 3 moving.
    """
    at_rest = {"hold": (0,), "door": (0, 1)}.get(report.state, ())
    return report.state in _STANDING or report.substate in at_rest


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """From where to where an axis moves, how exactly, and how long it may take.

    `switch` is the letter of its limit switch, `stops` those of the inputs that ask for
    a stop; what was closed at the start is in neither.
    """

    axis: int
    start_mm: float
    machine_mm: float
    tolerance_mm: float
    limit_s: float
    switch: str = ""
    stops: str = ""

    def closed(self, pins: str) -> str:
        """Return the letter that closed on the way, or nothing."""
        return next((n for n in self.switch + self.stops if n in pins), "")

    def is_astray(self, here_mm: float) -> bool:
        """Return whether a place is not on the way: a digit of the line was lost."""
        low, high = sorted((self.start_mm, self.machine_mm))
        slack = self.tolerance_mm + _ASTRAY_MM
        return not low - slack <= here_mm <= high + slack


def await_arrival(
    session: GrblSession,
    clock: Clock,
    target: Target,
    *,
    restarts: int,
    check_stop: Callable[[], None],
    moved: Moved,
) -> None:
    """Return when the stage stands at the target.

    Parameters
    ----------
    restarts : int
        `GrblSession.restarts` before the motion was sent.
    check_stop : callable
        Called before every question; raises to stop waiting.
    moved : callable
        Called with the machine position in mm after every answer.

    Raises
    ------
    AlarmError
        The board raised an alarm.
    InputClosedError
        Its feed hold, safety door, reset or emergency stop closed. grblHAL reports a
        feed hold while it jogs, and drives on.
    PositionLostError
        It restarted.
    StageTimeoutError
        It stopped short, went elsewhere, fell silent, took longer than it may, or its
        limit switch closed: a board with $21=0 drives on into it.
    """
    start_s = heard_s = progress_s = clock.monotonic_s()
    last: float | None = None
    closed = 0
    while True:
        check_stop()
        report = session.ask()
        now_s = clock.monotonic_s()
        if session.alarm is not None:
            raise session.alarm_error(session.alarm)
        session.raise_if_restarted(restarts)
        machine = session.machine()
        if report and machine and len(machine) > target.axis:
            heard_s, here = now_s, machine[target.axis]
            moved(here)
            letter = target.closed(report.pins)
            closed = closed + 1 if letter else 0
            if closed == _CLOSED:
                _raise_closed(letter, here)
            at_target = abs(here - target.machine_mm) <= target.tolerance_mm
            if report.state == "idle" and at_target and not letter:
                return
            if last is None or abs(here - last) > target.tolerance_mm:
                last, progress_s = here, now_s
            _raise_if_amiss(report, here, target, now_s - progress_s)
        if now_s - heard_s > _SILENCE_S:
            raise StageTimeoutError(f"the stage fell silent for {_SILENCE_S:.0f} s")
        if now_s - start_s > target.limit_s:
            where = "an unknown place" if last is None else f"{last:.3f} mm"
            raise StageTimeoutError(
                f"the stage did not reach {target.machine_mm:.3f} mm within "
                f"{target.limit_s:.1f} s (it is at {where})"
            )
        clock.sleep(POLL_S)


def _raise_closed(letter: str, here_mm: float) -> NoReturn:
    if letter in STOP_INPUTS:
        raise InputClosedError(
            f"the {STOP_INPUTS[letter]} of the board closed (Pn:{letter}) at "
            f"{here_mm:.3f} mm"
        )
    raise StageTimeoutError(
        f"the limit switch of {letter} closed at {here_mm:.3f} mm, where the board "
        "counts free way: it has lost steps"
    )


def _raise_if_amiss(
    report: Report, here_mm: float, target: Target, still_s: float
) -> None:
    if target.is_astray(here_mm):
        raise StageTimeoutError(
            f"the stage is at {here_mm:.3f} mm, which is not on its way from "
            f"{target.start_mm:.3f} to {target.machine_mm:.3f} mm"
        )
    if report.state == "idle" and still_s > _STALL_S:
        raise StageTimeoutError(
            f"the stage stopped at {here_mm:.3f} mm instead of "
            f"{target.machine_mm:.3f} mm"
        )
    if report.state == "door":
        _raise_closed("D", here_mm)
    if report.state in ("sleep", "check"):
        raise StageTimeoutError(f"the board went to the state {report.state}")


def await_homing(
    session: GrblSession,
    clock: Clock,
    limit_s: float,
    *,
    command: str,
    check_stop: Callable[[], None],
) -> None:
    """Wait for the ``ok`` at the end of a homing cycle; ``?`` is not answered in it.

    Raises
    ------
    AlarmError
        A switch was not found, stayed closed, or the cycle was cut off.
    CommandRefusedError, PositionLostError, StageTimeoutError
        As they say; after a timeout the board was reset.
    """
    deadline_s = clock.monotonic_s() + limit_s
    restarts = session.restarts
    while clock.monotonic_s() < deadline_s:
        line = session.pump(0.2)
        if isinstance(line, Ok):
            return
        if isinstance(line, Refusal):
            session.reset()  # a refused $HX leaves the stock build stuck in Home
            raise CommandRefusedError(command, line.code)
        if isinstance(line, Alarm):
            session.reset()
            raise session.alarm_error(line.code)
        session.raise_if_restarted(restarts)
        check_stop()
    session.reset()
    raise StageTimeoutError(
        f"homing did not end within {limit_s:.0f} s; the board was reset; look at "
        "switches and $23-$27, or raise stage.home_timeout_s"
    )
