"""``manifest.json``: from what, by which command, each derived file was made.

Digests of a file and of all it was made from: so a reader can tell a file that was
altered from one whose inputs were, and both from a file that nobody accounts for.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from .door import inside, open_file, read_file
from .errors import StoreError
from .files import write_text
from .json import parse_json
from .owned import owning_folder, program, root_of
from .seal import is_whole, sealed

MANIFEST_FILE = "manifest.json"
SCHEMA = 1
_PIECE = 1 << 20

FileStatus = Literal["good", "torn", "altered", "missing", "extra", "older input"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FileFinding:
    """What was found of one file: its name in the folder, its status, and details."""

    name: str
    status: FileStatus
    detail: str = ""

    @property
    def is_problem(self) -> bool:
        """Whether it is more than a last line that a power cut tore."""
        return self.status not in ("good", "torn")

    @property
    def sentence(self) -> str:
        """The finding in a line, for people."""
        detail = f" ({self.detail})" if self.detail else ""
        return f"{self.name}: {self.status}{detail}"


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a regular file, as 64 hexadecimal digits.

    Raises
    ------
    StoreError
        If it is missing, unreadable or no file.
    """
    with open_file(path, StoreError) as file:
        try:
            digest = hashlib.sha256()
            while piece := file.read(_PIECE):
                digest.update(piece)
            return digest.hexdigest()
        except OSError as error:
            raise StoreError(f"{path}: cannot be read: {error.strerror}") from None


def note_derived(
    outputs: Iterable[Path], *, sources: Iterable[Path], command: str
) -> None:
    """Note in its folder what files were made from, once they are written.

    Files that lie in no folder of ours are not noted: nobody looks for it there.

    Parameters
    ----------
    outputs : iterable of Path
        Files that were made, in folders of ours or anywhere.
    sources : iterable of Path
        What they were made from; names of files elsewhere are kept without their place.
    command : str
        What made them: ``analysis compare``.

    Raises
    ------
    StoreError
        If a file is gone, the manifest is damaged, or another process owns the folder.
    """
    roots: dict[Path, list[Path]] = {}
    for path in outputs:
        root = root_of(path)
        if root is not None:
            roots.setdefault(root, []).append(path.resolve())
    known = [path.resolve() for path in sources] if roots else []
    for root, made in roots.items():
        with owning_folder(root, "folder", command):
            entry = {
                "by": command,
                "with": program(),
                "time_utc": datetime.now(UTC).isoformat(timespec="seconds"),
                **_sources(root, known),
            }
            files = read_manifest(root)
            for path in made:
                name = path.relative_to(root).as_posix()
                size = path.stat().st_size
                files[name] = {"sha256": file_digest(path), "bytes": size, **entry}
            text = sealed({"schema": SCHEMA, "files": files}, indent=1)
            write_text(root / MANIFEST_FILE, text)


def _sources(root: Path, known: Iterable[Path]) -> dict[str, dict[str, str]]:
    found: dict[str, dict[str, str]] = {"from": {}, "from_elsewhere": {}}
    for path in known:
        digest = file_digest(path)
        if path.is_relative_to(root):
            found["from"][path.relative_to(root).as_posix()] = digest
        else:
            found["from_elsewhere"][path.name] = digest
    return found


def read_manifest(root: Path) -> dict[str, Any]:
    """Return the entries of a folder's manifest by file name; none if it has none.

    Raises
    ------
    StoreError
        If it is damaged or of a newer version.
    """
    path = root / MANIFEST_FILE
    if not path.exists():
        return {}
    data = read_file(path, 64.0, StoreError)
    try:
        manifest = parse_json(data) if is_whole(data) else {}
        schema, files = manifest["schema"], manifest["files"]
        well = all(isinstance(entry["sha256"], str) for entry in files.values())
        well = well and all(isinstance(e.get("from"), dict) for e in files.values())
    except (ValueError, KeyError, TypeError, AttributeError):
        schema, files, well = SCHEMA, {}, False
    if schema != SCHEMA:
        raise StoreError(f"{path}: is of format {schema}, which is not known here")
    if not well:
        raise StoreError(
            f"{path}: is altered or damaged; remove it, and make the derived files anew"
        )
    return dict(files)


def check_derived(
    root: Path, names: Iterable[str] | None = None
) -> Iterator[FileFinding]:
    """Yield what became of each derived file, or of those of the given names.

    Raises
    ------
    StoreError
        If the manifest itself is damaged.
    """
    files = read_manifest(root)
    digests: dict[str, str] = {}
    for name in files if names is None else names:
        entry = files.get(name)
        if entry is None:
            continue
        status = compare_digest(root, name, entry["sha256"])
        if status.status != "good":
            yield status
            continue
        older = [
            source
            for source, digest in entry["from"].items()
            if _digest_in(root, source, digests) != digest
        ]
        if older:
            detail = f"{', '.join(sorted(older)[:4])} changed since; run {entry['by']}"
            yield FileFinding(name=name, status="older input", detail=detail)
        else:
            yield status


def compare_digest(root: Path, name: str, digest: str) -> FileFinding:
    """Return whether a file of the folder is there and has that digest."""
    try:
        path = inside(root, name, StoreError)
        if not path.exists():
            return FileFinding(name=name, status="missing")
        is_same = file_digest(path) == digest
    except StoreError as error:
        return FileFinding(name=name, status="altered", detail=str(error))
    if is_same:
        return FileFinding(name=name, status="good")
    return FileFinding(name=name, status="altered", detail="its SHA-256 differs")


def _digest_in(root: Path, name: str, known: dict[str, str]) -> str:
    if name not in known:
        try:
            known[name] = file_digest(inside(root, name, StoreError))
        except StoreError:
            known[name] = ""
    return known[name]
