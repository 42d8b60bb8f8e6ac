"""Frames per second from JPEG files of two megapixels, decoding and start included.

    python benchmarks/bench_vision_batch.py [--frames 96] [--workers 2]

First one process: the median CPU time of a frame, decoded and measured, and what an
overlay costs besides. Then the whole of `extract_files` on several processes, to the
written tables: in wall time from the call and from the first result on (the workers
have started then), and in CPU time of the workers with what they need to start.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from magbend.vision import Setting, extract, extract_files, read_photo
from magbend.vision.batch.overlay import overlay_png
from magbend.vision.synthetic.square_view import LIGHTS, SHAPES, curve, draw


def write_frames(folder: Path, count: int):
    """Write the nine shapes over and over; return the files and their camera."""
    drawn = [
        draw(
            curve(kind, angle_deg=angle), np.random.default_rng([0, index]),
            light=LIGHTS["standard"], name=name,
        )
        for index, (name, kind, angle) in enumerate(SHAPES)
    ]  # fmt: skip
    paths = [folder / f"{index:03d}.jpg" for index in range(count)]
    for index, path in enumerate(paths):
        image = drawn[index % len(drawn)].image
        cv2.imwrite(str(path), image, [cv2.IMWRITE_JPEG_QUALITY, 95])
    return paths, drawn[0].truth.calibration


def median_ms(work, inputs) -> float:
    """Median over the inputs of the CPU time of one call, the better of two."""
    times = []
    for item in inputs:
        runs = []
        for _ in range(2):
            start = time.process_time()
            work(item)
            runs.append(time.process_time() - start)
        times.append(min(runs))
    return 1e3 * float(np.median(times))


def of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def on_one_core(paths, camera) -> None:
    decoding = median_ms(read_photo, paths)
    whole = median_ms(lambda path: extract(read_photo(path), camera), paths)
    photo = read_photo(paths[0])
    found = extract(photo, camera)
    drawing = median_ms(lambda _: overlay_png(photo, found), paths[:9])
    print(
        f"one core: {1e3 / whole:.0f} frames/s; {whole:.1f} ms of CPU a frame, "
        f"{decoding:.1f} of them to decode; an overlay takes {drawing:.1f} more"
    )


def on_several(paths, camera, out: Path, workers: int, *, overlays: bool) -> None:
    seen: list[tuple[int, float]] = []
    before = of_children()
    extract_files(
        paths, out, setting=Setting(calibration=camera), overlays=overlays,
        workers=workers, progress=lambda done, _: seen.append((done, time.monotonic())),
    )  # fmt: skip
    cpu = of_children() - before
    (_, call), (first, started), (last, end) = seen[0], seen[1], seen[-1]
    print(
        f"{workers} processes, {'with' if overlays else 'no'} overlays: "
        f"{last / (end - call):.0f} frames/s from the call on ({end - call:.1f} s), "
        f"{(last - first) / (end - started):.0f} from the first result on; "
        f"{1e3 * cpu / last:.1f} ms of CPU a frame, start included"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=96)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths, camera = write_frames(folder, options.frames)
        on_one_core(paths, camera)
        for overlays in (False, True):
            on_several(
                paths, camera, folder / f"out_{overlays}", options.workers,
                overlays=overlays,
            )  # fmt: skip


if __name__ == "__main__":
    main()
