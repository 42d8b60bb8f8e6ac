"""How long work tells how far it is: a callback, so that no package prints."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called as ``progress(done, total)``, from one thread, with `done` never falling."""


def silent(_done: int, _total: int) -> None:
    """Tell nobody: the default."""
