"""Who holds a stage, the request to stop it, and where it was left.

Small files in the user's runtime folder, one set a port, so that ``magbend rig stop``
reaches a stage whose port another process holds, and so that a stage that was homed and
left standing need not be homed again by the next command. Nothing here outlives a
restart of the machine on purpose: then the stage is homed again.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from pathlib import Path
from typing import Any

from ...core.files import write_text


def runtime_folder() -> Path:
    """Return the folder of these files: ``MAGBEND_RUNTIME_DIR``, else the system's."""
    named = os.environ.get("MAGBEND_RUNTIME_DIR") or os.environ.get("XDG_RUNTIME_DIR")
    if named and Path(named).is_dir():
        return Path(named)
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    folder = Path(tempfile.gettempdir()) / f"magbend-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder


class Presence:
    """The files of one port.

    Parameters
    ----------
    port : str
        The port as it is opened; symbolic links are followed.
    """

    def __init__(self, port: str) -> None:
        real = os.path.realpath(port) if port.startswith("/") else port
        digest = hashlib.sha256(real.encode()).hexdigest()[:12]
        self._stem = runtime_folder() / f"magbend-stage-{digest}"
        self._is_owner = False
        self._is_stop_asked = False

    def claim(self) -> None:
        """Say that this process holds the port; old requests to stop are void."""
        self.clear_stop()
        self._is_owner = True
        with contextlib.suppress(OSError):
            write_text(self._owner_file, json.dumps({"pid": os.getpid()}))

    def release(self) -> None:
        """Say that nobody holds the port."""
        self._is_owner = False
        self.clear_stop()  # first: a request without an owner was not met
        if self.owner() == os.getpid():
            self._owner_file.unlink(missing_ok=True)

    def owner(self) -> int | None:
        """Return the process that holds the port, if it is alive."""
        pid = _read(self._owner_file).get("pid")
        return pid if isinstance(pid, int) and _alive(pid) else None

    def ask_to_stop(self) -> None:
        """Ask the owner to stop the stage; it looks ten times a second.

        The owner itself only sets a flag: it may do so in a signal handler.
        """
        if self._is_owner:
            self._is_stop_asked = True
        else:
            write_text(self._stop_file, "stop\n")

    def stop_asked(self) -> bool:
        """Return whether a stop is asked for."""
        return self._is_stop_asked or self._stop_file.exists()

    def clear_stop(self) -> None:
        """Take the request back: it has been met, or is void."""
        self._is_stop_asked = False
        with contextlib.suppress(OSError):
            self._stop_file.unlink(missing_ok=True)

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

    @property
    def _owner_file(self) -> Path:
        return self._stem.with_suffix(".owner")

    @property
    def _stop_file(self) -> Path:
        return self._stem.with_suffix(".stop")

    @property
    def _position_file(self) -> Path:
        return self._stem.with_suffix(".position")


def _read(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}


def _alive(pid: int) -> bool:
    if os.name != "posix":
        # Signal 0 ends a process on Windows; a stale note is met by the open port.
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
