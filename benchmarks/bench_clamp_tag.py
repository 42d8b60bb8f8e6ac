"""What a tag on the clamp is worth on strangers' benches, none of them tuned on.

    python benchmarks/bench_clamp_tag.py [--count 60] [--seed 9401]

Each bench of `reserve_scenes` gets a tag on its clamp. Where the rod is from there is
learnt from three photographs of other rods, nearly straight, in ordinary light; then
the bench's own photograph is measured with and without it. Quoted figures come from
seeds of 9000 and above that nobody looked at before.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from bench_reserve import Row, measured
from reserve_scenes import Case, draw_case

from magbend.core.errors import VisionError
from magbend.vision import ClampTag, Setting, find_tag, tag_place
from magbend.vision.synthetic import (
    PAPER,
    RUBBER,
    Label,
    SceneLight,
    curve,
    render_scene,
)


def labelled(seed: int, index: int) -> Case:
    rng = np.random.default_rng([seed, index, 1])
    label = Label(
        tag=ClampTag(), x_mm=-rng.uniform(6.0, 9.0), y_mm=rng.uniform(-0.5, 0.5),
        angle_deg=90.0 * rng.integers(4) + rng.uniform(-10.0, 10.0),
    )  # fmt: skip
    return draw_case(seed, index, label)


def is_whole(case: Case) -> bool:
    """Whether the tag with its margin lies within the picture."""
    clamp = case.scene.clamp
    corners = clamp.pose.to_board(clamp.label.sheet_mm)
    seen = case.camera.to_px(corners, height_mm=clamp.height_mm)
    return bool(np.all(seen > 0.0) and np.all(seen < case.camera.image_size_px))


def of_the_tag(case: Case) -> tuple[float, ...] | None:
    """Return error of place in mm and of direction in deg, and both in deviations."""
    clamp = case.scene.clamp
    seen = find_tag(case.photo.grey, case.camera, clamp.label.tag)
    if seen is None:
        return None
    (true,) = clamp.pose.to_board(np.array([[clamp.label.x_mm, clamp.label.y_mm]]))
    away = np.hypot(*(true - (seen.pose.x_mm, seen.pose.y_mm)))
    turn = seen.pose.angle_deg - clamp.pose.angle_deg - clamp.label.angle_deg
    turn = abs((turn + 180.0) % 360.0 - 180.0)
    return away, turn, away / seen.place_sd_mm, turn / seen.angle_sd_deg


def learnt(case: Case, folder: Path) -> ClampTag:
    """Return the tag's place from three photographs of other rods in this clamp."""
    for k, bend_deg in enumerate((0.0, 8.0, -8.0)):
        scene = replace(
            case.scene, centreline=curve("arc", angle_deg=bend_deg, length_mm=18.0),
            marks=(), others=(), blocks=(), light=SceneLight(), rod_colour=RUBBER,
            rod_stripe=None, paper=PAPER,
        )  # fmt: skip
        picture = render_scene(scene, case.camera, np.random.default_rng(k))
        cv2.imwrite(str(folder / f"{k}.png"), picture)
    setting = Setting(
        calibration=case.camera, rod_height_mm=case.height_mm,
        clamp_height_mm=case.scene.clamp.height_mm,
    )  # fmt: skip
    return tag_place([folder], setting, case.scene.clamp.label.tag).tag


def line(name: str, rows: list[Row]) -> str:
    turn = np.array([row.pull * row.found.clamp_angle_sd_deg for row in rows])
    rms, tip, pull = (
        np.array([getattr(row, name) for row in rows])
        for name in ("rms", "tip", "pull")
    )
    return (
        f"{name:8} {np.sqrt(np.mean(turn**2)):9.3f} {np.sqrt(np.mean(pull**2)):6.2f} "
        f"{np.median(rms):8.4f} {np.quantile(rms, 0.9):7.4f} {rms.max():7.4f} "
        f"{np.median(tip):8.4f} {np.quantile(tip, 0.9):7.4f} {tip.max():7.4f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=9401)
    options = parser.parse_args()
    tags, pairs, whole, unlearnt = [], [], 0, 0
    for index in range(options.count):
        case = labelled(options.seed, index)
        tag = of_the_tag(case)
        whole += is_whole(case)
        if tag is None:
            continue
        tags.append(tag)
        with tempfile.TemporaryDirectory() as name:
            try:
                told = replace(case.camera, clamp_tag=learnt(case, Path(name)))
            except VisionError:
                unlearnt += 1
                continue
        pairs.append((measured(case), measured(replace(case, camera=told))))
    place, turn, place_z, turn_z = np.array(tags).T
    place_um = 1e3 * place
    print(
        f"{options.count} benches, the whole tag in the picture in {whole}: found in "
        f"{len(tags)}, its middle right to "
        f"{np.sqrt(np.mean(place_um**2)):.1f} um RMS (worst {place_um.max():.1f}, "
        f"z RMS {np.sqrt(np.mean(place_z**2)):.1f}), its direction to "
        f"{np.sqrt(np.mean(turn**2)):.3f} deg (worst {turn.max():.3f}, z RMS "
        f"{np.sqrt(np.mean(turn_z**2)):.1f})"
    )
    refused = sum(not pair[0].found.ok for pair in pairs)
    both = [pair for pair in pairs if pair[0].found.ok]
    print(
        f"not learnt in {unlearnt} (the straight rod leaves the picture, or stands in "
        f"shade), refused {refused}; the other {len(both)}, errors of the rod:"
    )
    print(f"{'':8} direction      z  RMS med    90 %   worst  tip med    90 %   worst")
    print(line("rod", [pair[0] for pair in both]))
    print(line("tag", [pair[1] for pair in both]))
    flagged = [own.wrong for own, told in both if "tag_differs" in told.found.flags]
    print(f"tag_differs: {len(flagged)}, of them wrong without the tag: {sum(flagged)}")


if __name__ == "__main__":
    main()
