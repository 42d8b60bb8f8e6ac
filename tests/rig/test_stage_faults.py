"""Everything that goes wrong with a stage ends in a named state, and can be mended."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from magbend.rig.errors import (
    AlarmError,
    LinkLostError,
    PositionLostError,
    StageTimeoutError,
    StoppedError,
)
from magbend.rig.interrupts import StopAtOnce
from magbend.rig.stage.grbl.protocol import STOP_INPUTS
from magbend.rig.stage.protocol import StageError
from magbend.rig.virtual.board.plant import Plant

from .stage_bench import StageBench, homed_bench, interrupt, make_bench

Fault = Callable[[StageBench], None]


def _later(action: Callable[[StageBench], object], after_s: float = 2.0) -> Fault:
    return lambda bench: bench.later(after_s, lambda: action(bench) and None)


def _unplug(bench: StageBench) -> None:
    bench.board.plugged = False


def _switch(bench: StageBench) -> None:
    bench.board.plant.stuck = True


def _host_reset(bench: StageBench) -> None:
    bench.board.receive(b"\x18")


def _stall(bench: StageBench) -> None:
    bench.board.mover.stalled = True


def _soft_limit(bench: StageBench) -> None:
    bench.board.receive(b"G90 G1 X-500 F300\n")


def _hold_button(bench: StageBench) -> None:
    bench.board.receive(b"!")


# what happens 2 s into a move of 40 mm: the error, and what the position is worth
MOVE_FAULTS: dict[str, tuple[Fault, type[BaseException], str]] = {
    "hard limit (ALARM:1)": (_later(_switch), AlarmError, "unknown"),
    "reset by another (ALARM:3)": (_later(_host_reset), AlarmError, "unknown"),
    "power cut, homing on": (
        _later(lambda b: b.board.power_cycle()), PositionLostError, "unknown"),
    "power cut, boot loader": (
        _later(lambda b: b.board.power_cycle(boot_s=1.8)), PositionLostError,
        "unknown"),
    "cable pulled": (_later(_unplug), LinkLostError, "unverified"),
    "motor stalled": (_later(_stall), StageTimeoutError, "unknown"),
    "board silent": (
        _later(lambda b: b.board.lose_output(60.0)), StageTimeoutError, "unverified"),
    "hold button pressed": (_later(_hold_button), StageTimeoutError, "unverified"),
    "stop from outside": (
        _later(lambda b: b.stage.request_stop()), StoppedError, "homed"),
    "Ctrl-C": (_later(lambda b: interrupt()), KeyboardInterrupt, "homed"),
}  # fmt: skip


@pytest.mark.parametrize("name", MOVE_FAULTS)
def test_fault_in_a_move_ends_in_its_state_and_is_mended(name):
    fault, error, position = MOVE_FAULTS[name]
    bench = homed_bench()
    fault(bench)
    with pytest.raises(error):
        bench.stage.goto_gap(60.0)
    assert bench.stage.position_state == position
    if position != "homed":
        with pytest.raises(StageError):
            bench.stage.goto_gap(70.0)
    bench.board.plugged = True
    bench.board.plant.stuck = bench.board.mover.stalled = False
    bench.clock.sleep(70.0)
    bench.stage.recover()
    if position != "homed":
        bench.stage.home()
    bench.stage.goto_gap(70.0)
    assert bench.true_gap_mm == pytest.approx(70.0, abs=0.005)


TOLERATED: dict[str, Fault] = {
    "a silence of 3 s": _later(lambda b: b.board.lose_output(3.0)),
    "garbage": _later(lambda b: b.board.send(b"\xff\xfe\x00<Idle|MP\r\nok\r\n#!\r\n")),
    "a torn report": _later(lambda b: b.board.send(b"<Run|MPos:-1.0")),
    "a report of nonsense": _later(
        lambda b: b.board.send(b"<Idle|MPos:nan,0,0|FS:0,0>\r\n")),
    "stray oks": _later(lambda b: b.board.send(b"ok\r\nok\r\n")),
    "an unknown message": _later(lambda b: b.board.send(b"[MSG:Hello]\r\n>G20:ok\r\n")),
}  # fmt: skip


@pytest.mark.parametrize("name", TOLERATED)
def test_disturbance_of_the_line_does_not_stop_the_move(name):
    bench = homed_bench()
    TOLERATED[name](bench)
    bench.stage.goto_gap(60.0)
    assert bench.stage.position_state == "homed"
    assert bench.true_gap_mm == pytest.approx(60.0, abs=0.005)


def test_a_board_that_answers_late_is_waited_for():
    bench = homed_bench()
    bench.board.latency_s = 0.8
    bench.stage.goto_gap(60.0)
    assert bench.true_gap_mm == pytest.approx(60.0, abs=0.005)


def test_a_swallowed_line_is_a_timeout_not_an_arrival():
    bench = homed_bench()
    receive = bench.board.receive
    lost = []

    def lose_the_first_jog(data):
        if data.startswith(b"$J") and not lost:
            lost.append(data)
        else:
            receive(data)

    bench.board.receive = lose_the_first_jog
    with pytest.raises(StageTimeoutError, match="did not answer"):
        bench.stage.goto_gap(60.0)
    assert bench.stage.position_state == "unverified"


def test_a_switch_that_closes_under_way_stops_a_board_without_hard_limits():
    """8 mm of steps lost near the magnet: the far switch comes 8 mm too early."""
    bench = homed_bench({1: 255, 20: 1, 21: 0, 22: 1, 130: 180})
    bench.board.plant.lose(8.0)
    bench.stage.goto_gap(60.0)
    with pytest.raises(StageTimeoutError, match=r"switch of X closed .* lost steps"):
        bench.stage.goto_gap(117.0)
    assert bench.stage.position_state == "unverified"
    # two reports at 5 mm/s, then the way that 10 mm/s2 takes to stop
    assert 120.0 < bench.true_gap_mm < 120.5 + 2 * 0.5 + 1.25
    with pytest.raises(PositionLostError):
        bench.stage.goto_gap(50.0)


@pytest.mark.parametrize("letter", STOP_INPUTS)
def test_an_input_that_asks_for_a_stop_stops_a_board_that_drives_on(letter):
    """grblHAL (core of August 2026) reports a feed hold while it jogs, and jogs on."""
    bench = homed_bench()
    bench.later(2.0, lambda: setattr(bench.board.plant, "pressed", letter))
    began_mm = bench.true_gap_mm
    with pytest.raises(StoppedError, match=rf"{STOP_INPUTS[letter]} .*Pn:{letter}"):
        bench.stage.goto_gap(60.0)
    # 2 s and two reports at 5 mm/s, then the way that 10 mm/s2 takes to stop
    assert began_mm - bench.true_gap_mm < 5.0 * 2.4 + 1.25
    assert bench.stage.position_state == "homed"
    stood = bench.board.plant.steps
    bench.clock.sleep(1.0)
    assert bench.board.plant.steps == stood
    bench.stage.goto_gap(60.0)  # held closed from the start: wired the other way, or so
    assert bench.true_gap_mm == pytest.approx(60.0, abs=0.005)


def test_one_report_of_a_closed_input_is_noise():
    bench = homed_bench()
    bench.later(2.0, lambda: setattr(bench.board.plant, "pressed", "H"))
    bench.later(2.05, lambda: setattr(bench.board.plant, "pressed", ""))
    bench.stage.goto_gap(60.0)
    assert bench.true_gap_mm == pytest.approx(60.0, abs=0.005)


def test_homing_that_finds_no_switch_is_alarm_9():
    bench = make_bench(
        {1: 255, 20: 1, 21: 1, 22: 1, 130: 5, 131: 5, 132: 5}, plant=Plant()
    )
    bench.stage.connect()
    with pytest.raises(AlarmError, match="no limit switch") as caught:
        bench.stage.home()
    assert caught.value.code == 9
    assert bench.stage.position_state == "unknown"
    assert bench.stage.status().state == "alarm"


def test_homing_with_a_stuck_switch_is_alarm_8():
    bench = make_bench()
    bench.board.plant.stuck = True
    bench.stage.connect()
    with pytest.raises(AlarmError, match="stayed closed") as caught:
        bench.stage.home()
    assert caught.value.code == 8
    bench.board.plant.stuck = False
    bench.stage.home()
    assert bench.stage.position_state == "homed"


def test_ctrl_c_in_homing_resets_and_the_position_is_unknown():
    bench = make_bench()
    bench.stage.connect()
    bench.later(3.0, interrupt)
    with pytest.raises(KeyboardInterrupt):
        bench.stage.home()
    assert bench.stage.position_state == "unknown"
    assert bench.stage.status().state == "alarm"
    assert not bench.board.mover.running


def test_second_ctrl_c_stops_at_once_without_waiting():
    bench = homed_bench()
    bench.later(2.0, interrupt)
    bench.later(2.2, interrupt)
    with pytest.raises(KeyboardInterrupt):
        bench.stage.goto_gap(60.0)
    bench.clock.sleep(0.1)
    bench.board.advance(0.1)
    assert not bench.board.mover.running
    assert bench.stage.position_state == "unverified"


def test_soft_limit_alarm_of_another_sender_keeps_the_position():
    bench = homed_bench()
    _soft_limit(bench)
    bench.clock.sleep(1.0)
    with pytest.raises(AlarmError) as caught:
        bench.stage.goto_gap(60.0)
    assert caught.value.code == 2
    bench.stage.unlock(confirm=True)
    assert bench.stage.position_state == "homed"
    bench.stage.goto_gap(60.0)
    assert bench.true_gap_mm == pytest.approx(60.0, abs=0.005)


def test_a_stop_asked_for_while_standing_is_met_before_the_next_motion():
    bench = homed_bench()
    stood = bench.board.plant.steps
    bench.stage.request_stop()
    with pytest.raises(StoppedError):
        bench.stage.goto_gap(60.0)
    assert bench.board.plant.steps == stood
    assert not bench.stage.stop_requested()
    bench.stage.goto_gap(60.0)
    assert bench.true_gap_mm == pytest.approx(60.0, abs=0.005)


@pytest.mark.parametrize("after_s", [0.0, 0.05, 0.3, 1.0, 2.0, 3.5, 5.0])
def test_ctrl_c_at_any_time_of_a_move_stands_within_3_s_and_keeps_the_position(after_s):
    bench = homed_bench()
    bench.later(after_s, interrupt)
    start_s = bench.clock.monotonic_s() + after_s
    with pytest.raises(KeyboardInterrupt):
        bench.stage.goto_gap(60.0)
    assert bench.clock.monotonic_s() - start_s < 3.0
    assert not bench.board.mover.running
    assert bench.stage.position_state == "homed"
    bench.stage.goto_gap(80.0)
    assert bench.true_gap_mm == pytest.approx(80.0, abs=0.005)


def test_power_cut_while_standing_is_seen_before_the_next_move():
    bench = homed_bench()
    bench.board.power_cycle()
    bench.clock.sleep(0.2)
    with pytest.raises(PositionLostError, match="home"):
        bench.stage.goto_gap(60.0)
    assert bench.stage.position_state == "unknown"


def test_power_cut_with_a_lost_banner_is_seen_by_the_jump_of_the_count():
    bench = homed_bench()
    bench.board.lose_output(0.5)
    bench.board.power_cycle()
    bench.board.eeprom.values[22] = 0  # no lock: it says Idle at 0
    bench.board.state = "Idle"
    bench.clock.sleep(1.0)
    with pytest.raises(PositionLostError):
        bench.stage.goto_gap(60.0)
    assert bench.stage.position_state == "unknown"


def test_link_lost_while_standing_then_replugged_is_unverified():
    bench = homed_bench()
    _unplug(bench)
    with pytest.raises(LinkLostError):
        bench.stage.goto_gap(60.0)
    with pytest.raises(StageError):
        bench.stage.recover()
    bench.board.plugged = True
    bench.stage.recover()
    assert bench.stage.position_state == "unverified"


def test_every_cell_of_the_matrix_is_counted(capsys):
    with capsys.disabled():
        print(
            f"\nstage faults: {len(MOVE_FAULTS)} that end a move, "
            f"{len(TOLERATED) + 1} that do not"
        )
    assert len(MOVE_FAULTS) >= 10


def test_a_second_ctrl_c_resets_and_does_not_slow_down():
    bench = homed_bench()
    heard = bytearray()
    receive = bench.board.receive

    def listen(data: bytes) -> None:
        heard.extend(data)
        receive(data)

    def strike() -> None:
        bench.board.receive = listen
        raise StopAtOnce

    bench.later(2.0, strike)
    with pytest.raises(StopAtOnce):
        bench.stage.goto_gap(60.0)
    assert b"!" not in heard
    assert heard.startswith(b"\x18")
    assert bench.stage.position_state != "homed"


UNASKED: dict[str, tuple[Callable[[StageBench], object], type[BaseException]]] = {
    "a switch closes": (_switch, AlarmError),
    "the board restarts": (lambda b: b.board.power_cycle(), PositionLostError),
    "the cable is pulled": (_unplug, LinkLostError),
}


@pytest.mark.parametrize("name", UNASKED)
def test_what_happens_while_the_stage_stands_is_heard_unasked(name):
    action, error = UNASKED[name]
    bench = homed_bench()
    bench.stage.listen()
    action(bench)

    def listen_for_half_a_second() -> None:
        for _ in range(5):
            bench.clock.sleep(0.1)
            bench.stage.listen()

    with pytest.raises(error):
        listen_for_half_a_second()


def test_after_an_unanswered_line_the_board_is_reset_before_it_moves():
    # An answer that comes late would count for the next line, and each after it.
    bench = homed_bench()
    receive, sent = bench.board.receive, []

    def lose_the_unlocking(data):
        sent.append(bytes(data))
        if not data.startswith(b"$X"):
            receive(data)

    bench.board.receive = lose_the_unlocking
    with pytest.raises(StageTimeoutError):
        bench.raw.unlock()
    del sent[:]
    bench.stage.goto_gap(60.0)
    words = b"".join(sent)
    assert words.index(b"\x18") < words.index(b"$J")
    assert bench.true_gap_mm == pytest.approx(60.0, abs=0.005)


def test_a_door_that_opens_on_the_way_is_named_and_the_stage_stands() -> None:
    bench = homed_bench()
    read = bench.board.read

    def open_the_door() -> None:
        bench.board.receive(b"!")
        bench.board.read = lambda: (
            read().replace(b"<Idle", b"<Door:1").replace(b"<Hold:0", b"<Door:1")
        )

    bench.later(1.0, open_the_door)
    with pytest.raises(StoppedError, match="safety door input") as failure:
        bench.stage.goto_gap(60.0)
    assert "it stood already" in str(failure.value)
    assert "cut the power" not in str(failure.value)
    for motion in (bench.stage.home, lambda: bench.stage.nudge(0.5)):
        with pytest.raises(StageError, match="its safety door input is open"):
            motion()
    del bench.board.read  # closed again
    bench.stage.home()
    assert bench.stage.goto_gap(60.0).gap_mm == pytest.approx(60.0, abs=0.005)
