"""A bench as its camera sees it: paper, clamp, rod and shadows in true perspective.

What the twin bench photographs. Every surface is a polygon projected through a
`Calibration`, so the picture and the truth share one camera; coverage is exact
(`raster`). Lengths are mm in the board frame of `calibration`, whose plane z = 0 is the
paper. Light is linear until the last step; pictures are (h, w, 3) in the order blue,
green, red, as OpenCV reads and writes them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ..camera.board import Board
from ..camera.calibration import Calibration
from ..edge.wall_light import reflectance
from ..measurement import Pose
from ..picture.raster import coverage, coverage_of, strip
from ..picture.srgb import encode_srgb

Array = NDArray[np.float64]
Picture = NDArray[np.float32]
Colour = tuple[float, float, float]

GREY: Colour = (0.21, 0.20, 0.20)
BLUE: Colour = (0.42, 0.13, 0.05)
BLACK: Colour = (0.045, 0.045, 0.045)
PAPER: Colour = (0.70, 0.71, 0.71)
RUBBER: Colour = (0.048, 0.048, 0.048)

SHEEN, WALL_SKY = 0.4, 0.4
"""What a wall of the rod mirrors of the paper, over Fresnel's reflectance of a smooth
one, and its diffuse light over the top's: those of path-traced rubber."""
_MOSAIC = 0.6
"""Noise that three channels share, over the noise of one alone: about 1/sqrt(3)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A box standing on the paper: the printed clamp, or a magnet at the edge.

    Parameters
    ----------
    pose : Pose
        Middle of its front edge, and the direction its front face looks.
    length_mm, width_mm, height_mm : float
        Back from the front face, across, and above the paper.
    colour : tuple of float
        Reflectance in blue, green, red, from 0 to 1.
    screws_mm : tuple of float
        Distances of screw heads behind the front face.
    """

    pose: Pose
    length_mm: float = 60.0
    width_mm: float = 10.0
    height_mm: float = 4.0
    colour: Colour = GREY
    screws_mm: tuple[float, ...] = (6.0, 16.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneLight:
    """Lamps, lens and sensor; levels are linear.

    Parameters
    ----------
    shadow_direction_deg : float
        Where shadows fall, counter-clockwise from the board's +x.
    shadow_depth : float
        Share of the light that the lamp behind the shadows gives.
    slope : float
        How far a shadow lies from its object, in mm per mm of height.
    softness : float
        Standard deviation of the shadow's edge, in mm per mm of height.
    gradient, vignette : float
        Loss of light across the picture, and toward its corners, relative.
    gloss : float
        Light added by a highlight on the rod, at its middle third.
    blur_px, noise : float
        Standard deviations of the lens blur, and of the noise on white paper.
    """

    shadow_direction_deg: float = -40.0
    shadow_depth: float = 0.35
    slope: float = 0.7
    softness: float = 0.25
    gradient: float = 0.10
    vignette: float = 0.05
    gloss: float = 0.0
    blur_px: float = 0.7
    noise: float = 0.006


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What lies on the paper.

    Parameters
    ----------
    clamp : Block
        Its pose is where the rod leaves it; `pose.height_mm` is the height of the rod's
        axis above the paper.
    centreline : Centreline or None
        The rod's axis in the specimen frame; None leaves the clamp empty.
    side_mm : float
        Side of the square rod.
    blocks : tuple of Block
        Other things on the paper.
    light : SceneLight
        Lamps, lens and sensor.
    dust : int
        Number of specks on the paper.
    paper_seed : int
        Which sheet of paper it is: the same seed has the same fibres and specks.
    """

    clamp: Block
    centreline: Centreline | None = None
    side_mm: float = 1.0
    blocks: tuple[Block, ...] = ()
    light: SceneLight = field(default_factory=SceneLight)
    dust: int = 12
    paper_seed: int = 0


def scene_camera(
    *,
    size_px: tuple[int, int] = (1600, 1200),
    focal_px: float = 6800.0,
    height_mm: float = 330.0,
    tilt_deg: float = 1.5,
    tilt_direction_deg: float = 60.0,
    turn_deg: float = 0.0,
    target_mm: tuple[float, float] = (35.0, -25.0),
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0),
) -> Calibration:
    """Return the exact calibration of a camera above the paper.

    Parameters
    ----------
    size_px : tuple of int
        Width and height of its pictures.
    focal_px : float
        Focal length in pixels.
    height_mm : float
        Distance from the camera to the point it looks at.
    tilt_deg, tilt_direction_deg : float
        Angle of its axis from the vertical, and toward where the camera is moved.
    turn_deg : float
        Turn of the picture about the axis.
    target_mm : tuple of float
        The point it looks at, in the board frame.
    distortion : tuple of float
        k1, k2, p1, p2, k3.
    """
    tilt, toward, turn = np.radians([tilt_deg, tilt_direction_deg, turn_deg])
    backward = np.array(
        [
            math.sin(tilt) * math.cos(toward),
            math.sin(tilt) * math.sin(toward),
            math.cos(tilt),
        ]
    )
    up = np.array([-math.sin(turn), math.cos(turn), 0.0])
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(right, backward), -backward])
    camera = np.array([*target_mm, 0.0]) + height_mm * backward
    width, height = size_px
    return Calibration(
        image_size_px=size_px,
        focal_px=(focal_px, focal_px),
        centre_px=((width - 1) / 2.0, (height - 1) / 2.0),
        distortion=distortion,
        rotation=rotation,
        translation_mm=-rotation @ camera,
        camera_height_sd_mm=0.0,
        camera_height_source="exact",
        scale_relative_sd=0.0,
        rms_px=0.0,
        board="exact",
    )


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
    blocks = (scene.clamp, *scene.blocks)
    shade = np.zeros(picture.shape[:2], dtype=np.float32)
    for block in blocks:
        shade = np.maximum(shade, _block_shadow(block, camera, light))
    if scene.centreline is not None:
        shade = np.maximum(shade, _rod_shadow(scene, camera))
    picture *= (1.0 - light.shadow_depth * shade)[..., None]
    for block in blocks:
        _paint(picture, _block_walls(block, camera), _scaled(block.colour, 0.72))
    if scene.centreline is not None:
        _draw_rod(picture, scene, camera)
    for block in blocks:
        _draw_top(picture, block, camera)
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
    pixels = [camera.to_px(_subdivide(outline)) for outline in outlines]
    ink = coverage_of(pixels, signs, *camera.image_size_px)
    _paint(picture, ink, (0.035, 0.035, 0.035))
    return expose(picture, lit, rng)


def _paper(scene: Scene, camera: Calibration) -> Picture:
    """Return the empty paper: fibres, specks, and the light that falls on it."""
    size = camera.image_size_px
    return _sheet(scene.paper_seed, scene.dust, scene.light, *size).copy()


@lru_cache(maxsize=2)
def _sheet(seed: int, dust: int, light: SceneLight, width: int, height: int) -> Picture:
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
    return np.asarray(texture[..., None] * np.array(PAPER, dtype=np.float32))


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


def _block_corners(block: Block) -> Array:
    half = block.width_mm / 2.0
    corners = np.array(
        [[0.0, half], [0.0, -half], [-block.length_mm, -half], [-block.length_mm, half]]
    )
    return block.pose.to_board(corners)


def _block_walls(block: Block, camera: Calibration) -> Picture:
    corners = _block_corners(block)
    pixels = np.concatenate(
        [
            camera.to_px(_subdivide(corners), height_mm=height)
            for height in (0.0, block.height_mm)
        ]
    )
    size = camera.image_size_px
    top = camera.to_px(_subdivide(corners), height_mm=block.height_mm)
    return _beside(coverage(_hull(pixels), *size), coverage(top, *size))


def _beside(whole: Picture, top: Picture) -> Picture:
    """Return where walls must be laid before the top: not where both end together.

    There each would cover its share of the pixel, and the edge move out by a sixth.
    """
    return np.where(whole > top + 1e-3, whole, np.float32(0.0))


def _draw_top(picture: Picture, block: Block, camera: Calibration) -> None:
    size = camera.image_size_px
    height = block.height_mm
    top = camera.to_px(_subdivide(_block_corners(block)), height_mm=height)
    _paint(picture, coverage(top, *size), block.colour)
    angle = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
    for behind_mm in block.screws_mm:
        for radius, sides, factor in ((1.6, 48, 1.25), (0.8, 6, 0.8)):
            around = angle[:: 48 // sides]
            ring = np.column_stack(
                [radius * np.cos(around) - behind_mm, radius * np.sin(around)]
            )
            outline = camera.to_px(block.pose.to_board(ring), height_mm=height)
            colour = _scaled(block.colour, factor)
            _paint(picture, coverage(outline, *size), colour)


def _block_shadow(block: Block, camera: Calibration, light: SceneLight) -> Picture:
    corners = _block_corners(block)
    shifted = corners + _shadow_shift(light, block.height_mm)
    outline = _hull(camera.to_px(_subdivide(_hull(np.concatenate([corners, shifted])))))
    sharp = coverage(outline, *camera.image_size_px)
    return _soften(sharp, light.softness * block.height_mm / _scale(camera))


def _rod_outline(scene: Scene, camera: Calibration, height_mm: float) -> Array:
    """Return the outline in pixels of the rod's section at a height above the paper."""
    line = scene.centreline
    if line is None:
        return np.empty((0, 2))
    left = np.column_stack([-np.sin(line.theta_rad), np.cos(line.theta_rad)])
    outline = strip(line.points_mm, left, scene.side_mm / 2.0)
    return camera.to_px(scene.clamp.pose.to_board(outline), height_mm=height_mm)


def _rod_shadow(scene: Scene, camera: Calibration) -> Picture:
    line, light = scene.centreline, scene.light
    if line is None:
        return np.zeros(camera.image_size_px[::-1], dtype=np.float32)
    height = scene.clamp.pose.height_mm
    left = np.column_stack([-np.sin(line.theta_rad), np.cos(line.theta_rad)])
    outline = strip(line.points_mm, left, scene.side_mm / 2.0)
    fallen = scene.clamp.pose.to_board(outline) + _shadow_shift(light, height)
    sharp = coverage(camera.to_px(fallen), *camera.image_size_px)
    return _soften(sharp, light.softness * height / _scale(camera))


def _draw_rod(picture: Picture, scene: Scene, camera: Calibration) -> None:
    """Draw the walls, then the top face: each a stack of outlines at their heights."""
    size = camera.image_size_px
    axis = scene.clamp.pose.height_mm
    levels = axis + scene.side_mm * np.linspace(-0.5, 0.5, 5)
    walls = np.zeros(picture.shape[:2], dtype=np.float32)
    for height in levels[:-1]:
        np.maximum(
            walls, coverage(_rod_outline(scene, camera, height), *size), out=walls
        )
    top = coverage(_rod_outline(scene, camera, levels[-1]), *size)
    np.maximum(walls, top, out=walls)
    walls = _beside(walls, top)
    mirrored = SHEEN * walls * _mirroring(scene, camera)
    seen = mirrored[..., None] * picture
    _paint(picture, walls, _scaled(RUBBER, WALL_SKY))
    picture += seen
    _paint(picture, top, RUBBER)
    if scene.light.gloss > 0.0:
        _draw_gloss(picture, scene, camera, levels[-1])


def _mirroring(scene: Scene, camera: Calibration) -> Picture:
    """Return the reflectance of the rod's walls, by Fresnel's formula."""
    size = camera.image_size_px
    out = np.zeros(size[::-1], dtype=np.float32)
    line, pose = scene.centreline, scene.clamp.pose
    if line is None:
        return out
    axis = pose.to_board(line.points_mm)
    left = np.column_stack([-np.sin(line.theta_rad), np.cos(line.theta_rad)])
    beside = pose.to_board(line.points_mm + left)
    at = camera.to_px(axis, height_mm=pose.height_mm)
    across = camera.to_px(beside, height_mm=pose.height_mm) - at
    rise = camera.to_px(axis, height_mm=pose.height_mm + 1.0) - at
    steep = np.abs(np.sum(rise * across, axis=1)) / np.sum(across**2, axis=1)
    value = reflectance(steep)
    thick = math.ceil(4.0 * scene.side_mm * float(np.hypot(*across.T).max()))
    pixels = np.round(at).astype(int)
    for k in range(len(pixels) - 1, 0, -1):
        cv2.line(
            out, pixels[k].tolist(), pixels[k - 1].tolist(), float(value[k]), thick
        )
    return out


def _draw_gloss(
    picture: Picture, scene: Scene, camera: Calibration, height_mm: float
) -> None:
    line = scene.centreline
    if line is None:
        return
    inner = slice(len(line.s_mm) // 3, 2 * len(line.s_mm) // 3)
    left = np.column_stack([-np.sin(line.theta_rad), np.cos(line.theta_rad)])
    streak = strip(line.points_mm[inner], left[inner], 0.2 * scene.side_mm)
    outline = camera.to_px(scene.clamp.pose.to_board(streak), height_mm=height_mm)
    sharp = coverage(outline, *camera.image_size_px)
    soft = _soften(sharp, 0.12 * scene.side_mm / _scale(camera))
    picture += np.float32(scene.light.gloss) * soft[..., None]


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
    green = np.maximum(blurred[..., 1], np.float32(0.02)) / np.float32(PAPER[1])
    noise = rng.standard_normal(green.shape, dtype=np.float32)
    noise *= np.float32(_MOSAIC * light.noise) * np.sqrt(green)
    blurred += noise[..., None]
    return encode_srgb(blurred)


def _paint(picture: Picture, mask: Picture, colour: Colour) -> None:
    """Lay a colour over the part of the picture that the mask covers."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if len(rows) == 0:
        return
    box = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
    part = picture[box]
    part += mask[box][..., None] * (np.array(colour, dtype=np.float32) - part)


def _soften(mask: Picture, sd_px: float) -> Picture:
    """Return the mask blurred; wide blurs on a smaller picture."""
    factor = max(1, int(sd_px / 3.0))
    if factor == 1:
        return np.asarray(cv2.GaussianBlur(mask, (0, 0), max(sd_px, 0.3)))
    height, width = mask.shape
    size = (math.ceil(width / factor), math.ceil(height / factor))
    small = cv2.resize(mask, size, interpolation=cv2.INTER_AREA)
    soft = cv2.GaussianBlur(small, (0, 0), sd_px / factor)
    return np.asarray(cv2.resize(soft, (width, height), interpolation=cv2.INTER_LINEAR))


def _shadow_shift(light: SceneLight, height_mm: float) -> Array:
    direction = math.radians(light.shadow_direction_deg)
    reach = light.slope * height_mm
    return np.array([reach * math.cos(direction), reach * math.sin(direction)])


def _scale(camera: Calibration) -> float:
    """Return the mm per pixel in the middle of the picture."""
    return camera.mm_per_px(camera.centre_px, height_mm=0.0)


def _subdivide(outline: Array, pieces: int = 24) -> Array:
    """Return an outline with its edges cut up, so that a lens can bend them."""
    t = np.arange(pieces)[None, :, None] / pieces
    following = np.roll(outline, -1, axis=0)
    points = outline[:, None] + t * (following - outline)[:, None]
    return np.asarray(points.reshape(-1, 2))


def _hull(points: Array) -> Array:
    hull = cv2.convexHull(np.ascontiguousarray(points, dtype=np.float32))
    return np.asarray(hull, dtype=np.float64).reshape(-1, 2)


def _scaled(colour: Colour, factor: float) -> Colour:
    return (colour[0] * factor, colour[1] * factor, colour[2] * factor)
