"""``magbend rig stop`` from a process that does not drive the stage."""

from __future__ import annotations

import pytest

from magbend.core.errors import ConfigError
from magbend.rig.bench.file_edit import replace_gap_at_zero
from magbend.rig.errors import StageTimeoutError
from magbend.rig.stage.presence import Presence
from magbend.rig.stage.stop_request import stop_from_outside

from .stage_bench import homed_bench


@pytest.fixture(autouse=True)
def runtime_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MAGBEND_RUNTIME_DIR", str(tmp_path))


def test_a_stage_whose_driver_died_is_stopped_directly():
    bench = homed_bench()
    config = bench.raw._config
    bench.stage.close()
    bench.board.receive(b"$J=G91X-20F300\n")
    bench.clock.sleep(0.5)
    bench.board.advance(0.5)
    assert bench.board.mover.running
    assert "has been stopped" in stop_from_outside(config, bench.clock)
    assert not bench.board.mover.running
    assert "already stands" in stop_from_outside(config, bench.clock)


def test_an_owner_that_does_not_react_is_said():
    bench = homed_bench()
    with pytest.raises(StageTimeoutError, match="does not react"):
        stop_from_outside(bench.raw._config, bench.clock)
    assert bench.stage.stop_requested()


def test_an_owner_that_dies_while_it_is_asked_is_replaced():
    bench = homed_bench()
    config = bench.raw._config
    bench.board.receive(b"$J=G91X-20F300\n")

    def die() -> None:
        bench.board.port_taken = False
        bench.raw._presence._owner_file.unlink()

    bench.later(0.5, die)
    assert "has been stopped" in stop_from_outside(config, bench.clock)
    assert not bench.board.mover.running
    assert not bench.raw._presence.stop_asked()


def test_an_owner_that_is_dead_is_no_owner(tmp_path):
    presence = Presence("/dev/ttyTEST")
    presence._owner_file.write_text('{"pid": 999999999}')
    assert presence.owner() is None


def test_the_rig_file_changes_in_one_number_only(tmp_path):
    path = tmp_path / "rig.toml"
    text = "[stage]\n  gap_at_zero_mm = 1.5e2 # here\nport = 'x'\n"
    path.write_text(text)
    replace_gap_at_zero(path, 99.25)
    assert path.read_text() == text.replace("1.5e2", "99.250")
    path.write_text("[stage]\n")
    with pytest.raises(ConfigError, match="on a line of its own"):
        replace_gap_at_zero(path, 1.0)
