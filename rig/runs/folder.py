"""Write a run folder so that a finished step is never lost and never doubled.

A step is a transaction: its photograph is written under a temporary name, synced and
renamed; only then one line is appended to ``steps.jsonl`` and synced. Before that line
the step does not exist, after it the step is complete, and there is nothing between.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import FrameType

from ...core.errors import StoreError
from ...core.files import sync_folder, write_bytes, write_text
from .read import is_run, read_run, read_steps
from .records import (
    END_FILE,
    IMAGES,
    PLAN_FILE,
    RUN_FILE,
    SESSIONS_FILE,
    STEP_TABLE_FILE,
    STEPS_FILE,
    WIRE_FILE,
    Record,
    image_name,
    sha256_of,
    sha256_of_file,
    utc_now,
)
from .step_table import step_table


class RunFolder:
    """A run folder open for writing; made by `create` or `reopen`."""

    def __init__(self, path: Path, done: frozenset[int]) -> None:
        self.path = path
        self.done = set(done)

    @classmethod
    def create(cls, path: Path, manifest: Record, plan_text: str) -> RunFolder:
        """Make the folder and write the manifest, before anything moves.

        Raises
        ------
        StoreError
            If `path` is a run already, holds other files, or cannot be written.
        """
        if is_run(path):
            raise StoreError(
                f"{path}: holds a run already; add --resume to go on with it, or name "
                f"another folder with --out"
            )
        if path.exists() and (not path.is_dir() or _foreign(path)):
            raise StoreError(f"{path}: exists and is not an empty folder")
        with _store_errors(path):
            (path / IMAGES).mkdir(parents=True, exist_ok=True)
            write_text(path / PLAN_FILE, plan_text)
            sync_folder(path.parent)
            write_text(path / RUN_FILE, _dumps(manifest, indent=1) + "\n")
        return cls(path, frozenset())

    @classmethod
    def reopen(cls, path: Path) -> RunFolder:
        """Open an unfinished run: cut a torn last line off, keep every finished step.

        Raises
        ------
        StoreError
            If it is no run, is finished, or its records are damaged.
        """
        run = read_run(path)
        if run.is_finished:
            raise StoreError(f"{path}: is finished; there is nothing left to resume")
        lines = read_steps(path / STEPS_FILE)
        with _store_errors(path):
            if lines.torn:
                _truncate(path / STEPS_FILE, lines.whole_bytes)
            (path / IMAGES).mkdir(exist_ok=True)
            for leftover in path.rglob(".*.tmp"):
                leftover.unlink()
        folder = cls(path, frozenset(step["index"] for step in lines.steps))
        folder.start_session({"previous_end": run.end, "steps_done": len(folder.done)})
        with _store_errors(path):
            (path / END_FILE).unlink(missing_ok=True)
            sync_folder(path)
        return folder

    def start_session(self, record: Record) -> None:
        """Append to ``sessions.jsonl`` that somebody went on with the run.

        Raises
        ------
        StoreError
            If it cannot be written.
        """
        with _store_errors(self.path):
            line = _dumps({"time_utc": utc_now(), **record})
            _append_line(self.path / SESSIONS_FILE, line)

    def commit_step(self, record: Record, images: Mapping[str, bytes]) -> Record:
        """Write the photographs, then the record that makes the step exist.

        Parameters
        ----------
        record : dict
            The step without its ``files``.
        images : mapping of str to bytes
            Encoded pictures under their path inside the run folder.

        Returns
        -------
        dict
            The record as written, with ``files``.

        Raises
        ------
        StoreError
            If the step is there already, or the disk refuses: then the step does not
            exist and every earlier one is untouched.
        """
        index = record["index"]
        if index in self.done:
            raise StoreError(f"{self.path}: step {index} is recorded already")
        files = [
            {"path": name, "sha256": sha256_of(data), "bytes": len(data)}
            for name, data in images.items()
        ]
        complete = {**record, "files": files}
        with _interrupts_later(), _store_errors(self.path):
            for name, data in images.items():
                write_bytes(self.path / name, data)
            _append_line(self.path / STEPS_FILE, _dumps(complete))
            self.done.add(index)
        return complete

    def finish(self, status: str, reason: str) -> Record:
        """Write ``end.json``, the last file, with the hashes of the run's own records.

        Raises
        ------
        StoreError
            If it cannot be written; the run then counts as cut off.
        """
        # Not the wire log: closing the devices is still written to it.
        names = (RUN_FILE, PLAN_FILE, STEPS_FILE, SESSIONS_FILE)
        steps = read_steps(self.path / STEPS_FILE).steps
        with _interrupts_later(), _store_errors(self.path):
            write_text(self.path / STEP_TABLE_FILE, step_table(steps))
            end = {
                "status": status,
                "reason": reason,
                "time_utc": utc_now(),
                "steps": len(self.done),
                "sha256": {
                    name: sha256_of_file(self.path / name)
                    for name in names
                    if (self.path / name).is_file()
                },
            }
            write_text(self.path / END_FILE, _dumps(end, indent=1) + "\n")
        return end

    def image_name(self, index: int) -> str:
        """Return the path of a step's photograph inside the folder."""
        return image_name(index)


def _foreign(path: Path) -> bool:
    # A folder in which an earlier attempt died before run.json holds at most these.
    ours = {PLAN_FILE, IMAGES, WIRE_FILE}
    return any(
        entry.name not in ours and not entry.name.endswith(".tmp")
        for entry in path.iterdir()
    )


def _dumps(record: Record, indent: int | None = None) -> str:
    return json.dumps(record, ensure_ascii=False, allow_nan=False, indent=indent)


def _append_line(path: Path, line: str) -> None:
    """Append one line and sync it; if the disk refuses, take the torn part back."""
    is_new = not path.exists()
    with path.open("ab", buffering=0) as file:
        size = file.tell()
        data = (line + "\n").encode("utf-8")
        try:
            written = 0
            while written < len(data):
                written += file.write(data[written:]) or 0
            os.fsync(file.fileno())
        except OSError:
            with contextlib.suppress(OSError):
                file.truncate(size)
            raise
    if is_new:
        sync_folder(path.parent)


def _truncate(path: Path, size: int) -> None:
    with path.open("r+b") as file:
        file.truncate(size)
        os.fsync(file.fileno())


@contextlib.contextmanager
def _store_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        name = error.filename or path
        raise StoreError(
            f"{name}: cannot be written: {error.strerror or error}; the finished steps "
            f"are safe, free the disk and go on with --resume"
        ) from error


@contextlib.contextmanager
def _interrupts_later() -> Iterator[None]:
    """Hold Ctrl-C back while a record is being written: at most a few fsyncs."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[tuple[int, FrameType | None]] = []
    signals = (signal.SIGINT, signal.SIGTERM)
    previous = {number: signal.getsignal(number) for number in signals}
    for number in signals:
        signal.signal(number, lambda *arguments: received.append(arguments))
    try:
        yield
    finally:
        for number in signals:
            signal.signal(number, previous[number])
        for late, frame in received[:1]:
            handler = previous[signal.Signals(late)]
            if callable(handler):
                handler(late, frame)
            elif handler == signal.SIG_DFL:
                signal.raise_signal(late)
