"""A stage of another package: found by its name, its keys checked, its stop proved."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import pytest

from magbend.core.errors import ConfigError, StageError
from magbend.rig.errors import InterlockError, PositionLostError, StoppedError
from magbend.rig.stage.config import LimitsConfig, StageConfig
from magbend.rig.stage.gap import GapStage
from magbend.rig.stage.make import make_stage
from magbend.rig.virtual.protocol_twin import register_board

from .stage_bench import InterruptingClock, interrupt
from .zaber_controller import ZaberController

_NAMES = itertools.count()
OPTIONS = {"axis": 2, "microstep_um": 0.49609375}


@pytest.fixture(autouse=True)
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The example is an installed package that declares a stage."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "examples")
    monkeypatch.syspath_prepend(tmp_path)
    info = tmp_path / "zaber_stage-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: zaber-stage\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[magbend.stages]\nzaber = zaber_stage:ZaberStage\nbare = zaber_stage:AXES\n"
    )
    yield
    sys.modules.pop("zaber_stage", None)


def config(**changes) -> StageConfig:
    table = {
        "driver": "zaber", "port": "twin://none", "gap_at_zero_mm": 120.0,
        "direction": -1, "options": OPTIONS,
    }  # fmt: skip
    return StageConfig(**(table | changes))


class Bench:
    """The stage on a controller with a clock that only steps."""

    def __init__(self) -> None:
        self.clock = InterruptingClock()
        self.controller = ZaberController()
        url = register_board(f"zaber-{next(_NAMES)}", self.controller, self.clock)
        table = config(port=url)
        limits = LimitsConfig(min_gap_mm=45.0, max_gap_mm=118.0)
        self.raw = make_stage(table, self.clock)
        self.stage = GapStage(self.raw, table, limits, self.clock)
        self.stage.connect()

    @property
    def true_gap_mm(self) -> float:
        return 120.0 - self.controller.true_mm[1]


@pytest.fixture
def bench() -> Bench:
    made = Bench()
    made.stage.home()
    return made


def test_it_homes_and_goes_where_it_is_sent_with_the_other_axis_left_alone(bench):
    assert bench.stage.position_state == "homed"
    for gap_mm in (100.0, 60.0, 80.0):
        bench.stage.goto_gap(gap_mm)
        assert bench.true_gap_mm == pytest.approx(gap_mm, abs=0.005)
    assert bench.controller.true_mm[0] == 30.0
    assert bench.raw.identity.firmware == "Zaber 7.34"


def test_the_interlock_is_that_of_every_stage(bench):
    with pytest.raises(InterlockError, match="nothing was sent"):
        bench.stage.goto_gap(30.0)
    assert bench.true_gap_mm == pytest.approx(120.0, abs=0.005)


def test_a_stop_is_proved_and_keeps_the_place(bench):
    bench.stage.goto_gap(110.0)
    bench.clock.at(bench.clock.monotonic_s() + 3.0, bench.raw.request_stop)
    with pytest.raises(StoppedError, match="feed hold"):
        bench.stage.goto_gap(60.0)
    proof = bench.raw.last_stop
    # At 300 mm/min and 50 mm/s2: v^2 / 2a = 0.25 mm, and a poll of 0.05 s.
    assert proof.is_place_kept
    assert proof.run_out_mm <= 1.2 * 0.25 + 0.25 + 0.01
    assert bench.stage.position_state == "homed"
    assert 60.0 < bench.true_gap_mm < 110.0
    bench.stage.goto_gap(60.0)
    assert bench.true_gap_mm == pytest.approx(60.0, abs=0.005)


def test_a_stop_that_is_ignored_escalates_and_doubts_the_place(bench):
    bench.controller.ignores_stop = True
    bench.clock.at(bench.clock.monotonic_s() + 3.0, interrupt)
    with pytest.raises(KeyboardInterrupt):
        bench.stage.goto_gap(60.0)
    assert bench.raw.last_stop.means == "reset"
    assert bench.raw.last_stop.tried
    assert bench.stage.position_state == "unverified"
    with pytest.raises(PositionLostError):
        bench.stage.goto_gap(60.0)


def test_a_restart_is_seen_by_its_lost_reference(bench):
    bench.stage.goto_gap(100.0)
    bench.controller.power_cycle()
    with pytest.raises(PositionLostError):
        bench.stage.goto_gap(90.0)


def test_silence_is_a_sentence(bench):
    bench.controller.is_deaf = True
    assert bench.raw.status().state == "silent"
    with pytest.raises(StageError, match="does not answer"):
        bench.stage.goto_gap(90.0)


def test_wrong_options_name_the_key_and_the_package():
    with pytest.raises(ConfigError, match=r"stage\.options\.axis: .*zaber_stage"):
        make_stage(config(options=OPTIONS | {"axis": 3}), InterruptingClock())
    with pytest.raises(ConfigError, match=r"stage\.options\.microstep_um"):
        make_stage(config(options={}), InterruptingClock())
    with pytest.raises(ConfigError, match="declares no class Options"):
        make_stage(config(driver="bare"), InterruptingClock())


def test_an_unknown_driver_lists_ours_and_theirs():
    with pytest.raises(ValueError, match="must be one of bare, grbl, marlin, zaber"):
        config(driver="zabr")
    with pytest.raises(ValueError, match="grbl has none"):
        config(driver="grbl")
