"""Points in the order of the rod, from clamp to tip, and in the clamp's frame."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from .shapes import Array, RawShape

Indices = NDArray[np.intp]


def path_length(points: Array) -> float:
    """Return the length of the line through the points, in their order."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def chained_length(points: Array) -> float:
    """Return the length of a line through the points, which may be in any order."""
    return path_length(points[_chain(points)])


def arc_length(points: Array) -> Array:
    """Return the length of the line up to each point."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def order_of(raw: RawShape, points: Array, notes: list[str]) -> Indices:
    """Return the places of the points from clamp to tip; notes say what was mended.

    Raises
    ------
    InputError
        If several points stand at one place along the rod.
    """
    key = raw.s if raw.s is not None else raw.material
    if key is not None:
        order = np.argsort(key, kind="stable")
        if np.any(np.diff(key[order]) <= 0.0):
            raise InputError(
                f"{raw.source}: has several points at one place along the rod: it is "
                "no line; export the rod's centre line (or one edge) alone"
            )
        if np.any(np.diff(order) != 1):
            notes.append("reordered")
        # A material coordinate may run from the tip; the arc length may not.
        if raw.s is None and _is_reversed(points[order]):
            order = order[::-1]
            notes.append("reversed")
        return order
    order = np.arange(len(points))
    if path_length(points) > 1.2 * chained_length(points):
        order = _chain(points)
        notes.append("reordered")
    if _is_reversed(points[order]):
        order = order[::-1]
        notes.append("reversed")
    return order


def _is_reversed(points: Array) -> bool:
    """Return whether the last point lies at the clamp, and the first does not."""
    first, last = np.hypot(*points[0]), np.hypot(*points[-1])
    return bool(last < 0.05 * path_length(points) and last < 0.2 * first)


def _chain(points: Array) -> Indices:
    """Order points as a line: from an end to the nearest left, over and over."""
    if len(points) > 20_000:
        return np.arange(len(points))
    from scipy.spatial import cKDTree

    # One of the two ends: the point farthest from the middle of all.
    at = int(np.argmax(np.hypot(*(points - points.mean(axis=0)).T)))
    tree, left = cKDTree(points), np.ones(len(points), dtype=bool)
    order = []
    for _ in range(len(points)):
        order.append(at)
        left[at] = False
        count = 8
        while left.any():
            near = tree.query(points[at], k=min(count, len(points)))[1]
            free = [k for k in np.atleast_1d(near) if left[k]]
            if free:
                at = int(free[0])
                break
            count *= 4
    return np.array(order, dtype=np.intp)


def root_direction(points: Array) -> tuple[float, float]:
    """Return the direction in which points leave the clamp, and its deviation, in rad.

    That of a cubic through the first third, steadier than one step; the deviation is
    what the scatter of these points makes of it, NaN where they are too few to tell.
    """
    n = max(3, len(points) // 3)
    s = arc_length(points[:n])
    basis = np.vander(s, min(4, n), increasing=True)
    inverse = np.linalg.pinv(basis)
    curve = inverse @ points[:n]
    angle = math.atan2(curve[1, 1], curve[1, 0])
    spare = n - basis.shape[1]
    if spare < 1:
        return angle, math.nan
    apart = (points[:n] - basis @ curve) @ [-math.sin(angle), math.cos(angle)]
    scatter = math.sqrt(float(apart @ apart) / spare)
    slope = float(np.hypot(*curve[1]))
    return angle, scatter * float(np.linalg.norm(inverse[1])) / slope


def aligned(points: Array, angle: float) -> Array:
    """Return the points from the clamp on, turned back by `angle` in rad."""
    c, sn = math.cos(angle), math.sin(angle)
    return np.asarray((points - points[0]) @ np.array([[c, -sn], [sn, c]]))
