"""Newton's matrix of lanes of rods in space: test, factors, and corrections of tips.

The matrix has turns and shifts of the roots by those of the tips, with what a rigid rod
would do divided out: where its symmetric part is positive, elimination needs no pivots.
"""

from __future__ import annotations

import math

from ...core.jit import njit
from ..spatial.sure import MARGIN
from .space_room import (
    CLAMP,
    COLUMN,
    LANES,
    LEVER,
    MATRIX,
    MISS,
    OPTIONS,
    POSITIVE,
    SIZE,
    SURE,
    TEST,
    TIP,
    TRACE,
    Y,
    Z,
)  # fmt: skip


@njit(**OPTIONS)
def matrix(w):  # type: ignore[no-untyped-def]
    """Write turns and shifts of the columns, less what a rigid rod would do."""
    for i in range(3 * LANES):
        w[LEVER + i] = w[Y + 12 * LANES + i] - w[TIP + 9 * LANES + i]
    for a in range(6):
        z = (Z + COLUMN * LANES * a) & POSITIVE
        m = (MATRIX + LANES * a) & POSITIVE
        for i in range(LANES):
            tx, ty, tz = w[z + i], w[z + LANES + i], w[z + 2 * LANES + i]
            lx, ly = w[LEVER + i], w[LEVER + LANES + i]
            lz = w[LEVER + 2 * LANES + i]
            x, y = w[z + 6 * LANES + i], w[z + 7 * LANES + i]
            w[m + i] = tx
            w[m + 6 * LANES + i] = ty
            w[m + 12 * LANES + i] = tz
            w[m + 18 * LANES + i] = x - (ty * lz - tz * ly)
            w[m + 24 * LANES + i] = y - (tz * lx - tx * lz)
            w[m + 30 * LANES + i] = w[z + 8 * LANES + i] - (tx * ly - ty * lx)


@njit(**OPTIONS)
def factor(n, at, w):  # type: ignore[no-untyped-def]
    """Factor a matrix (6, 6) at `at`; a pivot that is not positive ends `SURE`."""
    for k in range(n):
        d = (at + 7 * LANES * k) & POSITIVE
        for i in range(LANES):
            w[SURE + i] *= 1.0 if w[d + i] > 0.0 else 0.0
        for row in range(k + 1, n):
            f = (at + LANES * (6 * row + k)) & POSITIVE
            for i in range(LANES):
                w[f + i] /= w[d + i]
            for j in range(k + 1, n):
                x = (at + LANES * (6 * row + j)) & POSITIVE
                y = (at + LANES * (6 * k + j)) & POSITIVE
                for i in range(LANES):
                    w[x + i] -= w[f + i] * w[y + i]


@njit(**OPTIONS)
def _balance(w):  # type: ignore[no-untyped-def]
    """Choose units of shifts in which turns by shifts are as large as the reverse."""
    for i in range(LANES):
        up = down = 0.0
        for a in range(3):
            for b in range(3):
                up += w[TEST + LANES * (6 * a + 3 + b) + i] ** 2
                down += w[TEST + LANES * (6 * (3 + a) + b) + i] ** 2
        # Triangular by blocks: a unit makes what is left as small as one likes.
        scale = (
            1e-3
            if up == 0.0
            else 1e3
            if down == 0.0
            else math.sqrt(math.sqrt(up / down))
        )
        for a in range(3):
            for b in range(3):
                w[TEST + LANES * (6 * a + 3 + b) + i] /= scale
                w[TEST + LANES * (6 * (3 + a) + b) + i] *= scale


@njit(**OPTIONS)
def test(n, w):  # type: ignore[no-untyped-def]
    """End `SURE` where the matrix might become singular (`spatial.sure`)."""
    for i in range(36 * LANES):
        w[TEST + i] = w[MATRIX + i]
    if n == 6:
        _balance(w)
    for a in range(n):
        for b in range(a):
            x = (TEST + LANES * (6 * a + b)) & POSITIVE
            y = (TEST + LANES * (6 * b + a)) & POSITIVE
            for i in range(LANES):
                half = 0.5 * (w[x + i] + w[y + i])
                w[x + i] = half
                w[y + i] = half
        x = (TEST + 7 * LANES * a) & POSITIVE
        for i in range(LANES):
            w[x + i] -= MARGIN
    factor(n, TEST, w)


@njit(**OPTIONS)
def _miss(w):  # type: ignore[no-untyped-def]
    """Write by how much the roots miss the clamp."""
    for i in range(LANES):
        tx = ty = tz = trace = 0.0
        for a in range(3):
            d, c = Y + 3 * LANES * a + i, CLAMP + 3 * LANES * a + i
            dx, dy, dz = w[d], w[d + LANES], w[d + 2 * LANES]
            cx, cy, cz = w[c], w[c + LANES], w[c + 2 * LANES]
            tx += 0.5 * (dy * cz - dz * cy)
            ty += 0.5 * (dz * cx - dx * cz)
            tz += 0.5 * (dx * cy - dy * cx)
            trace += dx * cx + dy * cy + dz * cz
        lx, ly, lz = w[LEVER + i], w[LEVER + LANES + i], w[LEVER + 2 * LANES + i]
        y, c, m = Y + 12 * LANES + i, CLAMP + 9 * LANES + i, MISS + i
        w[TRACE + i] = trace
        w[m] = tx
        w[m + LANES] = ty
        w[m + 2 * LANES] = tz
        w[m + 3 * LANES] = w[c] - w[y] - (ty * lz - tz * ly)
        w[m + 4 * LANES] = w[c + LANES] - w[y + LANES] - (tz * lx - tx * lz)
        w[m + 5 * LANES] = w[c + 2 * LANES] - w[y + 2 * LANES] - (tx * ly - ty * lx)


@njit(**OPTIONS)
def move(w):  # type: ignore[no-untyped-def]
    """Turn and shift the tips by `MISS`, and leave how much."""
    for i in range(LANES):
        x, y, z = w[MISS + i], w[MISS + LANES + i], w[MISS + 2 * LANES + i]
        p, r = MISS + 3 * LANES + i, TIP + 9 * LANES + i
        turn = max(max(abs(x), abs(y)), abs(z))
        shift = max(max(abs(w[p]), abs(w[p + LANES])), abs(w[p + 2 * LANES]))
        w[SIZE + i] = max(turn, shift)
        w[r] += w[p]
        w[r + LANES] += w[p + LANES]
        w[r + 2 * LANES] += w[p + 2 * LANES]
        x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
        f = 2.0 / (1.0 + x * x + y * y + z * z)
        for a in range(3):
            d = TIP + 3 * LANES * a + i
            dx, dy, dz = w[d], w[d + LANES], w[d + 2 * LANES]
            ex = dx + y * dz - z * dy
            ey = dy + z * dx - x * dz
            ez = dz + x * dy - y * dx
            w[d] += f * (y * ez - z * ey)
            w[d + LANES] += f * (z * ex - x * ez)
            w[d + 2 * LANES] += f * (x * ey - y * ex)


@njit(**OPTIONS)
def correct(w):  # type: ignore[no-untyped-def]
    """Make a Newton step on the tips, by the factors in `MATRIX`."""
    _miss(w)
    for row in range(6):
        x = (MISS + LANES * row) & POSITIVE
        for k in range(row):
            f = (MATRIX + LANES * (6 * row + k)) & POSITIVE
            y = (MISS + LANES * k) & POSITIVE
            for i in range(LANES):
                w[x + i] -= w[f + i] * w[y + i]
    for row in range(5, -1, -1):
        x = (MISS + LANES * row) & POSITIVE
        for k in range(row + 1, 6):
            f = (MATRIX + LANES * (6 * row + k)) & POSITIVE
            y = (MISS + LANES * k) & POSITIVE
            for i in range(LANES):
                w[x + i] -= w[f + i] * w[y + i]
        d = (MATRIX + 7 * LANES * row) & POSITIVE
        for i in range(LANES):
            w[x + i] /= w[d + i]
    move(w)
