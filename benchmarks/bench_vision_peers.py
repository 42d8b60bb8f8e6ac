"""Centrelines side by side: scikit-image skeletonize, skan's longest path, and ours.

    python benchmarks/bench_vision_peers.py [--scale 20] [--light standard]

All see the same synthetic frames (nine shapes, exact truth). The peers are given what
they do not do themselves: a mask of the rod alone, flat-fielded, with the clamp cut off
at its true face and cropped to the rod. Their times are without that mask; ours is the
whole of `extract`. Times are CPU times of one thread, the best of three.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import cv2
import numpy as np
from scipy.sparse.csgraph import dijkstra
from skan import Skeleton
from skimage.morphology import skeletonize

from magbend.vision import as_photo, extract
from magbend.vision.synthetic.scoring import arc_length, signed_distance
from magbend.vision.synthetic.square_view import LIGHTS, SHAPES, Frame, curve, draw

Row = tuple[float, float, float, float, float]


def rod_mask(frame: Frame) -> tuple[np.ndarray, tuple[int, int]]:
    """Return the cropped mask of the rod alone, and its left top corner."""
    grey = as_photo(frame.image).grey
    truth = frame.truth
    size = int(2.5 * truth.width_px) | 1
    paper = cv2.morphologyEx(grey, cv2.MORPH_CLOSE, np.ones((size, size), np.uint8))
    dark = (grey < 0.55 * cv2.GaussianBlur(paper, (0, 0), size / 3)).astype(np.uint8)
    y, x = np.mgrid[0 : dark.shape[0], 0 : dark.shape[1]]
    clamp, following = truth.points_px[0], truth.points_px[1]
    along = (following - clamp) / np.hypot(*(following - clamp))
    u = (x - clamp[0]) * along[0] + (y - clamp[1]) * along[1]
    v = (x - clamp[0]) * along[1] - (y - clamp[1]) * along[0]
    dark[(u < 0.0) & (np.abs(v) < 4.6 * truth.px_per_mm)] = 0
    _, labels, stats, _ = cv2.connectedComponentsWithStats(dark)
    best = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    left, top, width, height, _ = stats[best]
    box = (slice(top, top + height), slice(left, left + width))
    return np.pad(labels[box] == best, 2), (left - 2, top - 2)


def longest_path(skeleton: np.ndarray) -> np.ndarray:
    """Return the pixels of the longest shortest path of a skeleton, x and y."""
    graph = Skeleton(skeleton)
    places = np.asarray(graph.coordinates, dtype=float)[:, ::-1]
    first, *_ = np.nonzero(np.diff(graph.graph.indptr) > 0)
    start = int(first[0])
    for _ in range(2):
        distance, before = dijkstra(
            graph.graph, indices=start, return_predecessors=True
        )
        distance[~np.isfinite(distance)] = -1.0
        end, start = start, int(np.argmax(distance))
    path = [start]
    while path[-1] != end and before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return places[path]


def best_of(times: int, work: Callable[[], object]) -> float:
    took = []
    for _ in range(times):
        start = time.process_time()
        work()
        took.append(time.process_time() - start)
    return 1e3 * min(took)


def errors(points: np.ndarray, frame: Frame) -> tuple[float, float, float, float]:
    """Return RMS and largest distance, length error and distance of the end, px."""
    truth = frame.truth.points_px
    if np.hypot(*(points[0] - truth[0])) > np.hypot(*(points[-1] - truth[0])):
        points = points[::-1]
    arc = arc_length(points)
    inner = points[(arc > 0.02 * arc[-1]) & (arc < 0.98 * arc[-1])]
    distance = signed_distance(inner, truth)
    return (
        float(np.sqrt(np.mean(distance**2))),
        float(np.abs(distance).max()),
        float(arc[-1] - frame.truth.length_px),
        float(np.hypot(*(points[-1] - truth[-1]))),
    )


def of_peers(frame: Frame) -> tuple[Row, Row]:
    mask, corner = rod_mask(frame)
    skeleton = skeletonize(mask)
    thin = np.argwhere(skeleton)[:, ::-1] + corner
    distance = signed_distance(thin.astype(float), frame.truth.points_px)
    path = longest_path(skeleton) + corner
    rms, largest, length, end = errors(path, frame)
    thin_ms = best_of(3, lambda: skeletonize(mask))
    path_ms = best_of(3, lambda: longest_path(skeletonize(mask)))
    pixels = (
        float(np.sqrt(np.mean(distance**2))), float(np.abs(distance).max()),
        float("nan"), float("nan"), thin_ms,
    )  # fmt: skip
    return pixels, (rms, largest, length, end, path_ms)


def of_ours(frame: Frame) -> Row | None:
    photo = as_photo(frame.image)
    found = extract(photo, None)
    if not found.ok:
        print(f"{frame.name}: ours refused: {found.reason}")
        return None
    points = found.points_px
    rms, largest, length, _ = errors(points, frame)
    end = float(np.hypot(*(np.array(found.tip_px) - frame.truth.points_px[-1])))
    return rms, largest, length, end, best_of(3, lambda: extract(photo, None))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=20.0, help="px/mm")
    parser.add_argument("--light", choices=sorted(LIGHTS), default="standard")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    size = (2600, 1800) if options.scale >= 30.0 else (1920, 1080)
    tables: dict[str, list[Row]] = {
        "skeletonize": [],
        "skan longest path": [],
        "ours": [],
    }
    for index, (name, kind, angle) in enumerate(SHAPES):
        frame = draw(
            curve(kind, angle_deg=angle), np.random.default_rng([0, index]),
            px_per_mm=options.scale, light=LIGHTS[options.light], size_px=size,
            name=name,
        )  # fmt: skip
        pixels, path = of_peers(frame)
        tables["skeletonize"].append(pixels)
        tables["skan longest path"].append(path)
        ours = of_ours(frame)
        if ours is not None:
            tables["ours"].append(ours)
    print(f"{options.light} light, {options.scale:g} px/mm, {size[0]} x {size[1]} px")
    print(
        f"{'method':20} {'RMS med/worst px':>18} {'max med px':>11} {'length px':>10} "
        f"{'end px':>7} {'CPU ms':>7}"
    )
    for name, rows in tables.items():
        table = np.array(rows)
        middle = np.median(table, axis=0)
        print(
            f"{name:20} {middle[0]:8.4f} / {table[:, 0].max():7.4f} {middle[1]:11.4f} "
            f"{middle[2]:10.3f} {middle[3]:7.3f} {middle[4]:7.1f}"
        )
    peer, own = (np.median(np.array(tables[n]), axis=0) for n in
                 ("skan longest path", "ours"))  # fmt: skip
    print(
        f"ours against skan: RMS 1/{peer[0] / own[0]:.0f}, "
        f"end 1/{peer[3] / own[3]:.0f}, time x{own[4] / peer[4]:.2f}"
    )


if __name__ == "__main__":
    main()
