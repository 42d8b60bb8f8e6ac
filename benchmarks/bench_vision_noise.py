"""What noise alone does to a measurement, against its Cramer-Rao bound and its word.

    python benchmarks/bench_vision_noise.py [--draws 40] [--scales 20,40] [--blur 1]

Each scene is photographed again and again with fresh noise. Of the inner points:
standard deviation over the draws, the mean's error (bias), the stated deviation, all as
RMS along the rod, and the share of errors within it (0.68 is honest); of tip, length
and median width their deviation and bias. The bound of the midline of a section of 1 px
is n sqrt(sqrt(pi) s) / A for noise n, blur s (pixels included) and contrast A.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace

import cv2
import numpy as np

from magbend.vision import as_photo, extract, score
from magbend.vision.synthetic.scoring import signed_distance
from magbend.vision.synthetic.square_view import LIGHTS, SHAPES, Frame, curve, draw

INNER = slice(3, -3)


def scene(shape: str, scale: float, light: str, blur: float, seed: int) -> Frame:
    name, kind, angle = next(item for item in SHAPES if item[0] == shape)
    return draw(
        curve(kind, angle_deg=angle), np.random.default_rng(seed), px_per_mm=scale,
        light=replace(LIGHTS[light], blur_px=blur), name=name,
        size_px=(1920, 1080) if scale < 30.0 else (2600, 1800),
    )  # fmt: skip


def errors(found, truth) -> dict[str, np.ndarray]:
    """Return errors along the rod: px, rad in the picture, 1/mm, px."""
    line, points = truth.centreline, found.points
    along = np.subtract(found.clamp_px, truth.points_px[0])
    start = truth.points_px[1] - truth.points_px[0]
    s = points["s_mm"] + along @ start / np.hypot(*start) / truth.px_per_mm
    turn = math.radians(found.pose.angle_deg - truth.pose.angle_deg)
    theta = points["theta_rad"] - np.interp(s, line.s_mm, line.theta_rad) + turn
    return {
        "midline px": signed_distance(found.points_px, truth.points_px),
        "theta mrad": 1e3 * ((theta + np.pi) % (2.0 * np.pi) - np.pi),
        "kappa /m": 1e3
        * (points["kappa_per_mm"] - np.interp(s, line.s_mm, line.kappa_per_mm)),
        "width px": points["width_px"] - truth.width_px,
    }


def stated(found, truth) -> dict[str, np.ndarray]:
    points = found.points
    return {
        "midline px": points["sigma_px"],
        "theta mrad": 1e3 * points["sigma_theta_rad"],
        "kappa /m": 1e3 * points["sigma_kappa_per_mm"],
        "width px": truth.px_per_mm * points["sigma_width_mm"],
    }


def rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def report(frame: Frame, draws: int, rng: np.random.Generator) -> None:
    rows, words, ends = [], [], []
    for _ in range(draws):
        frame = frame.again(rng)
        found = extract(as_photo(frame.image), frame.truth.calibration)
        if not found.ok:
            print(f"  refused: {found.reason}")
            continue
        rows.append(errors(found, frame.truth))
        words.append(stated(found, frame.truth))
        away = score(found, frame.truth)
        ends.append(
            (away.tip_along_px, away.tip_across_px, away.length_px, away.width_px)
        )
    for name in rows[0]:
        error = np.array([row[name] for row in rows])[:, INNER]
        word = np.array([row[name] for row in words])[:, INNER]
        print(
            f"  {name:11s} sd {rms(error.std(axis=0, ddof=1)):.4f}  bias "
            f"{rms(error.mean(axis=0)):.4f}  stated {rms(word):.4f}  within "
            f"{np.mean(np.abs(error) < word):.2f}"
        )
    for name, value in zip(
        ("tip along", "tip across", "length", "mean width"), np.array(ends).T,
        strict=True,
    ):  # fmt: skip
        print(f"  {name:11s} sd {value.std(ddof=1):.4f}  bias {value.mean():+.4f} px")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=40)
    parser.add_argument("--scales", default="20,40")
    parser.add_argument("--blur", type=float, default=1.0)
    parser.add_argument("--lights", default="clean,hard")
    parser.add_argument("--shapes", default="straight,arc090,graded090")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    for scale in map(float, options.scales.split(",")):
        for light in options.lights.split(","):
            for shape in options.shapes.split(","):
                frame = scene(shape, scale, light, options.blur, seed=0)
                blur = math.hypot(options.blur, 1.0 / math.sqrt(12.0))
                contrast = LIGHTS[light].paper - LIGHTS[light].rod
                bound = frame.noise * math.sqrt(math.sqrt(math.pi) * blur) / contrast
                print(
                    f"{shape} {light} {scale:g} px/mm; midline's bound {bound:.4f} "
                    f"px a section, {bound / math.sqrt(frame.truth.length_px):.4f} px "
                    "of one number for the whole rod"
                )
                report(frame, options.draws, np.random.default_rng(1))


if __name__ == "__main__":
    main()
