"""Run folders made in milliseconds: simulated shapes plus noise, no photographs.

What they hold is what `magbend rig run` and `magbend vision extract` leave behind, so
that reading, comparing, fitting and reporting can be tested on hundreds of runs.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from magbend import sim
from magbend.core.magnet import Magnet
from magbend.core.specimen import Specimen
from magbend.core.specimen_file import specimen_dict

MAGNET = Magnet.cube(55.0, 1.3)
GAPS_MM = (70.0, 60.0, 50.0)


def write_run(
    path: Path,
    *,
    specimen: Specimen | None = None,
    truth: Specimen | None = None,
    magnet: Magnet = MAGNET,
    clamp_angle_deg: float = 0.0,
    gaps_mm: Sequence[float] = GAPS_MM,
    support: sim.Support | None = None,
    sigma_mm: float = 0.0,
    frame_error: tuple[float, float, float] = (0.0, 0.0, 0.0),
    flux_noise_mT: float = 0.0,
    failed: Sequence[int] = (),
    overload: Sequence[int] = (),
    rng: np.random.Generator | None = None,
    points: int = 61,
    image: bytes | None = None,
    end: bool = True,
    reach_mm: float = 1.0,
    clamp_angle_sd_deg: float = math.nan,
    shared_clamp: str = "",
    sources: sim.Field | None = None,
) -> Path:
    """Write a run folder whose true rod is `truth`, and return it.

    `sources` stand in for the magnet, in truth. `frame_error` is the standard deviation
    of clamp position (mm), of the frame's angle (deg) and of the scale (relative).
    Errors of neighbours are alike over `reach_mm`.
    """
    specimen = specimen or sim.gmc(2)
    truth = truth or specimen
    rng = rng or np.random.default_rng(0)
    (path / "images").mkdir(parents=True)
    support = replace(support or sim.Support(), clamp_angle_deg=clamp_angle_deg)
    steps, frames, rows = [], [], []
    scale = 1.0 + frame_error[2] * rng.standard_normal()
    for index, gap_mm in enumerate(gaps_mm):
        name = f"step_{index:03d}.png"
        data = image or b""
        if image:
            (path / "images" / name).write_bytes(data)
        field = (sources or sim.before(magnet)).at_gap(gap_mm)
        L = truth.length_mm
        flux = sim.flux_mT(field, [L, 0.0, 0.0], length_mm=L)
        reading = float(np.linalg.norm(flux)) + flux_noise_mT * rng.standard_normal()
        steps.append(_step(index, gap_mm, reading, name, data, index in overload))
        if index in failed:
            frames.append({"image": name, "status": "failed", "flags": "no_rod",
                           "reason": "no rod was found"})  # fmt: skip
            continue
        line = sim.solve(truth, field, support=support, points=points).centreline
        assert line is not None
        xy, theta = _seen(
            line, clamp_angle_deg, scale, frame_error, sigma_mm, rng, reach_mm
        )
        frames.append(_frame(name, truth, line.length_mm * scale, xy, theta))
        if math.isfinite(clamp_angle_sd_deg):
            frames[-1]["clamp_angle_sd_deg"] = clamp_angle_sd_deg
        frames[-1]["shared_clamp"] = shared_clamp
        good = np.ones(points)
        rows.append(
            (
                name,
                np.column_stack(
                    [
                        line.s_mm * scale,
                        xy,
                        theta,
                        np.gradient(theta, line.s_mm),
                        np.full(points, truth.side_mm),
                        np.full(points, sigma_mm or 0.001),
                        800.0 + 20.0 * xy[:, 0],
                        400.0 - 20.0 * xy[:, 1],
                        good,
                    ]
                ),
            )
        )
    _write(path, specimen, gaps_mm, steps, frames, rows, end)
    return path


def _seen(line, clamp_angle_deg, scale, frame_error, sigma_mm, rng, reach_mm):
    """Turn the shape into the frame of its own root, with errors of the frame."""
    angle = -math.radians(clamp_angle_deg)
    angle += math.radians(frame_error[1]) * rng.standard_normal()
    c, s = math.cos(angle), math.sin(angle)
    xy = scale * line.points_mm @ np.array([[c, s], [-s, c]])
    xy[:, 1] += frame_error[0] * rng.standard_normal()
    theta = line.theta_rad + angle
    gap = np.abs(line.s_mm[:, None] - line.s_mm[None, :])
    factor = np.linalg.cholesky(
        np.exp(-0.5 * (gap / reach_mm) ** 2) + 1e-9 * np.eye(len(gap))
    )
    noise = sigma_mm * factor @ rng.standard_normal(len(gap))
    xy = xy + noise[:, None] * np.column_stack([-np.sin(theta), np.cos(theta)])
    return xy, theta


def _step(index, gap_mm, reading, name, data, is_overload):
    return {
        "index": index,
        "gap_mm": gap_mm,
        "stage_mm": -gap_mm,
        "flux_mT": None if is_overload else reading,
        "flux_sd_mT": None if is_overload else 0.05,
        "flux_samples": 5,
        "flux_status": "overload" if is_overload else "ok",
        "flux_raw": [],
        "settle": {"status": "settled", "time_s": 2.0, "difference": 0.01},
        "files": [
            {
                "path": f"images/{name}",
                "sha256": hashlib.sha256(data).hexdigest(),
                "bytes": len(data),
            }
        ],
        "time_utc": "2026-01-01T12:00:00.000Z",
        "monotonic_s": 10.0 * index,
        "flags": [],
    }


def _frame(name, truth, length_mm, xy, theta):
    return {
        "image": name,
        "status": "ok",
        "flags": "",
        "length_mm": length_mm,
        "tip_x_mm": xy[-1, 0],
        "tip_y_mm": xy[-1, 1],
        "tip_angle_deg": math.degrees(theta[-1]),
        "width_mm": truth.side_mm,
        "clamp_x_px": 800.0,
        "clamp_y_px": 400.0,
        "tip_x_px": 800.0 + 20.0 * xy[-1, 0],
        "tip_y_px": 400.0 - 20.0 * xy[-1, 1],
        "clamp_x_mm": 10.0,
        "clamp_y_mm": 20.0,
        "clamp_angle_deg": 0.0,
        "rod_height_mm": 0.0,
        "reason": "",
    }


def _write(path, specimen, gaps_mm, steps, frames, rows, end):
    import pandas as pd

    record = {
        "schema": 1,
        "id": path.name,
        "name": f"{specimen.name} test",
        "created_utc": "2026-01-01T12:00:00.000Z",
        "plan": {"name": "test", "gaps_mm": list(gaps_mm)},
        "specimen": specimen_dict(specimen),
        "rig": {"magnet": {"side_mm": 55.0, "remanence_T": 1.3}},
        "devices": {},
        "versions": {"magbend": "0.1.0"},
        "host": "test",
        "operator": "nobody",
        "twin": True,
    }
    (path / "run.json").write_text(json.dumps(record))
    (path / "steps.jsonl").write_text("".join(json.dumps(s) + "\n" for s in steps))
    if end:
        (path / "end.json").write_text(
            json.dumps({"status": "success", "reason": "", "time_utc": "2026"})
        )
    pd.DataFrame(frames).to_csv(path / "frames.csv", index=False)
    names = [
        "s_mm",
        "x_mm",
        "y_mm",
        "theta_rad",
        "kappa_per_mm",
        "width_mm",
        "sigma_mm",
        "x_px",
        "y_px",
        "good",
    ]
    tables = []
    for image, values in rows:
        table = pd.DataFrame(values, columns=names)
        table.insert(0, "image", image)
        tables.append(table)
    empty = pd.DataFrame(columns=["image", *names])
    all_rows = pd.concat(tables) if tables else empty
    all_rows.to_csv(path / "centrelines.csv", index=False)
