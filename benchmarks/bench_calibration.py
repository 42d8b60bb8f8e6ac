"""Errors of the plane map in um: ours against cv2.calibrateCamera on the same corners.

    python benchmarks/bench_calibration.py [--views 12]

A rendered ChArUco board (11 x 7 squares of 6 mm) seen by cameras of known truth, with
and without a barrel lens. Each is calibrated from the plane's photograph alone and with
tilted views. The error is that of distances: the best rigid motion is taken out, over
the whole picture, on the board's plane and 0.9 mm above it.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import cv2
import numpy as np

from magbend.vision import Board, Calibration, Photo, as_photo, calibrate
from magbend.vision.camera.board import find_corners
from magbend.vision.picture.srgb import encode_srgb
from magbend.vision.synthetic import render_board, scene_camera

BOARD = Board(columns=11, rows=7, square_mm=6.0, marker_mm=4.5)
SIZE = (1600, 1200)


def photograph(camera: Calibration, seed: int) -> Photo:
    return as_photo(render_board(BOARD, camera, np.random.default_rng(seed)))


def error_um(found: Calibration, truth: Calibration, height: float) -> np.ndarray:
    x, y = np.meshgrid(np.linspace(40, 1560, 20), np.linspace(40, 1160, 15))
    pixels = np.column_stack([x.ravel(), y.ravel()])
    a, b = (camera.to_mm(pixels, height_mm=height) for camera in (found, truth))
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    u, _, v = np.linalg.svd(a.T @ b)
    return 1e3 * np.hypot(*(a @ (u @ v) - b).T)


def by_opencv(photos: list[Photo], truth: Calibration) -> Calibration:
    """Calibrate with cv2.calibrateCamera and its explicit criteria."""
    objects, images = [], []
    for photo in photos:
        ids, points = find_corners(encode_srgb(photo.grey), BOARD)
        mm = BOARD.corners_mm(ids) * [1.0, -1.0]
        objects.append(np.column_stack([mm, np.zeros(len(mm))]).astype(np.float32))
        images.append(points.astype(np.float32))
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 300, 1e-12)
    rms, matrix, distortion, turns, shifts = cv2.calibrateCamera(
        objects, images, SIZE, None, None,
        flags=cv2.CALIB_FIX_K3 | cv2.CALIB_FIX_ASPECT_RATIO
        if len(photos) == 1 else cv2.CALIB_FIX_K3,
        criteria=criteria,
    )  # fmt: skip
    turn, _ = cv2.Rodrigues(turns[0])
    k = np.ravel(distortion)
    return replace(
        truth,
        focal_px=(matrix[0, 0], matrix[1, 1]),
        centre_px=(matrix[0, 2], matrix[1, 2]),
        distortion=tuple(float(value) for value in k[:5]),
        rotation=turn @ np.diag([1.0, -1.0, -1.0]),
        translation_mm=np.ravel(shifts[0]),
        rms_px=float(rms),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=12)
    views = parser.parse_args().views
    print(
        f"{'camera':30} {'plane um med/max':>17} {'0.9 mm up med/max':>18} "
        f"{'camera mm':>18} {'s':>5}"
    )
    for k1 in (0.0, -0.15):
        lens = {"focal_px": 6000.0, "distortion": (k1, 0.0, 0.0, 0.0, 0.0)}
        truth = scene_camera(
            tilt_deg=5.0, height_mm=300.0, target_mm=(33.0, -21.0), **lens
        )
        plane = photograph(truth, 0)
        tilted = [
            photograph(
                scene_camera(
                    tilt_deg=25.0 + 5.0 * (i % 3), tilt_direction_deg=360.0 * i / views,
                    turn_deg=30.0 * (i % 4), height_mm=300.0, target_mm=(33.0, -21.0),
                    **lens,
                ),
                i + 1,
            )
            for i in range(views)
        ]  # fmt: skip
        for name, others in (("one view", []), (f"{views} lens views", tilted)):
            for who in ("ours", "cv2"):
                start = time.process_time()
                try:
                    found = (
                        calibrate(plane, others, board=BOARD)
                        if who == "ours"
                        else by_opencv([plane, *others], truth)
                    )
                except cv2.error as error:
                    print(f"k1 {k1:+.2f}, {name}, {who}: {error.err}")
                    continue
                took = time.process_time() - start
                on, above = (error_um(found, truth, height) for height in (0.0, 0.9))
                sd = f" +- {found.camera_height_sd_mm:.2f}" if who == "ours" else ""
                print(
                    f"k1 {k1:+.2f}, {name}, {who:5}".ljust(30)
                    + f" {np.median(on):8.2f} / {on.max():6.1f} "
                    f"{np.median(above):9.2f} / {above.max():6.1f} "
                    f"{f'{found.camera_height_mm:.2f}{sd}':>18} {took:5.1f}"
                )
        print(f"truth: camera {truth.camera_height_mm:.1f} mm above the plane")


if __name__ == "__main__":
    main()
