"""Files that are whole or absent: written beside, synced, then renamed into place."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path

from .errors import InputError


def output_file(path: Path, *, kind: str = "", taken: Iterable[Path] = ()) -> Path:
    """Return `path` once a file can be written there; call it before the work.

    Folders that are missing on the way are made.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        Suffix of what is written, such as ``.csv``: no file of another is replaced.
    taken : iterable of Path
        Files that are read, or written as something else: they are not replaced.

    Raises
    ------
    InputError
        If `path` names a folder or nothing, a file that may not be replaced, or
        `output_folder` refuses its folder.
    """
    _check_name(path)
    if path.is_file():
        if kind and path.suffix.lower() != kind:
            raise InputError(
                f"{path}: is there already, and is no {kind} file; give another name"
            )
        if any(other.exists() and path.samefile(other) for other in taken):
            raise InputError(
                f"{path}: is read, or written as something else, by the same command; "
                "give another name"
            )
    if not path.exists() or path.is_file():
        output_folder(path.parent)
    return path


def output_folder(folder: Path) -> Path:
    """Return `folder` once files can be written in it; call it before the work.

    It is made where it is missing, with the folders on the way.

    Raises
    ------
    InputError
        If a file stands where a folder belongs, or nothing may be written there.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise InputError(
            f"{folder}: a file stands where a folder belongs; give another name"
        ) from None
    except PermissionError:
        raise InputError(
            f"{folder}: this folder may not be made; give another place"
        ) from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(
            f"{folder}: nothing may be written in this folder; give another place"
        )
    return folder


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` so that `path` holds the old content or all of the new.

    The bytes go to a temporary file in the same folder, are synced to the disk, renamed
    over `path`, and the folder is synced, so that the rename survives a power cut. A
    device or pipe (``/dev/stdout``) is written to, never replaced; a link is written
    through; the mode of a file that is replaced is kept.

    Raises
    ------
    InputError
        If `path` is empty, names no file, or a pipe that nobody reads.
    OSError
        If the folder is missing, read-only or full; it names `path`, and no temporary
        file is left.
    """
    _check_name(path)
    if path.is_fifo():
        _write_pipe(path, data)
        return
    if path.exists() and not path.is_file():
        path.write_bytes(data)
        return
    with beside(path) as temporary:
        temporary.write_bytes(data)


@contextlib.contextmanager
def beside(path: Path) -> Iterator[Path]:
    """Make an empty file beside `path`; what is written into it takes the place.

    It is synced and renamed at the end. If anything fails it is removed, and what was
    at `path` stays.

    Raises
    ------
    OSError
        Of writing, here or within: it names `path`.
    """
    target = _behind_links(path)
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
    try:
        with temporary.open("xb") as file:
            _keep_mode(file.fileno(), target)
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.replace(target)
    except BaseException as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError) and error.filename in (None, str(temporary)):
            error.filename, error.filename2 = str(path), None
            if isinstance(error, FileNotFoundError):
                error.strerror = f"there is no folder {path.parent}; make it first"
        raise
    sync_folder(target.parent)


def _write_pipe(path: Path, data: bytes) -> None:
    """Write into a pipe that somebody reads; another would be waited for for ever."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
    except OSError as error:
        if error.errno != errno.ENXIO:
            raise
        raise InputError(
            f"{path}: is a pipe that nobody reads; remove it or give another name"
        ) from None
    os.set_blocking(descriptor, True)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)


def _behind_links(path: Path) -> Path:
    """Return the file that a link leads to: it is written through, never cut."""
    if not path.is_symlink():
        return path
    try:
        return path.resolve()
    except (OSError, RuntimeError):
        raise InputError(f"{path}: is a link that leads nowhere; remove it") from None


def _keep_mode(descriptor: int, target: Path) -> None:
    """Give the new file the mode of the one it replaces: a private file stays so."""
    if os.name != "posix":
        return
    with contextlib.suppress(FileNotFoundError):
        os.fchmod(descriptor, stat.S_IMODE(target.stat().st_mode))


def _check_name(path: Path) -> None:
    if not path.name or path.is_dir():
        raise InputError(
            f"the output file must have a name; instead received the folder {path}"
        )


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8, whole or not at all (see `write_bytes`)."""
    write_bytes(path, text.encode("utf-8"))


def sync_folder(folder: Path) -> None:
    """Make renames and new names in `folder` durable, where the system can (POSIX)."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
