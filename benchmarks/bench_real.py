"""Real photographs: right, or refused with a reason.

    python benchmarks/bench_real.py PATH/TO/real [--overlays DIR]

The folder holds sets of photographs by others, as named in its SOURCES.md: worms with
the 52-point skeletons of their own tracker, yarns that hang from a clamp over a known
length, a cloth strip edge-on with a faint middle, a soft robot in a box. The skeletons
were smoothed by their authors and end inside the worm: agreement to half a pixel is all
they can tell. Distances are taken across the measured axis, over the inner 90 %.

Trifles that change nothing (a pixel's shift, 1 % of light, half a degree, JPEG of
quality 90, a mirror) must not change what is measured: the largest moves of both ends,
mapped back, and the spreads of length and width over ten of them are printed too.
"""

from __future__ import annotations

import argparse
import csv
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from magbend.vision import Measurement, as_photo, draw_overlay, extract, read_photo
from magbend.vision.synthetic.scoring import arc_length, signed_distance


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


def trifles(
    image: np.ndarray, centre: tuple[float, float]
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield name, picture and the 2 x 3 map of points for each trifling change.

    Turns are about the root: elsewhere a rod would enter the picture at another point.
    """
    height, width = image.shape[:2]
    still = np.eye(2, 3)

    def moved(change: np.ndarray) -> np.ndarray:
        return cv2.warpAffine(
            image, change, (width, height), borderMode=cv2.BORDER_REPLICATE
        )

    for x, y in ((1, 0), (0, 1), (-1, -1)):
        change = np.array([[1.0, 0.0, x], [0.0, 1.0, y]])
        yield f"shift {x} {y}", moved(change), change
    for angle in (-0.5, 0.5):
        change = cv2.getRotationMatrix2D(centre, angle, 1.0)
        yield f"turn {angle}", moved(change), change
    for factor in (0.99, 1.01):
        brighter = np.clip(np.rint(image * factor), 0, 255).astype(np.uint8)
        yield f"light {factor}", brighter, still
    _, packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 90])
    yield "JPEG 90", cv2.imdecode(packed, cv2.IMREAD_UNCHANGED), still
    noise = np.random.default_rng(0).normal(0.0, 1.0, image.shape)
    noisy = np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)
    yield "noise 1", noisy, still
    yield "mirror", image[:, ::-1].copy(), np.array([[-1.0, 0, width - 1], [0, 1.0, 0]])


def steadiness(path: Path, found: Measurement, **options) -> str:
    """Tell how far trifles move what is measured; px, and percent of the median."""
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    truth = np.array([found.clamp_px, found.tip_px])
    moves, lengths, widths, names, lost = [], [], [], [], []
    for name, changed, change in trifles(image, found.clamp_px):
        other = extract(as_photo(changed), None, **options)
        if not other.ok:
            lost.append(name)
            continue
        ends = np.array([other.clamp_px, other.tip_px])
        there = truth @ change[:, :2].T + change[:, 2]
        if options.get("clamp") == "none":  # either end may come first
            back = np.abs(ends[::-1] - there).max() < np.abs(ends - there).max()
            ends = ends[::-1] if back else ends
        moves.append(np.hypot(*(ends - there).T))
        lengths.append(other.length_px)
        widths.append(other.width_px)
        names.append(name)
    if not moves:
        return "refused after any trifle"
    root, tip = np.max(moves, axis=0)
    worst = names[int(np.argmax(np.max(moves, axis=1)))]
    spread = [100.0 * np.ptp(v) / np.median(v) for v in (lengths, widths)]
    return (
        f"root {root:.2f} and tip {tip:.2f} px at most ({worst}), length "
        f"{spread[0]:.2f} %, width {spread[1]:.1f} %"
        + (f", refused after {', '.join(lost)}" if lost else "")
    )


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
        if found.ok:
            print(f"{'':20} steady: {steadiness(path, found, clamp='none')}")
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
        if found.ok:
            print(f"{'':20} steady: {steadiness(path, found)}")
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
