"""Which of many planar rods may run in the lanes, and with how many steps.

A look at the straight rods and the loads on them, before any is solved (`batch.lanes`,
which says what makes a rod hard). Dimensionless as `planar.march`.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import INLINE, PART, blocked, field_at
from ..planar.march import E, H, M
from .patches import ENOUGH, HEAD, on_patches

STEP_UNIFORM = 0.6
"""What one step takes: errors stay below 1e-5 mm for rods of 30 mm."""
STEP_MAGNET = 0.48
"""The same, for errors below 1e-6 mm."""
MOST_STEPS = 4
"""Most steps in a section."""
LONGEST_ROD = 3.0
"""Largest sum of them: up to 3 pi / 2 there is one solution with gamma rising to T."""
PLAIN = 4
"""Numbers that a survey finds of a rod in a uniform field."""
NO_FLUX = 1e-12
"""Flux, in T, that is none."""
ANTIPARALLEL = -0.996
"""Least cosine between the clamp's direction and the load's."""


@njit(**INLINE)
def place(before, length, gap, row):  # type: ignore[no-untyped-def]
    """Write the field before a rod into `row` (`batch.patches.Before`)."""
    width = row.shape[0]
    for k in range(width):
        at = HEAD + k
        row[k] = before[at] + length * before[at + width] + gap * before[at + 2 * width]


@njit(**PART)
def tip_flux(x, y, length, gap, margin, before, row):  # type: ignore[no-untyped-def]
    """Return Bx, By, Gxx, Gxy, Gyy at a tip at (x, y), and how far B may be off.

    In T and mm. No flux: there is none, or a source is in the way.
    """
    px = length * x
    py = length * y
    off, bx, by, gxx, gxy, gyy = on_patches(before, px, py, length, gap)
    if not off <= ENOUGH * math.sqrt(bx * bx + by * by):
        off = 0.0
        place(before, length, gap, row)
        if blocked(row, px, py, 0.0, length * margin):
            bx = by = gxx = gxy = gyy = 0.0
        else:
            bx, by, gxx, gxy, gyy = field_at(row, px, py)
    return bx, by, gxx, gxy, gyy, off


@njit(**PART)
def near(x, y, length, gap, margin, before, row):  # type: ignore[no-untyped-def]
    """Tell whether a rod with its tip at (x, y) might touch a source.

    A curve of length 1 between two points at a distance d stays within
    sqrt(1 - d^2) / 2 of the straight line between them (an ellipse). If what is so
    near to the middle of that line or nearer is free, nothing is near; else nine places
    on it are looked at.
    """
    place(before, length, gap, row)
    d2 = x * x + y * y
    d = math.sqrt(d2)
    wide = 0.5 * math.sqrt(max(0.0, 1.0 - d2)) + margin
    px, py = length * x, length * y
    if not blocked(row, 0.5 * px, 0.5 * py, 0.0, length * (wide + 0.5 * d)):
        return False
    far = length * (wide + d / 16.0)
    for k in range(9):
        r = k / 8.0
        if blocked(row, r * px, r * py, 0.0, far):
            return True
    return False


@njit(**PART)
def _ready(rod, size, cosine, pull, step):  # type: ignore[no-untyped-def]
    """Return the rod's compliance to its load, and how many steps a section needs.

    0 steps: not for the lanes, as the rod is too long, or as the straight rod may be
    unstable under compression and `pull`, the change of the load across the rod as its
    tip moves across (neither is, by itself, where its product with a compliance is
    below 1; nor both, where the sum is: Dunkerley). What one step takes is that of
    `planar.march.substeps`, with the most that the moment can come to: between tip and
    clamp, e q^2 / 2 = P (cos gamma_L - cos gamma) < P (1 - cos T).
    """
    across = 0.0
    bend = math.sqrt(1.5 - 0.5 * cosine)
    sigma = 0.0
    total = 0.0
    soft = 0.0
    longest = 0.0
    for k in range(rod.shape[0]):
        hk = rod[k, H]
        ep = rod[k, E] * abs(rod[k, M]) * size
        z = hk * math.sqrt(ep)
        longest = max(longest, z)
        total += z
        soft += ep * hk * (sigma + 0.5 * hk)
        across += rod[k, E] * hk * (sigma * (sigma + hk) + hk * hk / 3.0)
        sigma += hk
    longest *= bend / step
    if not total < LONGEST_ROD or longest > MOST_STEPS:
        return soft, 0
    if pull > 0.0 and pull * across + soft * max(0.0, -cosine) >= 1.0:
        return soft, 0
    return soft, max(1, math.ceil(longest))


@njit(**PART)
def _alike(rod, exactly):  # type: ignore[no-untyped-def]
    """Tell whether all sections are magnetised the same way, or exactly the same."""
    for k in range(1, rod.shape[0]):
        if rod[k, M] * rod[0, M] < 0.0 or (exactly and rod[k, M] != rod[0, M]):
            return False
    return True


@njit(**PART)
def survey(  # type: ignore[no-untyped-def]
    rods, length, margin, flux, cosine, sine,
    gap, before, row, start, steps,
):  # fmt: skip
    """Find the load on each straight rod, and how many steps it needs (0: hard).

    `start` receives the compliance to the load, the flux and the load's direction; and
    before sources the load's gradient (xx, xy, yy), over its size.
    """
    uniform = before.shape[0] == 0
    step = STEP_UNIFORM if uniform else STEP_MAGNET
    pull = 0.0
    for i in range(rods.shape[0]):
        sign = -1.0 if rods[i, 0, M] < 0.0 else 1.0
        known = _alike(rods[i], not uniform)
        if uniform:
            turn = -sign if flux[i] < 0.0 else sign
            start[i, 1] = abs(flux[i])
            start[i, 2] = turn * cosine[i]
            start[i, 3] = turn * sine[i]
        elif known and not near(1.0, 0.0, length[i], gap[i], margin[i], before, row):
            bx, by, gxx, gxy, gyy, _ = tip_flux(
                1.0, 0.0, length[i], gap[i], 0.0, before, row
            )
            size = math.sqrt(bx * bx + by * by)
            known = size > NO_FLUX
            start[i, 1] = size
            start[i, 2] = sign * bx / size
            start[i, 3] = sign * by / size
            # d(m By) / dy, in lengths of the rod
            pull = length[i] * gyy * rods[i, 0, M]
            g = sign * length[i] / size
            start[i, PLAIN] = g * gxx
            start[i, PLAIN + 1] = g * gxy
            start[i, PLAIN + 2] = g * gyy
        else:
            known = False
        steps[i] = 0
        if known and start[i, 2] > ANTIPARALLEL:
            start[i, 0], steps[i] = _ready(
                rods[i], start[i, 1], start[i, 2], pull, step
            )


@njit(**PART)
def sorted_rows(steps):  # type: ignore[no-untyped-def]
    """Return the rows that have steps, those with equally many side by side."""
    ends = np.zeros(MOST_STEPS + 1, dtype=np.int64)
    for n in steps:
        ends[n] += 1
    ends[0] = 0
    for n in range(1, MOST_STEPS + 1):
        ends[n] += ends[n - 1]
    rows = np.empty(ends[MOST_STEPS], dtype=np.int64)
    for i in range(steps.shape[0] - 1, -1, -1):
        if steps[i] > 0:
            ends[steps[i]] -= 1
            rows[ends[steps[i]]] = i
    return rows
