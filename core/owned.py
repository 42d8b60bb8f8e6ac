"""A folder has one owner: made by us, locked while it is written, marked as ours.

In the folder ``.magbend`` of an owned folder stand ``folder.json`` (what it is, with a
seal), ``lock`` (dies with its process) and, meanwhile, ``holder.json`` (who writes). A
folder that is not empty and carries no mark is somebody else's and is never taken.
"""

from __future__ import annotations

import contextlib
import getpass
import os
import shutil
import socket
import threading
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from .door import read_file
from .errors import InputError, StoreError
from .files import output_folder, write_text
from .json import parse_json
from .seal import is_whole, sealed

MARK = ".magbend"
FOLDER_FILE = "folder.json"
LOCK_FILE = "lock"
HOLDER_FILE = "holder.json"
SCHEMA = 1
_MOST_ENTRIES = 200_000

_held: dict[str, tuple[int, int]] = {}
"""By real path: the thread of this process that owns a folder, and how often."""


def nobody_else(_folder: Path) -> bool:
    """Take no folder without a mark."""
    return False


def is_marked(folder: Path) -> bool:
    """Return whether a folder carries our mark."""
    return (folder / MARK / FOLDER_FILE).is_file()


def root_of(path: Path) -> Path | None:
    """Return the marked folder in which a file lies; None if there is none."""
    return next((one for one in path.resolve().parents if is_marked(one)), None)


def program() -> str:
    """Return name and version of this program, as records keep them."""
    try:
        return f"magbend {version('magbend')}"
    except PackageNotFoundError:
        return "magbend"


@contextlib.contextmanager
def owning_folder(
    folder: Path,
    kind: str,
    command: str,
    *,
    ours: Callable[[Path], bool] = nobody_else,
) -> Iterator[Path]:
    """Own a folder while the block runs; it is made where it is missing.

    Parameters
    ----------
    folder : Path
        New, empty, or marked as ours.
    kind : str
        What it is for people: ``run``, ``extraction``, ``library``.
    command : str
        What writes it: ``rig run``.
    ours : callable
        Tells a folder that an older version made, before there were marks.

    Yields
    ------
    Path
        The folder. One that was made for this and holds nothing is removed at the end.

    Raises
    ------
    StoreError
        If it is somebody else's, holds a link that leaves it, or another process
        writes it just now: the sentence says which. Nothing was written.
    InputError
        If it cannot be made.
    """
    real = os.path.realpath(folder)
    me = threading.get_ident()
    owner, times = _held.get(real, (me, 0))
    if times and owner == me:
        _held[real] = (me, times + 1)
        try:
            yield folder
        finally:
            _held[real] = (me, times)
        return
    is_new = _make(folder, ours)
    with _locked(folder, kind, command):
        _held[real] = (me, 1)
        try:
            yield folder
        finally:
            del _held[real]
            if is_new:
                _remove_if_empty(folder)


def _make(folder: Path, ours: Callable[[Path], bool]) -> bool:
    """Make a folder, or see that it may be taken; return whether it was made."""
    try:
        output_folder(folder.parent)
        folder.mkdir()
    except FileExistsError:
        output_folder(folder)
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{folder}: this folder cannot be made: {error}") from None
    else:
        return True
    # Whoever dies while marking leaves the mark's folder, perhaps without its file.
    is_empty = all(entry.name == MARK for entry in folder.iterdir())
    if not is_empty and not is_marked(folder) and not ours(folder):
        raise StoreError(
            f"{folder}: is not empty and was not made by magbend; name a folder that "
            f"is new or empty"
        )
    refuse_links(folder)
    return False


def refuse_links(folder: Path) -> None:
    """Refuse a folder through whose links one would write somewhere else.

    Raises
    ------
    StoreError
        If it holds a link that leaves it.
    """
    real = folder.resolve()
    for count, (at, folders, files) in enumerate(os.walk(folder)):
        for name in (*folders, *files):
            path = Path(at) / name
            if path.is_symlink() and not path.resolve().is_relative_to(real):
                raise StoreError(
                    f"{path}: is a link that leaves its folder, and nothing is "
                    f"written through it; remove it, or put the file itself there"
                )
        if count > _MOST_ENTRIES:
            raise StoreError(f"{folder}: holds too many folders")


@contextlib.contextmanager
def _locked(folder: Path, kind: str, command: str) -> Iterator[None]:
    from filelock import FileLock, Timeout

    mark = folder / MARK
    lock = FileLock(mark / LOCK_FILE, timeout=0.0)
    try:
        mark.mkdir(exist_ok=True)
        lock.acquire()
        _introduce(mark, kind, command)
    except Timeout:
        raise StoreError(f"{folder}: {_holder(mark)}") from None
    except OSError as error:
        lock.release()
        raise StoreError(f"{folder}: cannot be locked: {error.strerror}") from None
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            (mark / HOLDER_FILE).unlink(missing_ok=True)
        lock.release()


def _introduce(mark: Path, kind: str, command: str) -> None:
    """Sweep up after the dead; say what the folder is, once, and who writes it now."""
    for leftover in mark.glob(".*.tmp"):
        leftover.unlink(missing_ok=True)
    if not (mark / FOLDER_FILE).is_file():
        facts = {"schema": SCHEMA, "kind": kind, "made_by": program()}
        text = sealed({**facts, "made_utc": _now()}, indent=1)
        write_text(mark / FOLDER_FILE, text)
    write_text(mark / HOLDER_FILE, sealed(_me(command), indent=1))


def _me(command: str) -> dict[str, Any]:
    try:
        user = getpass.getuser()
    except (KeyError, OSError):
        user = ""
    return {
        "command": command, "pid": os.getpid(), "host": socket.gethostname(),
        "user": user, "since_utc": _now(),
    }  # fmt: skip


def _holder(mark: Path) -> str:
    try:
        who = parse_json(read_file(mark / HOLDER_FILE, 0.1, StoreError))
        return (
            f"is being written by magbend {who['command']}, process {who['pid']} on "
            f"{who['host']}, since {who['since_utc']}; wait until it is done"
        )
    except (ValueError, KeyError, TypeError, StoreError):
        return "is being written by another process; wait until it is done"


def altered_marks(folder: Path) -> list[str]:
    """Return the names of marks of a folder that are not as they were written."""
    mark = folder / MARK
    names = []
    found = sorted(mark.iterdir()) if mark.is_dir() else []
    for path in found:
        if path.is_dir() or path.name.endswith(".tmp"):
            continue  # a write that was cut off has no seal yet
        try:
            data = read_file(path, 0.1, StoreError)
            is_good = data == b"" if path.name == LOCK_FILE else is_whole(data)
        except StoreError:
            is_good = False
        if not is_good:
            names.append(f"{MARK}/{path.name}")
    return names


def _remove_if_empty(folder: Path) -> None:
    with contextlib.suppress(OSError):
        if [entry.name for entry in folder.iterdir()] == [MARK]:
            shutil.rmtree(folder / MARK)
            folder.rmdir()


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
