"""What became of each file of a run: good, torn, altered, missing or extra.

From format 2 on every file is accounted for: records by their seals and chains,
pictures by the digests in the step records, derived files by the manifest.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ...core.derived import (
    MANIFEST_FILE,
    FileFinding,
    check_derived,
    compare_digest,
    read_manifest,
)
from ...core.door import inside, read_file
from ...core.errors import StoreError
from ...core.json import parse_json
from ...core.owned import MARK, altered_marks
from ...core.seal import is_whole, seal_of
from ..wire_log import WireCheck, check_wire_log
from .read import Run, read_lines
from .records import (
    AMENDMENTS_FILE,
    END_FILE,
    IMAGES,
    PLAN_FILE,
    RUN_FILE,
    SESSIONS_FILE,
    STEP_TABLE_FILE,
    STEPS_FILE,
    WIRE_FILE,
)
from .step_table import step_table

_MOST_FILES = 1_000_000


def check_files(run: Run) -> Iterator[FileFinding]:
    """Yield what became of every file of a run of format 2."""
    root, end = run.path, run.end
    found: dict[str, FileFinding] = {}
    for finding in check_records(run):
        found.setdefault(finding.name, finding)
    for step in run.steps:
        for file in step["files"]:
            finding = compare_digest(root, file["path"], file["sha256"])
            found.setdefault(finding.name, finding)
    for name, digest in (end or {}).get("sha256", {}).items():
        if name not in found or found[name].status in ("good", "torn"):
            found[name] = compare_digest(root, name, digest)
    try:
        found.update((one.name, one) for one in check_derived(root))
        if read_manifest(root):
            found[MANIFEST_FILE] = FileFinding(name=MANIFEST_FILE, status="good")
    except StoreError as error:
        found[MANIFEST_FILE] = FileFinding(
            name=MANIFEST_FILE, status="altered", detail=str(error)
        )
    yield from found.values()
    yield from _extra(run, set(found))


def check_records(run: Run) -> Iterator[FileFinding]:
    """Yield what became of the run's own records, by their seals and chains."""
    root = run.path
    data = read_file(root / RUN_FILE, kind=StoreError)
    yield _sealed(RUN_FILE, data)
    yield compare_digest(root, PLAN_FILE, str(run.manifest.get("plan_sha256")))
    first = seal_of(data) or ""
    for name in (STEPS_FILE, SESSIONS_FILE, AMENDMENTS_FILE):
        if (root / name).exists():
            yield _chain(root / name, first)
        elif name == STEPS_FILE and (run.end or {}).get("steps"):
            yield FileFinding(name=name, status="missing")
    if run.end is not None:
        yield _sealed(END_FILE, read_file(root / END_FILE, kind=StoreError))
    yield from _wire_log(run)
    kept = (run.manifest.get("migrated") or {}).get("sha256") or {}
    for name, digest in kept.items():
        yield compare_digest(root, str(name), str(digest))
    for name in altered_marks(root):
        yield FileFinding(name=name, status="altered", detail="its seal is broken")
    for path in sorted((root / MARK).glob("*")):
        if path.name.endswith(".tmp"):
            yield _unknown(run, f"{MARK}/{path.name}")
        elif path.is_file():
            yield FileFinding(name=f"{MARK}/{path.name}", status="good")


def _sealed(name: str, data: bytes) -> FileFinding:
    if is_whole(data):
        return FileFinding(name=name, status="good")
    return FileFinding(name=name, status="altered", detail="its seal is broken")


def _chain(path: Path, before: str) -> FileFinding:
    """Check that each line is whole and follows the one before it."""
    name = path.name
    found = read_lines(path)
    for number, line in enumerate(found.lines, start=1):
        why = ""
        if not is_whole(line):
            why = f"line {number} is not as it was written"
        elif parse_json(line).get("after") != before:
            why = f"a line before line {number} is missing"
        if why:
            return FileFinding(name=name, status="altered", detail=why)
        before = seal_of(line) or ""
    if found.torn:
        detail = f"the last line, {len(found.torn)} bytes"
        return FileFinding(name=name, status="torn", detail=detail)
    return FileFinding(name=name, status="good")


def _wire_log(run: Run) -> Iterator[FileFinding]:
    """Check the chain of rows, and that it goes on as far as the records say."""
    path = run.path / WIRE_FILE
    heads = [record.get("wire_log") for record in (*run.steps, run.end or {})]
    noted = [head for head in heads if isinstance(head, dict)]
    if not path.exists():
        if noted:
            yield FileFinding(name=WIRE_FILE, status="missing")
        return
    try:
        check = check_wire_log(path)
    except StoreError as error:
        yield FileFinding(name=WIRE_FILE, status="altered", detail=str(error))
        return
    why = _why_not_whole(check, noted)
    if why:
        yield FileFinding(name=WIRE_FILE, status="altered", detail=why)
    elif check.whole_bytes != path.stat().st_size:
        yield FileFinding(name=WIRE_FILE, status="torn", detail="the last row")
    else:
        yield FileFinding(name=WIRE_FILE, status="good")


def _why_not_whole(check: WireCheck, noted: list[dict[str, Any]]) -> str:
    if check.bad_row:
        return f"row {check.bad_row} does not follow from the one before"
    for head in noted:
        rows = head.get("rows")
        if not isinstance(rows, int) or not 0 <= rows <= len(check.digests):
            return f"it had {rows} rows and has {len(check.digests)}"
        if rows and check.digests[rows - 1] != head.get("digest"):
            return f"row {rows} is not the one that was recorded"
    return ""


def unaccounted(run: Run) -> list[str]:
    """Return the names of files of which nothing says what made them."""
    return [one.name for one in check_files(run) if one.status == "extra"]


def _extra(run: Run, known: set[str]) -> Iterator[FileFinding]:
    """Yield the files that nobody accounts for."""
    root = run.path
    count = 0
    for at, folders, files in os.walk(root):
        links = [name for name in folders if (Path(at) / name).is_symlink()]
        for name in sorted((*files, *links)):
            count += 1
            if count > _MOST_FILES:
                raise StoreError(f"{root}: holds more than {_MOST_FILES} files")
            inner = (Path(at) / name).relative_to(root).as_posix()
            if inner not in known:
                yield _unknown(run, inner)


def _unknown(run: Run, name: str) -> FileFinding:
    try:
        path = inside(run.path, name, StoreError)
    except StoreError:
        detail = "a link that leaves the folder"
        return FileFinding(name=name, status="extra", detail=detail)
    if not run.is_finished and path.name.endswith(".tmp"):
        return FileFinding(name=name, status="torn", detail="a write that was cut off")
    if run.end is None and name == STEP_TABLE_FILE:
        # Written just before the ending; it says what the records say, or is altered.
        table = step_table(run.steps).encode()
        is_same = read_file(path, kind=StoreError) == table
        return FileFinding(name=name, status="good" if is_same else "altered")
    detail = "nothing says what made it"
    if name.startswith(f"{IMAGES}/") and not run.is_finished:
        detail = (
            "a photograph without a record: the run was cut off just then, or the "
            "record was taken away"
        )
    return FileFinding(name=name, status="extra", detail=detail)
