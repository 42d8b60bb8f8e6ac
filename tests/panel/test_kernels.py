"""The first panel after installation: what waits for the compiler says so."""

from __future__ import annotations

import subprocess
import sys
import threading

import pytest

from magbend.core.errors import MagbendError
from magbend.panel.kernels import KernelWatch


def test_it_says_how_far_the_compiler_is_and_ends_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told = threading.Event()
    helpers: list[subprocess.Popen[bytes]] = []

    def compile_beside() -> subprocess.Popen[bytes]:
        waits = [sys.executable, "-S", "-c", "import time; time.sleep(60)"]
        helpers.append(subprocess.Popen(waits))
        return helpers[0]

    monkeypatch.setattr("magbend.analysis.is_warm", lambda: False)
    monkeypatch.setattr("magbend.analysis.stored", lambda: (3, 14))
    monkeypatch.setattr("magbend.analysis.warm_up_beside", compile_beside)
    watch = KernelWatch(told.set)
    watch.begin()
    try:
        with pytest.raises(MagbendError, match=r"compiled.*: 3 of 14 parts are done"):
            watch.require()
        assert told.wait(10.0)
        assert helpers[0].poll() is None
    finally:
        watch.close()
    assert helpers[0].poll() is not None
    assert watch.news == ""


def test_a_warm_panel_waits_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("magbend.analysis.is_warm", lambda: True)
    watch = KernelWatch(lambda: None)
    watch.begin()
    watch.require()
    assert watch.news == ""
    watch.close()
