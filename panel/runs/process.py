"""Start a magbend command as a process that outlives the panel."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO

_WINDOWS_DETACHED = 0x00000008 | 0x00000200


def spelt(arguments: Sequence[str]) -> str:
    """Return the command as a person would type it."""
    return shlex.join(["magbend", *arguments])


def start(
    arguments: Sequence[str], folder: Path, output: IO[bytes] | int, *, detached: bool
) -> subprocess.Popen[bytes]:
    """Start ``magbend ARGUMENTS`` in `folder`.

    Parameters
    ----------
    arguments : sequence of str
        What follows ``magbend``.
    folder : Path
        Where it runs.
    output : file or int
        Where what it says goes.
    detached : bool
        In a session of its own, so that neither Ctrl-C in the panel's terminal nor the
        end of the panel reaches it.
    """
    command = [sys.executable, "-m", "magbend.cli.main", *arguments]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    windows = _WINDOWS_DETACHED if detached and os.name == "nt" else 0
    return subprocess.Popen(
        command, cwd=folder, stdin=subprocess.DEVNULL, stdout=output,
        stderr=subprocess.STDOUT, env=environment, creationflags=windows,
        start_new_session=detached and os.name == "posix",
    )  # fmt: skip
