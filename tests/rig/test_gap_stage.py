"""The gap frame: interlock, one-sided approach, stopping distance, abort."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from magbend.core.errors import InputError
from magbend.rig.errors import InterlockError, PositionLostError
from magbend.rig.stage.config import LimitsConfig
from magbend.rig.virtual.board.plant import Plant
from magbend.rig.wire_log import WireLog

from .stage_bench import SETTINGS, homed_bench, make_bench


@pytest.mark.parametrize("gap_mm", [44.0, 44.999, 0.0, -5.0, 118.1, 500.0])
def test_a_forbidden_gap_is_refused_before_a_byte_is_sent(gap_mm):
    bench = homed_bench()
    sent = []
    bench.board.receive = sent.append
    with pytest.raises(InterlockError, match="nothing was sent"):
        bench.stage.goto_gap(gap_mm)
    assert sent == []


@pytest.mark.parametrize("gap_mm", [float("nan"), float("inf")])
def test_what_is_no_number_is_refused(gap_mm):
    with pytest.raises(InputError):
        homed_bench().stage.goto_gap(gap_mm)


def test_the_limit_itself_is_allowed():
    bench = homed_bench()
    bench.stage.goto_gap(45.0)
    assert bench.true_gap_mm == pytest.approx(45.0, abs=0.005)


def test_motion_before_homing_is_refused():
    bench = make_bench()
    bench.stage.connect()
    with pytest.raises(PositionLostError, match="home it first"):
        bench.stage.goto_gap(60.0)


def test_every_gap_is_approached_from_the_far_side():
    bench = homed_bench(plant=Plant(start_mm=(-1.5,) * 3, backlash_mm=0.3))
    bench.stage.goto_gap(80.0)
    near = bench.board.plant.carriage_mm[0]
    for before in (60.0, 100.0, 79.9, 80.2):
        bench.stage.goto_gap(before)
        record = bench.stage.goto_gap(80.0)
        assert record.approach == "far side"
        assert bench.board.plant.carriage_mm[0] == pytest.approx(near, abs=1e-9)


def test_an_overshoot_is_clipped_at_the_far_limit_and_said():
    bench = homed_bench()
    assert bench.stage.goto_gap(118.0).approach == "clipped"
    assert bench.stage.goto_gap(117.8).approach == "clipped"
    assert bench.stage.goto_gap(117.0).approach == "far side"


def test_a_gap_that_is_reached_already_is_not_moved_to_again():
    bench = homed_bench()
    bench.stage.goto_gap(80.0)
    assert bench.stage.goto_gap(80.0).duration_s < 0.2


def test_no_more_than_one_short_piece_is_ever_queued(tmp_path):
    bench = homed_bench(piece_mm=7.0)
    jogs = []
    receive = bench.board.receive

    def note(data):
        if data.startswith(b"$J"):
            assert not bench.board.mover.blocks
            place = float(data.split(b"X")[1].split(b"F")[0])
            jogs.append(abs(place - bench.board.position[0] / 250.0))
        receive(data)

    bench.board.receive = note
    bench.stage.goto_gap(60.0)
    assert len(jogs) == 6
    assert max(jogs) <= 7.0


def test_speed_without_room_to_stop_is_refused():
    bench = make_bench(limits={"contact_gap_mm": 44.0, "min_gap_mm": 45.0})
    with pytest.raises(InterlockError, match=r"needs 1\.25 mm to stop"):
        bench.stage.connect()


def test_speed_beyond_the_board_is_refused():
    with pytest.raises(InterlockError, match="at most the controller's 500"):
        homed_bench().stage.goto_gap(60.0, feed_mm_min=501.0)


def test_abort_holds_or_retracts():
    bench = homed_bench(limits={"retract_gap_mm": 110.0})
    bench.stage.goto_gap(60.0)
    bench.stage.abort("hold")
    assert bench.stage.status().gap_mm == pytest.approx(60.0)
    bench.stage.abort("retract")
    assert bench.true_gap_mm == pytest.approx(110.0, abs=0.005)
    assert bench.stage.position_state == "homed"


def test_unlocking_needs_the_operators_word():
    bench = make_bench()
    bench.stage.connect()
    with pytest.raises(InterlockError, match="confirm"):
        bench.stage.unlock(confirm=False)
    assert bench.stage.status().state == "alarm"
    bench.stage.unlock(confirm=True)
    assert bench.stage.status().state == "idle"
    assert bench.stage.position_state == "unknown"


def test_a_mirrored_map_moves_the_other_way():
    bench = homed_bench(
        SETTINGS | {23: 1},
        gap_at_zero_mm=-60.0,
        direction=-1,
        plant=Plant(start_mm=(-180.0, -1.5, -1.5), switch_low_mm=-182.0),
    )
    bench.stage.goto_gap(60.0)
    assert bench.stage.status().stage_mm == pytest.approx(-120.0)
    away = bench.board.plant.carriage_mm[0]
    bench.stage.goto_gap(50.0)
    assert bench.stage.status().stage_mm == pytest.approx(-110.0)
    assert bench.board.plant.carriage_mm[0] == pytest.approx(away + 10.0)


def test_homing_toward_the_magnet_is_refused_before_a_byte_is_sent():
    bench = make_bench(gap_at_zero_mm=20.0, direction=-1)
    bench.stage.connect()
    sent = []
    bench.board.receive = sent.append
    with pytest.raises(InterlockError, match="homing would drive"):
        bench.stage.home()
    assert sent == []


def test_manual_homing_takes_the_operators_gap():
    bench = make_bench({1: 255, 22: 0}, homing="manual", gap_at_zero_mm=0.0)
    bench.stage.connect()
    with pytest.raises(PositionLostError):
        bench.stage.goto_gap(60.0)
    assert bench.stage.assume_gap(70.0) == pytest.approx(70.0)
    bench.stage.goto_gap(60.0)
    assert bench.stage.status().stage_mm == pytest.approx(-10.0)


def test_the_operators_gap_does_not_replace_switches():
    bench = make_bench()
    bench.stage.connect()
    bench.stage.unlock(confirm=True)
    with pytest.raises(PositionLostError, match="switches"):
        bench.stage.assume_gap(70.0)


def test_the_wire_log_rebuilds_the_motion(tmp_path):
    path = tmp_path / "wire.log"
    bench = make_bench()
    log = WireLog(path, bench.clock)
    bench.raw._log = log
    bench.stage.connect()
    bench.stage.home()
    bench.stage.goto_gap(100.0)
    bench.stage.close()
    log.close()
    rows = [row.split(" ", 4) for row in path.read_text().splitlines()]
    assert {row[2] for row in rows} == {"stage"}
    times = [float(row[0]) for row in rows]
    assert times == sorted(times)
    heard = b"".join(eval(row[4]) for row in rows if row[3] == "<<")
    assert b"<Idle|MPos:-20.000,-1.000,-1.000" in heard
    sent = b"".join(eval(row[4]) for row in rows if row[3] == ">>")
    assert b"$H\n" in sent
    assert b"X-20.000F300.0\n" in sent
    assert b"$X" not in sent
    assert b"~" not in sent


@pytest.fixture(scope="module")
def long_lived():
    return homed_bench()


@settings(max_examples=12, deadline=None)
@given(gaps_mm=st.lists(st.floats(45.0, 118.0), min_size=1, max_size=3))
def test_wherever_it_is_sent_it_ends_there_and_never_nearer(long_lived, gaps_mm):
    bench = long_lived
    bench.stage.goto_gap(110.0)
    places = [bench.true_gap_mm]
    step = bench.board.plant.step

    def watch(axis, count):
        step(axis, count)
        places.append(bench.true_gap_mm)

    bench.board.plant.step = watch
    for gap_mm in gaps_mm:
        bench.stage.goto_gap(gap_mm)
        assert bench.true_gap_mm == pytest.approx(gap_mm, abs=0.005)
    bench.board.plant.step = step
    assert min(places) >= min([110.0, *gaps_mm]) - 0.005


@pytest.mark.parametrize(
    "limits",
    [
        {"min_gap_mm": 50.0, "max_gap_mm": 40.0},
        {"min_gap_mm": -1.0, "max_gap_mm": 40.0},
        {"min_gap_mm": 50.0, "max_gap_mm": 60.0, "contact_gap_mm": 55.0},
        {"min_gap_mm": 50.0, "max_gap_mm": 60.0, "retract_gap_mm": 70.0},
        {"max_gap_mm": 60.0},
    ],
)
def test_limits_that_cannot_be_are_refused(limits):
    with pytest.raises(ValidationError):
        LimitsConfig(**limits)
