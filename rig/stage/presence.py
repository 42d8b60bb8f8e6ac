"""Where a homed stage was left standing, for the next command.

A small file in the user's control folder, one a port. Nothing here outlives a restart
of the machine on purpose: then the stage is homed again.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.files import write_text
from ..control.names import control_folder


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftPlace:
    """Where a stage was left.

    Attributes
    ----------
    machine_mm : tuple of float
        What the board counted, all axes.
    map : dict
        The map of `place.PlaceMap`, by which that was a gap.
    mark : float or None
        What a restart of the board would have cleared.
    """

    machine_mm: tuple[float, ...]
    map: dict[str, Any]
    mark: float | None = None


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

    def remember(self, place: LeftPlace) -> None:
        """Note where a homed stage was left standing."""
        with contextlib.suppress(OSError):
            write_text(self._position_file, json.dumps(dataclasses.asdict(place)))

    def recall(self) -> LeftPlace | None:
        """Return where a homed stage was left, and forget it until the next note."""
        noted = _read(self._position_file)
        with contextlib.suppress(OSError):
            self._position_file.unlink(missing_ok=True)
        place, map_, mark = (noted.get(key) for key in ("machine_mm", "map", "mark"))
        if not isinstance(place, list) or not isinstance(map_, dict):
            return None
        try:
            machine_mm = tuple(float(value) for value in place)
        except (TypeError, ValueError):
            return None
        return LeftPlace(machine_mm=machine_mm, map=map_, mark=mark)


def _read(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}
