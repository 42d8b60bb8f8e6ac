"""Ctrl-C ends every command with one line that says so, and exit code 130."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest

from magbend.cli import main as command_line
from magbend.core.units import mT_from_T


def press_ctrl_c(*_args: object, **_kwargs: object) -> None:
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(1_000_000):  # until the signal's handler raises
        mT_from_T(1.0)
    raise AssertionError("Ctrl-C was not heard")


def send_sigterm(*_args: object, **_kwargs: object) -> None:
    os.kill(os.getpid(), signal.SIGTERM)
    for _ in range(1_000_000):
        mT_from_T(1.0)
    raise AssertionError("SIGTERM was not heard")


def interrupted(monkeypatch: pytest.MonkeyPatch, where: str, *arguments: str) -> int:
    """Run a command that is interrupted in the function `where`; return the code."""
    monkeypatch.setattr(where, press_ctrl_c)
    monkeypatch.setattr(sys, "argv", ["magbend", *arguments])
    with pytest.raises(SystemExit) as end:
        command_line.main()
    return int(end.value.code or 0)


def test_a_command_says_that_it_was_stopped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code = interrupted(monkeypatch, "magbend.sim.fit_magnet", "sim", "magnet")
    assert code == 130
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "magbend: stopped by Ctrl-C\n"


def test_it_says_what_is_kept(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    space = Path(__file__).parents[2] / "fixtures" / "library" / "million.toml"
    code = interrupted(
        monkeypatch, "magbend.analysis.library.build.build",
        "analysis", "library", "build", str(space), "--out", str(tmp_path / "all"),
    )  # fmt: skip
    assert code == 130
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert err.startswith(f"magbend: stopped by Ctrl-C; {tmp_path / 'all'} keeps the")


def test_before_the_command_began_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert interrupted(monkeypatch, "magbend.cli.main.app") == 130
    assert capsys.readouterr().err == "magbend: stopped by Ctrl-C\n"


def test_sigterm_ends_as_ctrl_c_does(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # Its default action leaves worker processes behind, which wait for ever.
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr("magbend.sim.fit_magnet", send_sigterm)
    monkeypatch.setattr(sys, "argv", ["magbend", "sim", "magnet"])
    with pytest.raises(SystemExit) as end:
        command_line.main()
    assert end.value.code == 143
    assert capsys.readouterr().err == "magbend: stopped by SIGTERM\n"
    assert signal.getsignal(signal.SIGTERM) is before
