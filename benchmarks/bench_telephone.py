"""Telephones: f = 4 mm and 12 megapixels, time without decoding and error.

    python benchmarks/bench_telephone.py [--count 12] [--seed 9701]

A rod under a telephone whose lens has 2900 px of focal length, 65 to 95 mm above the
paper, tilted by up to 10 degrees. Printed are CPU times of one thread (to linear light,
and measured; the best of three) and errors in the rod's own frame.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import cv2
import numpy as np

from magbend.vision import Pose, as_photo, extract
from magbend.vision.synthetic import (
    Block,
    Scene,
    curve,
    render_scene,
    scene_camera,
    signed_distance,
)

HEIGHT_MM = 0.9


def best_ms(work: Callable[[], object]) -> float:
    times = []
    for _ in range(3):
        start = time.thread_time()
        work()
        times.append(time.thread_time() - start)
    return 1e3 * min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--seed", type=int, default=9701)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    times, errors, refused = [], [], 0
    for index in range(options.count):
        rng = np.random.default_rng([options.seed, index])
        camera = scene_camera(
            size_px=(4032, 3024), focal_px=2900.0, height_mm=rng.uniform(65.0, 95.0),
            tilt_deg=rng.uniform(0.0, 10.0), target_mm=(32.0, -25.0),
            tilt_direction_deg=rng.uniform(0.0, 360.0),
            distortion=(-rng.uniform(0.0, 0.1), 0.0, 0.0, 0.0, 0.0),
        )  # fmt: skip
        pose = Pose(
            x_mm=18.0, y_mm=-28.0, angle_deg=rng.uniform(-20.0, 20.0),
            height_mm=HEIGHT_MM,
        )  # fmt: skip
        line = curve("graded", angle_deg=rng.uniform(-100.0, 100.0))
        scene = Scene(clamp=Block(pose=pose), centreline=line, paper_seed=index)
        picture = render_scene(scene, camera, rng)
        photo = as_photo(picture)
        found = extract(photo, camera, rod_height_mm=HEIGHT_MM)
        if not found.ok:
            refused += 1
            print(f"refused: {found.reason}")
            continue
        light = best_ms(lambda picture=picture: as_photo(picture))
        whole = best_ms(
            lambda photo=photo, camera=camera: extract(
                photo, camera, rod_height_mm=HEIGHT_MM
            )
        )
        times.append((light, whole, light + whole))
        points = np.column_stack([found.points["x_mm"], found.points["y_mm"]])
        away = signed_distance(points, line.points_mm)
        tip = np.hypot(*(np.array(found.tip_mm) - line.tip_mm))
        errors.append((np.sqrt(np.mean(away**2)), tip))
    light, whole, both = np.median(times, axis=0)
    print(
        f"{len(times)} of 12 MP, refused {refused}: {both:.0f} ms without decoding "
        f"(worst {np.max(times, axis=0)[2]:.0f}): {light:.0f} to linear light, "
        f"{whole:.0f} measured"
    )
    rms, tip = np.array(errors).T
    print(
        f"RMS {np.median(rms):.4f} mm median, {rms.max():.4f} worst; "
        f"tip {np.median(tip):.4f} median, {tip.max():.4f} worst"
    )


if __name__ == "__main__":
    main()
