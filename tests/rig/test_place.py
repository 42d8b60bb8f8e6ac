"""A remembered place is worth what its map, its board and its sign of life are."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from magbend.core.errors import StageError, StoreError
from magbend.rig.errors import InterlockError, PositionLostError
from magbend.rig.runs.read import read_run
from magbend.rig.runs.runner import run
from magbend.rig.runs.verify import verify_run
from magbend.rig.stage.config import LimitsConfig, MeasuredConfig, StageConfig
from magbend.rig.stage.gap import GapStage
from magbend.rig.stage.make import make_stage
from magbend.rig.virtual.board.dialect import GRBL
from magbend.rig.virtual.board.firmware import GrblBoard
from magbend.rig.virtual.board.plant import Plant
from magbend.rig.virtual.protocol_twin import register_board

from .stage_bench import InterruptingClock

BY_HAND = {1: 255, 20: 0, 22: 0, 130: 180}


@pytest.fixture(autouse=True)
def control_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MAGBEND_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr("magbend.rig.stage.presence.control_folder", lambda: tmp_path)


class Bench:
    """A board that stays powered while programs come and go."""

    def __init__(self, settings=BY_HAND, dialect=GRBL, **config) -> None:
        self.clock = InterruptingClock()
        plant = Plant(start_mm=(-1.5,) * 3)
        self.board = GrblBoard(plant, {**BY_HAND, **settings}, dialect)
        self.config = {
            "port": register_board("place", self.board, self.clock),
            "gap_at_zero_mm": 120.5,
            "homing": "manual",
            **config,
        }

    def command(self, **changes) -> GapStage:
        """What the next command finds: a connected stage."""
        table = StageConfig(**{**self.config, **changes})
        limits = LimitsConfig(min_gap_mm=45.0, max_gap_mm=118.0, contact_gap_mm=35.0)
        stage = GapStage(make_stage(table, self.clock), table, limits, self.clock)
        stage.connect()
        return stage


def test_a_word_for_one_run_is_not_trusted_by_the_next_command():
    bench = Bench()
    stage = bench.command()
    stage.assume_gap(100.0, for_run=True)
    stage.goto_gap(70.0)
    stage.close()
    after = bench.command()
    with pytest.raises(PositionLostError, match="rig set-gap"):
        after.goto_gap(50.0)
    assert bench.board.position[0] / 250.0 == pytest.approx(-30.0)


def test_a_gap_that_was_set_is_trusted_while_the_board_lives():
    bench = Bench()
    stage = bench.command()
    zero_mm = stage.assume_gap(110.0)
    stage.close()
    again = bench.command(gap_at_zero_mm=zero_mm)
    assert again.position_state == "homed"
    again.goto_gap(100.0)
    again.close()
    assert bench.command(gap_at_zero_mm=zero_mm).position_state == "homed"


def test_a_board_that_was_restarted_meanwhile_is_asked_about():
    bench = Bench()
    stage = bench.command()
    zero_mm = stage.assume_gap(110.0)  # at a count of 0: what a restart counts too
    stage.close()
    bench.board.power_cycle()
    bench.board.advance(1.0)
    after = bench.command(gap_at_zero_mm=zero_mm)
    assert after.position_state == "unknown"
    with pytest.raises(PositionLostError, match=r"restarted since .* set-gap"):
        after.goto_gap(60.0)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"gap_at_zero_mm": 121.5}, "gap_at_zero_mm was 110 and is now 121.5"),
        ({"direction": -1}, "direction was 1 and is now -1"),
    ],
)
def test_another_map_makes_a_remembered_place_unverified(change, named):
    bench = Bench()
    stage = bench.command()
    zero_mm = stage.assume_gap(110.0)
    stage.close()
    after = bench.command(**{"gap_at_zero_mm": zero_mm, **change})
    assert after.position_state == "unverified"
    with pytest.raises(PositionLostError, match=named):
        after.goto_gap(60.0)


def test_settings_that_changed_since_the_gap_was_measured_stop_every_motion():
    bench = Bench()
    stage = bench.command()
    zero_mm = stage.assume_gap(110.0)
    measured = MeasuredConfig(
        gap_mm=110.0, machine_mm=0.0,
        firmware=stage.place_map.firmware, settings=dict(stage.place_map.settings),
    )  # fmt: skip
    stage.close()
    table = {"gap_at_zero_mm": zero_mm, "measured": measured}
    assert bench.command(**table).position_state == "homed"
    bench.board.port_taken = False
    bench.board.eeprom.values[100] = 200.0
    after = bench.command(**table)
    after.assume_gap(110.0, for_run=True)  # a word for the gap, not for the board
    bench.board.port_taken = False
    again = bench.command(**table)
    assert again.position_state != "homed"
    with pytest.raises(PositionLostError, match=r"\$100 was 250.000 and is now 200"):
        again._stage.move_to(-10.0, feed_mm_min=300.0)


def test_a_board_that_counts_from_elsewhere_was_not_homed():
    homing = {20: 0, 22: 1, 23: 1, 130: 180}
    plays = replace(GRBL, homed_mm={0: 1.0}, counts_up=True)
    bench = Bench(homing, plays, homing="switches", gap_at_zero_mm=-60.0, direction=-1)
    stage = bench.command()
    bench.board.plant._carriage_mm[0] = -180.0
    bench.board.plant._start_mm = (-180.0, -1.5, -1.5)
    with pytest.raises(PositionLostError, match=r"counts 1.000 mm .* -179.000 mm was"):
        stage.home()
    with pytest.raises(PositionLostError):
        stage.goto_gap(100.0)
    bench.board.port_taken = False
    told = bench.command(homed_at_mm=1.0, gap_at_zero_mm=119.0)
    told.home()
    assert told.status().stage_mm == pytest.approx(1.0)


def test_a_bench_that_was_never_measured_is_homed_and_jogged_and_no_more():
    bench = Bench({22: 1}, homing="switches", gap_at_zero_mm=None)
    stage = bench.command()
    stage.home()
    assert stage.status().gap_mm is None
    sent: list[bytes] = []
    receive = bench.board.receive
    bench.board.receive = sent.append
    with pytest.raises(PositionLostError, match=r"never measured.*set-gap GAP"):
        stage.goto_gap(100.0)
    assert sent == []
    bench.board.receive = receive
    here = stage.status().stage_mm
    stage.nudge(-1.0)
    assert stage.status().stage_mm == pytest.approx(here - 1.0)
    with pytest.raises(InterlockError, match="at most 1 mm"):
        stage.nudge(-1.5)
    stage.assume_gap(100.0)
    stage.goto_gap(90.0)


def test_a_stage_by_hand_is_jogged_to_a_known_gap_from_an_unknown_place():
    stage = Bench().command()
    for _ in range(3):
        stage.nudge(-0.5)
    stage.assume_gap(110.0)
    assert stage.goto_gap(100.0).gap_mm == pytest.approx(100.0, abs=0.005)


@pytest.mark.parametrize(
    "banner",
    [
        "Grbl 1.1i Mill7 4 Axis Router ['$' for help]",
        "grblHAL ['$' for help]",
        "Bench stage ready",
    ],
)
def test_a_start_up_line_may_say_what_it_likes(banner):
    bench = Bench(dialect=replace(GRBL, banner=banner))
    stage = bench.command()
    assert stage.identity.firmware == banner
    stage.assume_gap(110.0)
    bench.clock.at(
        bench.clock.monotonic_s() + 1.0, lambda: bench.board.power_cycle(boot_s=0.5)
    )
    with pytest.raises(StageError):
        stage.goto_gap(60.0)
    assert stage.position_state != "homed"


# --- runs ---------------------------------------------------------------------------


def _stop_after_one(bench) -> None:
    moves: list[str] = []

    def before(call: str) -> None:
        moves.append(call)
        if len([c for c in moves if c.startswith("move")]) > 2:
            bench.devices.stage.request_stop()

    bench.raw.before = before


def _begun(make_bench, tmp_path, *, assumed: float | None):
    bench = make_bench()
    if assumed is not None:
        bench.devices.stage.assume_gap(assumed, for_run=True)
    _stop_after_one(bench)
    summary = run(bench.plan, bench.devices, tmp_path / "run")
    assert summary.status == "abort"
    return bench


def test_a_resume_must_repeat_the_word_for_the_gap(make_bench, tmp_path):
    _begun(make_bench, tmp_path, assumed=100.0)
    fresh = make_bench()
    with pytest.raises(StoreError, match="begun with --assume-gap-mm 100"):
        run(fresh.plan, fresh.devices, tmp_path / "run", resume=True)
    assert not [c for c in fresh.raw.calls if c.startswith(("move", "home"))]


def test_a_resume_by_another_map_or_board_moves_nothing(make_bench, tmp_path):
    _begun(make_bench, tmp_path, assumed=None)
    fresh = make_bench()
    fresh.raw.identity = replace(fresh.raw.identity, settings={"$100": "200.000"})
    with pytest.raises(StoreError, match=r"\$100 was 250.000 and is now 200.000"):
        run(fresh.plan, fresh.devices, tmp_path / "run", resume=True)
    fresh = make_bench()
    fresh.raw.zero_mm = 170.5
    with pytest.raises(StoreError, match=r"gap_at_zero_mm was 150 and is now 170\.5"):
        run(fresh.plan, fresh.devices, tmp_path / "run", resume=True)
    assert not [c for c in fresh.raw.calls if c.startswith(("move", "home"))]


def test_verify_knows_a_gap_that_is_not_the_maps(make_bench, tmp_path):
    bench = make_bench()
    run(bench.plan, bench.devices, tmp_path / "run")
    assert verify_run(tmp_path / "run") == []
    manifest = read_run(tmp_path / "run").manifest
    manifest["map"]["gap_at_zero_mm"] = 170.5
    (tmp_path / "run" / "run.json").write_text(json.dumps(manifest))
    problems = "\n".join(verify_run(tmp_path / "run"))
    assert "step 1: its map (gap_at_zero_mm = 150)" in problems


def test_verify_finds_the_mixed_maps_of_older_runs(make_bench, tmp_path):
    bench = make_bench()
    run(bench.plan, bench.devices, tmp_path / "run")
    path = tmp_path / "run" / "steps.jsonl"
    steps = [json.loads(row) for row in path.read_text().splitlines()]
    for step in steps:
        del step["gap_at_zero_mm"], step["direction"]
    steps[1]["stage_mm"] += 20.5
    path.write_text("".join(json.dumps(step) + "\n" for step in steps))
    problems = "\n".join(verify_run(tmp_path / "run"))
    assert "step 2: stage_mm = -69.5 is a gap of 80.5 mm by the map, not 60 mm" in (
        problems
    )


def test_a_homed_stage_is_not_nudged_into_its_switch():
    bench = Bench({20: 1, 21: 1, 22: 1}, homing="switches", gap_at_zero_mm=None)
    stage = bench.command()
    stage.home()
    with pytest.raises(InterlockError, match=r"-180 to -1 mm.*nothing was sent"):
        stage.nudge(1.0)
    stage.nudge(-1.0)
    assert stage.status().state == "idle"
