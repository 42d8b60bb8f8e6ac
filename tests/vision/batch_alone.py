"""A batch of two workers that say that they are there, and do not end by themselves."""

from __future__ import annotations

import time
from pathlib import Path

from magbend.core import jit
from magbend.vision.batch.inputs import Source
from magbend.vision.batch.run import _run


def stay(_: Source) -> None:
    """Be busy for longer than any test."""
    print("busy", flush=True)
    time.sleep(60.0)


if __name__ == "__main__":
    jit.PLAIN_FIRST = False
    list(_run(stay, [Source(image=name, path=Path(name)) for name in "ab"], 2))
