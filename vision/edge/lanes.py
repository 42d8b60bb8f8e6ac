"""Lanes: light sampled along a curve and at even offsets beside it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.curve import Curve, points_at
from .profiles import _bilinear

Array = NDArray[np.float64]
Image = NDArray[np.float32]


def lanes(
    grey: Image, curve: Curve, s: Array, across: Array, sign: float = 1.0
) -> Array:
    """Sample lanes along a curve, carried past its ends.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    curve : Curve
        The axis.
    s : ndarray, shape (m,)
        Arc lengths.
    across : ndarray, shape (k,)
        Offsets along the normal (to the right in the picture).
    sign : float
        -1 for a light rod.

    Returns
    -------
    ndarray, shape (k, m)
        Light; NaN outside the picture.
    """
    return np.asarray(lanes_along(grey, curve, s, across, sign))


@njit(cache=True)
def lanes_along(
    grey: Image, curve: Curve, s: Array, across: Array, sign: float
) -> Array:
    """Sample lanes along a curve, as `lanes` does."""
    points, theta = points_at(curve, s)
    return np.asarray(sample_lanes(grey, points, theta, across, sign))


@njit(cache=True)
def sample_lanes(
    grey: Image, points: Array, theta: Array, across: Array, sign: float
) -> Array:
    """Sample lanes beside points, as `lanes` does, where the axis has given angles."""
    light = np.empty((across.size, len(points)))
    height, width = grey.shape
    low, high = across.min(), across.max()
    for k in range(len(points)):
        x, y = points[k]
        u, v = -np.sin(theta[k]), np.cos(theta[k])
        left, right = x + low * u, x + high * u
        upper, lower = y + low * v, y + high * v
        if (
            0.0 <= left < width - 1.0 and 0.0 <= right < width - 1.0
            and 0.0 <= upper < height - 1.0 and 0.0 <= lower < height - 1.0
        ):  # fmt: skip
            # Well inside: no sample needs to be checked.
            for i in range(across.size):
                px, py = x + across[i] * u, y + across[i] * v
                j, m = int(px), int(py)
                fx, fy = px - j, py - m
                a, b = grey[m, j], grey[m, j + 1]
                c, d = grey[m + 1, j], grey[m + 1, j + 1]
                above, below = a + (b - a) * fx, c + (d - c) * fx
                light[i, k] = sign * (above + (below - above) * fy)
            continue
        for i in range(across.size):
            light[i, k] = sign * _bilinear(grey, x + across[i] * u, y + across[i] * v)
    return light
