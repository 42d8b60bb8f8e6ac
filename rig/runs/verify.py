"""Check that every file of a run is present and unaltered."""

from __future__ import annotations

from pathlib import Path

from ...core.errors import StoreError
from .read import Run, read_run
from .records import IMAGES, PLAN_FILE, Record, sha256_of_file


def verify_run(path: Path) -> list[str]:
    """Return one sentence per problem of the run at `path`; none means it is good.

    Checked are the records, each photograph of each finished step against its SHA-256,
    the run's own files against the hashes in ``end.json``, that the planned steps are
    all there if it says success, and that ``images/`` holds nothing else. A run that
    was cut off is no problem in itself: what it holds must still be whole.
    """
    try:
        run = read_run(path)
    except StoreError as error:
        return [str(error)]
    problems: list[str] = []
    if not (path / PLAN_FILE).is_file():
        problems.append(f"{PLAN_FILE}: missing")
    problems += _steps(run)
    if run.end is not None:
        hashes = run.end.get("sha256", {})
        problems += [
            problem
            for name, digest in hashes.items()
            if (problem := _compare(path, name, digest))
        ]
        problems += _extra(run)
    return problems


def _steps(run: Run) -> list[str]:
    problems: list[str] = []
    gaps_mm = run.manifest.get("plan", {}).get("gaps_mm", [])
    indices = {step["index"] for step in run.steps}
    if run.is_finished:
        missing = sorted(set(range(len(gaps_mm))) - indices)
        problems += [f"step {index}: missing from a finished run" for index in missing]
    for step in run.steps:
        index = step["index"]
        if not 0 <= index < len(gaps_mm):
            problems.append(f"step {index}: is not in the plan")
        elif step.get("gap_mm") != gaps_mm[index]:
            problems.append(
                f"step {index}: gap_mm is {step.get('gap_mm')}, the plan says "
                f"{gaps_mm[index]}"
            )
        files = step.get("files", [])
        if not files:
            problems.append(f"step {index}: has no photograph")
        for file in files:
            problem = _check_file(run.path, file)
            problems += [f"step {index}: {problem}"] if problem else []
    return problems


def _check_file(path: Path, file: Record) -> str:
    name = str(file.get("path", ""))
    target = path / name
    if not target.is_file():
        return f"{name}: missing"
    size = target.stat().st_size
    if size != file.get("bytes"):
        return f"{name}: altered ({size} bytes, recorded were {file.get('bytes')})"
    return _compare(path, name, str(file.get("sha256")))


def _compare(path: Path, name: str, digest: str) -> str:
    try:
        actual = sha256_of_file(path / name)
    except FileNotFoundError:
        return f"{name}: missing"
    except OSError as error:
        return f"{name}: cannot be read: {error.strerror}"
    return "" if actual == digest else f"{name}: altered (SHA-256 differs)"


def _extra(run: Run) -> list[str]:
    recorded = {
        str(file.get("path")) for step in run.steps for file in step.get("files", [])
    }
    return [
        f"{name}: extra (belongs to no finished step)"
        for entry in sorted((run.path / IMAGES).glob("*"))
        if (name := f"{IMAGES}/{entry.name}") not in recorded
        and (run.is_finished or not name.endswith(".png"))
    ]
