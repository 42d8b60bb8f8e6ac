"""Kernels of the camera: a pinhole with a lens, between pixels and a plane in mm.

The lens is that of Brown (1966) with the radial and tangential distortion of OpenCV.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit

Array = NDArray[np.float64]

_STEPS = 200
_STILL = 1e-13
_NEAR_MM = 0.05
"""How far to either side a plane is looked at for its scale: a pixel or so."""


class Camera(NamedTuple):
    """A pinhole with a lens, and where the board lies before it.

    Parameters
    ----------
    lens : ndarray, shape (9,)
        Focal lengths and centre (x, y each) in px, and k1, k2, p1, p2, k3.
    rotation : ndarray, shape (3, 3)
        From the board frame to the camera frame.
    translation : ndarray, shape (3,)
        Origin of the board frame in the camera frame, mm.
    """

    lens: Array
    rotation: Array
    translation: Array


class LocalView(NamedTuple):
    """How a camera sees n points of a curve in a plane, shape (n,) each.

    Parameters
    ----------
    x_mm, y_mm : ndarray
        The points, in the board frame.
    heading : ndarray
        Direction of the curve in the board frame, in rad, unwrapped.
    along, across : ndarray
        Pixels per mm along and across the curve.
    rise_along, rise_across : ndarray
        Shift in the picture, px, of a point that rises by 1 mm, along the curve and to
        its right.
    """

    x_mm: Array
    y_mm: Array
    heading: Array
    along: Array
    across: Array
    rise_along: Array
    rise_across: Array


@njit(cache=True, error_model="numpy")
def points_to_plane(camera: Camera, points: Array, height: float) -> Array:
    """Return where pixels, shape (n, 2), lie in a plane of some height, mm."""
    out = np.empty((len(points), 2))
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        out[i, 0], out[i, 1] = _to_plane(camera, x, y, height)
    return out


@njit(cache=True, error_model="numpy")
def points_to_picture(camera: Camera, points: Array, height: float) -> Array:
    """Return the pixels of points, shape (n, 2), at some height, all in mm."""
    out = np.empty((len(points), 2))
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        out[i, 0], out[i, 1] = _to_picture(camera, x, y, height)
    return out


@njit(cache=True, error_model="numpy")
def local_view(camera: Camera, points: Array, theta: Array, height: float) -> LocalView:
    """Return how pixels of a curve with these angles are seen, at some height in mm."""
    out = np.empty((7, len(points)))
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        u, v = np.cos(theta[i]), np.sin(theta[i])
        at_x, at_y = _to_plane(camera, x, y, height)
        by_x = _shift(camera, at_x, at_y, height, (_NEAR_MM, 0.0, 0.0))
        by_y = _shift(camera, at_x, at_y, height, (0.0, _NEAR_MM, 0.0))
        rise_x, rise_y = _shift(camera, at_x, at_y, height, (0.0, 0.0, 0.5))
        # The inverse of these: mm that a pixel along the curve, and to its right, is.
        area = by_x[0] * by_y[1] - by_y[0] * by_x[1]
        step_x = (by_y[1] * u - by_y[0] * v) / area
        step_y = (by_x[0] * v - by_x[1] * u) / area
        right_x = -(by_y[1] * v + by_y[0] * u) / area
        right_y = (by_x[0] * u + by_x[1] * v) / area
        out[0, i], out[1, i] = at_x, at_y
        out[2, i] = np.arctan2(step_y, step_x)
        if i > 0:
            turns = round((out[2, i] - out[2, i - 1]) / (2.0 * np.pi))
            out[2, i] -= 2.0 * np.pi * turns
        out[3, i] = 1.0 / np.hypot(step_x, step_y)
        out[4, i] = 1.0 / np.hypot(right_x, right_y)
        out[5, i] = rise_x * u + rise_y * v
        out[6, i] = rise_y * u - rise_x * v
    return LocalView(out[0], out[1], out[2], out[3], out[4], out[5], out[6])


@njit(cache=True, error_model="numpy")
def _to_plane(camera: Camera, x: float, y: float, height: float) -> tuple[float, float]:
    """Meet the plane with a pixel's ray; NaN where it does not."""
    lens, turn, shift = camera.lens, camera.rotation, camera.translation
    u, v = _undistorted(lens, (x - lens[2]) / lens[0], (y - lens[3]) / lens[1])
    ray_x = turn[0, 0] * u + turn[1, 0] * v + turn[2, 0]
    ray_y = turn[0, 1] * u + turn[1, 1] * v + turn[2, 1]
    ray_z = turn[0, 2] * u + turn[1, 2] * v + turn[2, 2]
    eye_x = -(turn[0, 0] * shift[0] + turn[1, 0] * shift[1] + turn[2, 0] * shift[2])
    eye_y = -(turn[0, 1] * shift[0] + turn[1, 1] * shift[1] + turn[2, 1] * shift[2])
    eye_z = -(turn[0, 2] * shift[0] + turn[1, 2] * shift[1] + turn[2, 2] * shift[2])
    reach = (height - eye_z) / ray_z
    if not reach > 0.0:
        return np.nan, np.nan
    return eye_x + reach * ray_x, eye_y + reach * ray_y


@njit(cache=True, error_model="numpy")
def _to_picture(
    camera: Camera, x: float, y: float, height: float
) -> tuple[float, float]:
    lens, turn, shift = camera.lens, camera.rotation, camera.translation
    right = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * height + shift[0]
    down = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * height + shift[1]
    ahead = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * height + shift[2]
    u, v = _distorted(lens, right / ahead, down / ahead)
    return u * lens[0] + lens[2], v * lens[1] + lens[3]


@njit(cache=True, error_model="numpy")
def _shift(
    camera: Camera, x: float, y: float, z: float, by: tuple[float, float, float]
) -> tuple[float, float]:
    """Return by how much a point's pixel shifts for 1 mm along an axis of the board."""
    u, v, w = by
    ahead = _to_picture(camera, x + u, y + v, z + w)
    behind = _to_picture(camera, x - u, y - v, z - w)
    size = 2.0 * (u + v + w)
    return (ahead[0] - behind[0]) / size, (ahead[1] - behind[1]) / size


@njit(cache=True)
def _distorted(lens: Array, x: float, y: float) -> tuple[float, float]:
    k1, k2, p1, p2, k3 = lens[4], lens[5], lens[6], lens[7], lens[8]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )


@njit(cache=True)
def _undistorted(lens: Array, x: float, y: float) -> tuple[float, float]:
    """Undo `_distorted` by fixed-point steps."""
    u, v = x, y
    for _ in range(_STEPS):
        there_x, there_y = _distorted(lens, u, v)
        u, v = u + x - there_x, v + y - there_y
        if max(abs(x - there_x), abs(y - there_y)) < _STILL:
            break
    return u, v
