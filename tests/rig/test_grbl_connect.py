"""Connecting: whatever state the board is in, and every setting that does not fit."""

from __future__ import annotations

import pytest

from magbend.core.errors import StageError
from magbend.rig.stage.grbl.audit import homing_time_s
from magbend.rig.virtual.board.plant import Plant

from .stage_bench import SETTINGS, homed_bench, make_bench


@pytest.mark.parametrize(
    ("settings", "config", "named"),
    [
        ({100: 0}, {}, r"\$100 \(steps/mm of X\) is 0, the rig file says 250"),
        ({100: 0}, {"steps_per_mm": None}, r"\$100 .* must be above zero"),
        ({130: 200}, {"travel_mm": 180.0}, r"\$130 .* is 200, the rig file says 180"),
        ({120: 50}, {"acceleration_mm_s2": 10.0}, r"\$120"),
        ({110: 200}, {}, r"\$110 .* below stage.feed_mm_min"),
        ({22: 0, 20: 0}, {}, r"\$22 \(homing\) is off.*type \$22=1"),
        ({13: 1}, {}, r"\$13"),
        ({23: 1}, {"settings": {"$23": 0.0}}, r"\$23 \(listed in the rig file\)"),
        ({}, {"settings": {"$40": 1.0}}, r"does not report \$40"),
    ],
)
def test_a_setting_that_does_not_fit_is_refused_by_name(settings, config, named):
    bench = make_bench(SETTINGS | settings, **config)
    with pytest.raises(StageError, match=named):
        bench.stage.connect()
    assert not bench.board.port_taken


def test_identity_holds_all_settings_for_the_record():
    bench = make_bench()
    bench.stage.connect()
    identity = bench.stage.identity
    assert identity.settings["100"] == "250.000"
    assert len(identity.settings) == 34
    assert "VER:1.1h.20190830:" in identity.details
    assert identity.firmware.startswith("Grbl 1.1h")


def test_motors_that_switch_off_are_noted():
    bench = make_bench(SETTINGS | {1: 25})
    bench.stage.connect()
    assert any("$1" in note for note in bench.stage.identity.notes)


@pytest.mark.parametrize(
    ("before", "state"),
    [
        (b"", "alarm"),
        (b"$X\n", "idle"),
        (b"$X\nG91 G1 X-5 F300\n", "idle"),
        (b"$X\n!", "idle"),
        (b"$X\n$C\n", "idle"),
        (b"$X\n$SLP\n", "alarm"),
        (b"$X\nG90 G1 X-500 F300\n", "alarm"),
        (b"$HX\n", "alarm"),
        (b"G91 G1 X-1", "alarm"),
    ],
)
def test_connecting_works_from_every_state_and_moves_nothing_more(before, state):
    bench = make_bench()
    bench.board.advance(0.2)
    for line in before.splitlines(keepends=True):
        bench.board.receive(line)
        bench.board.advance(0.3)
    bench.stage.connect()
    assert bench.stage.status().state == state
    assert bench.stage.position_state == "unknown"
    stood = bench.board.plant.steps
    bench.clock.sleep(2.0)
    bench.stage.status()
    assert bench.board.plant.steps == stood


def test_a_board_that_boots_is_waited_for():
    bench = make_bench()
    bench.board.restart_on_open = True
    bench.stage.connect()
    bench.stage.home()
    assert bench.stage.position_state == "homed"


def test_a_port_in_use_is_said():
    bench = make_bench()
    bench.stage.connect()
    bench.board.read()
    from magbend.rig.stage.grbl.stage import GrblStage

    other = GrblStage(bench.raw._config, bench.clock)
    with pytest.raises(StageError, match="in use"):
        other.connect()
    assert bench.stage.status().state == "alarm"


def test_a_port_that_is_not_there_is_said():
    bench = make_bench(port="/dev/ttyNOSUCH")
    with pytest.raises(StageError, match=r"/dev/ttyNOSUCH cannot be opened"):
        bench.stage.connect()


def test_silence_is_not_grbl():
    bench = make_bench()
    bench.board.lose_output(1e6)
    with pytest.raises(StageError, match="nobody answers"):
        bench.stage.connect()


def test_a_homed_stage_that_was_left_standing_is_still_homed():
    bench = homed_bench()
    bench.stage.close()
    bench.clock.sleep(100.0)
    bench.stage.connect()
    assert bench.stage.position_state == "homed"
    assert bench.stage.status().gap_mm == pytest.approx(100.0)


@pytest.mark.parametrize("what", ["power", "moved", "not closed", "reset on open"])
def test_a_stage_that_was_disturbed_is_not_homed_any_more(what):
    bench = homed_bench()
    if what == "not closed":  # the program was killed
        bench.raw._link.close()
        bench.raw._session = None
    bench.stage.close()
    if what == "power":
        bench.board.power_cycle()
    elif what == "moved":
        bench.board.receive(b"G91 G1 X-1 F300\n")
        bench.board.advance(5.0)
    elif what == "reset on open":
        bench.board.restart_on_open = True
    bench.stage.connect()
    assert bench.stage.position_state == "unknown"


def test_single_axis_homing_is_only_sent_to_a_build_that_has_it():
    bench = make_bench(home_command="$HX")
    with pytest.raises(StageError, match=r"\[OPT:.*no single-axis homing"):
        bench.stage.connect()


def test_the_homing_time_covers_a_search_over_the_whole_travel():
    bench = make_bench(plant=Plant(start_mm=(-170.0, -170.0, -170.0)))
    bench.stage.connect()
    start_s = bench.clock.monotonic_s()
    bench.stage.home()
    took_s = bench.clock.monotonic_s() - start_s
    assert took_s < homing_time_s(bench.stage.identity.settings)
