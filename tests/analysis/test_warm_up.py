"""Kernels are compiled once, however many processes ask, and nobody outlives a stop."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from magbend.analysis import warm_up
from magbend.core.jit import one_process

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_ends_the_workers_without_a_word_of_theirs(
    number: signal.Signals, tmp_path: Path
) -> None:
    script = Path(__file__).with_name("warm_up_alone.py")
    with subprocess.Popen(
        [sys.executable, str(script), str(tmp_path)], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == "busy\n"
        if number == signal.SIGINT:  # a terminal sends it to all of them
            os.killpg(process.pid, number)
        else:
            process.send_signal(number)
        # Until nobody is left who could write:
        _, said = process.communicate(timeout=30.0)
    assert "Traceback" not in said
    assert said.startswith("compiling the numerical kernels")
    assert process.returncode == (130 if number == signal.SIGINT else -number)


def test_a_second_one_waits_for_the_first_and_finds_all_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    is_asked, is_first_done = threading.Event(), threading.Event()

    def is_warm() -> bool:
        is_asked.set()
        return is_first_done.is_set()

    monkeypatch.setattr(warm_up, "is_warm", is_warm)
    monkeypatch.setattr(warm_up, "_cache_folder", lambda: str(tmp_path))
    monkeypatch.setattr(warm_up.multiprocessing, "get_context", lambda _: None)
    second = threading.Thread(target=warm_up.warm_up)
    with one_process(tmp_path / "warm_up.lock"):
        second.start()
        assert not is_asked.wait(0.05)
        is_first_done.set()
    second.join(timeout=10.0)
    assert is_asked.is_set()
    assert not second.is_alive()
