"""Accuracy, honesty and time of `extract` on synthetic frames with exact truth.

    python benchmarks/bench_vision.py [--seed 3] [--frames 54]

One row a light and scale (nine shapes each): errors in pixels against the truth, the
share of points within one standard deviation, and CPU time of one thread without
decoding, the best of five. Ratios against a named peer: `bench_vision_peers.py`.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from importlib import import_module

import cv2
import numpy as np

from magbend.vision import as_photo, extract, score
from magbend.vision.synthetic import frames

STAGES = ("binarise", "find_candidates", "start_curve", "refine", "measurement")


def best_ms(photo, calibration, repeats=5) -> float:
    times = []
    for _ in range(repeats):
        start = time.process_time()
        extract(photo, calibration)
        times.append(time.process_time() - start)
    return 1e3 * min(times)


def stages_ms(photo, calibration, repeats=7) -> dict[str, float]:
    """Best time of each stage, measured around the calls that `extract` makes."""
    module = import_module("magbend.vision.extract")
    kept = {name: getattr(module, name) for name in STAGES}
    spent: dict[str, list[float]] = defaultdict(list)

    def timed(name):
        def call(*args, **options):
            start = time.process_time()
            result = kept[name](*args, **options)
            spent[name].append(time.process_time() - start)
            return result

        return call

    try:
        for name in STAGES:
            setattr(module, name, timed(name))
        for _ in range(repeats):
            extract(photo, calibration)
    finally:
        for name in STAGES:
            setattr(module, name, kept[name])
    return {name: 1e3 * min(spent[name]) for name in STAGES}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--frames", type=int, default=54)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    rows = defaultdict(list)
    failed, first = [], None
    for index, frame in enumerate(frames(options.seed)):
        if index == options.frames:
            break
        photo, camera = as_photo(frame.image), frame.truth.calibration
        result = extract(photo, camera)
        if not result.ok:
            failed.append(f"{frame.name}: {result.reason}")
            continue
        if first is None or frame.name == "graded090_standard_20":
            first = (photo, camera)
        rows[frame.name.split("_", 1)[1]].append(
            (score(result, frame.truth), best_ms(photo, camera), result.flags)
        )
    print("light_px/mm   rms med/worst   length worst  tip along/across worst  "
          "width med/worst  cover  shadow  ms")  # fmt: skip
    for name, row in rows.items():
        errors = [item[0] for item in row]
        rms = [e.rms_px for e in errors]
        width = [abs(e.width_px) for e in errors]
        print(
            f"{name:12s}  {np.median(rms):.4f} / {max(rms):.4f}  "
            f"{max(abs(e.length_px) for e in errors):12.3f}  "
            f"{max(abs(e.tip_along_px) for e in errors):12.3f} / "
            f"{max(abs(e.tip_across_px) for e in errors):.3f}  "
            f"{np.median(width):9.3f} / {max(width):.3f}  "
            f"{np.mean([e.coverage for e in errors]):6.2f}  "
            f"{sum('shadow' in item[2] for item in row)}/{len(row)}  "
            f"{np.median([item[1] for item in row]):6.1f}"
        )
    print(f"refused: {len(failed)}", *failed, sep="\n  ")
    if first is not None:
        print("stages of one 2-megapixel frame, ms:", {
            name: round(value, 2) for name, value in stages_ms(*first).items()
        })  # fmt: skip


if __name__ == "__main__":
    main()
