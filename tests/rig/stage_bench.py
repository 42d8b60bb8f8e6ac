"""A stage on the twin board with a clock that only steps, and things that go wrong."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from magbend.rig.clock import SteppedClock
from magbend.rig.stage.config import LimitsConfig, StageConfig
from magbend.rig.stage.gap import GapStage
from magbend.rig.stage.grbl.stage import GrblStage
from magbend.rig.virtual.board.firmware import GrblBoard
from magbend.rig.virtual.board.plant import Plant
from magbend.rig.virtual.protocol_twin import register_board
from magbend.rig.wire_log import WireLog

SETTINGS = {1: 255, 20: 1, 21: 1, 22: 1, 130: 180}
_NAMES = itertools.count()


class InterruptingClock(SteppedClock):
    """Do something at a given time, in the thread that waits (Ctrl-C, faults)."""

    def __init__(self) -> None:
        super().__init__()
        self._due: list[tuple[float, Callable[[], None]]] = []

    def at(self, time_s: float, action: Callable[[], None]) -> None:
        self._due.append((time_s, action))

    def forget(self) -> None:
        self._due.clear()

    def sleep(self, duration_s: float) -> None:
        super().sleep(duration_s)
        for item in [i for i in self._due if i[0] <= self.monotonic_s()]:
            self._due.remove(item)
            item[1]()


@dataclass
class StageBench:
    clock: InterruptingClock
    board: GrblBoard
    stage: GapStage
    raw: GrblStage

    @property
    def true_gap_mm(self) -> float:
        """Where the carriage is: the switch of the plant closes at +0.5 mm."""
        return 120.0 + self.board.plant.carriage_mm[0] - 0.5

    def later(self, after_s: float, action: Callable[[], None]) -> None:
        self.clock.at(self.clock.monotonic_s() + after_s, action)


def interrupt() -> None:
    raise KeyboardInterrupt


def make_bench(
    settings: dict[int, float] | None = None,
    /,
    *,
    log: WireLog | None = None,
    plant: Plant | None = None,
    limits: dict[str, Any] | None = None,
    **config: Any,
) -> StageBench:
    clock = InterruptingClock()
    near = plant or Plant(start_mm=(-1.5, -1.5, -1.5))
    board = GrblBoard(near, SETTINGS if settings is None else settings)
    url = register_board(f"test-{next(_NAMES)}", board, clock)
    options = {"gap_at_zero_mm": 120.0, "steps_per_mm": 250.0, "port": url} | config
    table = StageConfig(**options)
    bounds = LimitsConfig(**{"min_gap_mm": 45.0, "max_gap_mm": 118.0} | (limits or {}))
    raw = GrblStage(table, clock, log=log)
    stage = GapStage(raw, table, bounds, clock)
    return StageBench(clock, board, stage, raw)


def homed_bench(
    settings: dict[int, float] | None = None, /, **options: Any
) -> StageBench:
    bench = make_bench(settings, **options)
    bench.stage.connect()
    bench.stage.home()
    bench.stage.goto_gap(100.0)
    return bench
