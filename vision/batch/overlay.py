"""What was found, drawn on the photograph, so that a person can see at a glance."""

from __future__ import annotations

import math
import textwrap

import cv2
import numpy as np
from numpy.typing import NDArray

from ..measurement import Measurement
from ..picture.photo import Photo
from ..picture.srgb import encode_srgb

Array = NDArray[np.float64]
Colour = tuple[int, int, int]

AXIS: Colour = (0, 140, 255)
EDGE: Colour = (230, 190, 60)
MARK: Colour = (60, 200, 60)
WRONG: Colour = (40, 40, 230)
_SHIFT = 4  # cv2 takes fixed-point coordinates with this many binary digits

_SHADES = encode_srgb(np.linspace(0.0, 1.0, 256, dtype=np.float32)) & np.uint8(0xF0)
"""Of light in 255 parts; noise in the last bits would multiply size and time of the
file."""

MAX_SIDE_PX = 2400
"""Larger photographs are shown at a reduced scale."""

FILE_SIDE_PX = 1280
"""The same in files: writing them should not take longer than measuring."""

LEAST_SIDE_PX = 480


def draw_overlay(
    photo: Photo, measurement: Measurement, *, max_side_px: int = MAX_SIDE_PX
) -> NDArray[np.uint8]:
    """Return the photograph with what was found drawn on it.

    Parameters
    ----------
    photo : Photo
        The photograph.
    measurement : Measurement
        A failed one is crossed out and says why; what might have been the rod is
        drawn and numbered, the likeliest first.
    max_side_px : int
        Larger photographs are shown at a half, a third ... of their scale; tiny ones
        enlarged to `LEAST_SIDE_PX`, for lines and words to have room.

    Returns
    -------
    ndarray of uint8, shape (h, w, 3)
        Blue, green, red. The axis is orange, the edges blue, clamp and tip green. What
        was found stands in words below the photograph, of which it hides nothing.
    """
    width, height = photo.size_px
    longer = max(width, height)
    scale = math.ceil(LEAST_SIDE_PX / longer) / math.ceil(longer / max_side_px)
    grey = photo.grey
    if scale != 1.0:
        size = (max(1, round(width * scale)), max(1, round(height * scale)))
        kind = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_NEAREST
        grey = np.asarray(cv2.resize(grey, size, interpolation=kind))
    white = float(np.quantile(grey[::8, ::8], 0.995))
    light = cv2.convertScaleAbs(grey, alpha=0.9 * 255.0 / max(white, 1e-6))
    shades = cv2.LUT(light, _SHADES)
    picture = np.asarray(cv2.cvtColor(shades, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    if measurement.ok:
        _draw_found(picture, measurement, scale)
    else:
        _cross_out(picture)
        _draw_seen(picture, measurement, scale)
    return np.vstack([picture, _caption(picture, measurement)])


def overlay_png(photo: Photo, measurement: Measurement) -> bytes:
    """Return `draw_overlay`, at most `FILE_SIDE_PX` large, as the bytes of a PNG."""
    settings = [
        cv2.IMWRITE_PNG_COMPRESSION, 1,
        cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE,
    ]  # fmt: skip
    if hasattr(cv2, "IMWRITE_PNG_FILTER"):  # since OpenCV 4.12
        settings += [cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE]
    picture = draw_overlay(photo, measurement, max_side_px=FILE_SIDE_PX)
    _, data = cv2.imencode(".png", picture, settings)
    return bytes(np.asarray(data).tobytes())


def draw_line(
    picture: NDArray[np.uint8], points_px: Array, colour: Colour, thickness: int = 1
) -> None:
    """Draw a smooth line through points with fractions of a pixel, in place."""
    fixed = np.round(points_px[np.all(np.isfinite(points_px), axis=1)] * 2**_SHIFT)
    limit = 2**24
    line = np.clip(fixed, -limit, limit).astype(np.int32).reshape(-1, 1, 2)
    if len(line) > 1:
        cv2.polylines(
            picture, [line], False, colour, thickness, cv2.LINE_AA, shift=_SHIFT
        )


def _draw_found(
    picture: NDArray[np.uint8], measurement: Measurement, scale: float
) -> None:
    points = measurement.points

    def shown(x: Array, y: Array) -> Array:
        return (np.column_stack([x, y]) + 0.5) * scale - 0.5

    for side in ("left", "right"):
        if f"{side}_x_px" in points:
            edge = shown(points[f"{side}_x_px"], points[f"{side}_y_px"])
            draw_line(picture, edge, EDGE)
    thickness = max(1, round(max(picture.shape) / 1200))
    draw_line(picture, shown(points["x_px"], points["y_px"]), AXIS, thickness)
    arm = max(6.0, 0.8 * measurement.width_px * scale)
    for x, y in (measurement.clamp_px, measurement.tip_px):
        if np.isfinite(x) and np.isfinite(y):
            (centre,) = shown(np.array([x]), np.array([y]))
            for step in (np.array([arm, 0.0]), np.array([0.0, arm])):
                draw_line(picture, np.array([centre - step, centre + step]), MARK)


def _cross_out(picture: NDArray[np.uint8]) -> None:
    height, width = picture.shape[:2]
    for a, b in (
        ((0.0, 0.0), (width, height)), ((width, 0.0), (0.0, height)),
    ):  # fmt: skip
        draw_line(picture, np.array([a, b]), WRONG)


def _draw_seen(
    picture: NDArray[np.uint8], measurement: Measurement, scale: float
) -> None:
    """Draw and number the things that might have been the rod."""
    size = max(0.35, picture.shape[1] / 2600)
    for number, points in enumerate(measurement.seen_px, start=1):
        line = (points + 0.5) * scale - 0.5
        draw_line(picture, line, AXIS, 2)
        x, y = np.round(line[len(line) // 2]).astype(int)
        at = (int(x) + 6, int(y) - 6)
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(picture, str(number), at, font, size, AXIS, 2, cv2.LINE_AA)


def _caption(picture: NDArray[np.uint8], measurement: Measurement) -> NDArray[np.uint8]:
    """Return a strip with length, tip and flags, or the reason of a refusal."""
    m = measurement
    if not m.ok:
        lines = [f"failed: {', '.join(m.flags)}", m.reason]
    elif m.pose is None:
        lines = [f"{m.length_px:.1f} px long, uncalibrated"]
    else:
        lines = [
            f"L {m.length_mm:.3f} mm  tip ({m.tip_mm[0]:.3f}, {m.tip_mm[1]:.3f}) mm"
            f"  {m.tip_angle_deg:.2f} deg  width {m.width_mm:.3f} mm"
        ]
    if m.ok and m.flags:
        lines.append(f"flags: {', '.join(m.flags)}")
    size = max(0.35, picture.shape[1] / 2600)
    step = round(34 * size)
    room = max(10, int(picture.shape[1] / (19 * size)))
    lines = [part for line in lines for part in textwrap.wrap(line, room)]
    shape = (step * len(lines) + step // 2, picture.shape[1], 3)
    strip = np.full(shape, 240, dtype=np.uint8)
    for row, line in enumerate(lines):
        text = line.encode("ascii", "replace").decode()
        at = (round(12 * size), step * (row + 1))
        cv2.putText(
            strip, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, (40, 40, 40), 1,
            cv2.LINE_AA,
        )  # fmt: skip
    return strip
