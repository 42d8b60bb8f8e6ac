"""Read a run folder, also one that was cut off in the middle of a word."""

from __future__ import annotations

import json
import logging
from dataclasses import dataclass
from pathlib import Path

from ...core.errors import StoreError
from .records import END_FILE, RUN_FILE, STEPS_FILE, Record

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A run as it stands on the disk.

    Parameters
    ----------
    path : Path
        The folder.
    manifest : dict
        What ``run.json`` holds: plan, specimen, rig, devices, versions.
    steps : tuple of dict
        The finished steps, in the order in which they were taken, one record an index.
    end : dict or None
        What ``end.json`` holds; None if the run was cut off.
    warnings : tuple of str
        What was odd about the files: a torn last line, a missing ending.
    """

    path: Path
    manifest: Record
    steps: tuple[Record, ...]
    end: Record | None
    warnings: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the run, as its plan gives it."""
        return str(self.manifest.get("name", self.path.name))

    @property
    def status(self) -> str:
        """How it ended: success, abort, fail, or cut off."""
        return str(self.end["status"]) if self.end else "cut off"

    @property
    def is_finished(self) -> bool:
        """Whether every planned step was taken and the ending was written."""
        return self.status == "success"


@dataclass(frozen=True, slots=True, kw_only=True)
class StepLines:
    """The finished steps, and where in the file the last whole line ends."""

    steps: tuple[Record, ...]
    whole_bytes: int
    torn: bytes


def is_run(path: Path) -> bool:
    """Return whether `path` is a run folder."""
    return (path / RUN_FILE).is_file()


def read_run(path: Path) -> Run:
    """Read a run folder.

    A torn last line of ``steps.jsonl`` and a missing ``end.json`` are what a power cut
    leaves behind: they are tolerated and named in `Run.warnings`.

    Raises
    ------
    StoreError
        If the folder is no run, or a file in it is damaged before its last line.
    """
    if not path.is_dir():
        raise StoreError(f"{path}: there is no such run folder")
    manifest = _read_object(path / RUN_FILE)
    if manifest is None:
        raise StoreError(f"{path}: is not a run folder, since it has no {RUN_FILE}")
    lines = read_steps(path / STEPS_FILE)
    end = _read_object(path / END_FILE)
    warnings = []
    if lines.torn:
        warnings.append(
            f"{STEPS_FILE}: the last line is torn ({len(lines.torn)} bytes) and was "
            f"ignored"
        )
    if end is None:
        warnings.append(
            f"{END_FILE} is missing: the run was cut off and can be resumed"
        )
    for warning in warnings:
        logger.info("%s: %s", path, warning)
    return Run(
        path=path, manifest=manifest, steps=lines.steps, end=end,
        warnings=tuple(warnings),
    )  # fmt: skip


def read_steps(path: Path) -> StepLines:
    """Read the step records; whatever follows the last line break is torn.

    Raises
    ------
    StoreError
        If a line before the last cannot be read, or a step is recorded twice.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        data = b""
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from None
    whole, newline, torn = data.rpartition(b"\n")
    whole_bytes = len(whole) + len(newline)
    steps: list[Record] = []
    for number, line in enumerate(whole.split(b"\n") if newline else [], start=1):
        is_last = (
            not torn and whole_bytes == len(data) and number == whole.count(b"\n") + 1
        )
        record = _step(line)
        if record is None and is_last:
            # A lost disk block at the end can be followed by a line break: torn too.
            torn = line + newline
            whole_bytes -= len(torn)
            break
        if record is None:
            raise StoreError(f"{path}, line {number}: is damaged and cannot be read")
        steps.append(record)
    indices = [step["index"] for step in steps]
    doubled = sorted({index for index in indices if indices.count(index) > 1})
    if doubled:
        raise StoreError(f"{path}: step {doubled[0]} is recorded more than once")
    return StepLines(steps=tuple(steps), whole_bytes=whole_bytes, torn=torn)


def _step(line: bytes) -> Record | None:
    try:
        record = json.loads(line)
    except ValueError:
        return None
    if not isinstance(record, dict) or not isinstance(record.get("index"), int):
        return None
    return record


def _read_object(path: Path) -> Record | None:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from None
    if not isinstance(data, dict):
        raise StoreError(f"{path}: must hold one JSON object")
    return data
