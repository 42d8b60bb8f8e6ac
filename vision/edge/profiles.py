"""Light along straight lines through a picture, sampled by bilinear interpolation.

Of our own: OpenCV's is quantised to 1/32 px in some versions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit

Array = NDArray[np.float64]
Image = NDArray[np.float32]

STEP_PX = 0.5
"""Distance of samples along a profile."""


@njit(cache=True)
def _bilinear(grey: Image, x: float, y: float) -> float:
    height, width = grey.shape
    if not (x >= 0.0 and y >= 0.0 and x <= width - 1.0 and y <= height - 1.0):
        return np.nan
    j = min(int(x), width - 2)
    i = min(int(y), height - 2)
    u, v = x - j, y - i
    top = grey[i, j] * (1.0 - u) + grey[i, j + 1] * u
    bottom = grey[i + 1, j] * (1.0 - u) + grey[i + 1, j + 1] * u
    return float(top * (1.0 - v) + bottom * v)


@njit(cache=True)
def _sample(
    grey: Image, points: Array, normals: Array, edge: Array, outwards: float,
    before: int, sign: float, strip: Image,
) -> None:  # fmt: skip
    """Fill the strip: a row a station, columns outwards, the edge behind `before`."""
    count, columns = strip.shape
    height, width = grey.shape
    for i in range(count):
        u, v = outwards * normals[i, 0], outwards * normals[i, 1]
        first = outwards * edge[i] + (0.5 - before) * STEP_PX
        last = first + (columns - 1) * STEP_PX
        x, y = points[i, 0] + first * u, points[i, 1] + first * v
        far_x, far_y = points[i, 0] + last * u, points[i, 1] + last * v
        u, v = STEP_PX * u, STEP_PX * v
        if (
            min(x, far_x) >= 0.0 and max(x, far_x) < width - 1.001
            and min(y, far_y) >= 0.0 and max(y, far_y) < height - 1.001
        ):  # fmt: skip
            # Well inside: no sample needs to be checked.
            for k in range(columns):
                px, py = x + k * u, y + k * v
                j, m = int(px), int(py)
                fx, fy = np.float32(px - j), np.float32(py - m)
                a, b = grey[m, j], grey[m, j + 1]
                c, d = grey[m + 1, j], grey[m + 1, j + 1]
                top = a + (b - a) * fx
                strip[i, k] = sign * (top + (c + (d - c) * fx - top) * fy)
            continue
        for k in range(columns):
            strip[i, k] = sign * _bilinear(grey, x + k * u, y + k * v)
