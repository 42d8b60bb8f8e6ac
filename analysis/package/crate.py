"""A data package for a paper's supplement: runs, tables and figures as an RO-Crate.

The ZIP holds ``ro-crate-metadata.json`` (RO-Crate 1.1, JSON-LD), which describes every
file with its kind, size and SHA-256, and names title, authors, licence and software;
``README.txt`` says the same to people. Its bytes depend on its content alone.
"""

from __future__ import annotations

import hashlib
import json
import mimetypes
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ...core.errors import InputError
from ...core.files import beside, output_file
from ...core.progress import Progress, silent
from ..compare.compare import RunComparison
from ..compare.export import export_runs
from ..figures.write import methods_text, write_figures
from ..fit.result import FitResult

_STORED = frozenset((".png", ".jpg", ".jpeg", ".heic", ".webp", ".mp4", ".zip", ".pdf"))
_PIECE = 1 << 20
_EPOCH = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """What a person says of the data.

    Parameters
    ----------
    title : str
    authors : tuple of str
    licence : str
        Address or SPDX name, such as ``CC-BY-4.0``.
    citation : str
        Of the paper that the data belong to.
    date : str
        ISO 8601; of today if empty.
    """

    title: str
    authors: tuple[str, ...] = ()
    licence: str = ""
    citation: str = ""
    date: str = ""


def write_package(
    runs: Sequence[RunComparison],
    out: Path,
    description: Description,
    *,
    fits: Sequence[FitResult | str | None] = (),
    progress: Progress = silent,
) -> int:
    """Write the package and return how many files it holds.

    Parameters
    ----------
    runs : sequence of RunComparison
        Their folders go in whole, but for hidden and temporary files.
    out : Path
        ``NAME.zip``; whole or absent.
    description : Description
        Title, authors, licence, citation.
    fits : sequence of FitResult, str or None
        One a run, for the figures.
    progress : callable
        Told with 0 before the first file, and after every file.

    Raises
    ------
    InputError
        If the name does not end in .zip, lies in a run, or two runs have one name.
    """
    if out.suffix.lower() != ".zip":
        raise InputError(f"a package must end in .zip; instead received {out.name!r}")
    labels = [run.run.label for run in runs]
    if len(set(labels)) < len(labels):
        raise InputError(
            f"runs of a package must have names of their own; instead {labels} repeats"
        )
    output_file(out)
    for run in runs:
        if out.resolve().is_relative_to(run.run.path.resolve()):
            raise InputError(f"{out}: must not lie in a run that it is to hold")
    with TemporaryDirectory() as made:
        folder = Path(made)
        export_runs(runs, folder / "tables" / "data.csv")
        write_figures(runs, folder / "figures", fits=fits)
        files = [*_of_folder(folder, ""), *_of_runs(runs)]
        return _zip(files, out, description, runs, progress)


def _of_runs(runs: Sequence[RunComparison]) -> Iterator[tuple[str, Path]]:
    for run in runs:
        yield from _of_folder(run.run.path, f"runs/{run.run.label}/")


def _of_folder(folder: Path, prefix: str) -> Iterator[tuple[str, Path]]:
    for path in sorted(folder.rglob("*")):
        parts = path.relative_to(folder).parts
        if path.is_symlink() or not path.is_file():
            continue
        if any(part.startswith(".") or part.endswith(".tmp") for part in parts):
            continue
        yield prefix + "/".join(parts), path


def _zip(
    files: Sequence[tuple[str, Path]],
    out: Path,
    description: Description,
    runs: Sequence[RunComparison],
    progress: Progress,
) -> int:
    entries = []
    with (
        beside(out) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        progress(0, len(files))  # what came before tells nothing of the rest
        for count, (name, path) in enumerate(files, start=1):
            entries.append(_add(archive, name, path))
            progress(count, len(files))
        data = _metadata(entries, description, runs)
        for name, text in (
            ("ro-crate-metadata.json", json.dumps(data, indent=1) + "\n"),
            ("README.txt", _readme(entries, description, runs)),
        ):
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), text)
    return len(files) + 2


def _add(archive: zipfile.ZipFile, name: str, path: Path) -> dict[str, Any]:
    """Copy a file in pieces; return its entity of the crate."""
    info = zipfile.ZipInfo(name, _EPOCH)
    stored = path.suffix.lower() in _STORED
    info.compress_type = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
    digest, size = hashlib.sha256(), 0
    with path.open("rb") as source, archive.open(info, "w", force_zip64=True) as target:
        while piece := source.read(_PIECE):
            digest.update(piece)
            size += len(piece)
            target.write(piece)
    return {
        "@id": name,
        "@type": "File",
        "name": name.rpartition("/")[2],
        "contentSize": str(size),
        "encodingFormat": mimetypes.guess_type(name)[0] or "application/octet-stream",
        "sha256": digest.hexdigest(),
    }


def _metadata(
    entries: Sequence[dict[str, Any]],
    description: Description,
    runs: Sequence[RunComparison],
) -> dict[str, Any]:
    authors = [
        {"@id": f"#author-{i}", "@type": "Person", "name": name}
        for i, name in enumerate(description.authors, start=1)
    ]
    root: dict[str, Any] = {
        "@id": "./",
        "@type": "Dataset",
        "name": description.title,
        "description": methods_text(runs).strip(),
        "datePublished": description.date or datetime.now(UTC).date().isoformat(),
        "author": [{"@id": author["@id"]} for author in authors],
        "hasPart": [{"@id": entry["@id"]} for entry in entries],
        "mentions": [{"@id": "#magbend"}],
    }
    if description.licence:
        root["license"] = description.licence
    if description.citation:
        root["citation"] = description.citation
    software = {
        "@id": "#magbend",
        "@type": "SoftwareApplication",
        "name": "magbend",
        "version": _version(),
    }
    about = {
        "@id": "ro-crate-metadata.json",
        "@type": "CreativeWork",
        "about": {"@id": "./"},
        "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
    }
    return {
        "@context": "https://w3id.org/ro/crate/1.1/context",
        "@graph": [about, root, *authors, software, *entries],
    }


def _version() -> str:
    try:
        return version("magbend")
    except PackageNotFoundError:
        return "unknown"


def _readme(
    entries: Sequence[dict[str, Any]],
    description: Description,
    runs: Sequence[RunComparison],
) -> str:
    lines = [
        description.title,
        "=" * len(description.title),
        "",
        f"Authors: {', '.join(description.authors) or 'not named'}",
        f"Licence: {description.licence or 'not stated'}",
        f"Citation: {description.citation or 'not stated'}",
        "",
        methods_text(runs),
        "runs/NAME/   the run folders: records, photographs, centrelines",
        "tables/      points, simulated lines, steps and comparison as CSV; the unit",
        "             ends each column's name",
        "figures/     each figure as SVG, PDF and CSV",
        "",
        "SHA-256 of every file:",
        *(f"{entry['sha256']}  {entry['@id']}" for entry in entries),
    ]
    return "\n".join(lines) + "\n"
