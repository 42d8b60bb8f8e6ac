"""How long a run still takes: its plan's times, as this bench keeps them."""

from __future__ import annotations

import time
from collections.abc import Container

from ..bench.config import Plan
from .dry_run import plan_steps


class TimeLeft:
    """Time left of a run, learnt from the steps it took.

    Parameters
    ----------
    plan : Plan
        The plan.
    done : container of int
        Steps that were taken before.
    """

    def __init__(self, plan: Plan, done: Container[int]) -> None:
        self._planned_s = {
            step.index: step.time_s
            for step in plan_steps(plan)
            if step.index not in done
        }
        self._start_s = time.monotonic()
        self._taken_s = 0.0

    def now_s(self) -> float:
        """Return the time left, in s: planned, times how this bench keeps to it."""
        ratio = 1.0
        if self._taken_s:
            ratio = (time.monotonic() - self._start_s) / self._taken_s
        return ratio * sum(self._planned_s.values())

    def after(self, index: int) -> float:
        """Return the time left, in s, now that a step was taken."""
        self._taken_s += self._planned_s.pop(index, 0.0)
        return self.now_s()
