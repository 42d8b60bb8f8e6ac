"""Keys of a real terminal, keys of Windows by injection, and jogging with them."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
import types
from pathlib import Path

import pytest

from magbend.cli import keyboard
from magbend.cli.keyboard import END, Keyboard

needs_pty = pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs POSIX")


ISOLATED = str(Path(__file__).with_name("isolated.py"))
TAKE_TERMINAL = """
import os, sys
os.open(os.ttyname(0), os.O_RDWR)
os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
"""
# A session's first terminal opened is the one whose Ctrl-C it gets. Done in the child's
# own program: a function between fork and exec upsets threads of other tests' modules.


class Terminal:
    """The person's end of a pseudo-terminal, and a program at the other."""

    def __init__(self, words: list[str], folder) -> None:
        import pty

        self._master, slave = pty.openpty()
        self.seen = ""
        self.process = subprocess.Popen(
            [sys.executable, "-c", TAKE_TERMINAL, *words],
            stdin=slave, stdout=slave, stderr=slave,
            start_new_session=True, cwd=folder,
        )  # fmt: skip
        os.close(slave)

    def type(self, keys: str) -> None:
        os.write(self._master, keys.encode())

    def wait_for(self, text: str, after: int = 0, timeout_s: float = 20.0) -> str:
        """Read until `text` is on the screen after so many characters."""
        import select

        deadline_s = time.monotonic() + timeout_s
        while text not in self.seen[after:]:
            assert time.monotonic() < deadline_s, self.seen
            if select.select([self._master], [], [], 0.05)[0]:
                with contextlib.suppress(OSError):
                    self.seen += os.read(self._master, 4096).decode()
        return self.seen[after:]

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._master)


@pytest.fixture
def terminal(tmp_path):
    opened = []

    def start(*words: str) -> Terminal:
        opened.append(Terminal(list(words), tmp_path))
        return opened[-1]

    yield start
    for one in opened:
        one.close()


ECHO = """
from magbend.cli.keyboard import END, Keyboard, has_keys
with Keyboard() as keyboard:
    print("ready", has_keys(), flush=True)
    while True:
        key = keyboard.key(0.05)
        if key or key == END:
            print(repr(key), flush=True)
        if key in ("q", END):
            break
"""


@needs_pty
def test_keys_of_a_terminal_have_names(terminal):
    screen = terminal("-c", ECHO)
    screen.wait_for("ready True")
    screen.type("a\x1b[A\x1b[B\x1bOC\x1b[D\x1b[3~\x1b[1;5A5")
    assert screen.wait_for("'5'").split()[2:] == [
        "'a'", "'up'", "'down'", "'right'", "'left'", "'up'", "'5'",
    ]  # fmt: skip
    screen.type("q")
    assert screen.process.wait(timeout=10) == 0


RIG = """
[stage]
port = "twin://board.json?speed={speed}"
gap_at_zero_mm = 120.0
[limits]
min_gap_mm = 45.0
max_gap_mm = 118.0
"""


@needs_pty
def test_a_session_of_jogging_by_keys(terminal, tmp_path, system_temp):
    (tmp_path / "rig.toml").write_text(RIG.format(speed=25))
    screen = terminal(ISOLATED, str(system_temp), "rig", "jog")
    screen.wait_for("gap unknown (machine 0.000 mm)  alarm unknown  step 1 mm")
    screen.type("\x1b[A")
    screen.wait_for("press H to home")
    screen.type("H")
    screen.wait_for("homing; space stops it")
    screen.wait_for("gap  119.000 mm  idle homed")
    screen.type("5j")
    screen.wait_for("moving  step 10 mm")
    at = len(screen.wait_for("gap  109.000 mm  idle homed"))
    screen.type("+")
    screen.wait_for("must be at most 118 mm", at)
    screen.type("q")
    assert screen.process.wait(timeout=10) == 0


@needs_pty
def test_space_stops_a_jog_and_ctrl_c_leaves(terminal, tmp_path, system_temp):
    (tmp_path / "rig.toml").write_text(RIG.format(speed=4))
    screen = terminal(ISOLATED, str(system_temp), "rig", "jog")
    screen.wait_for("alarm unknown")
    screen.type("H")
    screen.wait_for("homing")
    screen.type(" ")
    at = len(screen.wait_for("stopped by magbend rig stop"))
    screen.wait_for("alarm unknown", at)
    screen.type("\x03")
    assert screen.process.wait(timeout=10) == 0
    assert "Traceback" not in screen.seen


def test_the_bell_rings_in_a_terminal_only(monkeypatch, capsys):
    import io

    from magbend.cli.rig_run import _report

    for is_terminal, heard in ((True, "\a"), (False, "")):
        terminal = io.StringIO()
        monkeypatch.setattr(terminal, "isatty", lambda told=is_terminal: told)
        monkeypatch.setattr(sys, "__stderr__", terminal)
        _report("\apaused")
        assert terminal.getvalue() == heard
        assert capsys.readouterr().err == "paused\n"


# Windows, by injection: what msvcrt gives, one character a call.


@pytest.fixture
def windows_keys(monkeypatch):
    waiting: list[str] = []
    fake = types.SimpleNamespace(
        kbhit=lambda: bool(waiting), getwch=lambda: waiting.pop(0)
    )
    monkeypatch.setitem(sys.modules, "msvcrt", fake)
    monkeypatch.setattr(keyboard, "_POSIX", False)
    return waiting


def test_keys_of_windows_have_the_same_names(windows_keys):
    windows_keys += [
        "a",
        "\xe0",
        "H",
        "\xe0",
        "P",
        "\x00",
        "K",
        "\xe0",
        "M",
        "\x00",
        ";",
    ]
    windows_keys += ["p"]
    with Keyboard() as keys:
        named = [keys.key(0.01) for _ in range(7)]
        none = keys.key(0.01)
    assert named == ["a", "up", "down", "left", "right", "", "p"]
    assert none == ""


def test_the_pause_key_works_on_windows(windows_keys, monkeypatch):
    from magbend.cli.keys import pausing
    from magbend.rig.runs.control import RunControl

    for stream in (sys.stdin, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
    control = RunControl()
    with pausing(control, keys=True):
        windows_keys.append("p")
        deadline_s = time.monotonic() + 5.0
        while not control.is_paused and time.monotonic() < deadline_s:
            time.sleep(0.01)
        assert control.is_paused


def test_a_terminal_that_is_gone_ends_the_reading(monkeypatch):
    if not hasattr(os, "openpty"):
        pytest.skip("needs POSIX")
    reader, writer = os.pipe()
    os.close(writer)
    monkeypatch.setattr(keyboard, "has_keys", lambda: True)
    with os.fdopen(reader) as stream:
        monkeypatch.setattr(sys, "stdin", stream)
        assert Keyboard().key(1.0) == END
