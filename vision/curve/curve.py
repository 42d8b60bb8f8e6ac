"""A plane curve on an even grid of arc length, in pixels and radians (y down)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit

Array = NDArray[np.float64]


class Curve(NamedTuple):
    """A fitted curve on an even grid of arc length.

    Parameters
    ----------
    s : ndarray, shape (n,)
        Arc length.
    points : ndarray, shape (n, 2)
        Position (x, y).
    theta, kappa : ndarray, shape (n,)
        Tangent angle, unwrapped, and its derivative.
    """

    s: Array
    points: Array
    theta: Array
    kappa: Array

    @property
    def tangents(self) -> Array:
        """Unit tangents, shape (n, 2)."""
        tangents = np.empty((len(self.theta), 2))
        np.cos(self.theta, out=tangents[:, 0])
        np.sin(self.theta, out=tangents[:, 1])
        return tangents

    @property
    def normals(self) -> Array:
        """Unit normals to the right in the picture (y down), shape (n, 2)."""
        return np.asarray(normals_of(self.theta))

    def reversed(self) -> Curve:
        """Return the same curve from its end on, where s is 0 less what it was."""
        return Curve(
            s=-self.s[::-1], points=self.points[::-1].copy(),
            theta=self.theta[::-1] + np.pi, kappa=-self.kappa[::-1],
        )  # fmt: skip

    def at(self, s: Array) -> tuple[Array, Array]:
        """Return points (n, 2) and angles (n,) at any s; beyond the ends an arc."""
        points, theta = points_at(self, np.ascontiguousarray(s, dtype=np.float64))
        return points, theta


@njit(cache=True)
def points_at(curve: Curve, at: Array) -> tuple[Array, Array]:
    """Return points and angles of a curve, as `Curve.at`: curvature runs straight."""
    s, points, theta, kappa = curve
    out, angle = np.empty((at.size, 2)), np.empty(at.size)
    last = s.size - 1
    step = s[1] - s[0]
    for i in range(at.size):
        inside = min(max(at[i], s[0]), s[last])
        place = (inside - s[0]) / step
        k = min(max(int(place), 0), last - 1)
        u = (place - k) * step
        slope = (kappa[k + 1] - kappa[k]) / step
        middle = theta[k] + 0.5 * u * (kappa[k] + 0.25 * slope * u)
        turned = theta[k] + u * (kappa[k] + 0.5 * slope * u)
        x, y = points[k, 0] + u * np.cos(middle), points[k, 1] + u * np.sin(middle)
        beyond = at[i] - inside
        if beyond != 0.0:
            bend = kappa[last] if beyond > 0.0 else kappa[0]
            middle = turned + 0.5 * beyond * bend
            x, y = x + beyond * np.cos(middle), y + beyond * np.sin(middle)
            turned += beyond * bend
        out[i, 0], out[i, 1], angle[i] = x, y, turned
    return out, angle


@njit(cache=True)
def normals_of(theta: Array) -> Array:
    """Return unit normals to the right in the picture (y down) of angles, (n, 2)."""
    normals = np.empty((theta.size, 2))
    normals[:, 0], normals[:, 1] = -np.sin(theta), np.cos(theta)
    return normals


@njit(cache=True)
def beside(points: Array, theta: Array, offset: Array) -> Array:
    """Return points (n, 2) moved by offsets along the normals of angles."""
    out = np.empty_like(points)
    for i in range(offset.size):
        out[i, 0] = points[i, 0] - offset[i] * np.sin(theta[i])
        out[i, 1] = points[i, 1] + offset[i] * np.cos(theta[i])
    return out


def arc_lengths(points: Array) -> Array:
    """Return the arc length at the points (n, 2) of a polyline."""
    lengths = np.zeros(len(points))
    np.cumsum(np.hypot(*(points[1:] - points[:-1]).T), out=lengths[1:])
    return lengths


def on_polyline(along: Array, s: Array, points: Array) -> Array:
    """Return points (k, 2) of a polyline at arc lengths; `s` are those of its own."""
    return np.column_stack([np.interp(along, s, axis) for axis in points.T])
