"""Time as something handed in: the wall clock, a fast one, and one that only steps."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Protocol

from ..core.checks import positive

Check = Callable[[], None]
"""Called in every wait, some ten times a second; it raises to end the wait."""

_SLICE_S = 0.1


def go_on() -> None:
    """End no wait."""


class Clock(Protocol):
    """What the rig asks of time; every wait of the rig goes through `sleep`."""

    def monotonic_s(self) -> float:
        """Return seconds since an arbitrary start; never falls."""
        ...

    def utc(self) -> datetime:
        """Return the time-zone aware UTC time."""
        ...

    def sleep(self, duration_s: float) -> None:
        """Let `duration_s` seconds of this clock pass."""
        ...


def wait(clock: Clock, duration_s: float, check: Check = go_on) -> None:
    """Let `duration_s` seconds of a clock pass, calling `check` all the while."""
    end_s = clock.monotonic_s() + duration_s
    while (left_s := end_s - clock.monotonic_s()) > 0.0:
        check()
        clock.sleep(min(left_s, _SLICE_S))


def utc_text(clock: Clock) -> str:
    """Return the UTC time of a clock, ISO 8601 with milliseconds, ending in Z."""
    return clock.utc().isoformat(timespec="milliseconds").replace("+00:00", "Z")


class SystemClock:
    """The clock of the machine: use it with real devices."""

    def monotonic_s(self) -> float:
        """Return the system's monotonic time in s."""
        return time.monotonic()

    def utc(self) -> datetime:
        """Return the system's UTC time."""
        return datetime.now(UTC)

    def sleep(self, duration_s: float) -> None:
        """Sleep."""
        time.sleep(max(duration_s, 0.0))


class ScaledClock:
    """A clock that runs `speed` times as fast as the system's: a demonstration.

    Parameters
    ----------
    speed : float
        Seconds of this clock in one second of the system's.
    """

    def __init__(self, speed: float) -> None:
        self._speed = positive(speed, "speed of the clock")
        self._start_s = time.monotonic()
        self._start_utc = datetime.now(UTC)

    def monotonic_s(self) -> float:
        """Return the scaled seconds since this clock was made."""
        return (time.monotonic() - self._start_s) * self._speed

    def utc(self) -> datetime:
        """Return the scaled UTC time."""
        return self._start_utc + timedelta(seconds=self.monotonic_s())

    def sleep(self, duration_s: float) -> None:
        """Sleep `duration_s` scaled seconds."""
        time.sleep(max(duration_s, 0.0) / self._speed)


class SteppedClock:
    """A clock that moves only in `sleep`: the twin bench as fast as the processor.

    Twin devices that share it with the driver make runs that take minutes on the bench
    take a second, the same every time. Use it from one thread.

    Parameters
    ----------
    start_utc : datetime, optional
        The UTC time it begins at; by default the system's.
    speed : float, optional
        Its seconds in one second of the system's: a demonstration to look at. What
        the processor needs beside them counts for nothing. By default no sleep lasts.
    """

    def __init__(
        self, start_utc: datetime | None = None, *, speed: float | None = None
    ) -> None:
        self._s_each = 0.0 if speed is None else 1.0 / positive(speed, "speed")
        self._now_s = 0.0
        self._start_utc = start_utc or datetime.now(UTC)

    def monotonic_s(self) -> float:
        """Return the seconds slept so far."""
        return self._now_s

    def utc(self) -> datetime:
        """Return the start time plus the seconds slept so far."""
        return self._start_utc + timedelta(seconds=self._now_s)

    def sleep(self, duration_s: float) -> None:
        """Move on by `duration_s`."""
        time.sleep(max(duration_s, 0.0) * self._s_each)
        self._now_s += max(duration_s, 0.0)
