"""Films and live pictures: time of a followed frame, against a full search of it.

    python benchmarks/bench_film.py [--frames 60] [--seed 9501]

A rod of three sections is drawn at rest, bending steadily, and swinging at 3 Hz before
60 frames/s, in pictures of 0.5, 1 and 2 megapixels. Printed are CPU times of one thread
without decoding (median, and the best tenth, which the machine's other work disturbs
least), how many frames needed a full search, and the error of the axis, followed and
searched anew. Then a film of a megapixel from its file to its tables.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from magbend.vision import (
    Measurement,
    Setting,
    as_photo,
    extract,
    extract_files,
    follow,
    score,
)
from magbend.vision.synthetic import Frame, curve, draw

SIZES = {"0.5 MP": ((860, 600), 15.0), "1 MP": ((1200, 860), 20.0),
         "2 MP": ((1920, 1080), 24.0)}  # fmt: skip
MOTIONS: dict[str, Callable[[int], float]] = {
    "at rest": lambda _: 50.0,
    "0.5 deg a frame": lambda k: 30.0 + 0.5 * k,
    "2 deg a frame": lambda k: 20.0 + 2.0 * k,
    "swinging": lambda k: 40.0 + 8.0 * float(np.cos(2.0 * np.pi * 3.0 * k / 60.0)),
}


def drawn(
    size: tuple[int, int], scale: float, motion: Callable[[int], float], count: int,
    seed: int,
) -> list[Frame]:  # fmt: skip
    return [
        draw(
            curve("graded", angle_deg=motion(k)), np.random.default_rng([seed, k]),
            px_per_mm=scale, size_px=size, angle_deg=4.0,
            clamp_px=(0.2 * size[0], 0.8 * size[1]),
        )
        for k in range(count)
    ]  # fmt: skip


def is_followed(found: Measurement) -> bool:
    """Whether a frame was not searched as if it were the first."""
    motion = found.motion
    return motion is not None and bool(np.any(motion.state[1]))


def live(size: str, name: str, count: int, seed: int) -> None:
    frames = drawn(*SIZES[size], MOTIONS[name], count, seed)
    setting = Setting(calibration=frames[0].truth.calibration)
    photos = [as_photo(frame.image) for frame in frames]
    last, spent, anew, errors = None, [], [], []
    for k, (frame, photo) in enumerate(zip(frames, photos, strict=True)):
        start = time.thread_time()
        last = follow(photo, setting, last)
        spent.append(1e3 * (time.thread_time() - start))
        anew.append(not is_followed(last))
        if k % 4 == 0:
            whole = extract(photo, setting.calibration)
            errors.append([score(f, frame.truth).rms_px for f in (last, whole)])
    followed = [ms for ms, searched in zip(spent[1:], anew[1:], strict=True)
                if not searched]  # fmt: skip
    rms = np.median(errors, axis=0)
    typical, best = np.quantile(followed, [0.5, 0.1])
    print(
        f"{size:8} {name:16} {typical:6.2f} {best:6.2f}"
        f" {sum(anew) - 1:9} {rms[0]:12.4f} {rms[1]:8.4f}"
    )


def of_file(count: int, seed: int) -> None:
    size, scale = SIZES["1 MP"]
    frames = drawn(size, scale, MOTIONS["swinging"], count, seed)
    setting = Setting(calibration=frames[0].truth.calibration)
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "swing.mp4"
        code = cv2.VideoWriter_fourcc(*"mp4v")
        film = cv2.VideoWriter(str(path), code, 60.0, size, isColor=False)
        for frame in frames:
            film.write(frame.image)
        film.release()
        for workers in (1, 2):
            best = np.inf
            for _ in range(3):
                start = time.process_time()
                result = extract_files(
                    [path], Path(name) / "out", setting=setting, workers=workers
                )
                best = min(best, (time.process_time() - start) / len(result.frames))
            print(
                f"a film of {size[0]} x {size[1]} px, decoded, measured and written, "
                f"workers={workers}: {1e3 * best:.1f} ms of CPU a frame, "
                f"{1.0 / best:.0f} frames/s a core"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--seed", type=int, default=9501)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    print(f"{'':25}      ms   best   searched    RMS px  searched")
    for size in SIZES:
        for name in MOTIONS:
            live(size, name, options.frames, options.seed)
    of_file(options.frames, options.seed)


if __name__ == "__main__":
    main()
