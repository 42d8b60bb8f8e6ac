"""The control socket: one owner a bench, found by rig file or port, gone with it."""

from __future__ import annotations

import json
import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from magbend.core.errors import RigError
from magbend.rig import BenchState, NobodyError, RunControl, ask, owning, run, watch
from magbend.rig.control import names, wire
from magbend.rig.control.names import bench_name, control_folder, sockets_of

posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX")
PORT = "/dev/ttyTEST"


@pytest.fixture(params=["unix", "tcp"])
def rig(request, tmp_path, monkeypatch) -> Path:
    """A rig file; its bench is reached by either kind of socket."""
    if request.param == "tcp":
        monkeypatch.setattr(wire, "HAS_UNIX", False)
    elif not wire.HAS_UNIX:
        pytest.skip("no Unix sockets here")
    return tmp_path / "rig.toml"


def test_nobody_holds_a_bench_that_nobody_holds(rig):
    with pytest.raises(NobodyError, match="no magbend command"):
        ask(rig, "status", port=PORT)
    with owning(rig, PORT, BenchState(), command="rig jog"):
        ask(rig, "status", port=PORT)
    with pytest.raises(NobodyError):
        ask(rig, "status", port=PORT)
    assert list(control_folder().glob("*.sock")) == []


def test_looking_for_a_bench_makes_no_control_folder(rig, system_temp):
    assert sockets_of(bench_name(rig, PORT)) == []
    assert list(system_temp.iterdir()) == []


def test_a_control_folder_swept_away_while_one_looks_holds_nobody(rig, monkeypatch):
    folder, glob = control_folder(), Path.glob

    def swept(self, pattern):
        if self == folder:
            raise FileNotFoundError(2, "No such file or directory", str(self))
        return glob(self, pattern)

    monkeypatch.setattr(Path, "glob", swept)
    with pytest.raises(NobodyError, match="no magbend command"):
        ask(rig, "status", port=PORT)


def test_the_owner_tells_what_it_does_under_either_half_of_its_name(rig, tmp_path):
    state = BenchState()
    link = tmp_path / "link.toml"
    rig.touch()
    link.symlink_to(rig)
    with owning(rig, PORT, state, command="rig run"):
        state.tell(step=2, steps=3, state="settling", gap_mm=60.0)
        state.expect_end(40.0)
        for path, port in ((rig, "auto"), (link, "auto"), (tmp_path / "b", PORT)):
            facts = ask(path, "status", port=port)
            assert facts["pid"] == os.getpid()
            assert (facts["step"], facts["state"]) == (2, "settling")
            assert 39.0 < facts["time_left_s"] <= 40.0
        with pytest.raises(NobodyError):
            ask(tmp_path / "b", "status", port="/dev/ttyOTHER")


def test_a_bench_has_one_owner_but_computed_ones_stand_beside_each_other(rig, tmp_path):
    with owning(rig, PORT, BenchState(folder="runs/a"), command="rig run"):
        for other in (rig, tmp_path / "other.toml"):
            with (
                pytest.raises(RigError, match=r"held by magbend rig run \(runs/a\)"),
                owning(other, PORT, BenchState(), command="rig goto"),
            ):
                pass
        with owning(rig, PORT, BenchState(), command="rig run", computed=True):
            assert ask(rig, "status", port=PORT)["twin"] is False


def test_what_is_asked_is_done_refused_or_unknown(rig):
    control = RunControl()
    with owning(rig, PORT, control.state, command="rig run") as owner:
        owner.commands["pause"] = control.pause
        owner.commands["stop"] = lambda: 1 / 0
        assert "pauses" in ask(rig, "pause", port=PORT)["text"]
        assert control.is_paused
        with pytest.raises(RigError, match="paused already"):
            ask(rig, "pause", port=PORT)
        with pytest.raises(RigError, match="internal error"):
            ask(rig, "stop", port=PORT)
        with pytest.raises(RigError, match="it knows: status, watch, pause, stop"):
            ask(rig, "dance", port=PORT)


def test_who_watches_sees_every_state_and_the_end(rig):
    state, seen = BenchState(), []
    ready = threading.Event()

    def look():
        for facts in watch(rig, port=PORT):
            seen.append(facts)
            ready.set()

    with owning(rig, PORT, state, command="rig run"):
        watcher = threading.Thread(target=look)
        watcher.start()
        for step in (1, 2, 3):
            assert ready.wait(5.0)
            ready.clear()
            state.tell(step=step)
        assert ready.wait(5.0)
    watcher.join(timeout=5.0)
    assert [facts.get("step") for facts in seen[:4]] == [None, 1, 2, 3]
    assert seen[-1]["state"] == "over"


def test_garbage_on_the_socket_harms_nobody(rig):
    generator = random.Random(7)
    with owning(rig, PORT, BenchState(), command="rig run"):
        path = sockets_of(bench_name(rig, PORT))[0]
        for _ in range(40):
            if wire.HAS_UNIX:
                caller = socket.socket(socket.AF_UNIX)
                caller.connect(str(path))
            else:
                port = json.loads(path.read_text())["port"]
                caller = socket.create_connection(("127.0.0.1", port))
            with caller:
                kind = generator.choice(["bytes", "deep", "list", "hang up"])
                data = {
                    "bytes": generator.randbytes(200) + b"\n",
                    "deep": b'{"ask":' + b"[" * 5000 + b"\n",
                    "list": b"[1]\n",
                    "hang up": b'{"ask"',
                }[kind]
                caller.sendall(data)
        assert ask(rig, "status", port=PORT)["command"] == "rig run"


def test_a_caller_without_the_token_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(wire, "HAS_UNIX", False)
    rig = tmp_path / "rig.toml"
    with owning(rig, PORT, BenchState(), command="rig run"):
        path = sockets_of(bench_name(rig, PORT))[0]
        known = json.loads(path.read_text())
        path.write_text(json.dumps({**known, "token": "0" * 32}))
        with pytest.raises(RigError, match="token is wrong"):
            ask(rig, "status", port=PORT)


@posix
@pytest.mark.parametrize("kind", ["link", "open", "file", "foreign"])
def test_a_control_folder_that_is_not_the_users_alone_is_refused(
    kind, system_temp, tmp_path, monkeypatch
):
    folder = system_temp / f"magbend-{os.geteuid()}"
    if kind == "link":
        (tmp_path / "elsewhere").mkdir(mode=0o700)
        folder.symlink_to(tmp_path / "elsewhere")
    elif kind == "open":
        folder.mkdir()
        folder.chmod(0o777)
    elif kind == "file":
        folder.touch()
    else:
        folder.mkdir(mode=0o700)
        monkeypatch.setattr(names.os, "geteuid", lambda: os.getuid() + 1)
        folder.rename(system_temp / f"magbend-{os.getuid() + 1}")
    with (
        pytest.raises(RigError, match="may not stand in it"),
        owning(tmp_path / "rig.toml", PORT, BenchState(), command="rig run"),
    ):
        pass


@posix
def test_the_death_of_the_owner_is_known_at_once(tmp_path, system_temp):
    rig = tmp_path / "rig.toml"
    code = (
        "import sys, pathlib, time\n"
        "from magbend.rig import BenchState, owning\n"
        "from magbend.rig.control import names\n"
        f"names._SYSTEM_TEMP = pathlib.Path({str(system_temp)!r})\n"
        f"with owning(pathlib.Path({str(rig)!r}), {PORT!r}, BenchState(),"
        " command='rig run'):\n"
        "    print('held', flush=True); time.sleep(60)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "held\n"
        assert ask(rig, "status", port=PORT)["pid"] == process.pid
        states = watch(rig, port=PORT)
        next(states)
        process.send_signal(signal.SIGKILL)
        process.wait()
        start_s = time.monotonic()
        with pytest.raises(NobodyError):
            ask(rig, "status", port=PORT)
        with pytest.raises(NobodyError, match="died"):
            list(states)
        assert time.monotonic() - start_s < 1.0
    with owning(rig, PORT, BenchState(), command="rig goto"):
        assert ask(rig, "status", port=PORT)["pid"] == os.getpid()


def test_a_run_tells_each_of_its_states_and_its_newest_picture(bench, tmp_path):
    control, seen = RunControl(), []
    plain = control.state.tell

    def tell(**facts):
        plain(**facts)
        seen.append(control.state.now())

    control.state.tell = tell
    out = tmp_path / "out"
    run(bench.plan, bench.devices, out, control=control)
    states = [facts["state"] for facts in seen]
    for state in ("homing", "moving", "settling", "measuring", "photographing"):
        assert state in states
    last = seen[-1]
    assert (last["step"], last["steps"], last["status"]) == (3, 3, "success")
    assert Path(last["picture"]) == (out / "images" / "step_002.png").resolve()
    assert last["time_left_s"] == 0.0
