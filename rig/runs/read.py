"""Read a run folder, also one that was cut off in the middle of a word.

A folder may come from a stranger: every file goes through the guarded door, and what is
not of the form of a record is refused here, so that nobody after has to ask again.
"""

from __future__ import annotations

import contextlib
import logging
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.checks import shown
from ...core.door import read_file
from ...core.errors import StoreError
from ...core.json import parse_json, read_json
from .records import AMENDMENTS_FILE, END_FILE, RUN_FILE, SCHEMA, STEPS_FILE, Record

logger = logging.getLogger(__name__)

_MOST_STEPS = 20_000
_MOST_MB = 256.0


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
    def schema(self) -> int:
        """Format of its files."""
        return int(self.manifest["schema"])

    @property
    def status(self) -> str:
        """How it ended: success, abort, fail, or cut off."""
        return str(self.end["status"]) if self.end else "cut off"

    @property
    def is_finished(self) -> bool:
        """Whether every planned step was taken and the ending was written."""
        return self.status == "success"


@dataclass(frozen=True, slots=True, kw_only=True)
class Lines:
    """The whole lines of a file, where the last one ends, and what follows it."""

    lines: tuple[bytes, ...]
    whole_bytes: int
    torn: bytes


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
    if not (path / RUN_FILE).exists():
        raise StoreError(f"{path}: is not a run folder, since it has no {RUN_FILE}")
    manifest = _manifest(path / RUN_FILE)
    lines = read_steps(path / STEPS_FILE)
    end = _end(path / END_FILE)
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
        path=path, manifest=manifest, steps=_amended(lines.steps, path), end=end,
        warnings=tuple(warnings),
    )  # fmt: skip


def read_lines(path: Path) -> Lines:
    """Read the lines of a file; whatever follows the last line break is torn.

    Raises
    ------
    StoreError
        If it is no regular file, or cannot be read.
    """
    data = read_file(path, _MOST_MB, StoreError) if path.exists() else b""
    whole, newline, torn = data.rpartition(b"\n")
    lines = tuple(whole.split(b"\n")) if newline else ()
    return Lines(lines=lines, whole_bytes=len(whole) + len(newline), torn=torn)


def read_objects(path: Path) -> Iterator[Record]:
    """Yield the objects of a file of lines; a damaged line says nothing."""
    for line in read_lines(path).lines:
        with contextlib.suppress(ValueError):
            record = parse_json(line)
            if isinstance(record, dict):
                yield record


def read_steps(path: Path) -> StepLines:
    """Read the step records; whatever follows the last line break is torn.

    Raises
    ------
    StoreError
        If a line before the last cannot be read, or a step is recorded twice.
    """
    found = read_lines(path)
    torn, whole_bytes = found.torn, found.whole_bytes
    if len(found.lines) > _MOST_STEPS:
        raise StoreError(f"{path}: must not hold more than {_MOST_STEPS} steps")
    steps: list[Record] = []
    for number, line in enumerate(found.lines, start=1):
        try:
            steps.append(_step(line))
        except ValueError as error:
            if number == len(found.lines) and not torn:
                # A lost disk block at the end can be followed by a line break: torn.
                torn = line + b"\n"
                whole_bytes -= len(torn)
                break
            raise StoreError(
                f"{path}, line {number}: is damaged and cannot be read ({error})"
            ) from None
    doubled = [i for i, n in Counter(step["index"] for step in steps).items() if n > 1]
    if doubled:
        raise StoreError(f"{path}: step {min(doubled) + 1} is recorded more than once")
    return StepLines(steps=tuple(steps), whole_bytes=whole_bytes, torn=torn)


def _step(line: bytes) -> Record:
    """Return a step record whose parts have the types that every reader expects.

    Raises
    ------
    ValueError
        If it is no such record.
    """
    record: Record = parse_json(line)
    well = isinstance(record, dict) and isinstance(record.get("settle", {}), dict)
    if not well:
        raise ValueError("it is no object, or settle is none")
    index = record.get("index")
    if type(index) is not int or not 0 <= index < _MOST_STEPS:
        raise ValueError(f"index is {shown(index)}")
    record["files"] = _files(record.get("files"))
    flags = record.get("flags") or []
    if not isinstance(flags, list) or not all(isinstance(f, str) for f in flags):
        raise ValueError("flags are no list of words")
    for name in ("gap_mm", "stage_mm", "flux_mT", "flux_sd_mT", "brightness"):
        value = record.get(name)
        if value is not None and type(value) not in (int, float):
            raise ValueError(f"{name} is {shown(value)}, which is no number")
    return record


def _files(found: Any) -> list[Record]:
    files = [] if found is None else found
    well = isinstance(files, list) and all(
        isinstance(file, dict)
        and isinstance(file.get("path"), str)
        and isinstance(file.get("sha256"), str)
        and type(file.get("bytes")) is int
        for file in files
    )
    if not well:
        raise ValueError("files are no list of paths, digests and sizes")
    return files


def _manifest(path: Path) -> Record:
    """Return ``run.json``, of a format that is known, with the parts readers expect."""
    record = read_json(path, kind=StoreError)
    schema = record.get("schema")
    if type(schema) is not int or schema < 1:
        raise StoreError(f"{path}: names no format (schema is {shown(schema)})")
    if schema > SCHEMA:
        raise StoreError(
            f"{path}: was written by a newer magbend (format {schema}; this one reads "
            f"up to {SCHEMA}); update magbend"
        )
    for name in ("plan", "specimen", "rig"):
        if not isinstance(record.get(name, {}), dict):
            raise StoreError(f"{path}: {name} must be an object")
    gaps = record.get("plan", {}).get("gaps_mm", [])
    if not isinstance(gaps, list) or len(gaps) > _MOST_STEPS:
        raise StoreError(f"{path}: plan.gaps_mm must be a list of gaps")
    for name in ("bench", "magnet"):
        if not isinstance(record.get("rig", {}).get(name) or {}, dict):
            raise StoreError(f"{path}: rig.{name} must be an object")
    return record


def _end(path: Path) -> Record | None:
    if not path.exists():
        return None
    record = read_json(path, kind=StoreError)
    if not isinstance(record.get("status"), str):
        raise StoreError(f"{path}: status is {shown(record.get('status'))}")
    digests = record.setdefault("sha256", {})
    well = isinstance(digests, dict) and all(
        isinstance(digest, str) for digest in digests.values()
    )
    if not well:
        raise StoreError(f"{path}: sha256 must be an object of digests")
    return record


def _amended(steps: tuple[Record, ...], path: Path) -> tuple[Record, ...]:
    """Return the steps with the readings that were corrected (see `amend`)."""
    found: dict[int, Record] = {}
    for record in read_objects(path / AMENDMENTS_FILE):
        if type(record.get("index")) is int:
            found[record["index"]] = record
    return tuple(
        {**step, **_corrected(step, found[step["index"]])}
        if step["index"] in found
        else step
        for step in steps
    )


def _corrected(step: Record, amendment: Record) -> Record:
    field = amendment.get("field") or {}
    flags = [flag for flag in step.get("flags", []) if flag != "field_disagrees"]
    return {
        "flux_mT": amendment.get("flux_mT"),
        "flux_sd_mT": None,
        "flux_samples": 1,
        "flux_status": "manual",
        "flux_amended": True,
        "field": field,
        "flags": ["field_disagrees", *flags] if field.get("sentence") else flags,
    }
