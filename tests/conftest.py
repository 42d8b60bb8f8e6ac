"""What all tests stand on."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # for `house`


def pytest_configure() -> None:
    """Let Ctrl-C be Ctrl-C: a shell starts background jobs with it ignored.

    Tests press Ctrl-C on themselves and on the programs they start; ignored, it would
    be inherited by both.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
