"""Check a run: every file present and unaltered, every step as the plan says."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from ...core.derived import FileFinding, check_derived, compare_digest, read_manifest
from ...core.errors import StoreError
from .map_check import map_problems
from .read import Run, read_run
from .records import END_FILE, IMAGES, PLAN_FILE, RUN_FILE, STEPS_FILE, Record
from .verify_files import check_files, check_records


@dataclass(frozen=True, slots=True, kw_only=True)
class RunCheck:
    """What a check of a run found.

    Parameters
    ----------
    run : Run or None
        None if it cannot be read.
    files : tuple of FileFinding
        One for each file; of a run of format 1 only of those that it accounts for.
    problems : tuple of str
        A sentence each; none means that the run is good.
    """

    run: Run | None
    files: tuple[FileFinding, ...]
    problems: tuple[str, ...]


def check_run(path: Path) -> RunCheck:
    """Check every file of a run, and its steps against its plan.

    Records are held against their seals and chains, photographs against the digests in
    the step records, derived files and what they were made from against the manifest.
    A run that was cut off is no problem in itself: what it holds must still be whole.
    """
    try:
        run = read_run(path)
        files = tuple(check_files(run) if run.schema > 1 else _first_format(run))
    except (StoreError, OSError) as error:
        return RunCheck(run=None, files=(), problems=(str(error),))
    problems = [one.sentence for one in files if one.is_problem]
    return RunCheck(
        run=run, files=files, problems=(*problems, *_steps(run), *map_problems(run))
    )


def verify_run(path: Path) -> list[str]:
    """Return one sentence per problem of the run at `path`; none means it is good."""
    return list(check_run(path).problems)


def check_used(run: Run, names: Iterable[str]) -> list[FileFinding]:
    """Check the records of a run, and some files that are about to be used.

    Parameters
    ----------
    run : Run
        From `read_run`.
    names : iterable of str
        Derived files and photographs; those that are not there are left to their
        reader.

    Returns
    -------
    list of FileFinding
        What is altered, older than its inputs, or extra: nothing says what made it.
        Of a run of format 1, which accounts for less, only what it can tell.
    """
    root = run.path
    wanted = [name for name in names if (root / name).exists()]
    images = {f["path"]: f["sha256"] for step in run.steps for f in step["files"]}
    found = [
        compare_digest(root, name, images[name]) for name in wanted if name in images
    ]
    found += check_derived(root, wanted)
    if run.schema == 1 and run.end:
        found += [compare_digest(root, *one) for one in run.end["sha256"].items()]
    if run.schema > 1:
        own = (RUN_FILE, STEPS_FILE, *([END_FILE] if run.end else []))
        found += [one for one in check_records(run) if one.name in own]
        known = {*read_manifest(root), *images}
        found += [
            FileFinding(name=name, status="extra", detail="nothing says what made it")
            for name in wanted
            if name not in known
        ]
    return [one for one in found if one.is_problem]


def _steps(run: Run) -> list[str]:
    problems: list[str] = []
    gaps_mm = run.manifest.get("plan", {}).get("gaps_mm", [])
    settings = run.manifest.get("plan", {}).get("settings") or []
    indices = {step["index"] for step in run.steps}
    if run.is_finished:
        missing = sorted(set(range(len(gaps_mm))) - indices)
        problems += [
            f"step {index + 1}: missing from a finished run" for index in missing
        ]
    for step in run.steps:
        index = step["index"]
        if not 0 <= index < len(gaps_mm):
            problems.append(f"step {index + 1}: is not in the plan")
        elif step.get("gap_mm") != gaps_mm[index]:
            problems.append(
                f"step {index + 1}: gap_mm is {step.get('gap_mm')}, the plan says "
                f"{gaps_mm[index]}"
            )
        asked = settings[index] if 0 <= index < len(settings) else {}
        off = _off(step.get("settings") or {}, asked, run.manifest)
        problems += [f"step {index + 1}: {sentence}" for sentence in off]
        if not step["files"]:
            problems.append(f"step {index + 1}: has no photograph")
    counted = (run.end or {}).get("steps", len(run.steps))
    if counted != len(run.steps):
        problems.append(
            f"{END_FILE} counts {counted} steps, {STEPS_FILE} holds {len(run.steps)}"
        )
    return problems


def _off(
    found: dict[str, float], asked: dict[str, float], manifest: Record
) -> Iterator[str]:
    """Yield what stood elsewhere than the plan asked, beyond its tolerance."""
    axes = {axis["name"]: axis for axis in manifest.get("rig", {}).get("axis") or []}
    for name, value in asked.items():
        tolerance = float(axes.get(name, {}).get("tolerance", 0.0)) + 1e-9
        if name not in found or abs(found[name] - value) > tolerance:
            yield f"{name} is {found.get(name)}, the plan says {value:g}"


def _first_format(run: Run) -> list[FileFinding]:
    """Check what a run of format 1 accounts for: pictures, once it ended records."""
    found = [
        compare_digest(run.path, file["path"], file["sha256"])
        for step in run.steps
        for file in step["files"]
    ]
    if not (run.path / PLAN_FILE).is_file():
        found.append(FileFinding(name=PLAN_FILE, status="missing"))
    if run.end is None:
        return found
    digests = run.end["sha256"]
    found += [compare_digest(run.path, name, one) for name, one in digests.items()]
    known = {one.name for one in found}
    for entry in sorted((run.path / IMAGES).glob("*")):
        name = f"{IMAGES}/{entry.name}"
        if name not in known and (run.is_finished or not name.endswith(".png")):
            found.append(FileFinding(name=name, status="extra"))
    return found
