"""Write a run folder so that a finished step is never lost and never doubled.

A step is a transaction: its photograph is written under a temporary name, synced and
renamed; only then one line is appended to ``steps.jsonl`` and synced. Before that line
the step does not exist, after it the step is complete, and there is nothing between.
Each line holds the seal of the one before, the first that of ``run.json``.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from types import FrameType

from ...core.derived import file_digest
from ...core.errors import StoreError
from ...core.files import sync_folder, write_bytes, write_text
from ...core.owned import MARK
from ...core.seal import seal_of, sealed
from ..wire_log import WireLog
from .read import is_run, read_lines, read_run, read_steps
from .records import (
    END_FILE,
    IMAGES,
    PLAN_FILE,
    RUN_FILE,
    SCHEMA,
    SESSIONS_FILE,
    STEP_TABLE_FILE,
    STEPS_FILE,
    WIRE_FILE,
    Record,
    image_name,
    sha256_of,
    utc_now,
)
from .step_table import step_table


class RunFolder:
    """A run folder open for writing; made by `create` or `reopen` while it is owned."""

    def __init__(
        self, path: Path, done: Mapping[int, str], log: WireLog | None = None
    ) -> None:
        self.path = path
        self.done = dict(done)
        self._log = log
        run_seal = seal_of((path / RUN_FILE).read_bytes()) or ""
        names = (STEPS_FILE, SESSIONS_FILE)
        self._after = {name: _last_seal(path / name) or run_seal for name in names}
        self._sizes = {name: _size(path / name) for name in names}

    @classmethod
    def create(
        cls, path: Path, manifest: Record, plan_text: str, log: WireLog | None = None
    ) -> RunFolder:
        """Write the manifest into a folder that is owned, before anything moves.

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
            _sweep(path)
            write_text(path / PLAN_FILE, plan_text)
            sync_folder(path.parent)
            digest = file_digest(path / PLAN_FILE)
            sealable = {**manifest, "schema": SCHEMA, "plan_sha256": digest}
            write_text(path / RUN_FILE, sealed(sealable, indent=1))
            if log is not None:
                log.start(path / WIRE_FILE)
        return cls(path, {}, log)

    @classmethod
    def reopen(cls, path: Path, log: WireLog | None = None) -> RunFolder:
        """Open an unfinished run: cut a torn last line off, keep every finished step.

        Raises
        ------
        StoreError
            If it is no run, is finished, of an older format, or its records are
            damaged.
        """
        run = read_run(path)
        if run.is_finished:
            raise StoreError(f"{path}: is finished; there is nothing left to resume")
        if run.schema < SCHEMA:
            raise StoreError(
                f"{path}: is a run of format {run.schema}; bring it to format "
                f"{SCHEMA} first: magbend migrate {path}"
            )
        lines = read_steps(path / STEPS_FILE)
        with _store_errors(path):
            for name in (STEPS_FILE, SESSIONS_FILE):
                whole = read_lines(path / name)
                if whole.torn:
                    _truncate(path / name, whole.whole_bytes)
            (path / IMAGES).mkdir(exist_ok=True)
            _sweep(path)
            if log is not None:
                log.start(path / WIRE_FILE)
        done = {step["index"]: str(step.get("seal", "")) for step in lines.steps}
        folder = cls(path, done, log)
        folder.start_session({"previous_end": run.end, "steps_done": len(folder.done)})
        with _store_errors(path):
            for name in (END_FILE, STEP_TABLE_FILE):
                (path / name).unlink(missing_ok=True)
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
            self._append(SESSIONS_FILE, {"time_utc": utc_now(), **record})

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
            raise StoreError(f"{self.path}: step {index + 1} is recorded already")
        files = [
            {"path": name, "sha256": sha256_of(data), "bytes": len(data)}
            for name, data in images.items()
        ]
        complete = {**record, "files": files}
        if self._log is not None:
            complete["wire_log"] = asdict(self._log.head)
        with _interrupts_later(), _store_errors(self.path):
            try:
                for name, data in images.items():
                    write_bytes(self.path / name, data)
                self.done[index] = self._append(STEPS_FILE, complete)
            except (OSError, StoreError):
                for name in images:
                    with contextlib.suppress(OSError):
                        (self.path / name).unlink()
                raise
        return complete

    def finish(self, status: str, reason: str) -> Record:
        """Write ``end.json``, the last file, with the digests of the run's own records.

        What the folder holds is compared with what was done: a run whose records were
        taken away meanwhile has failed, whatever `status` says.

        Returns
        -------
        dict
            What ``end.json`` holds.

        Raises
        ------
        StoreError
            If it cannot be written; the run then counts as cut off.
        """
        names = (RUN_FILE, PLAN_FILE, STEPS_FILE, SESSIONS_FILE, STEP_TABLE_FILE)
        with _interrupts_later(), _store_errors(self.path):
            (self.path / IMAGES).mkdir(exist_ok=True)
            steps = read_steps(self.path / STEPS_FILE).steps
            lost = self._lost(steps)
            if lost and status == "success":
                status, reason = "fail", f"{lost}; go on with --resume"
            write_text(self.path / STEP_TABLE_FILE, step_table(steps))
            end = {
                "status": status,
                "reason": reason,
                "time_utc": utc_now(),
                "steps": len(steps),
                "sha256": {
                    name: file_digest(self.path / name)
                    for name in names
                    if (self.path / name).is_file()
                },
            }
            if self._log is not None:
                end["wire_log"] = asdict(self._log.head)
            write_text(self.path / END_FILE, sealed(end, indent=1))
        return end

    def _lost(self, steps: tuple[Record, ...]) -> str:
        """Return what the folder no longer holds of the steps that were done."""
        recorded = {step["index"]: step.get("seal", "") for step in steps}
        for index, seal in self.done.items():
            if recorded.get(index) != seal:
                what = "altered" if index in recorded else "missing"
                return f"step {index + 1} was recorded and is {what} in {STEPS_FILE}"
        for step in steps:
            for file in step["files"]:
                path = self.path / file["path"]
                if not path.is_file() or path.stat().st_size != file["bytes"]:
                    return f"{file['path']} was written and is missing or altered"
        return ""

    def _append(self, name: str, record: Record) -> str:
        """Append a line that is chained to the one before; return its seal."""
        if _size(self.path / name) != self._sizes[name]:
            raise StoreError(
                f"{self.path / name}: was changed or removed by somebody else while "
                f"the run went on"
            )
        line = sealed({**record, "after": self._after[name]})
        _append_line(self.path / name, line)
        self._sizes[name] = _size(self.path / name)
        self._after[name] = seal_of(line.encode()) or ""
        return self._after[name]

    def image_name(self, index: int) -> str:
        """Return the path of a step's photograph inside the folder."""
        return image_name(index)


def _last_seal(path: Path) -> str:
    lines = read_lines(path).lines
    return (seal_of(lines[-1]) or "") if lines else ""


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def _sweep(path: Path) -> None:
    """Remove what a killed attempt left half written; the folder is ours."""
    for leftover in path.rglob(".*.tmp"):
        leftover.unlink()


def _foreign(path: Path) -> bool:
    # A folder in which an earlier attempt died before run.json holds at most these.
    ours = {MARK, PLAN_FILE, IMAGES, WIRE_FILE}
    return any(
        entry.name not in ours and not entry.name.endswith(".tmp")
        for entry in path.iterdir()
    )


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
