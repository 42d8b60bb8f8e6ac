"""The driver against the recorded words of a real board, on a bad line.

Independent of the twin: `recorded_board` knows no GRBL, and every byte it says was said
by the real board, section by section of the recording.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest

from magbend.rig.errors import (
    AlarmError,
    InterlockError,
    LinkLostError,
    PositionLostError,
    StoppedError,
)
from magbend.rig.stage.config import StageConfig
from magbend.rig.stage.grbl.stage import GrblStage
from magbend.rig.stage.protocol import StageError
from magbend.rig.virtual.protocol_twin import register_board

from .recorded_board import SAID, RecordedBoard, hal_words, line
from .stage_bench import InterruptingClock

SEEDS = range(5)
_NAMES = itertools.count()


def stage_on(board: RecordedBoard, homing: str = "manual") -> GrblStage:
    clock = InterruptingClock()
    port = register_board(f"recorded-{next(_NAMES)}", board, clock)
    config = StageConfig(gap_at_zero_mm=0.0, port=port, homing=homing)
    return GrblStage(config, clock)


def standing(seed: int) -> tuple[RecordedBoard, GrblStage]:
    """A board that stands trusted at -29.6 mm, as in section G."""
    board = RecordedBoard(seed, line("G", "<Idle|MPos:-29.600"))
    stage = stage_on(board)
    stage.connect()
    stage.assume_homed(-29.6, (0.0, 1))
    board.on(r"\$J=G21G90G53X-30.000F300.0", lambda: jog(board))
    return board, stage


def jog(board: RecordedBoard) -> None:
    """Section G: the absolute jog from -29.6 to -30 mm."""
    board.say(line("G", "ok"))
    first = line("G", "<Jog|MPos:-29.600", 1)
    board.report_as_recorded("G", first, line("G", "<Idle|MPos:-30.000"))


def locked(
    board: RecordedBoard, section: str, *, late_ok: bool = False, after_s: float = 0.0
) -> None:
    """After a reset: the late ok, the banner, the lock, the report of a section."""
    if late_ok:
        board.say(line(section, "ok"), after_s=after_s + 0.01)
    board.say(*board.banner(section), after_s=after_s + 0.05)
    board.later(
        after_s + 0.06, lambda: setattr(board, "report", line(section, "<Alarm"))
    )


def deaf(board: RecordedBoard, section: str, alarm: str, *, late_ok: bool) -> None:
    """Sections H, H2, L: no answer, a reset in the first half second is swallowed."""
    board.report = None
    board.say(line(section, alarm), after_s=0.0)
    board.on("\x18", lambda: None)

    def listens_again() -> None:
        board.say(line(section, "[MSG:Reset"), after_s=0.0)
        board.on("\x18", lambda: locked(board, section, late_ok=late_ok))

    board.later(0.55, listens_again)


@pytest.mark.parametrize("seed", SEEDS)
def test_it_connects_and_homes(seed: int) -> None:
    board = RecordedBoard(seed, line("C", "<Idle"))

    def home() -> None:  # section D: silent, one late report, then ok
        board.report = None
        board.say(line("D", "<Home"), line("D", "ok"), after_s=12.0)
        board.later(12.1, lambda: setattr(board, "report", line("D", "<Idle")))

    def list_settings() -> None:  # as section C set them
        settings = {b"$22=0\r\n": b"$22=1\r\n"}
        rows = [s for s in SAID["A"] if s.startswith(b"$") and b"N" not in s]
        board.say(*[settings.get(row, row) for row in rows], line("A", "ok"))

    board.on(r"\$H", home)
    board.on(r"\$\$", list_settings)
    stage = stage_on(board, "switches")
    stage.connect()
    assert len(stage.identity.settings) == 34
    assert stage.position_state == "unknown"
    stage.home()
    assert stage.position_state == "homed"
    assert board.heard.count("$H") == 1
    stage.close()


@pytest.mark.parametrize("seed", SEEDS)
def test_it_arrives_when_the_board_says_idle_there(seed: int) -> None:
    board, stage = standing(seed)
    stage.move_to(-30.0, feed_mm_min=300.0)
    assert stage.position_state == "homed"
    assert board.report == line("G", "<Idle|MPos:-30.000")
    stage.close()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_jog_out_of_the_travel_is_refused_and_nothing_is_lost(seed: int) -> None:
    board, stage = standing(seed)
    board.on(r"\$J=.*", lambda: board.say(line("G", "error:15")))
    with pytest.raises(InterlockError):
        stage.move_to(-31.0, feed_mm_min=300.0)
    assert stage.position_state == "homed"
    stage.close()


Happening = Callable[[RecordedBoard], None]
HAPPENINGS: dict[str, tuple[Happening, type[StageError], str]] = {
    "L: hard limit": (
        lambda b: deaf(b, "L", "ALARM:1", late_ok=False), AlarmError, "unknown"),
    "H: soft limit, late ok": (
        lambda b: deaf(b, "H", "ALARM:2", late_ok=True), AlarmError, "homed"),
    "J: reset in motion": (
        lambda b: (b.say(line("J", "ALARM:3"), after_s=0.0), setattr(b, "report", None),
                   locked(b, "J", after_s=0.6))[0],
        AlarmError, "unknown"),
    "M: power cut, homing on": (
        lambda b: locked(b, "M"), PositionLostError, "unknown"),
    "N: power cut, homing off": (
        lambda b: (b.say(*b.banner("N"), after_s=0.0),
                   setattr(b, "report", line("N", "<Idle")))[0],
        PositionLostError, "unknown"),
    "U: cable pulled": (
        lambda b: setattr(b, "plugged", False), LinkLostError, "unverified"),
}  # fmt: skip


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", HAPPENINGS)
def test_what_happened_to_the_real_board_in_motion(name: str, seed: int) -> None:
    happening, error, position = HAPPENINGS[name]
    board, stage = standing(seed)

    def slow_jog() -> None:  # the real board was 1.5 s on its way
        board.say(line("G", "ok"))
        board.report = line("G", "<Jog|MPos:-29.636")
        board.later(1.5, lambda: happening(board))

    board.on(r"\$J=.*", slow_jog)
    with pytest.raises(error):
        stage.move_to(-30.0, feed_mm_min=300.0)
    assert stage.position_state == position
    heard = len(board.heard)
    with pytest.raises(StageError):  # refused, until somebody homes or unlocks
        stage.move_to(-30.0, feed_mm_min=300.0)
    assert not any(text.startswith(("$J", "$X")) for text in board.heard[heard:])
    stage.close()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_soft_limit_is_unlocked_by_the_operator_alone(seed: int) -> None:
    board, stage = standing(seed)
    board.on(r"\$J=.*", lambda: deaf(board, "H", "ALARM:2", late_ok=True))
    with pytest.raises(AlarmError):
        stage.move_to(-30.0, feed_mm_min=300.0)
    assert "$X" not in board.heard

    def unlocked() -> None:
        board.say(line("H", "[MSG:Caution"), line("H", "ok"))
        board.report = line("H", "<Idle")

    board.on(r"\$X", unlocked)
    stage.unlock()
    assert [stage.status().state for _ in range(9)].count("idle") >= 3
    assert stage.position_state == "homed"
    stage.close()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_stop_slows_the_jog_down_and_keeps_the_position(seed: int) -> None:
    board, stage = standing(seed)

    def held() -> None:  # section G: the tail of the cancelled jog, from -28.776 mm
        first = line("G", "<Jog|MPos:-28.776")
        board.report_as_recorded("G", first, line("G", "<Idle|MPos:-29.600"))

    def long_jog() -> None:
        board.say(line("G", "ok"))
        board.report = line("G", "<Jog|MPos:-28.472")
        stage.request_stop()

    board.on(r"\$J=.*", long_jog)
    board.on("\x85", held)
    with pytest.raises(StoppedError, match="the position was kept"):
        stage.move_to(-35.0, feed_mm_min=300.0)
    assert stage.position_state == "homed"
    assert "\x18" not in board.heard[board.heard.index("\x85") :]
    stage.close()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("section", "code", "took_s"), [("L", 8, 1.1), ("V", 9, 3.8)])
def test_homing_that_fails_says_why(
    section: str, code: int, took_s: float, seed: int
) -> None:
    board = RecordedBoard(seed, line("C", "<Idle"))
    board.on(r"\$\$", lambda: board.say(*_homing_on(), line("A", "ok")))

    def fails() -> None:  # the alarm, then the ok of $H, then the banner and the lock
        board.report = None
        board.say(line(section, f"ALARM:{code}"), after_s=took_s)
        board.later(took_s + 0.6, lambda: locked(board, section, late_ok=True))

    board.on(r"\$H", fails)
    stage = stage_on(board, "switches")
    stage.connect()
    with pytest.raises(AlarmError, match=f"ALARM:{code}"):
        stage.home()
    assert stage.position_state == "unknown"
    stage.close()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_board_that_is_stuck_in_home_is_met_with_a_reset(seed: int) -> None:
    board = RecordedBoard(seed, line("Y", "<Home"))
    for query in (r"\$I", r"\$G", r"\$#", r"\$\$"):
        board.on(query, lambda: board.say(line("Y", "error:8")))

    def reset() -> None:
        board.say(line("Y", "ALARM:6"), after_s=0.01)
        board.later(0.5, lambda: locked(board, "Y"))
        for query in ("$I", "$G", "$#"):
            board.on(f"\\{query}", lambda: board.say(line("A", "ok")))
        board.on(r"\$\$", lambda: board.say(*_homing_on(), line("A", "ok")))

    board.on("\x18", reset)
    stage = stage_on(board, "switches")
    stage.connect()
    assert stage.position_state == "unknown"
    assert {stage.status().state for _ in range(9)} <= {"alarm", "silent"}
    stage.close()


def _homing_on() -> list[bytes]:
    rows = [s for s in SAID["A"] if s.startswith(b"$") and not s.startswith(b"$N")]
    return [b"$22=1\r\n" if row == b"$22=0\r\n" else row for row in rows]


def as_hal(board: RecordedBoard) -> None:
    """Section X: another banner, unknown fields, more settings and more decimals."""
    banner, report, details = hal_words()[:3]
    board.report = report.replace(b"MPos:0.000", b"MPos:-29.600")
    board.on("\x18", lambda: board.say(banner, after_s=0.04))
    board.on(r"\$I", lambda: board.say(details))
    settings = [
        row.replace(b".000\r\n", b".00000\r\n") for row in SAID["A"] if row[:1] == b"$"
    ]
    more = [b"$%d=0\r\n" % number for number in range(340, 396)]
    board.on(
        r"\$\$", lambda: board.say(*settings, *more, b"$676=15\r\n", line("A", "ok"))
    )


def as_fluidnc(board: RecordedBoard) -> None:
    """The dossier's FluidNC: its banner, messages at boot, reports nobody asked for."""
    banner = b"\r\nGrbl 3.7 [FluidNC v3.7.16 (wifi) '$' for help]\r\n"
    chatter = b"[MSG:INFO: Connecting to STA SSID:lab]\r\n"
    board.on("\x18", lambda: board.say(chatter, banner, chatter, after_s=0.04))
    board.on(
        r"\$I",
        lambda: board.say(b"[VER:3.7 FluidNC v3.7.16:]\r\n[OPT:PHS]\r\n", b"ok\r\n"),
    )

    def report_unasked() -> None:
        if board.report is not None:
            board.say(board.report, after_s=0.0)
        board.later(0.2, report_unasked)

    report_unasked()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("dialect", [as_hal, as_fluidnc])
def test_dialects_connect_move_refuse_and_go_on(dialect, seed: int) -> None:
    board = RecordedBoard(seed, line("G", "<Idle|MPos:-29.600"))
    dialect(board)
    stage = stage_on(board)
    stage.connect()
    stage.assume_homed(-29.6, (0.0, 1))
    assert stage.limits.step_mm == 0.004
    latched = False

    def refuse() -> None:
        nonlocal latched
        latched = True
        board.say(line("G", "error:15"))

    def jog_again() -> None:
        nonlocal latched
        latched = False  # a "$" line that succeeds lifts grblHAL's latch
        jog(board)

    board.on(r"[^$].*", lambda: board.say(b"error:15\r\n" if latched else b"ok\r\n"))
    board.on(r"\$J=.*X-31\.000.*", refuse)
    board.on(r"\$J=.*X-30\.000.*", jog_again)
    with pytest.raises(InterlockError):
        stage.move_to(-31.0, feed_mm_min=300.0)
    stage.move_to(-30.0, feed_mm_min=300.0)
    assert stage.position_state == "homed"
    assert not latched
    stage.close()
