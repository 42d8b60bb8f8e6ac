"""Boards that are not the one on the desk: other settings, builds, versions, lines."""

from __future__ import annotations

import random

import pytest

from magbend.core.errors import StageError
from magbend.rig.clock import SteppedClock
from magbend.rig.errors import AlarmError, InterlockError, StageTimeoutError
from magbend.rig.stage.config import StageConfig
from magbend.rig.stage.grbl.audit import audit, audit_build, limits_of, notes
from magbend.rig.stage.grbl.motion import Target
from magbend.rig.stage.grbl.protocol import Setting, parse_line
from magbend.rig.stage.grbl.stage import GrblStage
from magbend.rig.virtual.board.plant import Plant
from magbend.rig.virtual.board.settings import DEFAULTS
from magbend.rig.virtual.protocol_twin import register_board

from .stage_bench import SETTINGS, homed_bench, interrupt, make_bench

HOMING = {str(n): f"{v:g}" for n, v in (dict(DEFAULTS) | SETTINGS).items()}


def _config(**options) -> StageConfig:
    return StageConfig(gap_at_zero_mm=120.0, **options)


# --- the line: torn, late, doubled ----------------------------------------------------


def _chop(board, seed: int) -> None:
    """Hand over what the board says in shreds of one to five bytes."""
    whole, left, dice = board.read, bytearray(), random.Random(seed)

    def read() -> bytes:
        left.extend(whole())
        piece = bytes(left[: dice.randint(1, 5)])
        del left[: len(piece)]
        return piece

    board.read = read


@pytest.mark.parametrize("seed", [1, 2])
def test_a_whole_session_survives_a_line_in_shreds(seed):
    bench = make_bench()
    _chop(bench.board, seed)
    bench.stage.connect()
    bench.stage.home()
    bench.stage.goto_gap(100.0)
    assert bench.true_gap_mm == pytest.approx(100.0, abs=0.005)
    assert len(bench.stage.identity.settings) == 34


def test_reports_that_come_twice_change_nothing():
    bench = homed_bench()
    send = bench.board.send
    bench.board.send = lambda data: send(data * 2 if data.startswith(b"<") else data)
    bench.stage.goto_gap(60.0)
    assert bench.true_gap_mm == pytest.approx(60.0, abs=0.005)


@pytest.mark.parametrize("latency_s", [0.3, 1.2])
def test_a_late_answer_is_not_taken_for_standing(latency_s):
    bench = homed_bench()
    bench.later(1.0, lambda: setattr(bench.board, "latency_s", latency_s))
    bench.later(2.5, interrupt)
    with pytest.raises(KeyboardInterrupt):
        bench.stage.goto_gap(60.0)
    assert not bench.board.mover.running
    bench.board.latency_s = 0.0
    bench.clock.sleep(2.0)
    if bench.stage.position_state != "homed":
        bench.stage.home()
    bench.stage.goto_gap(70.0)
    assert bench.true_gap_mm == pytest.approx(70.0, abs=0.005)


def test_garbage_before_the_first_line_is_passed_over():
    bench = make_bench()
    bench.board.advance(0.2)
    receive, said = bench.board.receive, []

    def interfere(data):
        if not said:
            said.append(data)
            bench.board.send(b"\xf0\x00\xff<Idl\xfe\r\nerror:9\r\nok\r\n<Run|MPos:1")
        receive(data)

    bench.board.receive = interfere
    bench.stage.connect()
    bench.stage.home()
    assert bench.stage.position_state == "homed"


def test_a_lost_digit_on_the_line_stops_the_stage():
    bench = homed_bench()
    receive = bench.board.receive
    bench.board.receive = lambda data: receive(data.replace(b"X-30.", b"X-90."))
    with pytest.raises(StageTimeoutError, match="not on its way"):
        bench.stage.goto_gap(60.0)
    assert bench.stage.position_state == "unverified"
    assert bench.true_gap_mm > 85.0
    stood = bench.board.plant.steps
    bench.clock.sleep(1.0)
    assert bench.board.plant.steps == stood


def test_a_way_has_two_ends():
    way = Target(
        axis=0, start_mm=-20.0, machine_mm=-30.0, tolerance_mm=0.01, limit_s=1.0
    )
    assert not any(way.is_astray(place) for place in (-20.0, -25.0, -30.1))
    assert way.is_astray(-19.5)
    assert way.is_astray(-31.0)


def test_an_alarm_while_slowing_down_loses_the_position():
    bench = homed_bench({**SETTINGS, 120: 3.0})

    def stick():
        bench.board.plant.stuck = True

    bench.later(2.0, interrupt)
    bench.later(2.3, stick)
    with pytest.raises(KeyboardInterrupt):
        bench.stage.goto_gap(60.0)
    assert bench.stage.position_state == "unknown"


# --- what the reports say -------------------------------------------------------------


@pytest.mark.parametrize("reset", [True, False])
@pytest.mark.parametrize("mask", [0, 1, 2, 3])
def test_every_report_mask_gives_the_machine_position(mask, reset):
    bench = make_bench(SETTINGS | {10: mask}, reset_on_connect=reset)
    bench.board.eeprom.offsets["G54"] = [-16.0, 3.0, 1.5]
    bench.board.advance(0.2)
    bench.board.receive(b"$X\n???")  # the reports that hold the offset are over
    bench.board.advance(0.5)
    bench.stage.connect()
    assert bench.stage.status().stage_mm == pytest.approx(0.0)
    bench.stage.home()
    bench.stage.goto_gap(80.0)
    assert bench.stage.status().stage_mm == pytest.approx(-40.0)
    assert bench.true_gap_mm == pytest.approx(80.0, abs=0.005)


@pytest.mark.parametrize("steps_per_mm", [80.0, 157.48, 533.333, 3200.0])
@pytest.mark.parametrize("mask", [1, 0])
def test_gaps_that_no_step_divides_are_reached_within_half_a_step(steps_per_mm, mask):
    bench = make_bench(
        SETTINGS | {10: mask, 100: steps_per_mm},
        plant=Plant(start_mm=(-1.5,) * 3, steps_per_mm=steps_per_mm),
        steps_per_mm=steps_per_mm,
    )
    bench.board.eeprom.offsets["G54"] = [-7.0007, 0.0, 0.0]
    bench.stage.connect()
    bench.stage.home()
    for gap_mm in (99.9873, 77.7771, 60.0001):
        record = bench.stage.goto_gap(gap_mm)
        assert record.gap_mm == pytest.approx(gap_mm, abs=0.5 / steps_per_mm + 0.002)
        machine = -bench.board.position[0] / steps_per_mm
        assert 120.0 - machine == pytest.approx(gap_mm, abs=0.5 / steps_per_mm + 0.001)


def test_inches_are_refused_by_name():
    assert "$13" in (audit(HOMING | {"13": "1"}, _config()) or "")


@pytest.mark.parametrize(
    ("line", "value"),
    [
        ("$0=10 (step pulse, usec)", "10"),
        ("$100=250.000 (x, step/mm)", "250.000"),
        ("$N0=G54 G20", "G54 G20"),
        ("$130=180", "180"),
    ],
)
def test_settings_with_a_comment_are_read(line, value):
    parsed = parse_line(line)
    assert isinstance(parsed, Setting)
    assert parsed.value == value


# --- builds: homing, origin, axes -----------------------------------------------------


@pytest.mark.parametrize(
    ("mask", "origin", "travel", "switch"),
    [
        (0, {}, (-180.0, -1.0), 0.0),
        (1, {}, (-179.0, 0.0), -180.0),
        (0, {"details": ("OPT:VZ,15,128",)}, (-179.0, 0.0), 1.0),
        (1, {"details": ("OPT:VZ,15,128",)}, (0.0, 179.0), -1.0),
        (1, {"$22": "9"}, (0.0, 179.0), -1.0),  # grblHAL: homing, origin at 0
        (2, {}, (-180.0, -1.0), 0.0),  # another axis is inverted
    ],
)
def test_the_travel_ends_before_the_switch(mask, origin, travel, switch):
    settings = HOMING | {"23": str(mask), "22": origin.get("$22", "1")}
    limits = limits_of(settings, origin.get("details", ("OPT:V,15,128",)), _config())
    assert limits.travel_mm == travel
    assert limits.switch_mm == switch


def test_the_last_millimetre_before_the_switch_is_refused():
    bench = homed_bench(limits={"max_gap_mm": 200.0})
    assert bench.stage.range_mm()[1] == pytest.approx(119.0)
    with pytest.raises(InterlockError, match="travel of the controller"):
        bench.stage.goto_gap(119.5)
    bench.stage.goto_gap(119.0)
    assert bench.stage.status().state == "idle"


def test_a_map_that_misses_the_travel_is_said_on_connecting():
    bench = make_bench(gap_at_zero_mm=400.0)
    with pytest.raises(InterlockError, match="gap_at_zero_mm and direction"):
        bench.stage.connect()
    assert not bench.board.port_taken


@pytest.mark.parametrize(
    ("homing", "options", "allowed"),
    [
        ("1", "OPT:V,15,128", False),
        ("1", "OPT:VH,15,128", True),
        ("3", "OPT:VNMSL,100,1024,3,0", True),  # grblHAL: single axes by $22
        ("1", "", False),
    ],
)
def test_one_axis_is_homed_alone_where_the_build_can(homing, options, allowed):
    config = _config(home_command="$HX")
    problem = audit_build(HOMING | {"22": homing}, (options,), config)
    assert (problem is None) == allowed


def test_a_stock_build_with_one_switch_is_told_why_homing_fails():
    bench = make_bench(plant=Plant(start_mm=(-1.5, -1.5, -150.0)))
    bench.board.eeprom.values[132] = 20.0
    bench.stage.connect()
    with pytest.raises(AlarmError, match="homes Z, then X and Y"):
        bench.stage.home()


def test_more_steps_a_second_than_a_small_board_makes_are_noted():
    settings = HOMING | {"100": "3200", "110": "1000"}
    assert not any("steps/s" in note for note in notes(settings, _config()))
    fast = _config(feed_mm_min=600.0)
    assert any("32000 steps/s" in note for note in notes(settings, fast))


# --- boards that cannot be used, said in a sentence -----------------------------------


class OldBoard:
    """Answers from a table, as soon as a line or a real-time byte is there."""

    def __init__(self, answers: dict[bytes, bytes]) -> None:
        self.answers = answers
        self.now_s = 0.0
        self.plugged, self.port_taken, self.restart_on_open = True, False, False
        self._line, self._out = b"", b""

    def advance(self, duration_s: float) -> None:
        self.now_s += duration_s

    def read(self) -> bytes:
        data, self._out = self._out, b""
        return data

    def receive(self, data: bytes) -> None:
        for number in data:
            byte = bytes([number])
            if byte in self.answers:
                self._out += self.answers[byte]
            elif byte == b"\n":
                self._out += self.answers.get(self._line, b"")
                self._line = b""
            else:
                self._line += byte


GRBL_09 = {
    b"?": b"<Idle,MPos:0.000,0.000,0.000,WPos:0.000,0.000,0.000>\r\n",
    b"\x18": b"\r\nGrbl 0.9j ['$' for help]\r\n",
    b"$I": b"[0.9j.20160317:]\r\nok\r\n",
    b"$G": b"[G0 G54 G17 G21 G90 G94 M0 M5 M9 T0 F0. S0.]\r\nok\r\n",
    b"$#": b"ok\r\n",
    b"$$": b"$0=10 (step pulse, usec)\r\n$13=0 (report inches, bool)\r\n"
    b"$100=250.000 (x, step/mm)\r\nok\r\n",
}
DOOR = {
    b"?": b"<Door:1|MPos:0.000,0.000,0.000|FS:0,0|Pn:D>\r\n",
    b"\x18": b"\r\nGrbl 1.1h ['$' for help]\r\n",
}
MARLIN = {b"?": b"", b"\n": b'echo:Unknown command: "?"\r\nok\r\n'}


@pytest.mark.parametrize(
    ("answers", "sentence"),
    [
        (GRBL_09, r"Grbl 0\.9j.*status report.*cannot jog"),
        (DOOR, "in Door: its safety door input is open"),
        (MARLIN, "nobody answers as GRBL does.*stage.baud"),
        ({}, "nobody answers as GRBL does"),
    ],
    ids=["GRBL 0.9", "door open", "Marlin", "silent"],
)
def test_a_board_that_cannot_be_used_is_named(answers, sentence):
    clock, board = SteppedClock(), OldBoard(answers)
    config = _config(port=register_board("old", board, clock))
    with pytest.raises(StageError, match=sentence):
        GrblStage(config, clock).connect()
    assert not board.port_taken
    assert clock.monotonic_s() < 30.0


GRBLHAL = {
    b"?": b"<Alarm:11|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|A:|FW:grblHAL>\r\n",
    b"\x18": b"\r\nGrblHAL 1.1f ['$' or '$HELP' for help]\r\nALARM:11\r\n",
    b"$I": b"[VER:1.1f.20231210:]\r\n[OPT:VNMSL,100,1024,3,0]\r\nok\r\n",
    b"$G": b"[GC:G0 G54 G17 G21 G90 G94]\r\nok\r\n",
    b"$#": b"ok\r\n",
    b"$$": b"$1=255\r\n$13=0\r\n$20=1\r\n$21=1\r\n$22=7\r\n$23=0\r\n$27=1.000\r\n"
    b"$100=250.000\r\n$110=500.000\r\n$120=10.000\r\n$130=180.000\r\nok\r\n",
}


def test_a_grblhal_that_wants_homing_first_is_homed():
    clock, board = SteppedClock(), OldBoard(dict(GRBLHAL))
    config = _config(port=register_board("hal", board, clock), home_command="$HX")
    stage = GrblStage(config, clock)
    stage.connect()
    status = stage.status()
    assert (status.state, status.substate) == ("alarm", 11)
    assert stage.position_state == "unknown"
    board.answers |= {
        b"?": b"<Idle|MPos:-1.000,0.000,0.000|Bf:100,1023|FS:0,0>\r\n",
        b"$HX": b"ok\r\n",
    }
    board.answers[b"\x18"] = board.answers[b"\x18"].replace(b"ALARM:11\r\n", b"")
    stage.home()
    assert stage.position_state == "homed"


def test_a_locked_board_cannot_be_given_a_gap_and_says_the_way_out():
    bench = make_bench(homing="manual")
    bench.stage.connect()
    with pytest.raises(StageError, match=r"in alarm: home it, or magbend rig unlock"):
        bench.stage.assume_gap(70.0)


FLUIDNC = {
    b"?": b"<Alarm|MPos:0.000,0.000,0.000|FS:0,0>\r\n",
    b"\x18": b"[MSG:INFO: FluidNC v3.7.16 https://github.com/bdring/FluidNC]\r\n"
    b"[MSG:INFO: Axis X (0.000,180.000)]\r\n"
    b"\r\nGrbl 3.7 [FluidNC v3.7.16 (wifi) '$' for help]\r\n"
    b"[MSG:INFO: '$H'|'$X' to unlock]\r\n",
    b"$I": b"[VER:3.0 FluidNC v3.7.16 (esp32-wifi) :]\r\n[OPT:PHS]\r\nok\r\n",
    b"$G": b"[GC:G0 G54 G17 G21 G90 G94]\r\nok\r\n",
    b"$#": b"ok\r\n",
    b"$$": b"$20=1\r\n$21=1\r\n$22=1\r\n$23=1\r\n$100=250.000\r\n$110=600.000\r\n"
    b"$120=50.000\r\n$130=180.000\r\nok\r\n",
    b"$13": b"$13=0\r\nok\r\n",  # a command there, in no list of settings
}


def test_inches_that_are_in_no_list_are_asked_for():
    clock, board = SteppedClock(), OldBoard({**FLUIDNC, b"$13": b"$13=1\r\nok\r\n"})
    stage = GrblStage(_config(port=register_board("inches", board, clock)), clock)
    with pytest.raises(StageError, match=r"\$13 \(report in inches\) is 1"):
        stage.connect()


@pytest.mark.parametrize(
    ("told", "travel_mm", "homed_mm"),
    [
        ("at start", (0.0, 180.0), 0.0),
        ("when asked", (5.0, 185.0), 5.0),
        ("by the rig file", (-1.0, 179.0), -1.0),
        ("by nobody", None, None),
    ],
)
def test_a_fluidnc_counts_as_it_says_itself(told, travel_mm, homed_mm):
    answers = dict(FLUIDNC)
    if told != "at start":
        answers[b"\x18"] = answers[b"\x18"].replace(b"Axis X", b"Axis")
    asked = b"$/axes/x/homing/mpos_mm"
    answers[asked] = b"error:3\r\n"
    if told == "when asked":
        answers[asked] = b"$/axes/x/homing/mpos_mm=5.000\r\nok\r\n"
    clock, board = SteppedClock(), OldBoard(answers)
    port = register_board("fluid", board, clock)
    config = _config(port=port, homed_at_mm=-1.0 if told == "by the rig file" else None)
    stage = GrblStage(config, clock)
    stage.connect()
    assert stage.limits.travel_mm == travel_mm
    assert stage.limits.homed_mm == homed_mm
    assert not any("$1 " in note for note in stage.identity.notes)
    stage.close()
