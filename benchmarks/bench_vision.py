"""Accuracy, honesty and time of `extract` on synthetic frames with exact truth.

    python benchmarks/bench_vision.py [--seed 3] [--frames 54]

One row a light and scale (nine shapes each): errors in pixels against the truth, the
share of points within one standard deviation, and CPU time of one thread without
decoding, the best of five. Then, for the 2-megapixel frames: the own time of each
stage, and that of the peers' skeleton of the same frames, whose mask is given to them.
Errors of the peers: `bench_vision_peers.py`; frames per second:
`bench_vision_batch.py`.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from importlib import import_module

import cv2
import numpy as np
from bench_vision_peers import longest_path, rod_mask
from skimage.morphology import skeletonize

from magbend.vision import as_photo, extract, score
from magbend.vision.synthetic.square_view import frames

STAGES = {
    "binarise": "find.choose", "find_candidates": "find.choose",
    "start_curve": "extraction.best_light", "refine": "extraction.finish",
    "find_joints": "extraction.midline", "measurement": "extraction.finish",
    "doubts": "extraction.finish",
}  # fmt: skip
"""What is timed, and the module that calls it; joints are sought within `refine`, and
count for themselves."""


def best_ms(photo, calibration, repeats=5) -> float:
    times = []
    for _ in range(repeats):
        start = time.process_time()
        extract(photo, calibration)
        times.append(time.process_time() - start)
    return 1e3 * min(times)


def stages_ms(pairs, repeats=5) -> dict[str, float]:
    """Mean over frames of the own time of each stage and of the rest.

    Each frame's best run counts, so the stages add up to the mean time of a frame.
    """
    modules = {n: import_module(f"magbend.vision.{m}") for n, m in STAGES.items()}
    kept = {name: getattr(module, name) for name, module in modules.items()}
    spent: dict[str, float] = defaultdict(float)

    def timed(name, function):
        def call(*args, **options):
            within, start = sum(spent.values()), time.process_time()
            try:
                return function(*args, **options)
            finally:
                within -= sum(spent.values())
                spent[name] += time.process_time() - start + within

        return call

    rows = []
    try:
        for name, module in modules.items():
            setattr(module, name, timed(name, kept[name]))
        whole = timed("rest", extract)
        for pair in pairs:
            runs = []
            for _ in range(repeats):
                spent.clear()
                whole(*pair)
                runs.append([spent[name] for name in (*STAGES, "rest")])
            rows.append(min(runs, key=sum))
    finally:
        for name, module in modules.items():
            setattr(module, name, kept[name])
    return dict(zip((*STAGES, "rest"), 1e3 * np.mean(rows, axis=0), strict=True))


def cpu_ms(work, inputs) -> float:
    """Median CPU time of one call, over inputs, the best of three each."""
    times = []
    for item in inputs:
        runs = []
        for _ in range(3):
            start = time.process_time()
            work(item)
            runs.append(time.process_time() - start)
        times.append(min(runs))
    return 1e3 * float(np.median(times))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--frames", type=int, default=54)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    rows = defaultdict(list)
    failed, chosen = [], []
    for index, frame in enumerate(frames(options.seed)):
        if index == options.frames:
            break
        photo, camera = as_photo(frame.image), frame.truth.calibration
        result = extract(photo, camera)
        if not result.ok:
            failed.append(f"{frame.name}: {result.reason}")
            continue
        if frame.name.endswith("standard_20"):
            chosen.append(frame)
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
    if chosen:
        height, width = chosen[0].image.shape
        print(
            f"{len(chosen)} frames of {width} x {height} px, standard light, 20 px/mm"
        )
        pairs = [(as_photo(one.image), one.truth.calibration) for one in chosen]
        whole = cpu_ms(lambda pair: extract(*pair), pairs)
        stages = stages_ms(pairs)
        parts = " + ".join(f"{name} {ms:.2f}" for name, ms in stages.items())
        print(
            f"without decoding: median {whole:.1f} ms, "
            f"mean {sum(stages.values()):.2f} = {parts}"
        )
        masks = [rod_mask(one)[0] for one in chosen]
        path = cpu_ms(lambda mask: longest_path(skeletonize(mask)), masks)
        print(f"scikit-image skeletonize + skan, mask given: median {path:.1f} ms")


if __name__ == "__main__":
    main()
