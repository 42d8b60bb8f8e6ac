"""The tag on the clamp in a photograph: its pose in the board frame, to 0.03 px or so.

A marker is found on a smaller picture, its four edges then where the light is half way
between black and white; one square is fitted to all of them, in millimetres, so that
lens and perspective are allowed for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..measurement import Pose
from .board import dictionary_of
from .calibration import Calibration
from .clamp_tag import ClampTag

Array = NDArray[np.float64]
Image = NDArray[np.float32]

SEEN_PX = 40.0
"""Side of a marker, on the smaller picture on which it is sought."""
AROUND = 1.5
"""Half side of the window in which it is sought first, where the rod tells where it is,
in sides of the marker: it fits turned by any angle, with its margin."""
STATIONS, CORNERS = 40, 0.12
"""Stations along an edge, and the share of it near each corner that is left out."""
STEP_PX, REACH_PX = 0.25, 6.0
"""Step along a profile across an edge, and how far it goes to either side at most."""
EDGE_PX = 0.03
"""Systematic part of where an edge lies: print, blur, and light that is not even."""
MISFIT = 0.005
"""A tag that looks larger or smaller by this part: its camera has moved."""
TURNED_DEG = 0.5
"""A stage carries a clamp straight on; one that is turned by more was moved by hand."""
WIDE = 3.0
"""Crossings farther off the square, in their scatter, are left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenTag:
    """A tag in a photograph: its pose in the board frame, with deviations.

    Parameters
    ----------
    pose : Pose
        Its middle, and the direction of its x axis.
    side_mm : float
        Its side, as the calibration sees it at the height of the tag.
    place_sd_mm, angle_sd_deg, side_sd_mm : float
        Standard deviations.
    """

    pose: Pose
    side_mm: float
    place_sd_mm: float
    angle_sd_deg: float
    side_sd_mm: float


def find_tag(
    grey: Image, camera: Calibration, tag: ClampTag, near_px: Array | None = None
) -> SeenTag | None:
    """Find the tag on the clamp; None where it is not seen.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    camera : Calibration
        Of the camera that took the photograph.
    tag : ClampTag
        Which marker, its side and height.
    near_px : ndarray, shape (2,), optional
        Where its middle should be: it is sought there first, which is faster.
    """
    corners = None if near_px is None else _corners_near(grey, camera, tag, near_px)
    if corners is None:
        corners = _corners(grey, tag, _side_px(grey, camera, tag))
    if corners is None:
        return None
    for _ in range(2):
        crossings, edge = _crossings(grey, corners)
        if np.bincount(edge, minlength=4).min() < STATIONS // 4:
            return None
        points = camera.to_mm(crossings, height_mm=tag.height_mm)
        start = camera.to_mm(corners, height_mm=tag.height_mm)
        if not np.all(np.isfinite(start)):
            return None
        square, covariance = _fitted(points, _OUTWARD[edge], start)
        corners = camera.to_px(_square(square), height_mm=tag.height_mm)
    scale = camera.mm_per_px(
        (float(corners[:, 0].mean()), float(corners[:, 1].mean())),
        height_mm=tag.height_mm,
    )
    doubt, side = EDGE_PX * scale, float(square[3])
    sd = np.sqrt(np.diag(covariance))
    return SeenTag(
        pose=Pose(
            x_mm=float(square[0]), y_mm=float(square[1]),
            angle_deg=math.degrees(float(square[2])), height_mm=tag.height_mm,
        ),
        side_mm=side,
        place_sd_mm=math.hypot(*sd[:2], doubt),
        angle_sd_deg=math.degrees(math.hypot(float(sd[2]), doubt / side)),
        side_sd_mm=math.hypot(float(sd[3]), doubt),
    )  # fmt: skip


def _side_px(grey: Image, camera: Calibration, tag: ClampTag) -> float:
    """Return how large the marker is in the middle of the picture."""
    height, width = grey.shape
    middle = (0.5 * width, 0.5 * height)
    return tag.side_mm / camera.mm_per_px(middle, height_mm=tag.height_mm)


def _corners_near(
    grey: Image, camera: Calibration, tag: ClampTag, near_px: Array
) -> Array | None:
    """Return the marker's corners as `_corners` does, from a window of the picture."""
    side = _side_px(grey, camera, tag)
    reach = AROUND * side
    low = np.maximum(np.floor(near_px - reach), 0.0)
    high = np.ceil(near_px + reach)
    if not np.all(np.isfinite(high - low)) or np.any(high - low < side):
        return None
    (x0, y0), (x1, y1) = low.astype(int), high.astype(int)
    window = grey[y0:y1, x0:x1]
    corners = _corners(window, tag, side) if min(window.shape) > side else None
    return None if corners is None else corners + low


def _corners(grey: Image, tag: ClampTag, side_px: float) -> Array | None:
    """Return the marker's corners to a pixel or so, from the printed left top on."""
    height, width = grey.shape
    factor = max(1.0, side_px / SEEN_PX)
    size = (max(1, round(width / factor)), max(1, round(height / factor)))
    small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    light = np.clip(255.0 * np.sqrt(np.maximum(small, 0.0)), 0, 255).astype(np.uint8)
    detector = cv2.aruco.ArucoDetector(dictionary_of(tag.dictionary))
    found, numbers, _ = detector.detectMarkers(light)
    mine = np.flatnonzero(np.ravel([] if numbers is None else numbers) == tag.number)
    if len(mine) != 1:
        return None
    corners = np.asarray(found[int(mine[0])], dtype=np.float64).reshape(4, 2)
    ratio = np.array([width / size[0], height / size[1]])
    return np.asarray((corners + 0.5) * ratio - 0.5)


def _crossings(grey: Image, corners: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return where the marker's edges are at half their light, and on which edge.

    Shapes (n, 2), px, and (n,); edge k goes from corner k to the next.
    """
    along = np.roll(corners, -1, axis=0) - corners
    side = np.hypot(*along.T)[:, None]
    along /= side
    outward = np.column_stack([along[:, 1], -along[:, 0]])
    reach = min(REACH_PX, 0.075 * float(side.min()))
    across = np.arange(-reach, reach + STEP_PX / 2.0, STEP_PX)
    t = np.linspace(CORNERS, 1.0 - CORNERS, STATIONS) * side
    stations = corners[:, None] + t[..., None] * along[:, None]
    points = stations[:, :, None] + across[:, None] * outward[:, None, None]
    light = _sampled(grey, points)
    flat = max(2, len(across) // 6)
    dark, white = light[..., :flat].mean(axis=2), light[..., -flat:].mean(axis=2)
    step, half = white - dark, 0.5 * (dark + white)
    above = light >= half[..., None]
    at = np.argmax(above, axis=2)
    clear = step > 0.3 * np.median(step, axis=1, keepdims=True)
    edge, row = np.nonzero(clear & (at > 0) & above.any(axis=2))
    at = at[edge, row]
    low, high = light[edge, row, at - 1], light[edge, row, at]
    place = across[at - 1] + STEP_PX * (half[edge, row] - low) / (high - low)
    return stations[edge, row] + place[:, None] * outward[edge], edge


def _sampled(grey: Image, points: Array) -> Array:
    """Return the light at points, bilinear; points outside have that of the border."""
    height, width = grey.shape
    x = np.clip(points[..., 0], 0.0, width - 1.001)
    y = np.clip(points[..., 1], 0.0, height - 1.001)
    column, row = x.astype(np.intp), y.astype(np.intp)
    u, v = x - column, y - row
    upper = (1.0 - u) * grey[row, column] + u * grey[row, column + 1]
    lower = (1.0 - u) * grey[row + 1, column] + u * grey[row + 1, column + 1]
    return np.asarray((1.0 - v) * upper + v * lower, dtype=np.float64)


_OUTWARD = np.radians([0.0, -90.0, 180.0, 90.0])
"""Where the printed top, right, bottom and left edge look, from the tag's x axis."""


def _fitted(points: Array, looks: Array, corners: Array) -> tuple[Array, Array]:
    """Fit a square to points on its four edges: middle, angle, side, and covariance.

    `looks` is where the edge of each point looks, from the tag's x axis. Gauss-Newton
    on the distances n.(p - c) - side / 2 along each edge's normal n.
    """
    top = 0.5 * (corners[0] + corners[1]) - corners.mean(axis=0)
    square = np.array(
        [*corners.mean(axis=0), math.atan2(top[1], top[0]), 2.0 * np.hypot(*top)]
    )
    used = np.ones(len(points), dtype=bool)
    for _ in range(4):
        angle = square[2] + looks
        normal = np.column_stack([np.cos(angle), np.sin(angle)])
        tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
        away = points - square[:2]
        left = np.sum(normal * away, axis=1) - 0.5 * square[3]
        slopes = np.column_stack(
            [normal, -np.sum(tangent * away, axis=1), np.full(len(points), 0.5)]
        )
        some = slopes[used]
        change = np.linalg.solve(some.T @ some, some.T @ left[used])
        square = square + change
        left = left - slopes @ change
        scatter = 1.4826 * float(np.median(np.abs(left))) + 1e-9
        used = np.abs(left) < WIDE * scatter
    variance = float(np.mean(left[used] ** 2))
    return square, variance * np.linalg.inv(slopes[used].T @ slopes[used])


def _square(square: Array) -> Array:
    """Return the corners of a square in the order of a marker's."""
    half = 0.5 * square[3]
    x = np.array([half, half, -half, -half])
    y = np.array([half, -half, -half, half])
    c, s = math.cos(square[2]), math.sin(square[2])
    return np.column_stack([square[0] + c * x - s * y, square[1] + s * x + c * y])


@dataclass(frozen=True, slots=True, kw_only=True)
class TaggedClamp:
    """Where the rod leaves the clamp by the tag alone, with deviations.

    Parameters
    ----------
    pose : Pose
        Place and direction in the board frame.
    place_sd_mm, angle_sd_deg : float
        Standard deviations.
    misfit : float
        By which part the tag looks larger than when it was registered.
    misfit_sd : float
        Its standard deviation.
    turned_deg : float
        By how much it lies turned in the board frame since it was registered.
    """

    pose: Pose
    place_sd_mm: float
    angle_sd_deg: float
    misfit: float
    misfit_sd: float
    turned_deg: float

    @property
    def camera_moved(self) -> bool:
        """Whether the tag has another size than the calibration lets it have."""
        return abs(self.misfit) > MISFIT + 4.0 * self.misfit_sd

    @property
    def clamp_turned(self) -> bool:
        """Whether the clamp lies in another direction than the calibration knows."""
        return abs(self.turned_deg) > TURNED_DEG


def tagged_clamp(grey: Image, camera: Calibration, rod: Pose) -> TaggedClamp | None:
    """Return where the rod leaves the clamp by the calibration's tag.

    None where the calibration has no tag, or it is not seen.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    camera : Calibration
        Of the camera that took the photograph, with its tag.
    rod : Pose
        Where the rod itself seems to leave the clamp.
    """
    tag = camera.clamp_tag
    if tag is None:
        return None
    away = Pose(x_mm=0.0, y_mm=0.0, angle_deg=-tag.angle_deg).to_board(
        np.array([[-tag.root_x_mm, -tag.root_y_mm]])
    )
    (near,) = camera.to_px(rod.to_board(away), height_mm=tag.height_mm)
    seen = find_tag(grey, camera, tag, near)
    if seen is None:
        return None
    root = np.array([[tag.root_x_mm, tag.root_y_mm]])
    (place,) = seen.pose.to_board(root)
    before = tag.board_angle_deg
    turned = 0.0 if before is None else seen.pose.angle_deg - before
    lever = math.radians(seen.angle_sd_deg) * float(np.hypot(*root[0]))
    return TaggedClamp(
        pose=Pose(
            x_mm=float(place[0]), y_mm=float(place[1]),
            angle_deg=seen.pose.angle_deg + tag.angle_deg,
        ),
        place_sd_mm=math.hypot(seen.place_sd_mm, lever, tag.place_sd_mm),
        angle_sd_deg=math.hypot(seen.angle_sd_deg, tag.angle_sd_deg),
        misfit=seen.side_mm / tag.side_mm - 1.0,
        misfit_sd=seen.side_sd_mm / tag.side_mm,
        turned_deg=(turned + 180.0) % 360.0 - 180.0,
    )  # fmt: skip
