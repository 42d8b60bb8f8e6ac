"""A run and its centrelines, read from the run folder (DESIGN, section 4).

`load_run` gives what the rest of the analysis works on; its properties `steps_table`,
`frames_table` and `points_table` are tidy pandas tables for notebooks. A run that was
cut off is read as far as it goes, and says so in `warnings`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from ...core.centreline import Centreline
from ...core.errors import ConfigError, InputError, StoreError
from ...core.magnet import Magnet
from ...core.specimen_file import MagnetModel, SpecimenModel
from ...rig import Run, check_used, read_run
from ...vision import (
    Calibration,
    FrameRow,
    read_calibration,
    read_centrelines,
    read_frames,
)
from .data import MEASURED, Frame, RunData, Step
from .imported import read_imported


def find_runs(paths: Iterable[Path]) -> list[Path]:
    """Return the run folders among `paths`, and those directly inside them.

    Raises
    ------
    StoreError
        If a path is missing, is no folder, or holds no run.
    """
    runs: list[Path] = []
    for path in paths:
        if not path.is_dir():
            what = "is not a folder" if path.exists() else "there is no such folder"
            raise StoreError(f"{path}: {what}; give the folder of a run")
        if (path / "run.json").is_file():
            runs.append(path)
            continue
        inside = sorted(p.parent for p in path.glob("*/run.json"))
        if not inside:
            raise StoreError(
                f"{path}: is not a run folder: it has no run.json; "
                "magbend rig run makes one"
            )
        runs.extend(inside)
    return list(dict.fromkeys(runs))


def load_runs(
    paths: Iterable[Path], *, unverified: bool = False
) -> tuple[list[RunData], list[str]]:
    """Read the runs among `paths`, and those directly inside them.

    `unverified` goes on where a run does not hold (see `load_run`).

    Returns
    -------
    runs : list of RunData
        Those that can be read.
    left_out : list of str
        A sentence on each of the others.

    Raises
    ------
    StoreError
        If a path holds no run, or none of the runs can be read.
    """
    runs, left_out = [], []
    for path in find_runs(paths):
        try:
            runs.append(_free(load_run(path, unverified=unverified)))
        except StoreError as error:
            left_out.append(str(error))
    if not runs:
        raise StoreError(left_out[0])
    return runs, left_out


def _free(run: RunData) -> RunData:
    """Return a run whose rod nothing but its clamp holds.

    Raises
    ------
    StoreError
        If it lies in a lumen: what is made of free rods would be wrong of it.
    """
    if (run.record.get("plan") or {}).get("lumen"):
        raise StoreError(
            f"{run.path}: its rod lies in a lumen, whose walls hold it too; magbend "
            f"analysis lumen {run.path} compares it with such a rod"
        )
    return run


def load_run(path: Path | str, *, unverified: bool = False) -> RunData:
    """Read a run folder and the centrelines measured from its photographs.

    Its records, photographs and tables are held against their digests first.

    Parameters
    ----------
    path : Path
        A folder with ``run.json``, ``steps.jsonl``, ``frames.csv`` and
        ``centrelines.csv``; ``calibration.json`` and ``end.json`` if there are any.
    unverified : bool
        Go on where a file does not hold what was written: a warning says which.

    Raises
    ------
    StoreError
        If a file was altered or is older than its inputs, is missing, torn beyond use
        or does not hold what it should: one
        sentence with the command that makes it.
    """
    stored = read_run(Path(path))
    path, record, warnings = stored.path, stored.manifest, list(stored.warnings)
    warnings += _unproved(stored, unverified=unverified)
    try:
        specimen = SpecimenModel.model_validate(record.get("specimen")).specimen()
        magnet = _magnet(record)
        shapes = read_imported(path)
        steps = tuple(
            replace(_step(data), imported=shapes.get(int(data["index"])))
            for data in sorted(stored.steps, key=lambda d: int(d["index"]))
        )
    except (ValidationError, InputError, KeyError, TypeError, ValueError) as error:
        raise StoreError(
            f"{path}: its specimen, magnet or steps cannot be used: "
            f"{_first_line(error)}"
        ) from None
    if not steps:
        raise StoreError(
            f"{path}: the run has no finished step; "
            f"magbend rig run PLAN --out {path} --resume continues it"
        )
    end = stored.end or {}
    if end and not stored.is_finished:
        warnings.append(f"the run ended with {stored.status}: {end.get('reason', '')}")
    planned = (record.get("plan") or {}).get("gaps_mm") or []
    if len(steps) < len(planned):
        warnings.append(f"{len(planned)} steps were planned, {len(steps)} are finished")
    frames = _frames(path)
    for step in steps:
        if step.image not in frames:
            warnings.append(f"step {step.index + 1}: {step.image} was never measured")
    return RunData(
        path=path,
        id=str(record.get("id", path.name)),
        name=stored.name,
        specimen=specimen,
        magnet=magnet,
        steps=steps,
        frames=frames,
        calibration=_calibration(path, warnings),
        record=record,
        end=end,
        warnings=tuple(warnings),
    )


def _unproved(run: Run, *, unverified: bool) -> list[str]:
    """Return what does not hold of the files that are read; refuse it unless told."""
    photographs = [file["path"] for step in run.steps for file in step["files"]]
    found = check_used(run, [*MEASURED, *photographs])
    broken = [one.sentence for one in found if one.status not in ("extra", "missing")]
    if broken and not unverified:
        more = f", and {len(broken) - 1} more" if len(broken) > 1 else ""
        raise StoreError(
            f"{run.path}: {broken[0]}{more}; magbend rig verify {run.path} says all, "
            f"--unverified goes on"
        )
    return [one.sentence for one in found if one.status != "missing"]


def _first_line(error: Exception) -> str:
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        return f"{where}: {first['msg']}"
    return f"the key {error} is missing" if isinstance(error, KeyError) else str(error)


def _magnet(record: dict[str, Any]) -> Magnet | None:
    data = (record.get("rig") or {}).get("magnet")
    return MagnetModel.model_validate(data).magnet() if data else None


def _step(data: dict[str, Any]) -> Step:
    images = [
        Path(file["path"]).name
        for file in data.get("files", [])
        if str(file["path"]).startswith("images/")
    ]
    return Step(
        index=int(data["index"]),
        gap_mm=_number(data["gap_mm"]),
        flux_mT=_number(data.get("flux_mT")),
        flux_sd_mT=_number(data.get("flux_sd_mT")),
        flux_status=str(data.get("flux_status") or "none"),
        image=images[0] if images else str(data.get("image") or ""),
        flags=tuple(data.get("flags") or ()),
        time_utc=str(data.get("time_utc", "")),
        settings=dict(data.get("settings") or {}),
    )


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


def _calibration(path: Path, warnings: list[str]) -> Calibration | None:
    file = path / "calibration.json"
    if not file.is_file():
        if any((path / "images").glob("*")):
            warnings.append(
                "calibration.json is not in the run folder: simulated shapes cannot "
                f"be drawn on the photographs; copy it to {file}"
            )
        return None
    try:
        return read_calibration(file)
    except ConfigError as error:
        warnings.append(f"calibration.json cannot be used: {error}")
        return None


def _frames(path: Path) -> dict[str, Frame]:
    for name in ("frames.csv", "centrelines.csv"):
        if not (path / name).exists():
            raise StoreError(_how_to_measure(path, name))
    try:
        rows = read_frames(path / "frames.csv")
        lines = read_centrelines(path / "centrelines.csv")
    except ConfigError as error:
        raise StoreError(str(error)) from None
    return {row.image: _frame(path, row, lines.get(row.image)) for row in rows}


def _how_to_measure(path: Path, name: str) -> str:
    calibrate = ""
    if not (path / "calibration.json").is_file():
        calibrate = (
            f"magbend vision calibrate BOARD.png --out {path / 'calibration.json'}, "
            "then "
        )
    return (
        f"{path}: {name} is missing, the photographs are not measured yet; run "
        f"{calibrate}magbend vision extract {path} --calibration "
        f"{path / 'calibration.json'} --out {path}"
    )


def _frame(
    path: Path, row: FrameRow, points: dict[str, NDArray[np.float64]] | None
) -> Frame:
    centreline = None
    status, reason = row.status, row.reason
    if row.ok and points is not None:
        try:
            centreline = _centreline(points)
        except (ValueError, InputError) as error:
            raise StoreError(
                f"{path / 'centrelines.csv'}: the line of {row.image} cannot be "
                f"used: {error}"
            ) from None
    elif row.ok:
        status, reason = "failed", "centrelines.csv has no line for this photograph"
    if not row.ok or points is None:
        points = {}
    return Frame(
        image=row.image,
        status=status,
        flags=row.flags,
        reason=reason,
        points=points,
        centreline=centreline,
        sigma_mm=_good(points, points["sigma_mm"]) if points else np.empty(0),
        width_mm=row.width_mm,
        clamp_angle_sd_deg=row.clamp_angle_sd_deg,
        pose=row.pose,
        shared_clamp=row.shared_clamp,
    )


def _centreline(points: dict[str, NDArray[np.float64]]) -> Centreline | None:
    if not np.any(np.isfinite(points["x_mm"])):
        return None
    columns = {
        name: _good(points, points[name])
        for name in ("s_mm", "x_mm", "y_mm", "theta_rad")
    }
    kappa = _good(points, points["kappa_per_mm"])
    if not np.all(np.isfinite(kappa)):
        columns["kappa_per_mm"] = np.gradient(columns["theta_rad"], columns["s_mm"])
    else:
        columns["kappa_per_mm"] = kappa
    return Centreline(**columns)


def _good(
    points: dict[str, NDArray[np.float64]], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the values at measured points; both ends always stay."""
    good = points["good"]
    keep = (good > 0.0) | np.isnan(good)
    keep[[0, -1]] = True
    return np.asarray(values[keep])
