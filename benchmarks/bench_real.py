"""Real photographs: right, or refused with a reason.

    python benchmarks/bench_real.py PATH/TO/real [--overlays DIR]

The folder holds sets of photographs by others, as named in its SOURCES.md: worms with
the 52-point skeletons of their own tracker, yarns that hang from a clamp over a known
length, a cloth strip edge-on with a faint middle, a soft robot in a box. The skeletons
were smoothed by their authors and end inside the worm: agreement to half a pixel is all
they can tell. Distances are taken across the measured axis, over the inner 90 %.
"""

from __future__ import annotations

import argparse
import csv
import re
import sys
from pathlib import Path

import cv2
import numpy as np

from magbend.vision import Measurement, draw_overlay, extract, read_photo
from magbend.vision.score import arc_length, signed_distance


def skeletons(folder: Path) -> dict[str, np.ndarray | None]:
    """Return x, y, width of each worm; None where its tracker gave up."""
    points: dict[str, list[list[float]]] = {}
    with (folder / "skeletons.csv").open() as file:
        for row in csv.reader(file):
            if not row or not re.search(r"\d", row[0]):
                continue
            name = Path(row[0]).stem
            values = [float(v) for v in row[1:] if re.fullmatch(r"-?[\d.e+-]+", v)]
            points.setdefault(name, [])
            if len(values) >= 3:
                points[name].append(values[-3:])
    return {name: np.array(rows) if rows else None for name, rows in points.items()}


def against(found: Measurement, line: np.ndarray) -> str:
    """Compare with a reference midline, in px."""
    off = signed_distance(line, found.points_px)
    inner = slice(len(line) // 20, -(len(line) // 20) or None)
    length = arc_length(line)[-1]
    return (
        f"RMS {np.sqrt(np.mean(off[inner] ** 2)):.2f} px, largest "
        f"{np.abs(off[inner]).max():.2f}, length {found.length_px:.1f} for {length:.1f}"
    )


def measure(path: Path, overlays: Path | None, **options) -> Measurement:
    photo = read_photo(path)
    found = extract(photo, None, **options)
    if overlays is not None:
        overlays.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(overlays / f"{path.stem}.png"), draw_overlay(photo, found))
    return found


def tell(path: Path, found: Measurement, words: str) -> None:
    flags = ", ".join(found.flags)
    outcome = words if found.ok else f"refused: {found.reason}"
    print(f"{path.name:20} {outcome}  [{flags}]")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--overlays", type=Path)
    options = parser.parse_args()
    folder: Path = options.folder
    lost = 0
    reference = skeletons(folder / "worm_wormpose")
    for path in sorted((folder / "worm_wormpose").glob("*.png")):
        found = measure(path, options.overlays, clamp="none")
        line = reference.get(path.stem)
        known = found.ok and line is not None
        tell(path, found, against(found, line[:, :2]) if known else "no reference")
    for path in sorted((folder / "yarn_cantilever").glob("*.jpg")):
        found = measure(path, options.overlays)
        overhang_mm = 10.0 * float(path.stem.split("_")[1])
        lost += not found.ok
        tell(
            path, found,
            f"{found.length_px:.0f} px for {overhang_mm:.0f} mm: "
            f"{found.length_px / overhang_mm:.2f} px/mm, diameter "
            f"{found.width_px * overhang_mm / max(found.length_px, 1.0):.2f} mm",
        )  # fmt: skip
    cloth = folder / "cloth_cantilever"
    for path in sorted(cloth.glob("*.jpg")):
        found = measure(path, options.overlays)
        tell(path, found, f"{found.length_px:.0f} px long")
    for path in sorted((folder / "soft_robot_bench").glob("*.[jJ][pP][gG]")):
        found = measure(path, options.overlays)
        tell(path, found, f"{found.length_px:.0f} px long, {found.width_px:.0f} wide")
    print(f"yarns lost: {lost}")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
