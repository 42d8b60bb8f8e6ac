"""Errors in mm on rendered photographs with known truth.

    python benchmarks/bench_rendered.py PATH/TO/rendered

The folder holds photographs, the board as ``calib_*`` and ``truth/NAME.json``;
without a path the few photographs of ``examples/photographs`` are used. Shapes are
compared in the rod's own frame: RMS and largest distance across the true axis, and the
tip's error as a vector's length. "aligned" takes the best rigid motion out first, which
shows how much of the error is the clamp's place and direction.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from magbend.vision import Board, calibrate, extract, read_photo
from magbend.vision.synthetic.scoring import signed_distance

FIXTURES = Path(__file__).parents[1] / "examples" / "photographs"


def read_truth(path: Path) -> dict[str, Any]:
    data = json.loads(path.read_text())
    rod = data.get("rod", data)
    return {
        "line": np.array(rod["centreline_mm"]),
        "px": np.array(rod["centreline_px"]),
        "side_mm": rod["side_mm"],
        "height_mm": rod.get("axis_height_above_paper_mm", rod.get("axis_height_mm")),
        "length_mm": rod.get("arc_length_mm", rod.get("length_mm")),
    }


def aligned(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Move points rigidly onto a line: a few steps of closest points."""
    moved = points.copy()
    for _ in range(20):
        distance = signed_distance(moved, line)
        nearest = np.argmin(
            ((moved[:, None] - line[None]) ** 2).sum(axis=2), axis=1
        ).clip(1, len(line) - 2)
        tangent = line[nearest + 1] - line[nearest - 1]
        tangent /= np.hypot(*tangent.T)[:, None]
        normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        turn = moved[:, 0] * normal[:, 1] - moved[:, 1] * normal[:, 0]
        design = np.column_stack([normal, turn])
        dx, dy, angle = np.linalg.lstsq(design, -distance, rcond=None)[0]
        c, s = np.cos(angle), np.sin(angle)
        moved = moved @ np.array([[c, s], [-s, c]]) + (dx, dy)
    return moved


def start_deg(points: np.ndarray) -> float:
    """Return the direction at the first of evenly spread points, of a parabola."""
    x, y = -1.5 * points[0] + 2.0 * points[1] - 0.5 * points[2]
    return float(np.degrees(np.arctan2(y, x)))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=FIXTURES)
    parser.add_argument(
        "--rod-height-mm", type=float, help="one height for all; default: each truth's"
    )
    options = parser.parse_args()
    folder: Path = options.folder
    board = next(
        path for path in sorted(folder.glob("calib*")) if path.suffix != ".json"
    )
    camera = calibrate(read_photo(board), board=Board())
    print(
        f"{board.name}: RMS {camera.rms_px:.3f} px, camera "
        f"{camera.camera_height_mm:.0f} +- {camera.camera_height_sd_mm:.0f} mm\n"
    )
    print(
        f"{'photograph':12} {'RMS mm':>8} {'max mm':>8} {'aligned':>8} {'tip mm':>8} "
        f"{'length':>8} {'width mm':>9} {'RMS px':>8} {'ms':>5} "
        f"{'turn deg':>9} {'sd':>6}  flags"
    )
    rows, turns, failed = [], [], 0
    truths = folder / "truth" if (folder / "truth").is_dir() else folder
    for path in sorted(folder.iterdir()):
        truth_file = truths / f"{path.stem}.json"
        if path == board or path.suffix not in (".png", ".jpg"):
            continue
        truth = read_truth(truth_file)
        photo = read_photo(path)
        height = options.rod_height_mm
        start = time.process_time()
        found = extract(
            photo, camera,
            rod_height_mm=truth["height_mm"] if height is None else height,
        )  # fmt: skip
        took_ms = 1e3 * (time.process_time() - start)
        if not found.ok:
            failed += 1
            print(f"{path.name:12} failed: {', '.join(found.flags)}: {found.reason}")
            continue
        points = np.column_stack([found.points["x_mm"], found.points["y_mm"]])
        distance = signed_distance(points, truth["line"])
        best = signed_distance(aligned(points, truth["line"]), truth["line"])
        steps = min(len(found.points_px), len(truth["px"])) - 1
        turn, true = (
            start_deg(line[:: (len(line) - 1) // steps])
            for line in (found.points_px, truth["px"])
        )
        turn -= true
        turn = (turn + 180.0) % 360.0 - 180.0
        turn_sd = found.clamp_angle_sd_deg
        pixels = signed_distance(found.points_px, truth["px"])
        row = (
            float(np.sqrt(np.mean(distance**2))),
            float(np.abs(distance).max()),
            float(np.sqrt(np.mean(best**2))),
            float(np.hypot(*(np.array(found.tip_mm) - truth["line"][-1]))),
            found.length_mm - truth["length_mm"],
            found.width_mm - truth["side_mm"],
            float(np.sqrt(np.mean(pixels**2))),
        )
        rows.append(row)
        turns.append((turn, turn_sd))
        print(
            f"{path.name:12} {row[0]:8.4f} {row[1]:8.4f} {row[2]:8.4f} {row[3]:8.4f} "
            f"{row[4]:+8.4f} {row[5]:+9.4f} {row[6]:8.3f} {took_ms:5.0f} "
            f"{turn:+9.3f} {turn_sd:6.3f}  {', '.join(found.flags)}"
        )
    if rows:
        table = np.abs(np.array(rows))
        for name, values in (
            ("median", np.median(table, axis=0)), ("worst", table.max(axis=0)),
        ):  # fmt: skip
            print(
                f"{name:12} {values[0]:8.4f} {values[1]:8.4f} {values[2]:8.4f} "
                f"{values[3]:8.4f} {values[4]:8.4f} {values[5]:9.4f} {values[6]:8.3f}"
            )
        error, sd = np.array(turns).T
        print(
            f"direction at the clamp: RMS {np.sqrt(np.mean(error**2)):.3f} deg, "
            f"{np.sqrt(np.mean((error / sd) ** 2)):.2f} stated deviations"
        )
    print(f"{len(rows)} measured, {failed} failed")
    return 0 if rows and not failed else 1


if __name__ == "__main__":
    sys.exit(main())
