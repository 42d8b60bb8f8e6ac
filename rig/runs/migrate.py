"""Bring a run of an older format to the present one: ``magbend migrate``.

What it held stays in ``.magbend/format_1/``, byte for byte; the records are written
anew with seals and chains; the manifest takes in the derived files that were there. A
run that does not hold by the rules of its own format is refused.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from ...core.derived import file_digest, note_derived
from ...core.door import read_file
from ...core.errors import StoreError
from ...core.files import sync_folder, write_bytes, write_text
from ...core.json import parse_json, read_json
from ...core.owned import MARK, owning_folder, program
from ...core.seal import seal_of, sealed
from ..wire_log import chained
from .read import Run, is_run, read_lines, read_run
from .records import (
    END_FILE,
    PLAN_FILE,
    RUN_FILE,
    SCHEMA,
    SESSIONS_FILE,
    STEP_TABLE_FILE,
    STEPS_FILE,
    WIRE_FILE,
    Record,
    utc_now,
)
from .verify import verify_run
from .verify_files import unaccounted

KEPT = f"{MARK}/format_1"
UNDER_WAY = f"{MARK}/format_1.migrating"
_RECORDS = (RUN_FILE, STEPS_FILE, SESSIONS_FILE, END_FILE, WIRE_FILE)


def migrate_run(path: Path) -> list[str]:
    """Rewrite the records of a run in the present format; return the files rewritten.

    Parameters
    ----------
    path : Path
        Run folder. One of the present format is left as it is.

    Raises
    ------
    StoreError
        If it is no run, its files do not hold, or another process owns it.
    """
    run = read_run(path)
    if run.schema == SCHEMA and not (path / UNDER_WAY).exists():
        return []
    with owning_folder(path, "run", "migrate", ours=is_run):
        if not (path / UNDER_WAY).exists():
            _keep(run)
        names = _rewrite(path)
        (path / UNDER_WAY).rename(path / KEPT)
        sync_folder(path / MARK)
    derived = [path / name for name in unaccounted(read_run(path))]
    if derived:
        note_derived(derived, sources=[], command="magbend migrate (as it was found)")
    return names


def _keep(run: Run) -> None:
    """Copy the old records aside, once, when they are good."""
    problems = verify_run(run.path)
    if problems:
        raise StoreError(
            f"{run.path}: does not hold, and is left as it is: {problems[0]}"
        )
    kept = run.path / UNDER_WAY
    being_made = kept.with_suffix(".tmp")
    shutil.rmtree(being_made, ignore_errors=True)
    being_made.mkdir()
    for name in _RECORDS:
        if (run.path / name).exists():
            data = read_file(run.path / name, 1024.0, StoreError)
            write_bytes(being_made / name, data)
    being_made.rename(kept)
    sync_folder(kept.parent)


def _rewrite(path: Path) -> list[str]:
    kept = path / UNDER_WAY
    old = read_json(kept / RUN_FILE, kind=StoreError)
    names = [name for name in _RECORDS if (kept / name).exists()]
    manifest = {
        **old,
        "schema": SCHEMA,
        "plan_sha256": file_digest(path / PLAN_FILE),
        "migrated": {
            "from_schema": old["schema"],
            "with": program(),
            "time_utc": utc_now(),
            "sha256": {f"{KEPT}/{name}": file_digest(kept / name) for name in names},
        },
    }
    text = sealed(manifest, indent=1)
    first = seal_of(text.encode()) or ""
    for name in (STEPS_FILE, SESSIONS_FILE):
        if name in names:
            write_text(path / name, _chained(kept / name, first))
    if WIRE_FILE in names:
        rows = read_file(kept / WIRE_FILE, 1024.0, StoreError).decode(
            "utf-8", "surrogateescape"
        )
        write_bytes(path / WIRE_FILE, chained(rows.splitlines()))
    write_text(path / RUN_FILE, text)
    if END_FILE in names:
        end = _ending(path, read_json(kept / END_FILE, kind=StoreError))
        write_text(path / END_FILE, sealed(end, indent=1))
    return names


def _chained(path: Path, before: str) -> str:
    """Return the whole lines of a file, each with its seal; a torn last one is left."""
    lines = []
    for line in read_lines(path).lines:
        new = sealed({**dict(parse_json(line)), "after": before})
        before = seal_of(new.encode()) or ""
        lines.append(f"{new}\n")
    return "".join(lines)


def _ending(path: Path, end: Record) -> Record:
    names = (RUN_FILE, PLAN_FILE, STEPS_FILE, SESSIONS_FILE, STEP_TABLE_FILE)
    digests = {n: file_digest(path / n) for n in names if (path / n).is_file()}
    return {**end, "sha256": digests}
