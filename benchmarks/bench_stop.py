"""Stops at random moments on the twin playing each board: how long, how far, how sure.

    .venv/bin/python benchmarks/bench_stop.py [STOPS] [SEED]

A stage is sent to and fro at 300 mm/min (acceleration 10 mm/s2; Marlin 50) and asked to
stop at a random moment. Counted from the request, which the driver meets at its next
look: until the stage truly slows, until it truly stands, and how far it ran. ``grbl, no
soft stop`` is a board on which neither jog cancel nor feed hold works.
"""

from __future__ import annotations

import logging
import os
import random
import statistics
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from magbend.rig import (
    GapStage,
    LimitsConfig,
    StageConfig,
    SteppedClock,
    StoppedError,
    make_stage,
)
from magbend.rig.virtual.board.file import Board, make_board
from magbend.rig.virtual.board.plant import Plant
from magbend.rig.virtual.protocol_twin import register_board

KINDS = ("grbl", "grblhal", "fluidnc", "marlin", "grbl, no soft stop")


SLICE_S = 0.005


class WatchingClock(SteppedClock):
    """A clock that moves the board, and looks at it, 200 times a second."""

    def __init__(self) -> None:
        super().__init__()
        self.due_s = float("inf")
        self.action = lambda: None
        self.look = lambda: None
        self.advance = lambda now_s: None

    def sleep(self, duration_s: float) -> None:
        end_s = self.monotonic_s() + duration_s
        while (left_s := end_s - self.monotonic_s()) > 1e-9:
            super().sleep(min(SLICE_S, left_s))
            self.advance(self.monotonic_s())
            if self.monotonic_s() >= self.due_s:
                self.due_s = float("inf")
                self.action()
            self.look()


@dataclass
class Stop:
    """What one stop was, seen from the plant."""

    means: str
    slow_s: float
    stand_s: float
    run_out_mm: float
    speed_mm_s: float
    kept: bool
    error_mm: float


@dataclass
class Bench:
    """A stage that stands homed at a gap of 110 mm."""

    clock: WatchingClock
    board: Board
    stage: GapStage
    zero_mm: float = 0.0

    def ready(self) -> None:
        """Home it and go to the beginning."""
        self.board.heeds_stops = True
        self.stage.home()
        self.stage.goto_gap(110.0)
        counted = self.stage.status().stage_mm or 0.0
        self.zero_mm = self.board.plant.carriage_mm[0] - counted

    def stop(self, target_mm: float, after_s: float, *, heeds: bool) -> Stop | None:
        """Send it off and stop it; None if it had arrived before."""
        rows: list[tuple[float, float, float]] = []

        def look() -> None:
            place = self.board.plant.carriage_mm[0]
            rows.append((self.clock.monotonic_s(), place, self.board.mover.speed_mm_s))

        def ask() -> None:
            rows.clear()
            look()
            self.stage.request_stop()
            self.clock.look = look

        self.clock.due_s = self.clock.monotonic_s() + after_s
        self.clock.action = ask
        self.board.heeds_stops = heeds
        try:
            self.stage.goto_gap(target_mm)
        except StoppedError:
            return self._judge(rows)
        finally:
            self.clock.due_s, self.clock.look = float("inf"), lambda: None
        return None

    def _judge(self, rows: list[tuple[float, float, float]]) -> Stop:
        proof = self.stage.last_stop
        assert proof is not None, "a stop without a proof"
        assert not self.board.mover.running, "said to stand, and moves"
        start_s, start_mm, _ = rows[0]
        end_mm = self.board.plant.carriage_mm[0]
        peak = max(speed for _, _, speed in rows)
        at_peak = max(t for t, _, speed in rows if speed >= 0.999 * peak)
        stood = next(t for t, place, _ in rows if place == end_mm)
        counted = (proof.machine_mm or 0.0) + self.zero_mm
        return Stop(
            means=proof.means,
            slow_s=at_peak - start_s,
            stand_s=stood - start_s,
            run_out_mm=abs(end_mm - start_mm),
            speed_mm_s=peak,
            kept=proof.is_place_kept,
            error_mm=abs(counted - end_mm),
        )


def make_bench(kind: str) -> Bench:
    """Return a bench whose board plays `kind`."""
    low = kind == "marlin"
    plant = Plant(
        start_mm=((-178.0 if low else -1.5),) * 3,
        switch_low_mm=-180.0 if low else -190.0,
    )
    clock, board = WatchingClock(), make_board(kind.split(",")[0], plant)
    config = StageConfig(
        driver="marlin" if low else "grbl",
        port=register_board(f"stop-{kind}", board, clock),
        gap_at_zero_mm=160.0 if low else 120.0,
        direction=-1 if low else 1,
        homed_at_mm=0.0 if kind == "fluidnc" else None,
    )
    bounds = LimitsConfig(min_gap_mm=45.0, max_gap_mm=118.0)
    stage = GapStage(make_stage(config, clock), config, bounds, clock)
    stage.connect()
    bench = Bench(clock, board, stage)
    stage.status()
    behind_s = clock.monotonic_s() - board.now_s
    clock.advance = lambda now_s: board.advance(
        max(now_s - behind_s - board.now_s, 0.0)
    )
    bench.ready()
    return bench


def measure(kind: str, stops: int, seed: int) -> list[Stop]:
    """Return so many stops at random moments."""
    bench, dice = make_bench(kind), random.Random(seed)
    found: list[Stop] = []
    while len(found) < stops:
        target, after_s = dice.uniform(48.0, 112.0), dice.uniform(0.05, 6.0)
        stop = bench.stop(target, after_s, heeds="no soft stop" not in kind)
        if stop is not None:
            found.append(stop)
        bench.stage.hold()
        if bench.stage.position_state != "homed":
            bench.ready()
    bench.stage.close()
    return found


def main() -> None:
    """Print the table."""
    logging.getLogger("magbend").setLevel(logging.ERROR)
    stops = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 20261129
    print(f"{stops} stops a board, seed {seed}; median and longest")
    print("| board | stood by | slows after s | stands after s | runs on mm | "
          "place kept | place wrong by mm |")  # fmt: skip
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for kind in KINDS:
        found = measure(kind, stops, seed)
        by: dict[str, int] = {}
        for stop in found:
            by[stop.means] = by.get(stop.means, 0) + 1
        means = ", ".join(f"{name} {count}" for name, count in sorted(by.items()))
        cells = [
            f"{statistics.median(values):.2f}, {max(values):.2f}"
            for values in (
                [stop.slow_s for stop in found],
                [stop.stand_s for stop in found],
                [stop.run_out_mm for stop in found],
            )
        ]
        kept = [stop for stop in found if stop.kept]
        wrong = max((stop.error_mm for stop in kept), default=float("nan"))
        print(f"| {kind} | {means} | {' | '.join(cells)} | {len(kept)} | {wrong:.3f} |")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MAGBEND_RUNTIME_DIR"] = str(Path(folder))
        main()
