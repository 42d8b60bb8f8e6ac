"""A warm-up whose first job says that it is there, and does not end by itself."""

from __future__ import annotations

import sys
import time
from pathlib import Path

from magbend.analysis import warm_up


def stay() -> None:
    """Be busy for longer than any test."""
    print("busy", flush=True)
    time.sleep(60.0)


def nothing() -> None:
    """Be done."""


if __name__ == "__main__":
    warm_up.is_warm = lambda: False
    warm_up._cache_folder = lambda: str(Path(sys.argv[1]))
    warm_up._photograph = stay
    warm_up._rod = warm_up._curve = warm_up._solid = nothing
    warm_up.main()
