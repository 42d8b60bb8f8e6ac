"""Which points of the rod are contacts: found where it is behind a wall, and let go.

An exchange of points, as for semi-infinite programs (Hettich and Kortanek 1993): the
gap is asked for at a few points of the rod, and looked at everywhere.
"""

from __future__ import annotations

import numpy as np

from ...core.jit import njit
from ..magnet.flux import PART
from .rod import station
from .touch import FIXED, FLOATS, MOST, TIP, curvature, locate, nearest, slope
from .walls import clearance

OVERLAP = 1e-6
"""A place deeper than this behind a wall becomes a contact, in lengths of the rod."""
APART = 0.25
"""Least distance of contacts on one piece, in elements."""


@njit(**PART)
def lonely(t, piece, s, apart, but):  # type: ignore[no-untyped-def]
    """Return whether no contact but `but` is on the same piece within `apart`."""
    for k in range(t.used[0]):
        if k != but and t.piece[k] == piece and abs(t.s[k] - s) < apart:
            return False
    return True


@njit(**PART)
def prune(t, keep):  # type: ignore[no-untyped-def]
    """Drop contacts without force and clear of the wall; return how many."""
    n = 0
    for k in range(t.used[0]):
        if t.force[k] == 0.0 and t.gap[k] > keep:
            continue
        t.piece[n] = t.piece[k]
        t.kind[n] = t.kind[k]
        t.s[n] = t.s[k]
        t.force[n] = t.force[k]
        t.grip[n] = t.grip[k]
        t.gap[n] = t.gap[k]
        t.home[n] = t.home[k]
        t.room[n] = t.room[k]
        t.nx[n] = t.nx[k]
        t.ny[n] = t.ny[k]
        t.tx[n] = t.tx[k]
        t.ty[n] = t.ty[k]
        t.x[n] = t.x[k]
        t.y[n] = t.y[k]
        t.way[n] = t.way[k]
        n += 1
    dropped = t.used[0] - n
    t.used[0] = n
    return dropped


@njit(**PART)
def look(rod, u, bent, walls, half, h, t, free):  # type: ignore[no-untyped-def]
    """Find where the rod is behind a wall; add contacts there, or move those near.

    Returns
    -------
    tuple of int and float
        Contacts added or moved, and the deepest overlap seen.
    """
    n = rod.stiff.shape[0]
    length = rod.s[-1]
    changed = 0
    deepest = 0.0
    gaps = np.empty(4 * n + 1)
    for piece in range(walls.first.shape[0] - 1):
        for i in range(4 * n + 1):
            e = min(i // 4, n - 1)
            at = station(
                rod, u, bent,
                length if i == 4 * n
                else rod.s[e] + 0.25 * (i % 4) * (rod.s[e + 1] - rod.s[e]),
            )  # fmt: skip
            distance = clearance(walls, piece, at.x, at.y).distance
            gaps[i] = distance - half if distance > -walls.depth else 1e9
        for i in range(4 * n + 1):
            if gaps[i] > h:
                continue
            if i > 0 and gaps[i - 1] < gaps[i]:
                continue
            if i < 4 * n and gaps[i + 1] <= gaps[i]:
                continue
            e = min(i // 4, n - 1)
            s = length
            if i < 4 * n:
                s = rod.s[e] + 0.25 * (i % 4) * (rod.s[e + 1] - rod.s[e])
            rough = s
            if i < 4 * n:
                s = nearest(rod, u, bent, walls, piece, s, s, 0.3 * h)
            at = station(rod, u, bent, s)
            gap = clearance(walls, piece, at.x, at.y).distance - half
            if gap < -walls.depth:
                s = rough
                gap = gaps[i]
                at = station(rod, u, bent, s)
            if s < 1e-9 or gap > -OVERLAP:
                continue
            deepest = max(deepest, -gap)
            second = slope(clearance(walls, piece, at.x, at.y), at)[1]
            if free and second > 2.0 * flat_below(h) and join(t, piece, s, h) == 1:
                changed += 1
            else:
                changed += seat(t, piece, s, h, length, FLOATS if free else FIXED)
    return changed, deepest


@njit(**PART)
def flat_below(h):  # type: ignore[no-untyped-def]
    """Return the curvature of the gap below which one contact becomes two."""
    return 4.0 * OVERLAP / (APART * h) ** 2


@njit(**PART)
def join(t, piece, s, h):  # type: ignore[no-untyped-def]
    """Make two contacts near `s` one that floats; return 1 if there were just two."""
    a = b = -1
    n = 0
    for k in range(t.used[0]):
        if t.piece[k] == piece and t.kind[k] == FIXED and abs(t.s[k] - s) < h:
            n += 1
            a, b = b, k
    if n != 2:
        return 0
    t.s[b] = t.home[b] = s
    t.force[b] += t.force[a]
    t.grip[b] += t.grip[a]
    t.kind[b] = FLOATS
    t.room[b] = 0.5 * APART * h
    t.force[a] = 0.0
    t.gap[a] = 1.0
    return 1


@njit(**PART)
def seat(t, piece, s, h, length, kind):  # type: ignore[no-untyped-def]
    """Put a contact at `s` unless one is near; return 1 if anything changed."""
    is_tip = s > length - 1e-9
    best = -1
    for k in range(t.used[0]):
        alike = t.piece[k] == piece and (t.kind[k] == TIP) == is_tip
        if alike and (best < 0 or abs(t.s[k] - s) < abs(t.s[best] - s)):
            best = k
    if best >= 0 and abs(t.s[best] - s) < APART * h:
        return 0
    return add_touch(t, piece, s, TIP if is_tip else kind)


@njit(**PART)
def add_touch(t, piece, s, kind):  # type: ignore[no-untyped-def]
    """Add a contact without force, if there is room for one; return 1 if so."""
    if t.used[0] == MOST:
        return 0
    k = t.used[0]
    t.used[0] += 1
    t.piece[k] = piece
    t.s[k] = s
    t.force[k] = 0.0
    t.grip[k] = 0.0
    t.gap[k] = -1.0
    t.home[k] = s
    t.room[k] = 0.0
    t.kind[k] = kind
    return 1


@njit(**PART)
def sort_kinds(rod, u, bent, walls, half, t, h, free):  # type: ignore[no-untyped-def]
    """Let isolated contacts float, the others stay; split one that begins to lie flat.

    Two contacts, `APART` from each other, hold a rod that lies flat between them.
    """
    locate(rod, u, bent, walls, half, t)
    for k in range(t.used[0]):
        if t.kind[k] == TIP:
            continue
        if not free and t.kind[k] == FIXED:
            continue
        alone = lonely(t, t.piece[k], t.s[k], h, k) or t.bend[k] * h > 1.0
        second = curvature(t, k)
        half_apart = 0.5 * APART * h
        s = t.s[k]
        if not alone:
            t.kind[k] = FIXED
        elif (
            second < flat_below(h)
            and s > half_apart
            and s < rod.s[-1] - half_apart
            and t.force[k] > 0.0
            and add_touch(t, t.piece[k], s + half_apart, FIXED) == 1
        ):
            t.kind[k] = FIXED
            t.s[k] = s - half_apart
            t.force[k] *= 0.5
            t.force[t.used[0] - 1] = t.force[k]
        else:
            t.kind[k] = FLOATS
            t.home[k] = s
            t.room[k] = (0.5 if second > 1.0 else 0.5 * APART) * h


@njit(**PART)
def strayed(rod, t):  # type: ignore[no-untyped-def]
    """Return how many floating contacts are as far from home as they may be."""
    n = 0
    for k in range(t.used[0]):
        far = abs(t.s[k] - t.home[k]) > 0.999 * t.room[k]
        if t.kind[k] == FLOATS and t.force[k] > 0.0 and far:
            n += 1
    return n
