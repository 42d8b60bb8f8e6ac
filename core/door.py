"""The door for every file that somebody else may have written: regular, small enough.

A pipe or a device in place of a file would hang the reader or fill its memory, so what
is opened is looked at before a byte is read.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from .checks import shown
from .errors import ConfigError, MagbendError

MEGABYTE = 1 << 20


def open_file(path: Path, kind: type[MagbendError] = ConfigError) -> BinaryIO:
    """Open a regular file to read; what is none is refused, not waited for.

    Raises
    ------
    MagbendError
        Of the given `kind`, if it is missing, unreadable or no file.
    """
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    try:
        descriptor = os.open(path, flags)
    except FileNotFoundError:
        raise kind(f"{path}: there is no such file") from None
    except (OSError, ValueError) as error:
        if path.is_dir():
            raise kind(f"{path}: is a folder, not a file") from None
        why = getattr(error, "strerror", None) or error
        raise kind(f"{_short(path)}: cannot be read: {why}") from None
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        what = "a folder" if path.is_dir() else "a pipe or a device"
        raise kind(f"{path}: is {what}, not a file")
    return os.fdopen(descriptor, "rb")


def read_file(
    path: Path, most_MB: float = 64.0, kind: type[MagbendError] = ConfigError
) -> bytes:
    """Return the bytes of a regular file, never more than the limit.

    Raises
    ------
    MagbendError
        Of the given `kind`, if it is missing, unreadable, no file, or too large.
    """
    most = int(most_MB * MEGABYTE)
    with open_file(path, kind) as file:
        try:
            data = file.read(most + 1)
        except OSError as error:
            raise kind(f"{path}: cannot be read: {error.strerror}") from None
    if len(data) > most:
        raise kind(f"{path}: must not be longer than {most_MB:g} MB")
    return data


def inside(folder: Path, name: str, kind: type[MagbendError] = ConfigError) -> Path:
    """Return the path of a file that a record names, which must lie in `folder`.

    Raises
    ------
    MagbendError
        Of the given `kind`, if the name leaves the folder, also through a link.
    """
    parts = PurePosixPath(name).parts
    leaves = (
        not name or len(name) > 1000 or "\0" in name or "\\" in name or ".." in parts
        or PurePosixPath(name).is_absolute() or Path(name).is_absolute()
    )  # fmt: skip
    if leaves:
        raise kind(f"{folder}: the name {shown(name)} does not stay in the folder")
    path = folder / name
    try:
        real = path.resolve()
    except (OSError, ValueError, RuntimeError) as error:
        raise kind(f"{folder}: the name {shown(name)} is unusable: {error}") from None
    if not real.is_relative_to(folder.resolve()):
        raise kind(f"{folder}: {name} is a link that leaves the folder")
    return path


def real_path(path: Path) -> Path:
    """Return where a path leads through its links; from a ring of links, nowhere."""
    return Path(os.path.realpath(path))  # `Path.resolve` raises on a ring


def file_below(folder: Path, name: str) -> Path | None:
    """Return the file that a stranger's name leads to, in `folder` or below.

    None where there is no such file, or the name or a link leads elsewhere.
    """
    root = real_path(folder)
    try:
        found = real_path(root / name)
        is_file = found.is_file()
    except (OSError, ValueError):  # too long a name, a zero byte
        return None
    return found if root in found.parents and is_file else None


def _short(path: Path) -> str:
    text = str(path)
    return text if len(text) < 300 else shown(text)
