"""``wire.log``: every byte to and from the devices, each row chained to the one before.

A row is ``monotonic_s utc device direction bytes #digest``; direction is ``>>`` to the
device, ``<<`` from it and ``--`` a remark; bytes are a Python literal. The digest is
the beginning of the SHA-256 of the digest before and the row, so that a changed,
missing or moved row is noticed.
"""

from __future__ import annotations

import contextlib
import hashlib
import threading
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from ..core.door import open_file
from ..core.errors import StoreError
from .clock import Clock

_DIGITS = 16
_MOST_WAITING = 20_000
_LONGEST_ROW = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class WireHead:
    """Where a log stands: number of rows, and the digest of the last."""

    rows: int = 0
    digest: str = ""

    def after(self, row: str) -> WireHead:
        """Return where it stands after one more row."""
        data = (self.digest + row).encode("utf-8", "surrogateescape")
        digest = hashlib.sha256(data).hexdigest()[:_DIGITS]
        return WireHead(rows=self.rows + 1, digest=digest)


class WireLog:
    """The log of one session; rows wait in memory until there is a file for them.

    Parameters
    ----------
    path : Path or None
        Where to append. None: `start` says it, once somebody owns the folder.
    clock : Clock
        Source of both times.
    """

    def __init__(self, path: Path | None, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._file: BinaryIO | None = None
        self._waiting: deque[str] = deque(maxlen=_MOST_WAITING)
        self._is_closed = False
        self._head = WireHead()
        if path is not None:
            self.start(path)

    @property
    def head(self) -> WireHead:
        """Where the file stands."""
        with self._lock:
            return self._head

    def start(self, path: Path) -> None:
        """Append to this file from now on, after what waited; a torn last row is cut.

        Raises
        ------
        OSError
            If it cannot be written.
        StoreError
            If it is no log, or is damaged.
        """
        with self._lock:
            if self._file is not None:
                self._file.close()
            file = path.open("ab", buffering=0)
            try:
                check = check_wire_log(path)
                file.truncate(check.whole_bytes)
                file.seek(check.whole_bytes)
            except BaseException:
                file.close()
                raise
            self._file, self._head = file, check.head
            while self._waiting:
                self._write(self._waiting.popleft())

    def record(self, device: str, direction: str, data: bytes | str) -> None:
        """Append one row; a closed or full log never stops the stage."""
        utc = self._clock.utc().isoformat(timespec="milliseconds")
        what = data if isinstance(data, str) else repr(data)
        what = what.replace("\n", "\\n").replace("\r", "\\r")
        row = f"{self._clock.monotonic_s():.3f} {utc} {device} {direction} {what}"
        with self._lock:
            if self._is_closed:
                return
            if self._file is None:
                self._waiting.append(row)
            else:
                self._write(row)

    def close(self) -> None:
        """Close the file."""
        with self._lock, contextlib.suppress(OSError):
            self._is_closed = True
            if self._file is not None:
                self._file.close()

    def _write(self, row: str) -> None:
        """Write a row with its digest; if the disk refuses, the row is as if unsaid."""
        if self._file is None:
            return
        head = self._head.after(row)
        data = f"{row} #{head.digest}\n".encode("utf-8", "surrogateescape")
        with contextlib.suppress(OSError, ValueError):
            size = self._file.tell()
            if self._file.write(data) == len(data):
                self._head = head
            else:
                self._file.truncate(size)


@dataclass(frozen=True, slots=True, kw_only=True)
class WireCheck:
    """What a log holds: how far it is whole, and which row is not.

    Parameters
    ----------
    head : WireHead
        After the last whole row.
    whole_bytes : int
        Where that row ends; what follows is torn.
    bad_row : int
        The first row, from 1, that does not follow from the one before; 0 if all do.
    digests : tuple of str
        Of all rows, for those who noted where the log stood.
    """

    head: WireHead
    whole_bytes: int
    bad_row: int
    digests: tuple[str, ...]


def check_wire_log(path: Path) -> WireCheck:
    """Walk a log from its first row.

    Raises
    ------
    StoreError
        If it is missing or no file.
    """
    head, whole_bytes, bad_row = WireHead(), 0, 0
    digests: list[str] = []
    with open_file(path, StoreError) as file:
        while line := file.readline(_LONGEST_ROW):
            if not line.endswith(b"\n"):
                break  # torn, or longer than any row of ours
            text = line[:-1].decode("utf-8", "surrogateescape")
            row, _, digest = text.rpartition(" #")
            following = head.after(row)
            if digest != following.digest and not bad_row:
                bad_row = head.rows + 1
            head = WireHead(rows=following.rows, digest=digest[:_DIGITS])
            digests.append(digest)
            whole_bytes += len(line)
    return WireCheck(
        head=head, whole_bytes=whole_bytes, bad_row=bad_row, digests=tuple(digests)
    )


def chained(rows: Iterable[str]) -> bytes:
    """Return the text of a log made of rows that have no digests yet."""
    head, lines = WireHead(), []
    for row in rows:
        head = head.after(row)
        lines.append(f"{row} #{head.digest}\n")
    return "".join(lines).encode("utf-8", "surrogateescape")
