"""Scenes of strangers' benches, drawn at random, with exact truth.

A scene has a kind, which says what is difficult in it; everything else is drawn alike:
materials, clamp, paper, lens, lamps, bend and place.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from magbend.vision import Calibration, Photo, Pose, as_photo, specimen_to_px
from magbend.vision.synthetic import (
    BLACK,
    BLUE,
    GREY,
    PAPER,
    RUBBER,
    Block,
    Label,
    Mark,
    Rod,
    Scene,
    SceneLight,
    curve,
    render_scene,
    scene_camera,
)

KINDS = ("plain", "light", "clutter", "telephone", "colour", "blur", "mixed")
"""Plain; hard light; things beside the rod; f = 4 mm lens and tilt; rod, paper and
clamp of any colour; defocus, motion, grain or gloss; several of these at once."""

DEFECTS = ("defocus", "motion", "grain", "gloss", "exposure")

WHITE = (0.62, 0.62, 0.60)
CREAM = (0.52, 0.64, 0.68)
GREEN_BOARD = (0.16, 0.30, 0.10)
BLUE_BOARD = (0.38, 0.22, 0.10)
WOOD = (0.16, 0.30, 0.42)
DARK_BOARD = (0.04, 0.04, 0.045)
RED = (0.04, 0.04, 0.35)
GREEN = (0.06, 0.25, 0.05)
YELLOW = (0.05, 0.45, 0.55)
SILICONE = (0.55, 0.58, 0.60)
INK = (0.05, 0.05, 0.05)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A photograph, its camera, and what it shows."""

    kind: str
    words: str
    photo: Photo
    camera: Calibration
    scene: Scene

    @property
    def height_mm(self) -> float:
        return self.scene.clamp.pose.height_mm


def draw_case(
    seed: int, index: int, label: Label | None = None, defect: str | None = None,
    skew_deg: float = 0.0,
) -> Case:  # fmt: skip
    """Draw a scene: the same for the same seed and index, with a tag on its clamp.

    `defect` is one of `DEFECTS` that a scene of kind "blur" is to have; `skew_deg` the
    standard deviation by which clamps are not square to their rods.
    """
    kind = KINDS[index % len(KINDS)]
    rng = np.random.default_rng([seed, index])
    while True:
        camera = _camera(
            rng, telephone=kind == "telephone" or (kind == "mixed" and index % 2 == 0)
        )
        scene = _plain(rng, camera)
        if scene is not None:
            break
    words = ""
    if kind == "light":
        scene, words = _hard_light(rng, scene), "hard light"
    elif kind == "clutter":
        scene, words = _cluttered(rng, scene, camera)
    elif kind == "colour":
        scene, words = _coloured(rng, scene)
    elif kind == "blur":
        scene, words = _blurred(rng, scene, defect)
    elif kind == "mixed":
        scene, words = _mixed(rng, scene, camera)
    turn = skew_deg * np.random.default_rng([seed, index, 1]).normal()
    scene = replace(scene, clamp=replace(scene.clamp, skew_deg=float(turn)))
    if label is not None:
        scene = replace(scene, clamp=_labelled(scene.clamp, label))
    picture = render_scene(scene, camera, rng)
    quality = int(rng.choice([80, 90, 95, 100]))
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    photo = as_photo(cv2.imdecode(data, cv2.IMREAD_COLOR), source=f"{kind}_{index:03}")
    return Case(kind=kind, words=words, photo=photo, camera=camera, scene=scene)


def _labelled(clamp: Block, label: Label) -> Block:
    """Return a clamp with a tag on its top, wide enough for it."""
    tag = replace(label.tag, height_mm=clamp.height_mm)
    wide = max(clamp.width_mm, 11.0)
    label = replace(label, tag=tag)
    return replace(clamp, width_mm=wide, screws_mm=(), label=label)


def _camera(rng: np.random.Generator, *, telephone: bool) -> Calibration:
    scale = rng.uniform(16.0, 26.0)
    if telephone:  # 1600 px over 6.4 mm of sensor or less: 4 mm are 1000 to 1400 px
        focal, tilt = rng.uniform(1150.0, 1500.0), rng.uniform(2.0, 12.0)
        k1 = -rng.uniform(0.0, 0.12)
    else:
        focal, tilt = rng.uniform(3500.0, 9000.0), rng.uniform(0.0, 6.0)
        k1 = -rng.uniform(0.0, 0.15) if rng.random() < 0.4 else 0.0
    return scene_camera(
        focal_px=focal, height_mm=focal / scale, tilt_deg=tilt,
        tilt_direction_deg=rng.uniform(0.0, 360.0), turn_deg=rng.uniform(-5.0, 5.0),
        target_mm=(0.0, 0.0), distortion=(k1, 0.0, 0.0, 0.0, 0.0),
    )  # fmt: skip


def _plain(rng: np.random.Generator, camera: Calibration) -> Scene | None:
    kind = ("arc", "graded", "graded", "s", "straight")[rng.integers(5)]
    bend = rng.uniform(10.0, 130.0) * rng.choice([-1.0, 1.0])
    bend = 0.4 * bend if kind == "s" else bend
    line = curve(kind, angle_deg=bend, length_mm=rng.uniform(24.0, 32.0))
    side = float(rng.choice([0.75, 1.0, 1.25]))
    heading = 90.0 * rng.integers(4) + rng.uniform(-10.0, 10.0)
    pose = Pose(
        x_mm=0.0, y_mm=0.0, angle_deg=heading,
        height_mm=side / 2.0 + rng.uniform(0.2, 1.5),
    )  # fmt: skip
    low, high = _seen_box(camera)
    points = pose.to_board(np.vstack([line.points_mm, [[-6.0, 0.0]]]))
    room = (high - low) - np.ptp(points, axis=0) - 4.0
    if np.any(room < 0.0):
        return None
    x, y = low + 2.0 - points.min(axis=0) + rng.random(2) * room
    pose = replace(pose, x_mm=float(x), y_mm=float(y))
    seen = specimen_to_px(camera, pose, line.points_mm[::40])
    if np.any(seen < 25.0) or np.any(seen > np.array(camera.image_size_px) - 25.0):
        return None
    clamp = Block(
        pose=pose, width_mm=rng.uniform(8.0, 14.0), height_mm=rng.uniform(3.0, 6.0),
        colour=(GREY, BLUE, BLACK)[rng.integers(3)], length_mm=90.0,
    )  # fmt: skip
    light = SceneLight(
        shadow_direction_deg=rng.uniform(0.0, 360.0),
        shadow_depth=rng.uniform(0.1, 0.35), gradient=rng.uniform(0.0, 0.25),
        slope=rng.uniform(0.3, 1.0), softness=rng.uniform(0.15, 0.5),
        vignette=rng.uniform(0.0, 0.2), blur_px=rng.uniform(0.5, 1.2),
        noise=rng.uniform(0.003, 0.012),
    )  # fmt: skip
    return Scene(
        clamp=clamp, centreline=line, side_mm=side, light=light,
        dust=int(rng.integers(30)), paper_seed=int(rng.integers(10**6)),
    )  # fmt: skip


def _seen_box(camera: Calibration) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest upright box of the paper that the camera sees, roughly."""
    width, height = camera.image_size_px
    corners = camera.to_mm(
        np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=float)
    )
    (x0, x1), (y0, y1) = np.sort(corners[:, 0])[[1, 2]], np.sort(corners[:, 1])[[1, 2]]
    return np.array([x0, y0]), np.array([x1, y1])


def _hard_light(rng: np.random.Generator, scene: Scene) -> Scene:
    light = replace(
        scene.light, shadow_depth=rng.uniform(0.4, 0.65),
        slope=rng.uniform(0.3, 1.5), softness=rng.uniform(0.05, 0.3),
        gradient=rng.uniform(0.2, 0.5), vignette=rng.uniform(0.1, 0.4),
    )  # fmt: skip
    return replace(scene, light=light)


def _mixed(
    rng: np.random.Generator, scene: Scene, camera: Calibration
) -> tuple[Scene, str]:
    """Return a scene with hard light or blur, clutter, and perhaps colours."""
    scene, words = _cluttered(rng, scene, camera)
    if rng.random() < 0.4:
        scene, more = _coloured(rng, scene)
        words += "; " + more
    if rng.random() < 0.5:
        return _hard_light(rng, scene), words + "; hard light"
    scene, more = _blurred(rng, scene)
    return scene, f"{words}; {more}"


def _blurred(
    rng: np.random.Generator, scene: Scene, word: str | None = None
) -> tuple[Scene, str]:
    light, word = scene.light, word or DEFECTS[rng.integers(len(DEFECTS))]
    if word == "defocus":
        light = replace(light, blur_px=rng.uniform(1.5, 3.0))
    elif word == "motion":
        turn, far = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(2.0, 6.0)
        smear = (float(far * np.cos(turn)), float(far * np.sin(turn)))
        light = replace(light, motion_px=smear)
    elif word == "grain":
        light = replace(light, noise=rng.uniform(0.02, 0.05))
    elif word == "gloss":
        light = replace(light, gloss=rng.uniform(0.1, 0.6))
    else:
        light = replace(light, exposure=rng.uniform(1.5, 2.5))
    return replace(scene, light=light), word


def _coloured(rng: np.random.Generator, scene: Scene) -> tuple[Scene, str]:
    names = ("red on white", "green on cream", "blue on wood", "white on green board",
             "yellow on blue board", "silicone on dark board", "black on wood",
             "red on green board", "striped on white")  # fmt: skip
    word = names[rng.integers(len(names))]
    rod, paper = {
        "red on white": (RED, WHITE), "green on cream": (GREEN, CREAM),
        "blue on wood": (BLUE, WOOD), "white on green board": (SILICONE, GREEN_BOARD),
        "yellow on blue board": (YELLOW, BLUE_BOARD),
        "silicone on dark board": (SILICONE, DARK_BOARD),
        "black on wood": (RUBBER, WOOD),
        "red on green board": (RED, GREEN_BOARD), "striped on white": (GREEN, PAPER),
    }[word]  # fmt: skip
    stripe = YELLOW if word.startswith("striped") else None
    clamp = scene.clamp
    if word.endswith("dark board"):  # a black clamp could not be seen there
        clamp = replace(clamp, colour=GREY)
    scene = replace(scene, clamp=clamp, rod_colour=rod, paper=paper, rod_stripe=stripe)
    return scene, word


def _cluttered(
    rng: np.random.Generator, scene: Scene, camera: Calibration
) -> tuple[Scene, str]:
    low, high = _seen_box(camera)
    words = ("ruler", "pencil line", "shade strip", "grid paper", "table edge",
             "magnet", "second rod")  # fmt: skip
    chosen = sorted({words[rng.integers(len(words))] for _ in range(2)})
    for word in chosen:
        scene = _with(word, rng, scene, low, high)
    return scene, "; ".join(chosen)


def _with(
    word: str, rng: np.random.Generator, scene: Scene, low: np.ndarray, high: np.ndarray
) -> Scene:
    if word == "magnet":
        at, heading = _free_spot(rng, scene, low, high, 7.0)
        pose = Pose(x_mm=at[0], y_mm=at[1], angle_deg=heading)
        block = Block(
            pose=pose, length_mm=8.0, width_mm=8.0, height_mm=8.0,
            colour=(0.3, 0.3, 0.3), screws_mm=(),
        )  # fmt: skip
        return replace(scene, blocks=(*scene.blocks, block))
    if word == "second rod":
        line = curve("arc", angle_deg=rng.uniform(-40.0, 40.0), length_mm=12.0)
        at, heading = _free_spot(rng, scene, low, high, 3.0)
        pose = Pose(x_mm=at[0], y_mm=at[1], angle_deg=heading, height_mm=0.6)
        other = Rod(line=line, pose=pose, side_mm=rng.uniform(0.5, 1.2))
        return replace(scene, others=(*scene.others, other))
    return replace(scene, marks=(*scene.marks, *_marks(word, rng, scene, low, high)))


def _marks(
    word: str, rng: np.random.Generator, scene: Scene, low: np.ndarray, high: np.ndarray
) -> list[Mark]:
    along = bool(rng.integers(2))
    across = 1 if along else 0
    if word == "grid paper":
        step, tint = rng.uniform(4.0, 6.0), (0.85, 0.75, 0.55)
        return [
            _bar(axis, value, low - 5.0, high + 5.0, 0.15, tint)
            for axis in (0, 1)
            for value in np.arange(low[axis] - 5.0, high[axis] + 5.0, step)
        ]
    edge = rng.choice([low[across] + 1.5, high[across] - 1.5])
    clear = _clear_of_rod(scene, across, low[across], high[across], rng, edge)
    if word == "pencil line":
        return [_bar(across, clear, low - 5.0, high + 5.0, 0.4, (0.35, 0.35, 0.38))]
    if word == "shade strip":
        strip = _bar(across, clear, low - 9.0, high + 9.0, 4.0, INK)
        return [replace(strip, cover=rng.uniform(0.35, 0.6), softness_mm=0.8)]
    if word == "table edge":
        outside = edge + (3.5 if edge > 0.5 * (low + high)[across] else -3.5)
        return [_bar(across, outside, low - 9.0, high + 9.0, 7.0, (0.15, 0.2, 0.3))]
    ticks = np.arange(low[1 - across], high[1 - across], 1.0)
    body = _bar(across, clear, low - 9.0, high + 9.0, 5.0, (0.5, 0.75, 0.85))
    lines = []
    for k, at in enumerate(ticks):
        reach = 1.2 if k % 5 == 0 else 0.7
        mark = _bar(1 - across, at, low, high, 0.15, INK)
        corners = mark.outline_mm.copy()
        corners[:, across] = np.clip(
            corners[:, across], clear - 2.5, clear - 2.5 + reach
        )
        lines.append(replace(mark, outline_mm=corners))
    return [body, *lines]


def _bar(
    axis: int, value: float, low: np.ndarray, high: np.ndarray, width_mm: float,
    colour: tuple[float, float, float],
) -> Mark:  # fmt: skip
    """Return a bar across the picture: `axis` 0 stands at an x, 1 at a y."""
    half = 0.5 * width_mm
    corners = np.array(
        [[value - half, low[1 - axis]], [value + half, low[1 - axis]],
         [value + half, high[1 - axis]], [value - half, high[1 - axis]]]
    )  # fmt: skip
    return Mark(outline_mm=corners[:, ::-1] if axis else corners, colour=colour)


def _rod_points(scene: Scene) -> np.ndarray:
    return scene.clamp.pose.to_board(scene.centreline.points_mm[::20])


def _clear_of_rod(
    scene: Scene, axis: int, low: float, high: float, rng: np.random.Generator,
    edge: float,
) -> float:  # fmt: skip
    """Return a place along an axis that is 2.8 mm clear of the rod, else the edge."""
    held = _rod_points(scene)[:, axis]
    for _ in range(30):
        value = rng.uniform(low + 1.0, high - 1.0)
        if value < held.min() - 2.8 or value > held.max() + 2.8:
            return float(value)
    return float(edge)


def _free_spot(
    rng: np.random.Generator, scene: Scene, low: np.ndarray, high: np.ndarray,
    clear_mm: float,
) -> tuple[tuple[float, float], float]:  # fmt: skip
    """Return a place clear of the rod and its clamp, or just outside the picture."""
    behind = scene.clamp.pose.to_board(np.array([[-x, 0.0] for x in range(0, 60, 3)]))
    held = np.vstack([_rod_points(scene), behind])
    for _ in range(200):
        x, y = low + rng.random(2) * (high - low)
        heading = rng.uniform(0.0, 360.0)
        ahead = np.radians(heading)
        spots = np.array([[x, y]]) + np.outer(
            [0.0, 6.0, 12.0], [np.cos(ahead), np.sin(ahead)]
        )
        away = np.hypot(*(held[:, None] - spots[None]).reshape(-1, 2).T)
        if away.min() > clear_mm:
            return (float(x), float(y)), heading
    return (float(high[0]) + 60.0, float(high[1])), 0.0
