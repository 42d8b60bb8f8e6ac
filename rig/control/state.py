"""What the owner of a bench is doing, for everybody who asks."""

from __future__ import annotations

import threading
import time
from typing import Any

OVER = "over"


class BenchState:
    """A few facts that change while a process owns a bench; safe from any thread.

    Keys that a run tells: ``command``, ``name``, ``folder``, ``twin``, ``step`` (from
    1) and ``steps``, ``state`` (``homing``, ``moving``, ``settling``, ``measuring``,
    ``photographing``, ``paused``, ``over`` ...), ``gap_mm``, ``flux_mT``, ``flags``,
    ``picture`` (path of the newest photograph), ``line`` (what it said last), and, at
    the end, ``status`` and ``reason``.
    """

    def __init__(self, **facts: Any) -> None:
        self._facts: dict[str, Any] = {"state": "idle", **facts}
        self._ends_s: float | None = None
        self._left_s: float | None = None
        self._change = threading.Condition()
        self.version = 0

    def tell(self, **facts: Any) -> None:
        """Note what changed."""
        with self._change:
            self._facts.update(facts)
            self.version += 1
            self._change.notify_all()

    def expect_end(self, left_s: float | None) -> None:
        """Note how long the work will still take, in s; None if nobody can say."""
        with self._change:
            self._ends_s = None if left_s is None else time.monotonic() + left_s
            self._left_s = None

    def stand_still(self) -> None:
        """Let the time left stand, while a run is paused."""
        with self._change:
            self._left_s = self._time_left_s()

    def go_on(self) -> None:
        """Let the time left run again."""
        with self._change:
            if self._left_s is not None:
                self._ends_s = time.monotonic() + self._left_s
            self._left_s = None

    def now(self) -> dict[str, Any]:
        """Return the facts, with ``time_left_s``."""
        with self._change:
            left_s = self._left_s if self._left_s is not None else self._time_left_s()
            return {**self._facts, "time_left_s": left_s}

    def wait(self, version: int, timeout_s: float) -> int:
        """Wait until something changed since `version`; return the version now."""
        with self._change:
            self._change.wait_for(lambda: self.version != version, timeout_s)
            return self.version

    def _time_left_s(self) -> float | None:
        if self._ends_s is None:
            return None
        return max(self._ends_s - time.monotonic(), 0.0)
