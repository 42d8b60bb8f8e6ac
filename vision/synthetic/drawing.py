"""Blocks, rods and marks as the camera sees them: polygons laid over a picture.

Coverage is exact (`raster`); pictures are (h, w, 3), linear blue, green, red.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..camera.calibration import Calibration
from ..edge.wall_light import reflectance
from ..picture.raster import coverage, coverage_of, strip
from .parts import INK, PAPER, Block, Colour, Label, Mark, Ridge, Rod, SceneLight
from .ridges import ridge_faces, ridge_shade, ridge_tops

Array = NDArray[np.float64]
Picture = NDArray[np.float32]

SHEEN, WALL_SKY = 0.4, 0.4
"""What a wall of the rod mirrors of the paper, over Fresnel's reflectance of a smooth
one, and its diffuse light over the top's: those of path-traced rubber."""


def _block_corners(block: Block) -> Array:
    half = block.width_mm / 2.0
    corners = np.array(
        [[0.0, half], [0.0, -half], [-block.length_mm, -half], [-block.length_mm, half]]
    )
    return block.to_board(corners)


def block_walls(block: Block, camera: Calibration) -> Picture:
    """Return where the sides of a block are seen beside its top."""
    size = camera.image_size_px
    corners = _block_corners(block)
    top = camera.to_px(subdivide(corners), height_mm=block.height_mm)
    whole = _box_outline(corners, block.height_mm, camera)
    return _beside(coverage(whole, *size), coverage(top, *size))


def _box_outline(corners: Array, height_mm: float, camera: Calibration) -> Array:
    """Return the outline of an upright box, px: without the lens it would be convex."""
    pinhole = replace(camera, distortion=(0.0, 0.0, 0.0, 0.0, 0.0))
    levels = (0.0, height_mm)
    ends = np.vstack([np.insert(corners, 2, level, axis=1) for level in levels])
    seen = [pinhole.to_px(corners, height_mm=level) for level in levels]
    hull = cv2.convexHull(np.vstack(seen).astype(np.float32), returnPoints=False)
    edges = subdivide(ends[hull[:, 0]])
    # What lies between the levels is an upright edge: short, and straight enough.
    edges = edges[np.isin(edges[:, 2], levels)]
    pixels = np.empty((len(edges), 2))
    for level in levels:
        at = edges[:, 2] == level
        pixels[at] = camera.to_px(edges[at, :2], height_mm=level)
    return pixels


def _beside(whole: Picture, top: Picture) -> Picture:
    """Return how much of a wall to lay where a top that covers the rest is laid later.

    Of a pixel that both share, that is left of the ground which the whole leaves.
    """
    left = np.maximum(1.0 - top, np.float32(1e-6))
    return np.asarray(np.where(whole > top, (whole - top) / left, np.float32(0.0)))


def draw_top(picture: Picture, block: Block, camera: Calibration) -> None:
    """Draw the top of a block with its screws and its label."""
    size = camera.image_size_px
    height = block.height_mm
    top = camera.to_px(subdivide(_block_corners(block)), height_mm=height)
    paint(picture, coverage(top, *size), block.colour)
    angle = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
    for behind_mm in block.screws_mm:
        for radius, sides, factor in ((1.6, 48, 1.25), (0.8, 6, 0.8)):
            around = angle[:: 48 // sides]
            ring = np.column_stack(
                [radius * np.cos(around) - behind_mm, radius * np.sin(around)]
            )
            outline = camera.to_px(block.to_board(ring), height_mm=height)
            colour = scaled(block.colour, factor)
            paint(picture, coverage(outline, *size), colour)
    if block.label is not None:
        _draw_label(picture, block, block.label, camera)


def _draw_label(
    picture: Picture, block: Block, label: Label, camera: Calibration
) -> None:
    def seen(outline_mm: Array) -> Array:
        on_board = block.to_board(subdivide(outline_mm))
        return camera.to_px(on_board, height_mm=block.height_mm)

    size = camera.image_size_px
    paint(picture, coverage(seen(label.sheet_mm), *size), PAPER)
    outlines, signs = label.black_polygons()
    ink = coverage_of([seen(outline) for outline in outlines], signs, *size)
    paint(picture, ink, INK)


def block_shadow(block: Block, camera: Calibration, light: SceneLight) -> Picture:
    """Return where a block keeps the lamp's light from the paper, from 0 to 1."""
    corners = _block_corners(block)
    shifted = corners + _shadow_shift(light, block.height_mm)
    outline = camera.to_px(subdivide(_hull(np.concatenate([corners, shifted]))))
    sharp = coverage(outline, *camera.image_size_px)
    return _soften(sharp, light.softness * block.height_mm / _scale(camera))


def rod_shadow(rod: Rod, camera: Calibration, light: SceneLight) -> Picture:
    """Return where a rod keeps the lamp's light from the paper, from 0 to 1."""
    height = rod.pose.height_mm
    fallen = rod.pose.to_board(_outline(rod)) + _shadow_shift(light, height)
    sharp = coverage(camera.to_px(fallen), *camera.image_size_px)
    return _soften(sharp, light.softness * height / _scale(camera))


def ridge_walls(ridges: Sequence[Ridge], camera: Calibration) -> Picture:
    """Return where the faces of ridges are seen beside their tops."""
    return _beside(ridge_faces(ridges, camera), ridge_tops(ridges, camera))


def ridges_shadow(
    ridges: Sequence[Ridge], camera: Calibration, light: SceneLight
) -> Picture:
    """Return where ridges keep the lamp's light from the paper, from 0 to 1."""
    height = max(ridge.height_mm for ridge in ridges)
    sharp = ridge_shade(ridges, camera, _shadow_shift(light, 1.0))
    return _soften(sharp, light.softness * height / _scale(camera))


def draw_rod(
    picture: Picture, rod: Rod, camera: Calibration, gloss: float,
    over: Picture | None = None,
) -> None:  # fmt: skip
    """Draw the walls, then the top face: each a stack of outlines at their heights.

    `over` is what will be laid beside it later: of a pixel that both share nothing else
    is to be seen.
    """
    size = camera.image_size_px
    levels = rod.pose.height_mm + rod.side_mm * np.linspace(-0.5, 0.5, 5)
    walls = np.zeros(picture.shape[:2], dtype=np.float32)
    for height in levels[:-1]:
        np.maximum(walls, coverage(_seen(rod, camera, height), *size), out=walls)
    top = coverage(_seen(rod, camera, levels[-1]), *size)
    np.maximum(walls, top, out=walls)
    walls = _beside(walls, top)
    if over is not None:
        top = np.minimum(1.0, top / np.maximum(1.0 - over, np.float32(1e-3)))
    mirrored = SHEEN * walls * _mirroring(rod, camera)
    seen = mirrored[..., None] * picture
    paint(picture, walls, scaled(rod.colour, WALL_SKY))
    picture += seen
    paint(picture, top, rod.colour)
    if rod.stripe is not None:
        _draw_stripes(picture, rod, rod.stripe, camera, levels[-1])
    if gloss > 0.0:
        _draw_gloss(picture, rod, camera, levels[-1], gloss)


def draw_mark(picture: Picture, mark: Mark, camera: Calibration) -> None:
    """Lay a mark over the paper, in the light that falls there."""
    sharp = coverage(camera.to_px(mark.outline_mm), *camera.image_size_px)
    if mark.softness_mm > 0.0:
        sharp = _soften(sharp, mark.softness_mm / _scale(camera))
    colour = np.array(mark.colour, dtype=np.float32)
    picture *= 1.0 - np.float32(mark.cover) * sharp[..., None] * (1.0 - colour)


def _outline(rod: Rod, part: slice = slice(None), half: float = 0.5) -> Array:
    """Return the outline of a part of a rod in its own frame, mm."""
    line = rod.line
    left = np.column_stack([-np.sin(line.theta_rad), np.cos(line.theta_rad)])
    return strip(line.points_mm[part], left[part], half * rod.side_mm)


def _seen(
    rod: Rod, camera: Calibration, height_mm: float, part: slice = slice(None),
    half: float = 0.5,
) -> Array:  # fmt: skip
    """Return the outline in pixels of the rod's section at a height above the paper."""
    outline = rod.pose.to_board(_outline(rod, part, half))
    return camera.to_px(outline, height_mm=height_mm)


def _draw_stripes(
    picture: Picture, rod: Rod, colour: Colour, camera: Calibration, height_mm: float
) -> None:
    s = rod.line.s_mm
    for first in np.arange(rod.stripe_mm, s[-1], 2.0 * rod.stripe_mm):
        inside = np.flatnonzero((s >= first) & (s <= first + rod.stripe_mm))
        if len(inside) > 1:
            part = slice(int(inside[0]), int(inside[-1]) + 1)
            piece = _seen(rod, camera, height_mm, part)
            paint(picture, coverage(piece, *camera.image_size_px), colour)


def _mirroring(rod: Rod, camera: Calibration) -> Picture:
    """Return the reflectance of the rod's walls, by Fresnel's formula."""
    size = camera.image_size_px
    out = np.zeros(size[::-1], dtype=np.float32)
    line, pose = rod.line, rod.pose
    axis = pose.to_board(line.points_mm)
    left = np.column_stack([-np.sin(line.theta_rad), np.cos(line.theta_rad)])
    beside = pose.to_board(line.points_mm + left)
    at = camera.to_px(axis, height_mm=pose.height_mm)
    across = camera.to_px(beside, height_mm=pose.height_mm) - at
    rise = camera.to_px(axis, height_mm=pose.height_mm + 1.0) - at
    steep = np.abs(np.sum(rise * across, axis=1)) / np.sum(across**2, axis=1)
    value = reflectance(steep)
    thick = math.ceil(4.0 * rod.side_mm * float(np.hypot(*across.T).max()))
    pixels = np.round(at).astype(int)
    for k in range(len(pixels) - 1, 0, -1):
        cv2.line(
            out, pixels[k].tolist(), pixels[k - 1].tolist(), float(value[k]), thick
        )
    return out


def _draw_gloss(
    picture: Picture, rod: Rod, camera: Calibration, height_mm: float, gloss: float
) -> None:
    inner = slice(len(rod.line.s_mm) // 3, 2 * len(rod.line.s_mm) // 3)
    streak = _seen(rod, camera, height_mm, inner, 0.2)
    sharp = coverage(streak, *camera.image_size_px)
    soft = _soften(sharp, 0.12 * rod.side_mm / _scale(camera))
    picture += np.float32(gloss) * soft[..., None]


def paint(picture: Picture, mask: Picture, colour: Colour) -> None:
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


def subdivide(outline: Array, pieces: int = 24) -> Array:
    """Return an outline with its edges cut up, so that a lens can bend them."""
    t = np.arange(pieces)[None, :, None] / pieces
    following = np.roll(outline, -1, axis=0)
    points = outline[:, None] + t * (following - outline)[:, None]
    return np.asarray(points.reshape(-1, outline.shape[1]))


def _hull(points: Array) -> Array:
    hull = cv2.convexHull(np.ascontiguousarray(points, dtype=np.float32))
    return np.asarray(hull, dtype=np.float64).reshape(-1, 2)


def scaled(colour: Colour, factor: float) -> Colour:
    """Return a colour as bright as a factor makes it."""
    return (colour[0] * factor, colour[1] * factor, colour[2] * factor)
