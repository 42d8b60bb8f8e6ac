"""Photographs in the page: JPEG inside an SVG, the lines drawn on it as vectors."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import MagbendError
from ...vision import Calibration, encode_srgb, oriented, read_photo, specimen_to_px
from ..compare.compare import Comparison, RunComparison

Array = NDArray[np.float64]

MARGIN = 0.18
"""Paper kept around the rod, as a share of its extent."""


def photograph_svg(
    run: RunComparison,
    comparisons: Sequence[Comparison],
    *,
    width_px: int = 900,
    quality: int = 80,
) -> str:
    """Return one step's photograph with measured and simulated lines, as SVG.

    Parameters
    ----------
    run : RunComparison
        Its folder holds the photograph and its calibration.
    comparisons : sequence of Comparison
        The field models of one step.
    width_px : int
        Width to which the picture is reduced.
    quality : int
        Of the JPEG, 1 to 100.

    Returns
    -------
    str
        Empty if the photograph is missing or cannot be read. A failed frame is shown
        whole and without lines.
    """
    import cv2

    first = comparisons[0]
    path = run.run.path / "images" / first.step.image
    if not first.step.image or not path.is_file():
        return ""
    picture = _picture(path, run.run.calibration)
    if picture is None:
        return ""
    lines = _lines(run, comparisons)
    height, width = picture.shape[:2]
    x0, y0, x1, y1 = _crop([points for _, points in lines], width, height)
    crop = picture[y0:y1, x0:x1]
    scale = min(1.0, width_px / crop.shape[1])
    if scale < 1.0:
        crop = np.asarray(
            cv2.resize(crop, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA),
            dtype=np.uint8,
        )
    done, data = cv2.imencode(".jpg", crop, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        return ""
    encoded = base64.b64encode(np.asarray(data).tobytes()).decode("ascii")
    title = escape(f"{run.run.label}, step {first.step.index + 1}")
    parts = [
        f'<svg class="photo" viewBox="{x0} {y0} {x1 - x0} {y1 - y0}" role="img">'
        f"<title>{title}</title>"
        f'<image x="{x0}" y="{y0}" width="{x1 - x0}" height="{y1 - y0}" '
        f'href="data:image/jpeg;base64,{encoded}"/>'
    ]
    parts += [_polyline(name, points) for name, points in lines]
    parts.append(_scale_bar(run.run.calibration, first, (x0, y0, x1, y1)))
    return "".join([*parts, "</svg>"])


def _picture(path: Path, calibration: Calibration | None) -> NDArray[np.uint8] | None:
    """Return a photograph as it was measured: upright, or as its camera's board."""
    try:
        photo = read_photo(path, linear=False)
        if calibration is not None:
            photo = oriented(photo, calibration)
    except MagbendError:
        return None
    colour = photo.colour()
    return encode_srgb(photo.grey if colour is None else colour)


def _lines(
    run: RunComparison, comparisons: Sequence[Comparison]
) -> list[tuple[str, Array]]:
    """Lines in pixels by what they are; the measured one last, so on top."""
    frame = comparisons[0].frame
    if frame is None or not frame.points:
        return []
    lines = []
    calibration = run.run.calibration
    for comparison in comparisons:
        line = comparison.solution.centreline if comparison.solution else None
        if line is not None and calibration is not None and frame.pose is not None:
            pixels = specimen_to_px(calibration, frame.pose, line.points_mm)
            lines.append((comparison.model, pixels))
    measured = np.column_stack([frame.points["x_px"], frame.points["y_px"]])
    if np.all(np.isfinite(measured)):
        lines.append(("measured", measured))
    return lines


def _scale_bar(
    calibration: Calibration | None, first: Comparison, box: tuple[int, int, int, int]
) -> str:
    """Return a bar of a round length at the lower left, at the height of the rod."""
    pose = first.frame.pose if first.frame else None
    if calibration is None or pose is None:
        return ""
    x0, y0, x1, y1 = box
    middle = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    scale = calibration.mm_per_px(middle, height_mm=pose.height_mm)
    wanted_mm = 0.25 * (x1 - x0) * scale
    length_mm = max((n for n in (1, 2, 5, 10, 20, 50) if n <= wanted_mm), default=0)
    if not length_mm:
        return ""
    pad, thick = 0.03 * (x1 - x0), 0.006 * (x1 - x0)
    x, y = x0 + pad, y1 - pad
    return (
        f'<rect x="{x:.0f}" y="{y - thick:.0f}" width="{length_mm / scale:.1f}" '
        f'height="{thick:.1f}" fill="#1b1f24"/><text x="{x:.0f}" '
        f'y="{y - 2.5 * thick:.0f}" font-size="{6.0 * thick:.0f}" '
        f'fill="#1b1f24">{length_mm} mm</text>'
    )


def _crop(lines: Sequence[Array], width: int, height: int) -> tuple[int, int, int, int]:
    if not lines:
        return 0, 0, width, height
    points = np.vstack(lines)
    low, high = points.min(axis=0), points.max(axis=0)
    room = MARGIN * float(np.max(high - low)) + 10.0
    x0, y0 = np.clip(np.floor(low - room), 0, [width - 2, height - 2]).astype(int)
    x1, y1 = np.clip(np.ceil(high + room), [x0 + 2, y0 + 2], [width, height]).astype(
        int
    )
    return int(x0), int(y0), int(x1), int(y1)


def _polyline(name: str, points: Array) -> str:
    text = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline class="line-{escape(name)}" points="{text}"/>'


def photo_settings(count: int) -> dict[str, Any]:
    """Return width and quality that keep `count` photographs under about 9 MB."""
    if count <= 40:
        return {"width_px": 900, "quality": 80}
    if count <= 120:
        return {"width_px": 560, "quality": 72}
    return {"width_px": 400, "quality": 62}
