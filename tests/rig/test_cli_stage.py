"""``magbend rig`` on a virtual board: what it prints, what it refuses, how it stops."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from magbend.cli.main import app
from magbend.cli.rig_stage import connected
from magbend.core.errors import ConfigError, MagbendError

ISOLATED = Path(__file__).with_name("isolated.py")

RIG = """
[stage]
port = "twin://board.json?speed=40"
gap_at_zero_mm = 120.0   # measured with a gauge
feed_mm_min = 500.0
[limits]
min_gap_mm = 45.0
max_gap_mm = 118.0
[camera]
backend = "twin"
[meter]
driver = "manual"
"""


@pytest.fixture(autouse=True)
def bench_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.toml").write_text(RIG)
    return tmp_path


def rig(*words: str) -> str:
    result = CliRunner().invoke(app, ["rig", *words])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.parametrize(("command", "does"), [("goto", "moving"), ("home", "homing")])
def test_who_asks_beside_a_moving_stage_is_told_that_it_moves(command, does):
    with connected(command, Path("rig.toml"), None, None):
        assert f"state      {does}" in rig("status")


def test_a_session_from_power_up_to_a_gap(bench_folder):
    text = rig("status")
    assert "alarm" in text
    assert "to do     home it" in text
    with pytest.raises(MagbendError, match="home it first"):
        rig("goto", "60")
    assert "homed" in rig("home")
    assert "gap 100.000 mm" in rig("goto", "100")
    data = json.loads(rig("status", "--json"))
    assert data["gap_mm"] == pytest.approx(100.0)
    assert data["position_state"] == "homed"
    assert data["allowed_mm"] == [45.0, 118.0]
    record = json.loads(rig("goto", "95", "--json"))
    assert record["approach"] == "far side"
    with pytest.raises(MagbendError, match="nothing was sent"):
        rig("goto", "44")
    assert "gap_at_zero_mm = 120.500" in rig("set-gap", "95.5")
    assert "gap_at_zero_mm = 120.500   # measured with a gauge" in (
        bench_folder / "rig.toml"
    ).read_text(encoding="utf-8")
    assert json.loads(rig("status", "--json"))["gap_mm"] == pytest.approx(95.5)
    assert "already stands" in rig("stop")


def test_a_gap_that_leaves_no_gap_is_not_kept(bench_folder):
    rig("home")
    before = (bench_folder / "rig.toml").read_bytes()
    with pytest.raises(MagbendError, match=r"500 mm here.*gauge it again"):
        rig("set-gap", "500", "--yes")
    assert (bench_folder / "rig.toml").read_bytes() == before
    assert "homed" in rig("status")


def test_a_misread_gauge_is_held_against_the_map(bench_folder):
    rig("home")
    rig("goto", "110")
    before = (bench_folder / "rig.toml").read_bytes()
    with pytest.raises(
        MagbendError, match=r"map said 110.0 mm; this changes it by -40.0 mm.*--yes"
    ):
        rig("set-gap", "70")
    assert (bench_folder / "rig.toml").read_bytes() == before
    assert json.loads(rig("status", "--json"))["gap_mm"] == pytest.approx(110.0)
    assert "gap_at_zero_mm = 80.000" in rig("set-gap", "70", "--yes")


def test_goto_homes_first_if_told(bench_folder):
    assert "gap 110.000 mm" in rig("goto", "110", "--home")


def test_goto_refuses_a_speed_before_it_homes():
    with pytest.raises(MagbendError, match="at most the controller's"):
        rig("goto", "110", "--home", "--feed-mm-min", "9000")
    assert json.loads(rig("status", "--json"))["position_state"] == "unknown"


def test_unlock_asks_and_does_what_it_is_told():
    runner = CliRunner()
    assert "still locked" in runner.invoke(app, ["rig", "unlock"], input="n\n").output
    assert "unknown" in rig("unlock", "--yes")
    assert "not locked" in rig("unlock", "--yes")


def test_jog_needs_a_terminal():
    with pytest.raises(MagbendError, match="needs a terminal"):
        rig("jog")


def test_a_missing_rig_file_is_one_sentence():
    with pytest.raises(ConfigError, match=r"nowhere.toml: there is no such file"):
        rig("status", "--rig", "nowhere.toml")


def test_ports_for_a_machine_is_a_list():
    assert isinstance(json.loads(rig("ports", "--json")), list)


needs_pty = pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")


@pytest.fixture
def moving(bench_folder, system_temp):
    """A process in the middle of a slow move, on a pseudo-terminal."""
    from magbend.rig.clock import SystemClock
    from magbend.rig.virtual.board.firmware import GrblBoard
    from magbend.rig.virtual.board.plant import Plant
    from magbend.rig.virtual.pty_server import PtyBoard

    settings = {20: 1, 21: 1, 22: 1, 120: 500, 121: 500, 122: 500, 24: 400, 26: 20}
    board = GrblBoard(Plant(start_mm=(-0.2,) * 3), settings)
    (bench_folder / "rig.toml").write_text(RIG)
    with PtyBoard(board, SystemClock()) as served:
        rig("home", "--port", served.port)
        words = ["rig", "goto", "60", "--port", served.port]
        process = subprocess.Popen(
            [sys.executable, str(ISOLATED), str(system_temp), *words],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        deadline = time.monotonic() + 30.0
        while not board.mover.running and time.monotonic() < deadline:
            time.sleep(0.02)
        yield served.port, process, board
        process.kill()
        process.communicate()


@needs_pty
def test_stop_from_another_terminal_reaches_a_moving_stage(moving):
    port, process, board = moving
    assert "has stopped the stage" in rig("stop", "--port", port)
    _, error = process.communicate(timeout=20)
    assert process.returncode == 1
    assert "stopped by magbend rig stop" in error
    assert "Traceback" not in error
    assert not board.mover.running
    data = json.loads(rig("status", "--json", "--port", port))
    assert data["position_state"] == "homed"


@needs_pty
def test_ctrl_c_slows_down_and_keeps_the_position(moving):
    port, process, board = moving
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=20)
    assert process.returncode == 1
    assert "the position was kept" in error
    assert "Traceback" not in error
    assert not board.mover.running
    data = json.loads(rig("status", "--json", "--port", port))
    assert data["state"] == "idle"
    assert data["position_state"] == "homed"
