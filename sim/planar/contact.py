"""Whether a rod touches the magnet, at stations or between them.

Dimensionless, with fields as of `planar.march`. Of an arc of length h between points at
distances a and b no point is nearer than (a + b - h) / 2. Where that leaves it open,
points are taken from the arc, by its cubic through ends and tangents, every quarter of
the margin (half the rod's side, nearer than which it touches).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...core.jit import njit
from ..magnet.flux import PART, distance, in_reach

_MOST_PIECES = 512


@njit(**PART)
def _arc_touches(field, margin, h, a, b):  # type: ignore[no-untyped-def]
    """Tell whether an arc of length h comes within `margin` of the magnet inside.

    Its ends `a` and `b`, shape (6,), are positions and unit tangents.
    """
    pieces = int(min(4.0 * h / margin, _MOST_PIECES - 1.0)) + 1
    for j in range(1, pieces):
        t = j / pieces
        p = (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t)
        q = h * t * (1.0 - t) * (1.0 - t)
        r = h * t * t * (t - 1.0)
        x = p * a[0] + (1.0 - p) * b[0] + q * a[3] + r * b[3]
        y = p * a[1] + (1.0 - p) * b[1] + q * a[4] + r * b[4]
        z = p * a[2] + (1.0 - p) * b[2] + q * a[5] + r * b[5]
        if distance(field, x, y, z) <= margin:
            return True
    return False


@njit(**PART)
def touches_in_plane(field, margin, s, curve):  # type: ignore[no-untyped-def]
    """Tell whether a planar rod comes within `margin` of the magnet.

    Parameters
    ----------
    field, margin, s : ndarray, float, ndarray of shape (n,)
        The field, half the side, and the stations.
    curve : ndarray, shape (3 or more, n)
        x, y and tangent angle there.
    """
    ends = np.zeros((2, 6))
    after = distance(field, curve[0, 0], curve[1, 0], 0.0)
    for k in range(1, s.shape[0]):
        before = after
        after = distance(field, curve[0, k], curve[1, k], 0.0)
        h = s[k] - s[k - 1]
        if min(before, after) <= margin:
            return True
        if before + after - h > 2.0 * margin:
            continue
        for j in range(2):
            i = k - 1 + j
            ends[j, 0], ends[j, 1] = curve[0, i], curve[1, i]
            ends[j, 3], ends[j, 4] = math.cos(curve[2, i]), math.sin(curve[2, i])
        if _arc_touches(field, margin, h, ends[0], ends[1]):
            return True
    return False


@njit(cache=True)
def touches(field, margin, s, line):  # type: ignore[no-untyped-def]
    """Tell whether a rod in space comes within `margin` of the magnet.

    Parameters
    ----------
    field, margin, s : ndarray, float, ndarray of shape (n,)
        The field, half the side, and the stations.
    line : ndarray, shape (n, 6)
        Position and unit tangent there.
    """
    if not in_reach(field, margin):
        return False
    after = distance(field, line[0, 0], line[0, 1], line[0, 2])
    for k in range(1, s.shape[0]):
        before = after
        after = distance(field, line[k, 0], line[k, 1], line[k, 2])
        h = s[k] - s[k - 1]
        if min(before, after) <= margin:
            return True
        if before + after - h > 2.0 * margin:
            continue
        if _arc_touches(field, margin, h, line[k - 1], line[k]):
            return True
    return False


def load_before_touching(end: float, clear: Callable[[float], bool]) -> float:
    """Return up to which load a rod touches no magnet, if its branch ends at `end`.

    `clear` tells of a load whether the rod then has a shape that touches none.
    """
    low, high = 0.0, end
    load = end * (1.0 - 1e-6)
    for _ in range(20):
        if not clear(load):
            high = load
        elif high == end:
            return end
        else:
            low = load
        load = 0.5 * (low + high)
    return low
