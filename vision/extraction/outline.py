"""Where a known outline lies in a photograph: the walls of a printed channel.

First roughly, anywhere and at any turn: the picture's steps of light, as vectors of
length 1, are correlated with the outline's normals (a matched filter over all shifts by
Fourier transform). Then finely: edges are sought along the normals, and the rigid
motion that fits them best is taken until it no longer moves (Besl and McKay 1992),
outliers weighing little (Huber 1964).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import VisionError
from ..camera.calibration import Calibration
from ..measurement import Pose
from ..picture.photo import Photo
from ..picture.sample import bilinear

Array = NDArray[np.float64]
Image = NDArray[np.float32]
Outline = tuple[Array, Array]
"""Points and normals."""

COARSE_PX = 256
"""Longest side of the picture in which the outline is sought first."""
TURN_DEG = 2.0
"""Step of that search."""
STARTS = 12
"""Best places of that search from which the finer one sets out."""
REACHES_PX = (24.0, 12.0, 6.0, 4.0, 3.0)
"""How far from the outline edges are sought, round by round."""
FINE_PX = 2.0
"""And in the last rounds, which look at whole profiles."""
BLURS_PX = (1.0, 1.2, 1.4, 1.7, 2.1)
"""Of an edge, after lens and smoothing."""
FACES = (0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2)
"""How light the face of a wall may be, over its top."""
LEAST_SHARE = 0.6
"""Of the outline must be found."""
WORST_PX = 1.5
"""Of the edges' distance from the outline, in the middle of all."""


class Seen(NamedTuple):
    """The outline in the picture, px: edges, normals, how far the foot stands out."""

    at: Array
    along: Array
    out: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """Where an outline lies.

    Parameters
    ----------
    pose : Pose
        Of its frame on the board; `height_mm` is that of the walls.
    sd_mm, sd_deg : float
        Standard deviations of its place and turn, from the edges' scatter.
    rms_px, share : float
        Of the edges about it, and how much of the outline was found.
    """

    pose: Pose
    sd_mm: float
    sd_deg: float
    rms_px: float
    share: float


def place_outline(
    photo: Photo,
    calibration: Calibration,
    faces: Sequence[tuple[Array, Array]],
    *,
    height_mm: float,
) -> Placed:
    """Find an outline of known shape and size.

    Parameters
    ----------
    photo : Photo
        Of the channel without its rod, in the orientation of the calibration.
    calibration : Calibration
        The camera.
    faces : sequence of (points, normals)
        Each of shape (n, 2), in mm in the outline's frame: along its walls, and toward
        the inside of the lumen.
    height_mm : float
        Of the walls above the board's plane.

    Raises
    ------
    VisionError
        If it is not to be seen.
    """
    points, normals = (np.concatenate(part) for part in zip(*faces, strict=True))
    outline = points, normals
    grey = np.asarray(cv2.GaussianBlur(photo.grey, (0, 0), 0.8), np.float32)
    rough = [
        _approached(grey, calibration, outline, *start)
        for start in _anywhere(photo.grey, calibration, outline, height_mm)
    ]
    off_px, share, pose, sign = min(rough, key=lambda one: one[0])
    for _ in range(2):
        if share < LEAST_SHARE or off_px > WORST_PX:
            raise _unseen(share)
        seen = _seen(calibration, pose, *outline)
        found = _edges(grey, seen, sign, FINE_PX)[1]
        off = _fitted_edges(grey, seen)[found]
        trust = _steps(grey, seen)[found] ** 2
        pose, sd = _moved(pose, calibration, points[found], normals[found], off, trust)
        share, off_px = float(found.mean()), 1.4826 * float(np.median(np.abs(off)))
    return Placed(
        pose=pose, sd_mm=float(np.hypot(sd[0], sd[1])), sd_deg=float(sd[2]),
        rms_px=off_px, share=share,
    )  # fmt: skip


def _approached(
    grey: Image, calibration: Calibration, outline: Outline, pose: Pose, sign: float
) -> tuple[float, float, Pose, float]:
    """Return the middle distance of edges about a start, their share, pose and sign."""
    points, normals = outline
    for reach in REACHES_PX:
        seen = _seen(calibration, pose, *outline)
        off, found = _edges(grey, seen, sign, reach)
        share = float(found.mean())
        if share < LEAST_SHARE:
            return np.inf, share, pose, sign
        trust = _steps(grey, seen)[found] ** 2
        pose, _ = _moved(
            pose, calibration, points[found], normals[found], off[found], trust
        )
    return 1.4826 * float(np.median(np.abs(off[found]))), share, pose, sign


def _unseen(share: float) -> VisionError:
    return VisionError(
        "the channel's walls are not to be seen in the bare picture: "
        f"{100.0 * share:.0f} % of their outline has an edge; is it the right lumen, "
        "does it lie in the picture, and do its walls differ from its floor?"
    )


def _anywhere(
    grey: Image, calibration: Calibration, outline: Outline, height_mm: float
) -> list[tuple[Pose, float]]:
    """Return where the outline may lie, and whether its inside is the lighter there."""
    factor = max(1.0, max(grey.shape) / COARSE_PX)
    size = round(grey.shape[1] / factor), round(grey.shape[0] / factor)
    small = np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA))
    gx, gy = (cv2.Sobel(small, cv2.CV_32F, dx, 1 - dx) for dx in (1, 0))
    strong = np.hypot(gx, gy)
    soft = strong + 2.0 * float(np.median(strong)) + 1e-6
    waves = np.fft.rfft2(gx / soft), np.fft.rfft2(gy / soft)
    middle = 0.5 * np.array([[grey.shape[1] - 1.0, grey.shape[0] - 1.0]])
    origin = calibration.to_mm(middle, height_mm=height_mm)[0]
    centre = outline[0].mean(axis=0, keepdims=True)
    found: list[tuple[float, Pose, float]] = []
    for angle_deg in np.arange(0.0, 360.0, TURN_DEG).tolist():
        turned = Pose(x_mm=0.0, y_mm=0.0, angle_deg=angle_deg, height_mm=height_mm)
        start = _shifted(turned, origin - turned.to_board(centre)[0])
        seen = _seen(calibration, start, *outline)
        score = _score(waves, seen.at / factor, seen.along, small.shape)
        for sign in (1.0, -1.0):
            row, column = np.unravel_index(int(np.argmax(sign * score)), score.shape)
            shift = np.array([column, row], dtype=float)
            shift -= np.array(size) * (shift > 0.5 * np.array(size))
            here = calibration.to_mm(middle + factor * shift, height_mm=height_mm)[0]
            most = float(sign * score[row, column])
            found.append((most, _shifted(start, here - origin), sign))
    found.sort(key=lambda one: -one[0])
    return [(pose, sign) for _, pose, sign in found[:STARTS]]


def _shifted(pose: Pose, by_mm: Array) -> Pose:
    x, y = float(pose.x_mm + by_mm[0]), float(pose.y_mm + by_mm[1])
    return replace(pose, x_mm=x, y_mm=y)


def _score(
    waves: tuple[NDArray[np.complex128], NDArray[np.complex128]],
    at: Array,
    along: Array,
    shape: tuple[int, ...],
) -> Array:
    """Return how well the outline's normals agree with the steps, for each shift."""
    total = np.zeros((shape[0], shape[1] // 2 + 1), dtype=complex)
    column, row = np.rint(at).astype(int).T % np.array([[shape[1]], [shape[0]]])
    for wave, part in zip(waves, along.T, strict=True):
        drawn = np.zeros(shape)
        drawn[row, column] = part
        total += wave * np.conj(np.fft.rfft2(drawn))
    return np.fft.irfft2(total, s=shape)


def _seen(calibration: Calibration, pose: Pose, points: Array, normals: Array) -> Seen:
    """Return in px where the edge of each point is seen, and its normal, of length 1.

    Of the wall's upper edge and its foot, the one that stands out into the lumen.
    """
    board, tips = pose.to_board(points), pose.to_board(points + normals)
    top = calibration.to_px(board, height_mm=pose.height_mm)
    along = calibration.to_px(tips, height_mm=pose.height_mm) - top
    along /= np.hypot(*along.T)[:, None]
    foot = calibration.to_px(board, height_mm=0.0)
    out = np.maximum(np.sum((foot - top) * along, axis=1), 0.0)
    return Seen(top + out[:, None] * along, along, out)


def _edges(
    grey: Image, seen: Seen, sign: float, reach: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Return how far along its normal each point's edge is, and where there is one."""
    steps = np.arange(-reach - 2.0, reach + 2.01, 0.5)
    rise = sign * np.gradient(_profiles(grey, seen, steps), axis=1)
    peak = np.argmax(rise[:, 4:-4], axis=1) + 4
    typical = float(np.quantile(rise.max(axis=1), 0.7))
    height, width = grey.shape
    inside = np.all((seen.at > 2.0) & (seen.at < (width - 3.0, height - 3.0)), axis=1)
    return steps[peak], inside & (rise.max(axis=1) > 0.2 * typical)


def _fitted_edges(grey: Image, seen: Seen) -> Array:
    """Return how far along its normal each point's edge is, from the whole profile.

    Light along a normal is that of the top, of the face below it (darker by one factor
    everywhere), and of the floor, whose shade is a slope; the picture's blur rounds the
    steps between. Of factors and blurs the best are taken.
    """
    steps = np.arange(-5.0, 5.01, 0.5)
    offsets = np.arange(-2.0, 2.01, 0.25)
    light = _profiles(grey, seen, steps)
    best, found = np.inf, np.zeros(len(light))
    for factor, blur in product(FACES, BLURS_PX):
        left = np.empty((len(light), len(offsets)))
        for out in np.unique(np.round(seen.out, 1)):
            rows = np.flatnonzero(np.round(seen.out, 1) == out)
            for k, offset in enumerate(offsets):
                levels = _levels(steps - offset, float(out), factor, blur)
                basis = np.linalg.qr(levels)[0]
                rest = light[rows] - (light[rows] @ basis) @ basis.T
                left[rows, k] = np.sum(rest**2, axis=1)
        total = float(np.median(left.min(axis=1)))
        if total < best:
            best, found = total, _lowest(offsets, left)
    return found


def _steps(grey: Image, seen: Seen) -> Array:
    """Return the step of light from wall to floor at each point: how plain its edge."""
    light = _profiles(grey, seen, np.array([-4.0, 3.0]))
    return np.abs(light[:, 1] - light[:, 0])


def _levels(x: Array, out: float, factor: float, blur: float) -> Array:
    """Return what top and floor of level 1 add to a profile, and a slope of the floor.

    The edge is at 0, the upper edge `out` before it, the face between `factor` times as
    light as the top. Shape (n, 3).
    """
    from scipy.special import ndtr

    past_top, past = ndtr((x + out) / blur), ndtr(x / blur)
    top = 1.0 - past_top + factor * (past_top - past)
    return np.column_stack([top, past, past * x])


def _lowest(offsets: Array, left: Array) -> Array:
    """Return where each row of `left` is least, between its samples."""
    k = np.clip(np.argmin(left, axis=1), 1, len(offsets) - 2)
    rows = np.arange(len(left))
    a, b, c = left[rows, k - 1], left[rows, k], left[rows, k + 1]
    bend = np.maximum(a - 2.0 * b + c, 1e-12)
    shift = np.clip(0.5 * (a - c) / bend, -1.0, 1.0)
    return np.asarray(offsets[k] + shift * (offsets[1] - offsets[0]))


def _profiles(grey: Image, seen: Seen, steps: Array) -> Array:
    """Return the light along each point's normal, shape (n, steps)."""
    where = seen.at[:, None] + steps[None, :, None] * seen.along[:, None]
    return bilinear(grey, where)


def _moved(
    pose: Pose, calibration: Calibration, points: Array, normals: Array, off_px: Array,
    trust: Array,
) -> tuple[Pose, Array]:  # fmt: skip
    """Return the pose moved toward the edges, and its standard deviations.

    `trust` is how much each edge weighs.
    """
    board, tips = pose.to_board(points), pose.to_board(points + normals)
    across = tips - board
    top = calibration.to_px(board, height_mm=pose.height_mm)
    scale = np.hypot(*(calibration.to_px(tips, height_mm=pose.height_mm) - top).T)
    off_mm = off_px / scale
    centre = board.mean(axis=0)
    arm = board - centre
    lever = arm[:, 0] * across[:, 1] - arm[:, 1] * across[:, 0]
    A = np.column_stack([across, lever])
    trust = trust / trust.mean()
    weight = trust
    for _ in range(5):
        W = A * weight[:, None]
        step = np.linalg.lstsq(W.T @ A, W.T @ off_mm, rcond=None)[0]
        left = np.abs(off_mm - A @ step)
        spread = 1.5 * 1.4826 * float(np.median(left)) + 1e-9
        weight = trust * spread / np.maximum(left, spread)
    cov = np.linalg.pinv(W.T @ A) * float(np.mean(weight * left**2))
    # Neighbours share their errors: as if a tenth of the points were independent.
    sd = np.sqrt(10.0 * np.diag(cov)) * (1.0, 1.0, np.degrees(1.0))
    turn = float(step[2])
    c, s = np.cos(turn), np.sin(turn)
    origin = np.array([pose.x_mm, pose.y_mm]) - centre
    x, y = centre + np.array(
        [c * origin[0] - s * origin[1], s * origin[0] + c * origin[1]]
    )
    moved = Pose(
        x_mm=float(x + step[0]), y_mm=float(y + step[1]),
        angle_deg=pose.angle_deg + float(np.degrees(turn)), height_mm=pose.height_mm,
    )  # fmt: skip
    return moved, sd
