"""``magbend rig stop`` from a process that does not drive the stage."""

from __future__ import annotations

import threading

import pytest

from magbend.core.errors import RigError
from magbend.rig.control.owner import owning
from magbend.rig.control.state import BenchState
from magbend.rig.stage import stop_request
from magbend.rig.stage.stop_request import stop_from_outside, stopping

from .stage_bench import homed_bench


def test_a_stage_whose_driver_died_is_stopped_directly(tmp_path):
    bench = homed_bench()
    config = bench.raw._config
    bench.stage.close()
    bench.board.receive(b"$J=G91X-20F300\n")
    bench.clock.sleep(0.5)
    bench.board.advance(0.5)
    assert bench.board.mover.running
    rig = tmp_path / "rig.toml"
    assert "has been stopped" in stop_from_outside(rig, config, bench.clock)
    assert not bench.board.mover.running
    assert "already stands" in stop_from_outside(rig, config, bench.clock)


def test_an_owner_that_moves_is_told_and_holds(tmp_path):
    bench = homed_bench()
    rig, port = tmp_path / "rig.toml", bench.raw._config.port
    answers = []

    def outside():
        answers.append(stop_from_outside(rig, bench.raw._config, bench.clock))

    caller = threading.Thread(target=outside)

    def call():
        caller.start()
        while not bench.stage.stop_requested():
            pass

    bench.later(1.0, call)
    with owning(rig, port, BenchState(), command="rig goto") as owner:
        owner.commands["stop"] = stopping(bench.stage)
        with pytest.raises(RigError, match="stopped"):
            bench.stage.goto_gap(60.0)
        caller.join(timeout=20.0)
    assert "has stopped the stage" in answers[0]
    assert not bench.board.mover.running
    assert bench.stage.position_state == "homed"


def test_an_owner_that_does_not_react_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(stop_request, "_STOP_S", 0.1)
    bench = homed_bench()
    rig, port = tmp_path / "rig.toml", bench.raw._config.port
    with owning(rig, port, BenchState(), command="rig goto") as owner:
        owner.commands["stop"] = stopping(bench.stage)
        with pytest.raises(RigError, match="does not react"):
            stop_from_outside(rig, bench.raw._config, bench.clock)
    assert bench.stage.stop_requested()
