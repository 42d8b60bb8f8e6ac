"""What all tests stand on."""

from __future__ import annotations

import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # for `house`


def pytest_configure() -> None:
    """Let Ctrl-C be Ctrl-C: a shell starts background jobs with it ignored.

    Tests press Ctrl-C on themselves and on the programs they start; ignored, it would
    be inherited by both.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def system_temp(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Give each test a system folder of its own for control sockets.

    A short one: the path of a Unix socket has some hundred characters at most.
    """
    with tempfile.TemporaryDirectory(prefix="mb-") as folder:
        monkeypatch.setattr("magbend.rig.control.names._SYSTEM_TEMP", Path(folder))
        yield Path(folder)
