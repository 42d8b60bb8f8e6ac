"""Polygons to pixels with exact area coverage: the truth behind drawn photographs.

The signed-area accumulation of font rasterisers: every edge adds its exact area to the
pixels it crosses, and a running sum along each row fills the inside. Unlike
supersampling it is exact, and its cost grows with the outline, not with the area.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit

Array = NDArray[np.float64]


def coverage(polygon_px: Array, width: int, height: int) -> NDArray[np.float32]:
    """Return how much of each pixel a simple polygon covers, from 0 to 1.

    Parameters
    ----------
    polygon_px : ndarray, shape (n, 2)
        Corners in pixels, either way round, closed by itself; pixel (0, 0) has its
        centre at (0, 0). The outline must not cross itself.
    width, height : int
        Size of the picture; what lies outside is cut off.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Area of each pixel inside the polygon.
    """
    return coverage_of([polygon_px], [1], width, height)


def coverage_of(
    polygons_px: Sequence[Array], signs: Sequence[int], width: int, height: int
) -> NDArray[np.float32]:
    """Return how much of each pixel several polygons cover, from 0 to 1.

    Parameters
    ----------
    polygons_px : sequence of ndarray, shape (n, 2)
        Simple polygons, as for `coverage`.
    signs : sequence of int
        +1 adds the polygon, -1 cuts it out. Added polygons may touch but not overlap,
        and a hole must lie inside of what it is cut from.
    width, height : int
        Size of the picture.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Area of each pixel inside.
    """
    picture = np.zeros((height, width), dtype=np.float32)
    outlines = [np.ascontiguousarray(p, dtype=np.float64) + 0.5 for p in polygons_px]
    kept = [
        (outline, sign)
        for outline, sign in zip(outlines, signs, strict=True)
        if len(outline) >= 3 and np.all(np.isfinite(outline))
    ]
    if not kept:
        return picture
    everything = np.concatenate([outline for outline, _ in kept])
    left, top = np.clip(np.floor(everything.min(axis=0)), 0, (width, height))
    right, bottom = np.clip(np.ceil(everything.max(axis=0)), 0, (width, height))
    x0, y0, columns, rows = int(left), int(top), int(right - left), int(bottom - top)
    if columns <= 0 or rows <= 0:
        return picture
    cells = np.zeros((rows, columns + 2))
    for outline, sign in kept:
        turn = 1.0 if _signed_area(outline) > 0.0 else -1.0
        _accumulate(outline - (x0, y0), cells, columns, rows, -sign * turn)
    area = np.cumsum(cells[:, :columns], axis=1)
    picture[y0 : y0 + rows, x0 : x0 + columns] = np.clip(area, 0.0, 1.0)
    return picture


def _signed_area(outline: Array) -> float:
    x, y = outline.T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))


@njit(cache=True)
def _accumulate(outline, cells, width, height, weight):  # type: ignore[no-untyped-def]
    """Add the signed area right of every edge to `cells`; corners at integers."""
    n = outline.shape[0]
    for i in range(n):
        x0, y0 = outline[i, 0], outline[i, 1]
        x1, y1 = outline[(i + 1) % n, 0], outline[(i + 1) % n, 1]
        if y0 == y1:
            continue
        sign = weight
        if y0 > y1:
            sign = -weight
            x0, y0, x1, y1 = x1, y1, x0, y0
        slope = (x1 - x0) / (y1 - y0)
        if y0 < 0.0:
            x0 -= y0 * slope
            y0 = 0.0
        bottom = min(y1, float(height))
        y, x = y0, x0
        while y < bottom - 1e-12:
            row = math.floor(y + 1e-12)
            if row >= height:
                break
            y_next = min(float(row + 1), bottom)
            x_next = x + slope * (y_next - y)
            _span(cells[row], x, x_next, sign * (y_next - y), width)
            y, x = y_next, x_next


@njit(cache=True)
def _span(cells, xa, xb, dy, width):  # type: ignore[no-untyped-def]
    """Spread the edge piece from xa to xb of signed height dy over one row."""
    left, right = min(xa, xb), max(xa, xb)
    if right <= 0.0:
        cells[0] += dy
        return
    if left >= width:
        return
    if left < 0.0 or right > width:
        # Cut at the sides: what is left of 0 counts whole, right of the picture not.
        length = right - left
        if left < 0.0:
            cells[0] += dy * (-left) / length
        inside_left, inside_right = max(left, 0.0), min(right, float(width))
        dy *= (inside_right - inside_left) / length
        left, right = inside_left, inside_right
    first = min(math.floor(left), width - 1)
    last = math.ceil(right)
    if last <= first + 1:
        mean = 0.5 * (left + right) - first
        cells[first] += dy * (1.0 - mean)
        cells[first + 1] += dy * mean
        return
    per_px = dy / (right - left)
    before = 0.0
    for column in range(first, last):
        a, b = max(left, float(column)), min(right, float(column + 1))
        share = per_px * (b - a)
        mean = 0.5 * (a + b) - column
        cells[column] += before + share * (1.0 - mean)
        before = share * mean
    cells[last] += before


def strip(points: Array, normals: Array, half_width: float) -> Array:
    """Return the outline of a flat-ended strip about a curve, shape (2 n, 2).

    Parameters
    ----------
    points, normals : ndarray, shape (n, 2)
        The curve and its unit normals.
    half_width : float
        Half the strip's width, in the unit of the points; it must be smaller than the
        smallest radius of curvature.
    """
    return np.concatenate(
        [points + half_width * normals, (points - half_width * normals)[::-1]]
    )
