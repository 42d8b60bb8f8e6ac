"""How near a point is to the walls of a lumen: segments and arcs in closed form.

Lengths are over the rod's. A wall is cut at its concave corners into *pieces*, so that
the distance from each piece is smooth on the side of the lumen: at a convex corner the
nearest point is the corner itself, and in a concave one the rod touches two pieces.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..magnet.flux import PART

Array = NDArray[np.float64]

KIND, AX, AY, DX, DY, SIZE, SIDE, HALF, MX, MY, REACH = range(11)
"""Columns of a part. Segment (kind 0): start, direction, length. Arc (kind 1): centre,
direction of its middle, radius. Side: +1 if the lumen is to the left of the segment or
outside the circle, else -1. Cosine of half the arc's sweep. Circle round it all."""
SX, SY, EX, EY, SNX, SNY, ENX, ENY = range(11, 19)
"""Start and end of a part, and the normals there that tell the sides of a corner apart;
(0, 0) at a free end, which has no wrong side."""
COLUMNS = 19


class Walls(NamedTuple):
    """All parts of all walls, piece by piece.

    Parameters
    ----------
    parts : ndarray, shape (n, 19)
        See `KIND` and `SX`.
    first : ndarray, shape (pieces + 1,)
        Where the parts of each piece begin.
    depth : float
        A point deeper behind a wall than this has come round its end: no contact begins
        there.
    """

    parts: Array
    first: NDArray[np.int64]
    depth: float


class Near(NamedTuple):
    """Signed distance from a piece, its gradient, and the curvature of its level line.

    The Hessian of the distance is `bend` times the dyad of the tangent.
    """

    distance: float
    nx: float
    ny: float
    bend: float


@njit(**PART)
def _to_end(p, x, y, cx, cy, nx, ny):  # type: ignore[no-untyped-def]
    """Return what `Near` holds, at an end of a part."""
    dx = x - cx
    dy = y - cy
    d = math.hypot(dx, dy)
    if d < 1e-15:
        return Near(0.0, nx, ny, 0.0)
    sign = -1.0 if dx * nx + dy * ny < 0.0 else 1.0
    return Near(sign * d, sign * dx / d, sign * dy / d, sign / d)


@njit(**PART)
def _to_part(p, x, y):  # type: ignore[no-untyped-def]
    """Return the distance of a point from one part."""
    if p[KIND] == 0.0:
        dx = x - p[AX]
        dy = y - p[AY]
        along = dx * p[DX] + dy * p[DY]
        if along <= 0.0:
            return _to_end(p, x, y, p[SX], p[SY], p[SNX], p[SNY])
        if along >= p[SIZE]:
            return _to_end(p, x, y, p[EX], p[EY], p[ENX], p[ENY])
        side = p[SIDE]
        d = side * (p[DX] * dy - p[DY] * dx)
        return Near(d, -side * p[DY], side * p[DX], 0.0)
    dx = x - p[AX]
    dy = y - p[AY]
    rho = math.hypot(dx, dy)
    if rho > 0.0 and (p[DX] * dx + p[DY] * dy) >= p[HALF] * rho:
        side = p[SIDE]
        return Near(
            side * (rho - p[SIZE]), side * dx / rho, side * dy / rho, side / rho
        )
    to_start = math.hypot(x - p[SX], y - p[SY])
    if to_start <= math.hypot(x - p[EX], y - p[EY]):
        return _to_end(p, x, y, p[SX], p[SY], p[SNX], p[SNY])
    return _to_end(p, x, y, p[EX], p[EY], p[ENX], p[ENY])


@njit(**PART)
def clearance(walls, piece, x, y):  # type: ignore[no-untyped-def]
    """Return the signed distance (`Near`) of a point from a piece."""
    best = Near(1e9, 0.0, 1.0, 0.0)
    least = 1e9
    for i in range(walls.first[piece], walls.first[piece + 1]):
        p = walls.parts[i]
        if math.hypot(x - p[MX], y - p[MY]) - p[REACH] >= least:
            continue
        near = _to_part(p, x, y)
        if abs(near.distance) < least:
            least = abs(near.distance)
            best = near
    return best


@njit(cache=True, error_model="numpy")
def clearances(walls, points):  # type: ignore[no-untyped-def]
    """Return the least signed distance of each point from any wall.

    Parameters
    ----------
    walls : Walls
        The lumen.
    points : ndarray, shape (n, 2)
        In the walls' own lengths.

    Returns
    -------
    ndarray, shape (n,)
        Negative behind a wall.
    """
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        least = 1e9
        for piece in range(walls.first.shape[0] - 1):
            near = clearance(walls, piece, points[i, 0], points[i, 1])
            least = min(least, near.distance)
        out[i] = least
    return out
