"""Whether a rod touches the magnet (dimensionless, as `planar_march`)."""

from __future__ import annotations

import math

from ..core.jit import njit
from .planar_march import PART

_MOST_PIECES = 512


@njit(**PART)
def in_reach(field, margin):  # type: ignore[no-untyped-def]
    """Tell whether a rod clamped at the origin is long enough to touch the magnet."""
    if field[0] == 0.0:
        return False
    corner = math.sqrt(field[1] ** 2 + field[2] ** 2 + field[3] ** 2)
    return math.hypot(field[4], field[5]) <= 1.0 + margin + corner


@njit(**PART)
def _distance(field, x, y):  # type: ignore[no-untyped-def]
    """Return the distance of a point of the plane z = 0 from the magnet."""
    total = 0.0
    dx = x - field[4]
    dy = y - field[5]
    for k in range(3):
        along = (
            field[7 + 3 * k] * dx + field[8 + 3 * k] * dy - field[9 + 3 * k] * field[6]
        )
        beyond = max(0.0, abs(along) - field[1 + k])
        total += beyond * beyond
    return math.sqrt(total)


@njit(**PART)
def touches(field, margin, s, curve):  # type: ignore[no-untyped-def]
    """Tell whether a rod comes within `margin` of the magnet, at or between stations.

    Of an arc of length h between points at distances a and b no point is nearer than
    (a + b - h) / 2. Where that leaves it open, points are taken from the arc, by its
    cubic through ends and tangents, every quarter of the margin.

    Parameters
    ----------
    field, margin, s : ndarray, float, ndarray of shape (n,)
        The field (see `planar_march`), half the side, and the stations.
    curve : ndarray, shape (3 or more, n)
        x, y and tangent angle there.
    """
    after = _distance(field, curve[0, 0], curve[1, 0])
    for k in range(s.shape[0] - 1):
        before = after
        after = _distance(field, curve[0, k + 1], curve[1, k + 1])
        h = s[k + 1] - s[k]
        if min(before, after) <= margin:
            return True
        if before + after - h > 2.0 * margin:
            continue
        pieces = int(min(4.0 * h / margin, _MOST_PIECES - 1.0)) + 1
        for j in range(1, pieces):
            t = j / pieces
            p = (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t)
            q = h * t * (1.0 - t) * (1.0 - t)
            r = h * t * t * (t - 1.0)
            a, b = curve[2, k], curve[2, k + 1]
            x = p * curve[0, k] + (1.0 - p) * curve[0, k + 1]
            y = p * curve[1, k] + (1.0 - p) * curve[1, k + 1]
            x += q * math.cos(a) + r * math.cos(b)
            y += q * math.sin(a) + r * math.sin(b)
            if _distance(field, x, y) <= margin:
                return True
    return False
