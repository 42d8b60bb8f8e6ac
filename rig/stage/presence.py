"""Where a homed stage was left standing, for the next command.

A small file in the user's control folder, one a port. Nothing here outlives a restart
of the machine on purpose: then the stage is homed again.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from pathlib import Path
from typing import Any

from ...core.files import write_text
from ..control.names import control_folder


class Presence:
    """The note of one port.

    Parameters
    ----------
    port : str
        The port as it is opened; symbolic links are followed.
    """

    def __init__(self, port: str) -> None:
        real = os.path.realpath(port) if port.startswith("/") else port
        digest = hashlib.sha256(real.encode()).hexdigest()[:12]
        self._position_file = control_folder() / f"{digest}.position"

    def remember(self, machine_mm: tuple[float, ...]) -> None:
        """Note where a homed stage was left standing, all axes, in mm."""
        with contextlib.suppress(OSError):
            write_text(self._position_file, json.dumps({"machine_mm": machine_mm}))

    def recall(self) -> tuple[float, ...] | None:
        """Return where a homed stage was left, and forget it until the next note."""
        noted = _read(self._position_file).get("machine_mm")
        with contextlib.suppress(OSError):
            self._position_file.unlink(missing_ok=True)
        if not isinstance(noted, list):
            return None
        return tuple(float(value) for value in noted)


def _read(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}
