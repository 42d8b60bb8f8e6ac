"""The march of lanes of rods in space from their tips, with its columns."""

from __future__ import annotations

from ...core.jit import njit
from ..magnet.flux import flux_at
from ..spatial.march import AXIAL, WIDTH, H
from .space_matrix import matrix, test
from .space_room import (
    COLUMN,
    LANES,
    OPTIONS,
    PACK,
    SECTION,
    SURE,
    TIP,
    Y,
    Z,
)  # fmt: skip
from .space_steps import state_step


@njit(**OPTIONS)
def _begin(columns, own, b, w):  # type: ignore[no-untyped-def]
    """Set states and columns at the tips."""
    for i in range(12 * LANES):
        w[Y + i] = w[TIP + i]
    for i in range(3 * LANES):
        w[Y + 12 * LANES + i] = w[TIP + 9 * LANES + i]
        w[Y + 9 * LANES + i] = 0.0
    if columns > 0:
        for i in range(6 * COLUMN * LANES):
            w[Z + i] = 0.0
    for i in range(LANES):
        w[SURE + i] = 1.0
        y = Y + 12 * LANES + i
        flux_at(own[i], w[y], w[y + LANES], w[y + 2 * LANES], b)
        m = w[PACK + AXIAL * LANES + i]
        for k in range(3):
            w[y + (3 + k) * LANES] = m * b[k]
            w[y + (6 + k) * LANES] = b[k]
        if columns > 0:
            for a in range(3):
                turn = Z + COLUMN * LANES * a + i
                shift = Z + COLUMN * LANES * (3 + a) + i
                w[turn + a * LANES] = 1.0
                w[shift + (6 + a) * LANES] = 1.0
                for k in range(3):
                    w[shift + (9 + k) * LANES] = m * b[3 + 3 * k + a]


@njit(**OPTIONS)
def _cross(joint, columns, own, b, w):  # type: ignore[no-untyped-def]
    """Add the pole loads of a joint."""
    here = PACK + (WIDTH * joint + AXIAL) * LANES
    for i in range(LANES):
        m = w[here + WIDTH * LANES + i] - w[here + i]
        if m == 0.0:
            continue
        y = Y + 12 * LANES + i
        flux_at(own[i], w[y], w[y + LANES], w[y + 2 * LANES], b)
        for k in range(3):
            w[y + (3 + k) * LANES] += m * b[k]
            for a in range(columns):
                z = Z + COLUMN * LANES * a + i
                for j in range(3):
                    g = m * b[3 + 3 * k + j]
                    w[z + (9 + k) * LANES] += g * w[z + (6 + j) * LANES]


@njit(**OPTIONS)
def march(sections, steps, columns, tilted, along, own, b, w):  # type: ignore[no-untyped-def]
    """March all rods, with `columns` columns."""
    _begin(columns, own, b, w)
    for k in range(sections):
        at = PACK + WIDTH * LANES * k
        for i in range(WIDTH * LANES):
            w[SECTION + i] = w[at + i]
        for i in range(LANES):
            w[SECTION + H * LANES + i] /= steps
        for step in range(steps):
            state_step(columns, tilted, along, w)
            if columns > 0 and (step % 2 == 1 or step + 1 == steps):
                matrix(w)
                test(columns, w)
        if k + 1 < sections:
            _cross(k, columns, own, b, w)
