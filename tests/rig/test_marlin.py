"""The Marlin driver against a small board that answers as Marlin's sources say."""

from __future__ import annotations

import math
import re

import pytest

from magbend.core.errors import StageError
from magbend.rig.errors import PositionLostError, StageTimeoutError, StoppedError
from magbend.rig.stage.config import LimitsConfig, StageConfig
from magbend.rig.stage.gap import GapStage
from magbend.rig.stage.marlin.session import read_position, read_setup
from magbend.rig.stage.marlin.stage import MarlinStage
from magbend.rig.virtual.protocol_twin import register_board

from .stage_bench import InterruptingClock, interrupt

M503 = """echo:  G21    ; Units in mm (mm)
echo:; Steps per unit:
echo: M92 X80.00 Y80.00 Z400.00 E93.00
echo:; Max feedrates (units/s):
echo:  M203 X10.00 Y10.00 Z5.00 E25.00
echo:; Max Acceleration (units/s2):
echo:  M201 X50.00 Y50.00 Z100.00 E10000.00"""
# With INCH_MODE_SUPPORT, after G20: every number is divided by 25.4.
M503_INCHES = re.sub(
    r"([XYZE])([\d.]+)",
    lambda value: f"{value[1]}{float(value[2]) / 25.4:.2f}",
    M503.replace("G21    ; Units in mm (mm)", "G20    ; Units in inches (in)"),
)
M211 = "echo:Soft endstops: On  Min: X0.00 Y0.00 Z0.00   Max: X200.00 Y200.00 Z180.00"


class MarlinBoard:
    """What `twin://` asks of a board; lines in, lines out, moves that take time."""

    def __init__(self) -> None:
        self.now_s = self._free_s = self._last_s = 0.0
        self.plugged, self.port_taken, self.restart_on_open = True, False, False
        self._line = b""
        self._out: list[tuple[float, bytes]] = []
        self.x_mm = 37.0
        self.homed = self.silent = self.short = self.old = False
        self.waits = self.place_in_ok = self.relative = self.inches = False
        self.offset_mm = 0.0  # G92
        self.motors_off_after_s = 120.0
        self.ok = "ok"
        self.seen: list[str] = []
        self.say("start\necho:Marlin 2.1.2.4", 0.5)

    def say(self, text: str, at_s: float) -> None:
        for line in text.splitlines():
            self._out.append((at_s, line.encode() + b"\n"))

    def advance(self, duration_s: float) -> None:
        before_s = self.now_s
        self.now_s += duration_s
        if self.waits and int(self.now_s) > int(before_s):
            self.say("wait", self.now_s)

    def read(self) -> bytes:
        ready = [data for time_s, data in self._out if time_s <= self.now_s]
        self._out = [item for item in self._out if item[0] > self.now_s]
        return b"".join(ready)

    def receive(self, data: bytes) -> None:
        self._line += data
        while b"\n" in self._line:
            line, self._line = self._line.split(b"\n", 1)
            self.seen.append(line.decode())
            if not self.silent:
                self._answer(line.decode())

    def _answer(self, line: str) -> None:
        # One line at a time: an answer never overtakes the one before.
        now = self._last_s = max(self.now_s + 0.01, self._last_s)
        if line == "M115":
            self.say("FIRMWARE_NAME:Marlin 2.1.2.4 MACHINE_TYPE:Stage", now)
        elif line == "M503":
            self.say(M503_INCHES if self.inches else M503, now)
        elif line == "M211" and not self.old:
            self.say(M211, now)
        elif line.startswith("G28"):
            self.x_mm, self.homed = 0.0, True
            self._free_s = now + 9.0
            for second in (2, 4, 6, 8):
                self.say("echo:busy: processing", now + second)
            now = self._free_s
        elif match := re.match(r"G1 X(\S+) F(\S+)", line):
            distance = float(match[1]) + self.offset_mm - self.x_mm
            distance = float(match[1]) if self.relative else distance
            self._free_s = now + abs(distance) / (float(match[2]) / 60.0)
            self.x_mm += distance * (0.5 if self.short else 1.0)
        elif line.startswith("M118") and not self.old:
            self.say(line[5:], now)
        elif line in ("G20", "G21") and not self.old:
            self.inches = line == "G20"
        elif line in ("G90", "G91"):
            self.relative = line == "G91"
        elif line.startswith(("M118", "M211")) or (line == "G21" and self.old):
            self.say(f'echo:Unknown command: "{line}"', now)
        elif line.startswith("M84 S"):
            self.motors_off_after_s = float(line[5:]) or math.inf
        elif line == "M400":
            now = max(now, self._free_s)
        elif line == "M410":
            self._free_s = now
        elif line == "M114":
            steps = round(self.x_mm * 80)
            logical = self.x_mm - self.offset_mm
            place = f"X:{logical:.2f} Y:0.00 Z:0.00 E:0.00 Count X:{steps} Y:0"
            self.say(f"ok {place}" if self.place_in_ok else place, now)
        if not (line == "M114" and self.place_in_ok):
            self.say(self.ok, now)
        self._last_s = now


@pytest.fixture
def bench(tmp_path, monkeypatch):
    clock, board = InterruptingClock(), MarlinBoard()
    config = StageConfig(
        driver="marlin", port=register_board("marlin", board, clock),
        gap_at_zero_mm=160.0, direction=-1, steps_per_mm=80.0, feed_mm_min=600.0,
    )  # fmt: skip
    bounds = LimitsConfig(min_gap_mm=45.0, max_gap_mm=155.0)
    stage = GapStage(MarlinStage(config, clock), config, bounds, clock)
    return board, stage, clock


@pytest.mark.parametrize(
    "habit", [{"waits": True}, {"place_in_ok": True}, {"ok": "ok N0 P15 B3"}]
)
def test_habits_of_other_boards_are_understood(bench, habit):
    # Each of them is OctoPrint's virtual printer in one of its settings.
    board, stage, clock = bench
    for name, value in habit.items():
        setattr(board, name, value)
    stage.connect()
    assert clock.monotonic_s() < 15.0
    stage.home()
    assert stage.goto_gap(60.0).gap_mm == pytest.approx(60.0, abs=0.02)


def test_it_homes_its_axis_alone_and_goes_to_gaps(bench):
    board, stage, _ = bench
    stage.connect()
    with pytest.raises(PositionLostError):
        stage.goto_gap(60.0)
    stage.home()
    record = stage.goto_gap(60.0)
    assert record.gap_mm == pytest.approx(60.0, abs=0.02)
    assert record.duration_s >= 100.0 / 10.0
    assert "G28 X" in board.seen
    assert stage.limits.travel_mm == (0.0, 200.0)
    assert max(_steps(board.seen)) <= 10.0 + 1e-6


def test_coordinates_that_another_program_left_relative_are_absolute_again(tmp_path):
    # A jog of a print host says G91 first; cut off there, G1 X37.5 would be 37.5 mm on.
    clock, board = InterruptingClock(), MarlinBoard()
    config = StageConfig(
        driver="marlin", port=register_board("relative", board, clock),
        homing="manual", feed_mm_min=600.0,
    )  # fmt: skip
    stage = MarlinStage(config, clock)
    stage.connect()
    board.relative = True
    stage.nudge(0.5)
    assert board.x_mm == 37.5
    stage.assume_homed(37.5, (160.0, -1))
    board.relative = True
    stage.move_to(50.0, feed_mm_min=600.0)
    assert board.x_mm == 50.0


def test_a_board_that_another_program_left_in_inches_is_read_in_mm():
    clock, board = InterruptingClock(), MarlinBoard()
    board.inches = True
    config = StageConfig(
        driver="marlin", port=register_board("inches", board, clock),
        homing="manual", feed_mm_min=600.0,
    )  # fmt: skip
    stage = MarlinStage(config, clock)
    stage.connect()
    assert stage.limits.step_mm == 1 / 80
    assert stage.limits.max_feed_mm_min == 600.0
    stage.assume_homed(37.0, (160.0, -1))
    stage.move_to(50.0, feed_mm_min=600.0)
    assert board.x_mm == 50.0


def test_the_motors_hold_the_stage_through_a_long_step(bench):
    board, stage, _ = bench
    stage.connect()
    stage.home()
    stage.goto_gap(100.0)
    assert board.motors_off_after_s == math.inf
    board.motors_off_after_s = 120.0  # it was restarted, and is homed again
    stage.home()
    assert board.motors_off_after_s == math.inf


def test_nothing_moves_by_coordinates_that_are_offset(bench):
    board, stage, _ = bench
    stage.connect()
    stage.home()
    stage.goto_gap(100.0)
    board.offset_mm = 30.0
    with pytest.raises(StageError, match=r"30\.000 mm.*G92"):
        stage.goto_gap(90.0)
    assert board.x_mm == 60.0


def _steps(lines: list[str]) -> list[float]:
    places = [float(m[1]) for line in lines if (m := re.match(r"G1 X(\S+)", line))]
    return [abs(b - a) for a, b in zip([0.0, *places], places, strict=False)]


def test_an_ok_is_queued_not_arrived(bench):
    board, stage, _ = bench
    stage.connect()
    stage.home()
    stage.goto_gap(150.0)
    moves = [i for i, line in enumerate(board.seen) if line.startswith("G1")]
    assert all(board.seen[i + 1] == "M400" for i in moves)


@pytest.mark.parametrize("said", ["start", "X:0.00 Y:0.0start", "\x7fstart"])
def test_a_restart_loses_the_position(bench, said):
    """Also one that cuts a line short, or comes with the noise of switching on."""
    board, stage, clock = bench
    stage.connect()
    stage.home()
    board.say(said, board.now_s)
    clock.sleep(0.1)
    with pytest.raises(PositionLostError):
        stage.goto_gap(60.0)
    assert stage.position_state == "unknown"


def test_stopping_short_and_silence_are_unverified(bench):
    board, stage, _ = bench
    stage.connect()
    stage.home()
    board.short = True
    with pytest.raises(StageTimeoutError, match="instead of"):
        stage.goto_gap(150.0)
    assert stage.position_state == "unverified"
    board.short = False
    stage.home()
    stage.goto_gap(150.0)
    board.silent = True
    assert stage.status().state == "silent"


def test_a_stop_from_outside_ends_after_one_piece(bench):
    board, stage, _ = bench
    stage.connect()
    stage.home()
    before = len(board.seen)
    stage.request_stop()
    with pytest.raises(StoppedError):
        stage.goto_gap(60.0)
    assert not any(line.startswith("G1") for line in board.seen[before:])
    assert stage.position_state == "homed"


@pytest.mark.parametrize("after_s", [0.3, 2.0, 5.1])
def test_a_stop_in_motion_stands_within_a_second(bench, after_s):
    _, stage, clock = bench
    stage.connect()
    stage.home()
    asked_s = clock.monotonic_s() + after_s
    clock.at(asked_s, stage.request_stop)
    with pytest.raises(StoppedError):
        stage.goto_gap(60.0)
    assert clock.monotonic_s() - asked_s < 1.0
    assert stage.position_state == "homed"


def test_settings_are_audited_by_name():
    lines = M503.splitlines()
    assert read_setup([*lines, M211], "X").travel_mm == (0.0, 200.0)
    with pytest.raises(StageError, match="M92 X"):
        read_setup([line.replace("X80.00", "X0.00") for line in lines], "X")
    with pytest.raises(StageError, match="M203"):
        read_setup([line for line in lines if "M203" not in line], "X")


def test_the_counted_steps_are_believed_before_the_planned_position():
    assert read_position(["X:99.00 Y:0 Count X:800 Y:0"], "X", 80.0) == 10.0
    assert read_position(["X:12.50 Y:0.00 Z:0.00"], "X", 80.0) == 12.5
    assert read_position(["busy"], "X", 80.0) is None


@pytest.mark.parametrize("old", [False, True], ids=["M118", "no M118"])
@pytest.mark.parametrize("after_s", [0.0, 0.3, 2.5, 7.0])
def test_ctrl_c_while_homing_stops_and_the_next_answers_are_not_off_by_one(
    bench, after_s, old
):
    board, stage, clock = bench
    board.old = old
    stage.connect()
    clock.at(clock.monotonic_s() + after_s, interrupt)
    with pytest.raises(KeyboardInterrupt):
        stage.home()
    assert "M410" in board.seen
    assert stage.position_state == "unknown"
    clock.sleep(10.0)  # without its emergency parser the board homes to the end
    stage.home()
    assert stage.goto_gap(150.0).gap_mm == pytest.approx(150.0, abs=0.02)


@pytest.mark.parametrize("after_s", [0.0, 0.4, 1.1, 3.0])
def test_ctrl_c_in_a_move_lets_the_piece_end_and_keeps_the_position(bench, after_s):
    board, stage, clock = bench
    stage.connect()
    stage.home()
    clock.at(clock.monotonic_s() + after_s, interrupt)
    with pytest.raises(KeyboardInterrupt):
        stage.goto_gap(60.0)
    assert "M410" not in board.seen
    assert stage.position_state == "homed"
    assert stage.goto_gap(80.0).gap_mm == pytest.approx(80.0, abs=0.02)


def test_a_slow_piece_is_given_its_time_to_end(bench):
    board, stage, clock = bench
    stage.connect()
    stage.home()
    clock.at(clock.monotonic_s() + 2.0, interrupt)
    with pytest.raises(KeyboardInterrupt):
        stage.goto_gap(150.0, feed_mm_min=15.0)  # 40 s for its 10 mm
    assert "M410" not in board.seen
    assert stage.position_state == "homed"


def test_an_unseen_restart_is_found_by_the_jump_of_the_count(bench):
    board, stage, _ = bench
    stage.connect()
    stage.home()
    stage.goto_gap(100.0)
    board.x_mm = 0.0  # its "start" was lost
    with pytest.raises(PositionLostError, match="restarted, or another program"):
        stage.goto_gap(90.0)
    assert stage.position_state == "unknown"


def test_a_board_without_soft_end_stops_has_no_known_travel(bench):
    board, stage, _ = bench
    board.old = True
    stage.connect()
    assert stage.limits.travel_mm is None
    stage.home()
    assert stage.goto_gap(150.0).gap_mm == pytest.approx(150.0, abs=0.02)


def test_a_halted_board_says_so_until_it_is_restarted(bench):
    board, stage, clock = bench
    stage.connect()
    stage.home()
    board.say("Error:Printer halted. kill() called!", board.now_s)
    board.silent = True
    clock.sleep(0.1)
    with pytest.raises(PositionLostError, match="halted"):
        stage.goto_gap(60.0)
    assert stage.position_state == "unknown"
    assert stage.status().state == "alarm"
    board.silent = False
    board.say("start", board.now_s + 0.1)
    stage.recover()
    stage.home()
    assert stage.position_state == "homed"


def test_a_busy_board_is_not_a_silent_one(bench):
    board, stage, clock = bench
    stage.connect()
    now_s = board.now_s
    board._last_s = now_s + 9.0
    for second in (2, 4, 6, 8):
        board.say("echo:busy: processing", now_s + second)
    assert stage.status().state == "idle"
    assert clock.monotonic_s() > 9.0
