"""A bench as its camera sees it: paper, clamp, rod and shadows in true perspective.

What the twin bench photographs. Every surface is a polygon projected through a
`Calibration`, so the picture and the truth share one camera; coverage is exact
(`raster`). Lengths are mm in the board frame of `calibration`, whose plane z = 0 is the
paper. Light is linear until the last step; pictures are (h, w, 3) in the order blue,
green, red, as OpenCV reads and writes them.
"""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from ..camera.board import Board
from ..camera.calibration import Calibration
from ..measurement import Pose
from ..picture.raster import coverage, coverage_of
from ..picture.srgb import encode_srgb
from .drawing import (
    block_shadow,
    block_walls,
    draw_mark,
    draw_rod,
    draw_top,
    paint,
    ridge_walls,
    ridges_shadow,
    rod_shadow,
    scaled,
    subdivide,
)
from .parts import INK, PAPER, Block, Colour, Scene, SceneLight
from .ridges import ridge_tops

Array = NDArray[np.float64]
Picture = NDArray[np.float32]

_MOSAIC = 0.6
"""Noise that three channels share, over the noise of one alone: about 1/sqrt(3)."""


def render_scene(
    scene: Scene, camera: Calibration, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Photograph a scene.

    Parameters
    ----------
    scene : Scene
        What lies on the paper.
    camera : Calibration
        The camera, exactly (see `scene_camera`).
    rng : numpy.random.Generator
        Source of the sensor's noise, and of nothing else.

    Returns
    -------
    ndarray of uint8, shape (h, w, 3)
        Blue, green, red in sRGB.
    """
    return expose(paint_scene(scene, camera), scene.light, rng)


def paint_scene(scene: Scene, camera: Calibration) -> Picture:
    """Return the light of a scene before lens and sensor: the slow, repeatable part.

    Parameters
    ----------
    scene : Scene
        What lies on the paper.
    camera : Calibration
        The camera, exactly (see `scene_camera`).

    Returns
    -------
    ndarray of float32, shape (h, w, 3)
        Linear blue, green, red; `expose` makes a photograph of it.
    """
    light = scene.light
    picture = _paper(scene, camera)
    for mark in scene.marks:
        draw_mark(picture, mark, camera)
    blocks = (scene.clamp, *scene.blocks)
    shade = np.zeros(picture.shape[:2], dtype=np.float32)
    for block in blocks:
        shade = np.maximum(shade, block_shadow(block, camera, light))
    for rod in scene.rods:
        shade = np.maximum(shade, rod_shadow(rod, camera, light))
    if scene.ridges:
        shade = np.maximum(shade, ridges_shadow(scene.ridges, camera, light))
    picture *= (1.0 - light.shadow_depth * shade)[..., None]
    for block in blocks:
        paint(picture, block_walls(block, camera), scaled(block.colour, 0.72))
    tops = None
    if scene.ridges:
        tops = ridge_tops(scene.ridges, camera)
        faces = ridge_walls(scene.ridges, camera)
        paint(picture, faces, scaled(scene.ridges[0].colour, 0.72))
    for rod in scene.rods:
        draw_rod(picture, rod, camera, light.gloss, tops)
    for block in blocks:
        draw_top(picture, block, camera)
    if tops is not None:
        paint(picture, tops, scene.ridges[0].colour)
    return picture


def render_board(
    board: Board, camera: Calibration, rng: np.random.Generator, *,
    light: SceneLight | None = None, paper_seed: int = 0,
) -> NDArray[np.uint8]:  # fmt: skip
    """Photograph the calibration board lying in the paper's plane.

    Parameters
    ----------
    board : Board
        A ChArUco board, its frame that of `camera`.
    camera : Calibration
        The camera, exactly.
    rng : numpy.random.Generator
        Source of the sensor's noise.
    light : SceneLight, optional
        Lamps, lens and sensor.
    paper_seed : int
        Which sheet of paper it is printed on.

    Returns
    -------
    ndarray of uint8, shape (h, w, 3)
        Blue, green, red in sRGB.
    """
    lit = light or SceneLight()
    empty = Scene(
        clamp=Block(pose=Pose(x_mm=0.0, y_mm=0.0, angle_deg=0.0)),
        light=lit, dust=0, paper_seed=paper_seed,
    )  # fmt: skip
    picture = _paper(empty, camera)
    outlines, signs = board.black_polygons()
    pixels = [camera.to_px(subdivide(outline)) for outline in outlines]
    ink = coverage_of(pixels, signs, *camera.image_size_px)
    paint(picture, ink, INK)
    return expose(picture, lit, rng)


def _paper(scene: Scene, camera: Calibration) -> Picture:
    """Return the empty paper: fibres, specks, and the light that falls on it."""
    size = camera.image_size_px
    return _sheet(scene.paper_seed, scene.dust, scene.light, scene.paper, *size).copy()


@lru_cache(maxsize=2)
def _sheet(
    seed: int, dust: int, light: SceneLight, paper: Colour, width: int, height: int
) -> Picture:
    rng = np.random.default_rng(seed)
    texture = np.ones((height, width), dtype=np.float32)
    for cell_px, amount in ((6, 0.004), (24, 0.006), (120, 0.008)):
        shape = (height // cell_px + 3, width // cell_px + 3)
        coarse = rng.standard_normal(shape, dtype=np.float32)
        texture += amount * cv2.resize(
            coarse, (width, height), interpolation=cv2.INTER_CUBIC
        )
    for _ in range(dust):
        x, y = rng.uniform(size=2) * (width, height)
        radius = rng.uniform(0.4, 1.6)
        angle = np.linspace(0.0, 2.0 * np.pi, 13)[:-1]
        speck = np.column_stack(
            [x + radius * np.cos(angle), y + radius * np.sin(angle)]
        )
        texture *= 1.0 - 0.7 * coverage(speck, width, height)
    texture *= _lamps(light, width, height)
    return np.asarray(texture[..., None] * np.array(paper, dtype=np.float32))


def _lamps(light: SceneLight, width: int, height: int) -> Picture:
    """Return the light on each pixel: a slope across and a fall to the corners."""
    x = np.linspace(-0.5, 0.5, width, dtype=np.float32)[None, :]
    y = np.linspace(-0.5, 0.5, height, dtype=np.float32)[:, None]
    direction = math.radians(light.shadow_direction_deg)
    along = math.cos(direction) * x - math.sin(direction) * y
    return np.asarray(
        (1.0 - light.gradient * (along + 0.5) * 0.7)
        * (1.0 - light.vignette * 2.0 * (x * x + y * y)),
        dtype=np.float32,
    )


def expose(
    picture: Picture, light: SceneLight, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Blur, add the noise of light (its root) and of the sensor, and encode.

    The noise is that of a colour mosaic: after its interpolation the three channels of
    a pixel rise and fall together.
    """
    blurred: Picture = np.asarray(
        cv2.GaussianBlur(picture, (0, 0), light.blur_px), dtype=np.float32
    )
    if any(light.motion_px):
        blurred = np.asarray(cv2.filter2D(blurred, -1, _smear(light.motion_px)))
    if light.exposure != 1.0:
        blurred = blurred * np.float32(light.exposure)
    green = np.maximum(blurred[..., 1], np.float32(0.02)) / np.float32(PAPER[1])
    noise = rng.standard_normal(green.shape, dtype=np.float32)
    noise *= np.float32(_MOSAIC * light.noise) * np.sqrt(green)
    blurred += noise[..., None]
    return encode_srgb(blurred)


def _smear(motion_px: tuple[float, float]) -> Picture:
    """Return the kernel of a straight motion while the shutter is open."""
    reach = math.ceil(max(map(abs, motion_px))) + 1
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1), np.float32)
    t = np.linspace(-0.5, 0.5, 201)
    x, y = (reach + t * step for step in motion_px)
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    v, u = y - i, x - j
    for di, dj, part in (
        (0, 0, (1 - u) * (1 - v)), (0, 1, u * (1 - v)), (1, 0, (1 - u) * v),
        (1, 1, u * v),
    ):  # fmt: skip
        np.add.at(kernel, (i + di, j + dj), part.astype(np.float32))
    return np.asarray(kernel / kernel.sum(), np.float32)
