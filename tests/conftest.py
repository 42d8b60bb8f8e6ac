"""What all tests stand on."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from magbend.core import jit

# Before numpy is loaded: threads of OpenBLAS that wait for each other spin, and where
# several workers share the cores a solve of 200 unknowns takes ten times its work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parent))  # for `house`

# In a fresh clone all that is compiled by and by would first run as plain Python, for
# minutes.
jit.PLAIN_FIRST = False


def pytest_configure() -> None:
    """Let Ctrl-C be Ctrl-C: a shell starts background jobs with it ignored.

    Tests press Ctrl-C on themselves and on the programs they start; ignored, it would
    be inherited by both.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Let Python look for no garbage among what is collected: all of it stays.

    The looking takes a quarter of the time of collecting, in each worker.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown() -> Iterator[None]:
    """Refuse a test after which numba keeps kernels elsewhere than before it.

    Numba reads its environment when it compiles, and not again once a test has put
    that back: the kernels of all later tests would be cold.
    """
    yield
    numba = sys.modules.get("numba")
    if numba is not None:
        assert os.environ.get("NUMBA_CACHE_DIR", "") == numba.config.CACHE_DIR


@pytest.fixture(autouse=True)
def system_temp(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Give each test a system folder of its own for control sockets.

    A short one: the path of a Unix socket has some hundred characters at most.
    """
    with tempfile.TemporaryDirectory(prefix="mb-") as folder:
        monkeypatch.setattr("magbend.rig.control.names._SYSTEM_TEMP", Path(folder))
        yield Path(folder)


class Done(NamedTuple):
    """What a command left behind; the names are those of `subprocess`."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def magbend(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Done]:
    """Return what runs a command in this process, in a folder if one is named.

    A process of its own would import everything again, for a second or more.
    """
    from magbend.cli.main import main

    def run(*words: object, cwd: Path | None = None) -> Done:
        monkeypatch.setattr(sys, "argv", ["magbend", *map(str, words)])
        code = 0
        with contextlib.chdir(cwd or "."):
            try:
                main()
            except SystemExit as stop:
                code = int(stop.code or 0)
        out, messages = capsys.readouterr()
        assert "Traceback" not in messages
        return Done(code, out, messages)

    return run
