"""A stop is proved or it escalates, on every board that the twin can play."""

from __future__ import annotations

import itertools
import random
from dataclasses import dataclass

import pytest

from magbend.rig.errors import NotStoppedError, StoppedError
from magbend.rig.stage.config import LimitsConfig, StageConfig
from magbend.rig.stage.gap import GapStage
from magbend.rig.stage.make import make_stage
from magbend.rig.virtual.board.file import Board, make_board
from magbend.rig.virtual.board.marlin import MarlinBoard
from magbend.rig.virtual.board.plant import Plant
from magbend.rig.virtual.protocol_twin import register_board

from .stage_bench import InterruptingClock

_NAMES = itertools.count()
STOP_BYTES = (b"\x85", b"!", b"\x18")
FEED_MM_S = 5.0


@pytest.fixture(autouse=True)
def runtime_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MAGBEND_RUNTIME_DIR", str(tmp_path))


@dataclass
class StopBench:
    clock: InterruptingClock
    board: Board
    stage: GapStage

    def stopped(self, target_mm: float, after_s: float) -> tuple[float, float] | None:
        """Go there, be stopped; return true run-out and speed when the byte came."""
        seen: list[tuple[float, float]] = []
        receive, is_asked = self.board.receive, False

        def look() -> None:
            place = self.board.plant.carriage_mm[0]
            seen.append((place, self.board.mover.speed_mm_s))

        def ask() -> None:
            nonlocal is_asked
            is_asked = True
            self.stage.request_stop()
            if isinstance(self.board, MarlinBoard):  # it gets no byte: its piece ends
                look()

        def note(data: bytes) -> None:
            if data in STOP_BYTES and is_asked and not seen:
                look()
            receive(data)

        self.board.receive = note
        self.clock.at(self.clock.monotonic_s() + after_s, ask)
        try:
            self.stage.goto_gap(target_mm)
        except StoppedError:
            assert not self.board.mover.running
            run_out = abs(self.board.plant.carriage_mm[0] - seen[0][0])
            return run_out, seen[0][1]
        else:
            return None
        finally:
            self.board.receive = receive
            self.clock.forget()


def bench_of(kind: str) -> StopBench:
    """A stage that stands homed at a gap of 110 mm."""
    clock = InterruptingClock()
    low = kind == "marlin"
    start = -178.0 if low else -1.5
    plant = Plant(start_mm=(start,) * 3, switch_low_mm=-180.0 if low else -190.0)
    board = make_board(kind, plant)
    config = StageConfig(
        driver="marlin" if low else "grbl",
        port=register_board(f"stop-{next(_NAMES)}", board, clock),
        gap_at_zero_mm=160.0 if low else 120.0,
        direction=-1 if low else 1,
        homed_at_mm=0.0 if kind == "fluidnc" else None,
    )
    bounds = LimitsConfig(min_gap_mm=45.0, max_gap_mm=118.0)
    stage = GapStage(make_stage(config, clock), config, bounds, clock)
    stage.connect()
    stage.home()
    stage.goto_gap(110.0)
    return StopBench(clock, board, stage)


@pytest.mark.parametrize("kind", ["grbl", "grblhal", "fluidnc", "marlin"])
def test_random_stops_are_proved_and_keep_the_place(kind):
    bench, dice = bench_of(kind), random.Random(7)
    zero_mm = bench.board.plant.carriage_mm[0] - bench.stage.status().stage_mm
    stops = 0
    for _ in range(12):
        met = bench.stopped(dice.uniform(50.0, 112.0), dice.uniform(0.1, 4.0))
        if met is None:
            bench.stage.hold()
            continue
        stops += 1
        run_out_mm, _ = met
        proof = bench.stage.last_stop
        assert proof.is_place_kept
        assert bench.stage.position_state == "homed"
        assert proof.means in ("jog cancel", "end of the piece", "nothing")
        counted_mm = bench.board.plant.carriage_mm[0] - zero_mm
        assert proof.machine_mm == pytest.approx(counted_mm, abs=0.01)
        if kind == "marlin":  # it cannot slow down: the piece of 0.75 s ends
            assert run_out_mm <= 0.75 * FEED_MM_S + 0.01
        else:
            slowing_mm = FEED_MM_S**2 / (2.0 * 10.0)
            assert run_out_mm <= 1.2 * (slowing_mm + 0.05 * FEED_MM_S)
            assert proof.begun_s is None or proof.begun_s <= 0.35
    assert stops >= 6


def test_a_board_that_heeds_no_stop_is_reset_and_says_so():
    bench = bench_of("grbl")
    bench.board.heeds_stops = False
    run_out_mm, speed_mm_s = bench.stopped(50.0, 1.2)
    proof = bench.stage.last_stop
    assert proof.means == "reset"
    assert [text.partition(":")[0] for text in proof.tried] == [
        "jog cancel", "feed hold",
    ]  # fmt: skip
    assert "unverified" in proof.sentence()
    assert bench.stage.position_state != "homed"
    assert run_out_mm <= 1.0 * speed_mm_s  # two means of 0.4 s each, and the answers


def test_a_hold_alone_would_not_have_stopped_a_grblhal():
    bench = bench_of("grblhal")
    bench.board.receive(b"$J=G91X-20F300\n")
    bench.clock.sleep(0.5)
    bench.stage.status()
    bench.board.receive(b"!")
    bench.clock.sleep(1.0)
    bench.stage.status()
    assert bench.board.mover.running
    assert bench.stage.hold().means == "jog cancel"
    assert not bench.board.mover.running


def test_a_stage_that_moves_after_a_reset_too_is_not_said_to_stand():
    bench = bench_of("grbl")
    bench.board.heeds_stops = False
    receive = bench.board.receive
    bench.board.receive = lambda data: receive(data.replace(b"\x18", b""))
    bench.clock.at(bench.clock.monotonic_s() + 1.2, bench.stage.request_stop)
    with pytest.raises(NotStoppedError, match="cut the power"):
        bench.stage.goto_gap(50.0)
    assert bench.stage.position_state == "unverified"


def test_a_silent_board_is_held_then_reset_within_a_stated_time():
    bench = bench_of("grbl")
    bench.clock.at(
        bench.clock.monotonic_s() + 2.0, lambda: bench.board.lose_output(1e9)
    )
    heard: list[bytes] = []
    receive = bench.board.receive
    bench.board.receive = lambda data: (heard.append(data), receive(data))
    bench.clock.at(bench.clock.monotonic_s() + 2.1, bench.stage.request_stop)
    with pytest.raises(NotStoppedError, match="cut the power"):
        bench.stage.goto_gap(50.0)
    assert [byte for byte in heard if byte in STOP_BYTES][:3] == [
        b"\x85",
        b"!",
        b"\x18",
    ]
    assert not bench.board.mover.running
