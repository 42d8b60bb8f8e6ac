"""What one clamp for a whole run is worth: errors in the rod's frame, own and shared.

    python benchmarks/bench_shared_clamp.py [--runs 14] [--photos 8] [--twin 0]

Each run is a scene of `bench_scenes.py` (random camera, lens, clamp and light) whose
rod is bent step by step from straight to 60 to 120 degrees; with ``--twin``, runs of
the twin bench follow, whose stage carries the clamp. Then the same readings with a
clamp that moves half way by 0.1 mm, or turns by 0.3 degrees: how often is it noticed?
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from bench_scenes import inside, random_camera, random_scene

from magbend.analysis.twin.bench import TwinBench
from magbend.core.magnet import Magnet
from magbend.sim import gmc
from magbend.vision import Calibration, Measurement, Pose, as_photo, extract
from magbend.vision.batch.shared_clamp import Reading, shared_direction
from magbend.vision.synthetic import Scene, render_scene
from magbend.vision.synthetic.scoring import signed_distance
from magbend.vision.synthetic.square_view import curve

Shot = tuple[Measurement, np.ndarray, float]
"""A measurement, the true axis in the clamp's frame, mm, and the true direction."""


def scenes(rng: np.random.Generator, photos: int) -> tuple[list[Scene], Calibration]:
    while True:
        camera, _ = random_camera(rng)
        bends = rng.choice([-1, 1]) * np.linspace(2.0, rng.uniform(60.0, 120.0), photos)
        kind, length = ("arc", "graded")[rng.integers(2)], rng.uniform(25.0, 32.0)
        drawn = random_scene(rng, camera)
        if drawn is None:
            continue
        scene, pose = drawn[0], drawn[0].clamp.pose
        lines = [curve(kind, angle_deg=bend, length_mm=length) for bend in bends]
        points = np.vstack([pose.to_board(line.points_mm) for line in lines])
        points = np.vstack([points, pose.to_board(np.array([[-6.0, 0.0]]))])
        low, high = inside(camera)
        room = (high - low) - np.ptp(points, axis=0) - 4.0
        if np.any(room < 0.0):
            continue
        place = low + 2.0 - points.min(axis=0) + rng.random(2) * room
        pose = replace(pose, x_mm=pose.x_mm + place[0], y_mm=pose.y_mm + place[1])
        clamp = replace(scene.clamp, pose=pose)
        return [replace(scene, clamp=clamp, centreline=line) for line in lines], camera


def scene_run(seed: int, photos: int) -> Iterator[Shot]:
    rng = np.random.default_rng([77, seed])
    drawn, camera = scenes(rng, photos)
    for scene in drawn:
        pose = scene.clamp.pose
        photo = as_photo(render_scene(scene, camera, rng))
        found = extract(photo, camera, rod_height_mm=pose.height_mm)
        yield found, scene.centreline.points_mm, pose.angle_deg


def twin_run(seed: int, photos: int) -> Iterator[Shot]:
    magnet = Magnet.cube(55.0, 1.305)
    bench = TwinBench(gmc(2), magnet, seed=seed)
    for gap_mm in np.linspace(90.0, 45.0, photos):
        photo = as_photo(bench.photograph(float(gap_mm), 0.0))
        camera, height = bench._camera, bench.axis_height_mm
        turn = bench.truth.clamp_angle_deg
        back = Pose(x_mm=0.0, y_mm=0.0, angle_deg=turn)
        line = back.from_board(bench.solution(float(gap_mm)).centreline.points_mm)
        yield extract(photo, camera, rod_height_mm=height), line, turn


def reading(found: Measurement) -> Reading:
    pose = found.pose
    return Reading(
        x_mm=pose.x_mm, y_mm=pose.y_mm, angle_deg=pose.angle_deg,
        sd_deg=found.clamp_angle_sd_deg, mm_per_px=found.length_mm / found.length_px,
    )  # fmt: skip


def rms_mm(found: Measurement, line: np.ndarray, angle_deg: float) -> float:
    """Return the RMS error in the rod's frame whose x axis has this direction."""
    own = found.pose
    points = np.column_stack([found.points["x_mm"], found.points["y_mm"]])
    seen = replace(own, angle_deg=angle_deg).from_board(own.to_board(points))
    return float(np.sqrt(np.mean(signed_distance(seen, line) ** 2)))


def apart(angle_deg: float, truth_deg: float) -> float:
    return (angle_deg - truth_deg + 180.0) % 360.0 - 180.0


def judge(name: str, runs: list[list[Shot]]) -> None:
    own, shared, scores, before, after = [], [], [], [], []
    alarms, aside, turned = 0, 0, 0
    for run in runs:
        shots = [shot for shot in run if shot[0].ok]
        readings = [reading(found) for found, _, _ in shots]
        errors = [
            apart(r.angle_deg, shot[2]) for r, shot in zip(readings, shots, strict=True)
        ]
        found = shared_direction(readings)
        alarms += found is None
        half = len(readings) // 2
        first, last = readings[:half], readings[half:]
        move = [replace(r, x_mm=r.x_mm + 0.1) for r in last]
        turn = [replace(r, angle_deg=r.angle_deg + 0.3) for r in last]
        aside += shared_direction(first + move) is None
        turned += shared_direction(first + turn) is None
        own += errors
        if found is not None:
            error = apart(found.angle_deg, shots[0][2])
            scores.append(error / found.sd_deg)
            shared.append(error)
        for (measured, line, _), r in zip(shots, readings, strict=True):
            before.append(rms_mm(measured, line, r.angle_deg))
            to = r.angle_deg if found is None else found.angle_deg
            after.append(rms_mm(measured, line, to))
    print(
        f"{name}: {len(runs)} runs, {len(own)} photographs\n"
        f"  direction, RMS: own {rms(own):.3f} deg, shared {rms(shared):.3f} deg "
        f"({rms(scores):.2f} stated deviations)"
    )
    for words, values in (("own", before), ("shared", after)):
        print(
            f"  shape in the rod's frame, {words}: geometric mean "
            f"{np.exp(np.mean(np.log(values))):.4f}, median {np.median(values):.4f}, "
            f"RMS {rms(values):.4f}, worst {max(values):.4f} mm"
        )
    print(
        f"  called moved: {alarms} that stood still, {aside} moved by 0.1 mm, "
        f"{turned} turned by 0.3 deg"
    )


def rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=14)
    parser.add_argument("--photos", type=int, default=8)
    parser.add_argument("--twin", type=int, default=0)
    options = parser.parse_args()
    for name, run, count in (
        ("random scenes", scene_run, options.runs),
        ("twin bench", twin_run, options.twin),
    ):
        if count:
            judge(name, [list(run(seed, options.photos)) for seed in range(count)])


if __name__ == "__main__":
    main()
