"""Which of many planar rods may run in the lanes, and with how many steps.

A look at the straight rods and the loads on them, before any is solved (`batch.lanes`,
which says what makes a rod hard). Dimensionless as `planar.march`.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.field import inside, plane_flux
from ..planar.march import E, H, M

STEP_UNIFORM = 0.6
"""What one step takes: errors stay below 1e-5 mm for rods of 30 mm."""
STEP_MAGNET = 0.48
"""The same, for errors below 1e-6 mm."""
MOST_STEPS = 4
"""Most steps in a section."""
LONGEST_ROD = 3.0
"""Largest sum of them: up to 3 pi / 2 there is one solution with gamma rising to T."""
ANTIPARALLEL = -0.996
"""Least cosine between the clamp's direction and the load's."""
OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**OPTIONS)
def tip_load(x, y, length, gap, margin, sign, magnet):  # type: ignore[no-untyped-def]
    """Return flux and direction of the load on a tip at (x, y), and their gradients.

    By x and y: of the flux, then of the direction. No flux: there is no field, or the
    magnet is in the way.
    """
    px = length * (x - 1.0) + gap * magnet[12]
    py = length * y + gap * magnet[13]
    if inside(magnet, px, py, 0.0, length * margin):
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    b = plane_flux(magnet, px, py)
    size = math.sqrt(b[0] * b[0] + b[1] * b[1])
    if size < 1e-12:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    c = b[0] / size
    s = b[1] / size
    g = length / size
    return (
        size,
        sign * c,
        sign * s,
        length * (c * b[2] + s * b[3]),
        length * (c * b[3] + s * b[4]),
        g * (c * b[3] - s * b[2]),
        g * (c * b[4] - s * b[3]),
    )


@njit(**OPTIONS)
def near(x, y, length, gap, margin, magnet):  # type: ignore[no-untyped-def]
    """Tell whether a rod with its tip at (x, y) might touch its magnet.

    A curve of length 1 between two points at a distance d stays within
    sqrt(1 - d^2) / 2 of the straight line between them (an ellipse); eight pieces of
    that line are checked.
    """
    d2 = x * x + y * y
    far = 0.5 * math.sqrt(max(0.0, 1.0 - d2)) + math.sqrt(d2) / 16.0
    far = length * (far + margin)
    ox = gap * magnet[12] - length
    oy = gap * magnet[13]
    found = False
    for k in range(9):
        r = length * k / 8.0
        found = found or inside(magnet, r * x + ox, r * y + oy, 0.0, far)
    return found


@njit(**OPTIONS)
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


@njit(**OPTIONS)
def _alike(rod, exactly):  # type: ignore[no-untyped-def]
    """Tell whether all sections are magnetised the same way, or exactly the same."""
    for k in range(1, rod.shape[0]):
        if rod[k, M] * rod[0, M] < 0.0 or (exactly and rod[k, M] != rod[0, M]):
            return False
    return True


@njit(**OPTIONS)
def survey(rods, length, margin, flux, cosine, sine, magnet, gap, start, steps):  # type: ignore[no-untyped-def]
    """Find the load on each straight rod, and how many steps it needs (0: hard).

    `start` receives the compliance to the load, the flux and the load's direction.
    """
    uniform = magnet.shape[0] == 0
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
        elif known and not near(1.0, 0.0, length[i], gap[i], margin[i], magnet):
            size, cf, sf, _, by, _, ty = tip_load(
                1.0, 0.0, length[i], gap[i], 0.0, sign, magnet
            )
            known = size > 0.0
            start[i, 1] = size
            start[i, 2] = cf
            start[i, 3] = sf
            # d(m B sin phi) / dy
            pull = (by * sf + size * cf * ty) * abs(rods[i, 0, M])
        else:
            known = False
        steps[i] = 0
        if known and start[i, 2] > ANTIPARALLEL:
            start[i, 0], steps[i] = _ready(
                rods[i], start[i, 1], start[i, 2], pull, step
            )


@njit(**OPTIONS)
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
