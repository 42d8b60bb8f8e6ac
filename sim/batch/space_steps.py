"""One step of lanes of rods in space, and of the columns of their tips.

The equations are in `batch.space_room`. The state goes by the sixth-order method of
`spatial.march`. The columns only give Newton's matrix and what is surely stable, for
which three digits do: they go by Kutta's 3/8 rule in what the state's stages have seen
at 0, 1/3, 2/3 and 1 of the step.
"""

from __future__ import annotations

import numpy as np

from ...core.jit import njit
from ..spatial.march import _A, C1, C2, C3, K1, K2, K3, MU1, MU2, WX, WY, WZ, H
from .space_field import bends, gradients
from .space_room import (
    BENT,
    COLUMN,
    FOUND,
    KEPT,
    LANES,
    LOOK,
    OPTIONS,
    POSITIVE,
    SEEN,
    SIGHT,
    SLOPE,
    STAGES,
    STATE,
    Z_FOUND,
    Z_LOOK,
    Z_SLOPE,
    G,
    Y,
    Z,
)

_SEEN_AT = (0, 2, 3, 6)
"""The stages that the columns look at."""
_KUTTA = np.array([[0, 0, 0], [1 / 3, 0, 0], [-1 / 3, 1, 0], [1, -1, 1]])
"""Weights of the slopes of a column at each look."""


@njit(**OPTIONS)
def _state_slope(w):  # type: ignore[no-untyped-def]
    """Write h dy/dsigma where the lanes look."""
    for i in range(LANES):
        h = w[H * LANES + i]
        y = LOOK + i
        ax, ay, az = w[y], w[y + LANES], w[y + 2 * LANES]
        bx, by, bz = w[y + 3 * LANES], w[y + 4 * LANES], w[y + 5 * LANES]
        cx, cy, cz = w[y + 6 * LANES], w[y + 7 * LANES], w[y + 8 * LANES]
        mx, my, mz = w[y + 9 * LANES], w[y + 10 * LANES], w[y + 11 * LANES]
        nx, ny, nz = w[y + 15 * LANES], w[y + 16 * LANES], w[y + 17 * LANES]
        fx, fy, fz = w[y + 18 * LANES], w[y + 19 * LANES], w[y + 20 * LANES]
        o1 = w[C1 * LANES + i] * (ax * mx + ay * my + az * mz) + w[K1 * LANES + i]
        o2 = w[C2 * LANES + i] * (bx * mx + by * my + bz * mz) + w[K2 * LANES + i]
        o3 = w[C3 * LANES + i] * (cx * mx + cy * my + cz * mz) + w[K3 * LANES + i]
        o1 *= h
        o2 *= h
        o3 *= h
        mu1, mu2 = h * w[MU1 * LANES + i], h * w[MU2 * LANES + i]
        px, py, pz = mu1 * ax + mu2 * bx, mu1 * ay + mu2 * by, mu1 * az + mu2 * bz
        xx, xy = w[G + i], w[G + LANES + i]
        xz, yy = w[G + 2 * LANES + i], w[G + 3 * LANES + i]
        yz = w[G + 4 * LANES + i]
        zz = -(xx + yy)
        j = FOUND + i
        w[j] = o2 * cx - o3 * bx
        w[j + LANES] = o2 * cy - o3 * by
        w[j + 2 * LANES] = o2 * cz - o3 * bz
        w[j + 3 * LANES] = o3 * ax - o1 * cx
        w[j + 4 * LANES] = o3 * ay - o1 * cy
        w[j + 5 * LANES] = o3 * az - o1 * cz
        w[j + 6 * LANES] = o1 * bx - o2 * ax
        w[j + 7 * LANES] = o1 * by - o2 * ay
        w[j + 8 * LANES] = o1 * bz - o2 * az
        cx *= h
        cy *= h
        cz *= h
        w[j + 9 * LANES] = cy * nz - cz * ny + py * fz - pz * fy
        w[j + 10 * LANES] = cz * nx - cx * nz + pz * fx - px * fz
        w[j + 11 * LANES] = cx * ny - cy * nx + px * fy - py * fx
        w[j + 12 * LANES] = -cx
        w[j + 13 * LANES] = -cy
        w[j + 14 * LANES] = -cz
        w[j + 15 * LANES] = xx * px + xy * py + xz * pz + h * w[WX * LANES + i]
        w[j + 16 * LANES] = xy * px + yy * py + yz * pz + h * w[WY * LANES + i]
        w[j + 17 * LANES] = xz * px + yz * py + zz * pz + h * w[WZ * LANES + i]
        w[j + 18 * LANES] = -(xx * cx + xy * cy + xz * cz)
        w[j + 19 * LANES] = -(xy * cx + yy * cy + yz * cz)
        w[j + 20 * LANES] = -(xz * cx + yz * cy + zz * cz)


@njit(**OPTIONS)
def _see(w):  # type: ignore[no-untyped-def]
    """Write what the columns need of the state where the lanes look."""
    for i in range(LANES):
        h = w[H * LANES + i]
        y = LOOK + i
        ax, ay, az = w[y], w[y + LANES], w[y + 2 * LANES]
        bx, by, bz = w[y + 3 * LANES], w[y + 4 * LANES], w[y + 5 * LANES]
        cx, cy, cz = w[y + 6 * LANES], w[y + 7 * LANES], w[y + 8 * LANES]
        c1, c2 = h * w[C1 * LANES + i], h * w[C2 * LANES + i]
        c3 = h * w[C3 * LANES + i]
        mu1, mu2 = h * w[MU1 * LANES + i], h * w[MU2 * LANES + i]
        j = SIGHT + i
        w[j] = h * cx
        w[j + LANES] = h * cy
        w[j + 2 * LANES] = h * cz
        w[j + 3 * LANES] = w[y + 15 * LANES]
        w[j + 4 * LANES] = w[y + 16 * LANES]
        w[j + 5 * LANES] = w[y + 17 * LANES]
        w[j + 6 * LANES] = w[y + 9 * LANES]
        w[j + 7 * LANES] = w[y + 10 * LANES]
        w[j + 8 * LANES] = w[y + 11 * LANES]
        w[j + 9 * LANES] = c1 * ax * ax + c2 * bx * bx + c3 * cx * cx
        w[j + 10 * LANES] = c1 * ax * ay + c2 * bx * by + c3 * cx * cy
        w[j + 11 * LANES] = c1 * ax * az + c2 * bx * bz + c3 * cx * cz
        w[j + 12 * LANES] = c1 * ay * ay + c2 * by * by + c3 * cy * cy
        w[j + 13 * LANES] = c1 * ay * az + c2 * by * bz + c3 * cy * cz
        w[j + 14 * LANES] = c1 * az * az + c2 * bz * bz + c3 * cz * cz
        w[j + 15 * LANES] = mu1 * ax + mu2 * bx
        w[j + 16 * LANES] = mu1 * ay + mu2 * by
        w[j + 17 * LANES] = mu1 * az + mu2 * bz
        w[j + 18 * LANES] = w[y + 18 * LANES]
        w[j + 19 * LANES] = w[y + 19 * LANES]
        w[j + 20 * LANES] = w[y + 20 * LANES]
        w[j + 21 * LANES] = w[G + i]
        w[j + 22 * LANES] = w[G + LANES + i]
        w[j + 23 * LANES] = w[G + 2 * LANES + i]
        w[j + 24 * LANES] = w[G + 3 * LANES + i]
        w[j + 25 * LANES] = w[G + 4 * LANES + i]
        w[j + 26 * LANES] = h * w[BENT + i]
        w[j + 27 * LANES] = h * w[BENT + LANES + i]
        w[j + 28 * LANES] = h * w[BENT + 2 * LANES + i]
        w[j + 29 * LANES] = h * w[BENT + 3 * LANES + i]
        w[j + 30 * LANES] = h * w[BENT + 4 * LANES + i]


@njit(**OPTIONS)
def _look_ahead(k, to, w):  # type: ignore[no-untyped-def]
    """Set the state at which stage k looks, by the slopes so far (7: at the end)."""
    to &= POSITIVE
    row, f = STATE * LANES, SLOPE
    if k == 0:
        for i in range(STATE * LANES):
            w[to + i] = w[Y + i]
    elif k <= 2:
        a = _A[k, k - 1]
        f = (SLOPE + row * (k - 1)) & POSITIVE
        for i in range(STATE * LANES):
            w[to + i] = w[Y + i] + a * w[f + i]
    elif k <= 4:
        a, b, c, d = _A[k, 0], _A[k, 1], _A[k, 2], _A[k, 3]
        for i in range(STATE * LANES):
            f = SLOPE + i
            w[to + i] = (
                w[Y + i] + a * w[f] + b * w[f + row] + c * w[f + 2 * row]
                + d * w[f + 3 * row]
            )  # fmt: skip
    else:
        a, b, c, d = _A[k, 0], _A[k, 1], _A[k, 2], _A[k, 3]
        e, g, h = _A[k, 4], _A[k, 5], _A[k, 6]
        for i in range(STATE * LANES):
            f = SLOPE + i
            w[to + i] = (
                w[Y + i] + a * w[f] + b * w[f + row] + c * w[f + 2 * row]
                + d * w[f + 3 * row] + e * w[f + 4 * row] + g * w[f + 5 * row]
                + h * w[f + 6 * row]
            )  # fmt: skip


@njit(**OPTIONS)
def _column_slope(w):  # type: ignore[no-untyped-def]
    """Write h dz/dsigma of a column, but for what acts across the rod."""
    for i in range(LANES):
        z, c, j = Z_LOOK + i, SIGHT + i, Z_FOUND + i
        tx, ty, tz = w[z], w[z + LANES], w[z + 2 * LANES]
        vx, vy, vz = w[z + 9 * LANES], w[z + 10 * LANES], w[z + 11 * LANES]
        cx, cy, cz = w[c], w[c + LANES], w[c + 2 * LANES]
        nx, ny, nz = w[c + 3 * LANES], w[c + 4 * LANES], w[c + 5 * LANES]
        mx, my, mz = w[c + 6 * LANES], w[c + 7 * LANES], w[c + 8 * LANES]
        ex = w[z + 3 * LANES] - (ty * mz - tz * my)
        ey = w[z + 4 * LANES] - (tz * mx - tx * mz)
        ez = w[z + 5 * LANES] - (tx * my - ty * mx)
        xy, xz, yz = w[c + 10 * LANES], w[c + 11 * LANES], w[c + 13 * LANES]
        qx, qy, qz = ty * cz - tz * cy, tz * cx - tx * cz, tx * cy - ty * cx
        w[j] = -(w[c + 9 * LANES] * ex + xy * ey + xz * ez)
        w[j + LANES] = -(xy * ex + w[c + 12 * LANES] * ey + yz * ez)
        w[j + 2 * LANES] = -(xz * ex + yz * ey + w[c + 14 * LANES] * ez)
        w[j + 3 * LANES] = qy * nz - qz * ny + cy * vz - cz * vy
        w[j + 4 * LANES] = qz * nx - qx * nz + cz * vx - cx * vz
        w[j + 5 * LANES] = qx * ny - qy * nx + cx * vy - cy * vx
        w[j + 6 * LANES] = -qx
        w[j + 7 * LANES] = -qy
        w[j + 8 * LANES] = -qz
        w[j + 9 * LANES] = 0.0
        w[j + 10 * LANES] = 0.0
        w[j + 11 * LANES] = 0.0


@njit(**OPTIONS)
def _column_across(w):  # type: ignore[no-untyped-def]
    """Add what the transverse magnetisation does."""
    for i in range(LANES):
        z, c, j = Z_LOOK + i, SIGHT + i, Z_FOUND + i
        tx, ty, tz = w[z], w[z + LANES], w[z + 2 * LANES]
        rx, ry, rz = w[z + 6 * LANES], w[z + 7 * LANES], w[z + 8 * LANES]
        px, py, pz = w[c + 15 * LANES], w[c + 16 * LANES], w[c + 17 * LANES]
        bx, by, bz = w[c + 18 * LANES], w[c + 19 * LANES], w[c + 20 * LANES]
        xx, xy, xz = w[c + 21 * LANES], w[c + 22 * LANES], w[c + 23 * LANES]
        yy, yz = w[c + 24 * LANES], w[c + 25 * LANES]
        zz = -(xx + yy)
        qx, qy, qz = ty * pz - tz * py, tz * px - tx * pz, tx * py - ty * px
        dx = xx * rx + xy * ry + xz * rz
        dy = xy * rx + yy * ry + yz * rz
        dz = xz * rx + yz * ry + zz * rz
        w[j + 3 * LANES] += qy * bz - qz * by + py * dz - pz * dy
        w[j + 4 * LANES] += qz * bx - qx * bz + pz * dx - px * dz
        w[j + 5 * LANES] += qx * by - qy * bx + px * dy - py * dx
        dx = xx * qx + xy * qy + xz * qz
        dy = xy * qx + yy * qy + yz * qz
        dz = xz * qx + yz * qy + zz * qz
        xx, xy, xz = w[c + 26 * LANES], w[c + 27 * LANES], w[c + 28 * LANES]
        yy, yz = w[c + 29 * LANES], w[c + 30 * LANES]
        zz = -(xx + yy)
        w[j + 9 * LANES] += dx + xx * rx + xy * ry + xz * rz
        w[j + 10 * LANES] += dy + xy * rx + yy * ry + yz * rz
        w[j + 11 * LANES] += dz + xz * rx + yz * ry + zz * rz


@njit(**OPTIONS)
def _column_ahead(column, k, w):  # type: ignore[no-untyped-def]
    """Set a column as look k sees it."""
    z = (Z + COLUMN * LANES * column) & POSITIVE
    g = (Z_SLOPE + COLUMN * LANES * column) & POSITIVE
    a, b, c = _KUTTA[k, 0], _KUTTA[k, 1], _KUTTA[k, 2]
    row = 6 * COLUMN * LANES
    for i in range(COLUMN * LANES):
        f = g + i
        w[Z_LOOK + i] = w[z + i] + a * w[f] + b * w[f + row] + c * w[f + 2 * row]


@njit(**OPTIONS)
def _look_of_columns(columns, k, tilted, w):  # type: ignore[no-untyped-def]
    """Write the slopes of the columns at look k."""
    for column in range(columns):
        _column_ahead(column, k, w)
        _column_slope(w)
        if tilted:
            _column_across(w)
        _copy(COLUMN, Z_FOUND, Z_SLOPE + COLUMN * LANES * (6 * k + column), w)


@njit(**OPTIONS)
def _end_of_columns(columns, w):  # type: ignore[no-untyped-def]
    """Advance the columns by their slopes at all looks."""
    row = 6 * COLUMN * LANES
    for i in range(columns * COLUMN * LANES):
        f = Z_SLOPE + i
        w[Z + i] += 0.125 * (
            w[f] + 3.0 * (w[f + row] + w[f + 2 * row]) + w[f + 3 * row]
        )


@njit(**OPTIONS)
def _copy(rows, here, there, w):  # type: ignore[no-untyped-def]
    """Copy rows."""
    here &= POSITIVE
    there &= POSITIVE
    for i in range(rows * LANES):
        w[there + i] = w[here + i]


@njit(**OPTIONS)
def state_step(columns, tilted, along, w):  # type: ignore[no-untyped-def]
    """Advance the states, and the first `columns` columns, by a step.

    Some rods are `tilted`, and the field is not the same all `along` them.
    """
    for k in range(STAGES):
        _look_ahead(k, LOOK, w)
        if tilted and along:
            gradients(w)
        _state_slope(w)
        _copy(STATE, FOUND, SLOPE + STATE * LANES * k, w)
        if columns > 0 and k in _SEEN_AT:
            if tilted and along:
                bends(w)
            _see(w)
            if k == 2:  # 2/3 comes before 1/3
                _copy(SEEN, SIGHT, KEPT, w)
                continue
            look = 0 if k == 0 else 1 if k == 3 else 3
            _look_of_columns(columns, look, tilted, w)
            if k == 3:
                _copy(SEEN, KEPT, SIGHT, w)
                _look_of_columns(columns, 2, tilted, w)
    _look_ahead(STAGES, Y, w)
    if columns > 0:
        _end_of_columns(columns, w)
