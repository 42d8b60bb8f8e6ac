"""The folder of runs, and one run in detail, as the pages show them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...core.errors import ConfigError, MagbendError
from ...core.json import read_json
from ..workspace import Workspace
from .plan_file import flux_mT

FLAGS = {
    "settle_timeout": "the rod was not still in time: it swings, or the light flickers",
    "approach_clipped": "a limit left too little room to come from the far side",
    "no_flux": "there is no reading of the Tesla-meter at this gap",
    "flux_overload": "the Tesla-meter was beyond its range: choose a higher one",
    "flux_silent": "the Tesla-meter did not answer: look at its cable and power",
    "flux_garbled": "the Tesla-meter sent what cannot be read",
    "overexposed": "parts of the picture are white: expose it less",
    "dark": "the picture is too dark: expose it more",
    "brightness_drift": "the light changed since the first step",
}
"""What a flag means, and what to do."""

_LINE_POINTS = 40

DERIVED = {
    "extract": "centrelines.csv",
    "compare": "comparison.csv",
    "fit": "fit.json",
    "report": "report.html",
}


def list_runs(workspace: Workspace) -> list[dict[str, Any]]:
    """Return every run of the bench, newest first."""
    from ...rig import read_run

    rows = []
    for folder in _folders(workspace):
        fit = _fit(folder) or {}
        row: dict[str, Any] = {
            "name": folder.name,
            "has": derived(folder),
            "verdict": fit.get("verdict"),
        }
        try:
            run = read_run(folder)
        except MagbendError as error:
            row |= {"status": "damaged", "problem": str(error)}
        else:
            gaps = run.manifest.get("plan", {}).get("gaps_mm") or []
            row |= {
                "status": run.status,
                "plan": run.name,
                "begun_utc": run.manifest.get("created_utc"),
                "steps": len(run.steps),
                "planned": len(gaps),
                "flags": sum(len(step.get("flags", ())) for step in run.steps),
                "twin": bool(run.manifest.get("twin")),
            }
        rows.append(row)
    return rows


def _folders(workspace: Workspace) -> list[Path]:
    if not workspace.runs_path.is_dir():
        return []
    found = [
        path for path in workspace.runs_path.iterdir() if (path / "run.json").is_file()
    ]
    return sorted(found, key=lambda path: path.name, reverse=True)


def derived(folder: Path) -> list[str]:
    """Return what was made of a run so far."""
    return [name for name, file in DERIVED.items() if (folder / file).is_file()]


def run_detail(workspace: Workspace, name: str) -> dict[str, Any]:
    """Return the steps of a run, its ending, and what a fit said.

    Raises
    ------
    MagbendError
        If there is no such run, or it cannot be read.
    """
    from ...rig import read_run

    folder = workspace.run_path(name)
    if not (folder / "run.json").is_file():
        return {
            "name": name,
            "status": "starting",
            "steps": [],
            "planned": 0,
            "has": [],
            "model_mT": [],
        }
    run = read_run(folder)
    files = workspace.files()
    gaps = run.manifest.get("plan", {}).get("gaps_mm") or []
    return {
        "name": name,
        "status": run.status if run.end else "running or cut off",
        "reason": run.end.get("reason") if run.end else "",
        "warnings": list(run.warnings),
        "planned": len(gaps),
        "gaps_mm": gaps,
        "steps": [_step(step) for step in run.steps],
        "model_mT": [[gap, flux_mT(files, gap)] for gap in _between(gaps)],
        "has": derived(folder),
        "fit": _fit(folder),
    }


def _between(gaps_mm: list[float]) -> list[float]:
    """Return gaps along which the model's line is drawn."""
    if not gaps_mm:
        return []
    low, high = min(gaps_mm), max(gaps_mm)
    return [low + (high - low) * i / _LINE_POINTS for i in range(_LINE_POINTS + 1)]


def _step(step: dict[str, Any]) -> dict[str, Any]:
    paths = [str(file["path"]) for file in step.get("files", [])]
    images = [path for path in paths if path.startswith("images/")]
    settle = step.get("settle") or {}
    return {
        "index": step["index"],
        "gap_mm": step.get("gap_mm"),
        "gap_reached_mm": step.get("gap_reached_mm"),
        "flux_mT": step.get("flux_mT"),
        "flux_sd_mT": step.get("flux_sd_mT"),
        "flux_status": step.get("flux_status"),
        "settle": settle.get("status"),
        "settle_s": settle.get("time_s"),
        "flags": [
            {"name": flag, "means": FLAGS.get(flag, flag.replace("_", " "))}
            for flag in step.get("flags", [])
        ],
        "image": images[0] if images else None,
        "time_utc": step.get("time_utc"),
    }


def _fit(folder: Path) -> dict[str, Any] | None:
    try:
        data = read_json(folder / "fit.json")
    except ConfigError:
        return None
    keys = (
        "verdict", "p_value", "reasons", "E_MPa", "E_sd_MPa", "chi2_reduced",
        "not_identifiable", "model", "steps", "degenerate_directions", "rests_on",
        "suspects",
    )  # fmt: skip
    return {key: data.get(key) for key in keys}
