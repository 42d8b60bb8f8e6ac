"""What a bench's control socket is called: by its rig file and by its port.

The sockets of a user stand in one folder whose place depends on no environment
variable: a terminal, an ssh session and a desktop find the same one. A name has two
halves, one for the rig file and one for the port, so that a bench is found by either.
"""

from __future__ import annotations

import hashlib
import os
import stat
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ...core.errors import RigError, StageError
from ..ports import resolve_port

ENDING = ".sock"
_SYSTEM_TEMP = Path("/tmp")
"""Of POSIX systems; what `tempfile` says depends on the environment."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchName:
    """The two halves under which the owner of a bench listens."""

    rig: str
    port: str

    @property
    def file(self) -> str:
        """Name of the socket in the control folder."""
        return f"{self.rig}-{self.port}{ENDING}"


def bench_name(rig_file: Path, port: str, *, computed: bool = False) -> BenchName:
    """Return the name of a bench.

    Parameters
    ----------
    rig_file : Path
        The rig file; symbolic links are followed.
    port : str
        Port of its stage, as the rig file or ``--port`` says it.
    computed : bool
        Whether the whole bench is computed: it has no port that only one may hold.
    """
    rig = os.path.realpath(rig_file)
    if computed:
        device = f"{rig}|computed|{os.getpid()}"
    else:
        device = _device(port) or f"{rig}|{port}"
    return BenchName(rig=_digest(rig), port=_digest(device))


def _device(port: str) -> str:
    """Return the real device behind a port; empty where only the rig file tells it."""
    try:
        found = resolve_port(port)
    except StageError:
        return ""  # not plugged in just now
    if found.startswith("twin://"):
        return ""
    return os.path.realpath(found) if found.startswith("/") else found


def _digest(text: str) -> str:
    return hashlib.sha256(os.fsencode(text)).hexdigest()[:12]


def control_folder() -> Path:
    """Return this user's folder of control sockets, made if missing.

    Raises
    ------
    RigError
        If something stands there that is not this user's alone: a link, another
        user's folder, a folder that is open to others.
    """
    folder = _place()
    try:
        folder.mkdir(mode=0o700)
    except FileExistsError:
        pass
    except OSError as error:
        raise RigError(f"{folder}: cannot be made: {error.strerror}") from None
    _check_ours(folder)
    return folder


def _place() -> Path:
    """Return where this user's folder of control sockets stands, made or not."""
    if os.name != "posix":
        return Path(tempfile.gettempdir()) / "magbend-control"
    return _SYSTEM_TEMP / f"magbend-{os.geteuid()}"


def _check_ours(folder: Path) -> None:
    why = _why_not_ours(folder, os.geteuid()) if os.name == "posix" else ""
    if why:
        raise RigError(
            f"{folder}: {why}, so the bench's control socket may not stand in it; "
            f"remove it, or ask its owner to"
        )


def _why_not_ours(folder: Path, user: int) -> str:
    """Return what is wrong with a control folder; empty if it is `user`'s alone."""
    try:
        found = folder.lstat()
    except OSError as error:
        return f"cannot be looked at ({error.strerror})"
    if not stat.S_ISDIR(found.st_mode):
        return "is not a folder"
    if found.st_uid != user:
        return f"belongs to another user ({found.st_uid})"
    if found.st_mode & 0o077:
        return f"is open to other users (mode {stat.S_IMODE(found.st_mode):o})"
    return ""


def sockets_of(name: BenchName) -> list[Path]:
    """Return the sockets under which a bench may be reached, the likeliest first.

    First that of both halves, then of the port, then of the rig file. The
    administrator also reaches the benches of other users. Looking makes no folder.

    Raises
    ------
    RigError
        If this user's folder is not theirs alone.
    """
    ours = _place()
    if os.path.lexists(ours):
        _check_ours(ours)
    folders = [ours, *_folders_of_others()]
    patterns = (name.file, f"*-{name.port}{ENDING}", f"{name.rig}-*{ENDING}")
    found = (path for at in folders for one in patterns for path in _in(at, one))
    return list(dict.fromkeys(found))


def _in(folder: Path, pattern: str) -> list[Path]:
    try:
        return sorted(folder.glob(pattern))
    except FileNotFoundError:  # swept away meanwhile: nobody listens there
        return []


def _folders_of_others() -> Iterator[Path]:
    if os.name != "posix" or os.geteuid() != 0:
        return
    for folder in _in(_SYSTEM_TEMP, "magbend-*"):
        user = folder.name.removeprefix("magbend-")
        if user.isdecimal() and user != "0" and not _why_not_ours(folder, int(user)):
            yield folder
