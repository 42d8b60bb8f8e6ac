"""Vibrations from films: frequency, damping and settling time in stated deviations.

    python benchmarks/bench_ring.py [--films 40] [--seed 9801] [--tips 400]

A rod is drawn as an arc, held, let go between two frames, and swinging about a bent
shape; frequency, damping, frame rate, first amplitude, bend and the picture's noise are
random. Each film is followed as `vision ring` does. Then the same for tip paths alone,
with noise of 1 to 30 micrometres and swings by up to 20 degrees. Printed are the RMS of
errors over their deviations (1 is right) and the median relative errors.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np

from magbend.core.errors import VisionError
from magbend.vision import Ringing, Setting, as_photo, follow, ring_down
from magbend.vision.synthetic import Light, curve, draw

LENGTH_MM, SETTLE_MM = 30.0, 0.05
SIZE, SCALE = (480, 360), 8.0


class Swing(NamedTuple):
    """A vibration that is drawn: `bend_deg` is the rod's in each frame."""

    time_s: np.ndarray
    bend_deg: np.ndarray
    frequency_Hz: float
    ratio: float
    settled_s: float


def drawn(rng: np.random.Generator, frames: int, most_deg: float) -> Swing:
    rate = float(rng.choice([30.0, 60.0, 120.0, 240.0]))
    frequency = rng.uniform(0.04, 0.3) * rate
    ratio = float(np.exp(rng.uniform(np.log(0.003), np.log(0.15))))
    rest = rng.uniform(-60.0, 60.0)
    swing = rng.choice([-1.0, 1.0]) * np.exp(rng.uniform(0.0, np.log(most_deg)))
    omega = 2.0 * np.pi * frequency
    decay = ratio * omega / np.sqrt(1.0 - ratio**2)
    time_s = np.arange(frames) / rate
    held_s = rng.uniform(0.05, 0.2) * frames / rate
    after = np.maximum(time_s - held_s, 0.0)
    bend = rest + swing * np.exp(-decay * after) * np.cos(omega * after)
    step = tips(np.array([rest - 1e-3, rest + 1e-3]))
    amplitude = abs(swing) * float(np.hypot(*(step[1] - step[0]))) / 2e-3
    settled = held_s + np.log(max(amplitude / SETTLE_MM, 1.0)) / decay
    return Swing(time_s, bend, frequency, ratio, settled)


def tips(bend_deg: np.ndarray) -> np.ndarray:
    """Return the tips of arcs, mm."""
    half = 0.5 * np.radians(bend_deg)
    chord = LENGTH_MM * np.sinc(half / np.pi)
    return np.column_stack([chord * np.cos(half), chord * np.sin(half)])


def of_path(rng: np.random.Generator) -> tuple[Swing, np.ndarray]:
    swing = drawn(rng, int(rng.integers(60, 400)), 20.0)
    path = tips(swing.bend_deg)
    noise_mm = np.exp(rng.uniform(np.log(0.001), np.log(0.03)))
    return swing, path + noise_mm * rng.standard_normal(path.shape)


def of_film(rng: np.random.Generator) -> tuple[Swing, np.ndarray]:
    swing = drawn(rng, int(rng.integers(60, 120)), 15.0)
    light = Light(noise=rng.uniform(0.002, 0.03), blur_px=rng.uniform(0.7, 1.3))
    found, path = None, []
    for bend in swing.bend_deg:
        frame = draw(
            curve("arc", angle_deg=bend, length_mm=LENGTH_MM), rng, light=light,
            px_per_mm=SCALE, size_px=SIZE, clamp_px=(120.0, 180.0), angle_deg=0.0,
        )  # fmt: skip
        setting = Setting(calibration=frame.truth.calibration)
        found = follow(as_photo(frame.image), setting, found)
        at = found.pose.to_board(np.array([found.tip_mm])) if found.ok else 2 * [np.nan]
        path.append(np.ravel(at))
    return swing, np.array(path)


def off(found: Ringing, swing: Swing) -> tuple[list[float], list[float]]:
    """Return errors over deviations, and relative errors."""
    wrong = [
        found.frequency_Hz - swing.frequency_Hz,
        found.damping_ratio - swing.ratio,
        found.first_s + found.settle_s - swing.settled_s,
    ]
    sd = [found.frequency_sd_Hz, found.damping_ratio_sd, found.settle_sd_s or np.nan]
    size = [swing.frequency_Hz, swing.ratio, swing.settled_s]
    return list(np.divide(wrong, sd)), list(np.abs(np.divide(wrong, size)))


def report(
    name: str, count: int, seed: int,
    made: Callable[[np.random.Generator], tuple[Swing, np.ndarray]],
) -> None:  # fmt: skip
    scores, sizes, refused = [], [], 0
    for index in range(count):
        swing, path = made(np.random.default_rng([seed, index]))
        try:
            found = ring_down(swing.time_s, path, settle_mm=SETTLE_MM)
        except VisionError as error:
            refused += 1
            print(f"{name} {index}: {error}")
            continue
        z, relative = off(found, swing)
        scores.append(z)
        sizes.append(relative)
    rms = np.sqrt(np.nanmean(np.square(scores), axis=0))
    worst, typical = np.nanmax(np.abs(scores), axis=0), np.median(sizes, axis=0)
    print(f"{len(scores)} {name}, {refused} refused")
    for k, what in enumerate(("frequency", "damping", "settling")):
        print(
            f"  {what:10} z RMS {rms[k]:.2f}, worst {worst[k]:.1f}; "
            f"typically {100.0 * typical[k]:.3g} % off"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--films", type=int, default=40)
    parser.add_argument("--tips", type=int, default=400)
    parser.add_argument("--seed", type=int, default=9801)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    if options.tips:
        report("tip paths", options.tips, options.seed, of_path)
    if options.films:
        report("films", options.films, options.seed, of_film)


if __name__ == "__main__":
    main()
