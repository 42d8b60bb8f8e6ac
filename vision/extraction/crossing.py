"""Whether the axis of a rod lies where it should: not under another thing, or on paper.

Its edges are lost at such a place, and what is measured beyond may be another thing's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..curve.robust import median
from .refine import Refined, covered
from .strip import GRID, Strip

Array = NDArray[np.float64]

_CLAMP, _ASIDE = 3.0, 0.875
"""Nearer to the clamp its own sides may be beside the rod; and how far from the axis
another thing is looked for, in widths: clear of an edge that is blurred, and nearer
than the next turn of a coil."""

_DARK = 0.2
"""Light, from the rod's to the paper's, below which it is no shade."""

_THICK, _LONG = 0.5, 5.0
"""Widths along the rod that a thing must hide: a thread is less, its shade is more."""

_BARE, _RIM = 0.6, 0.375
"""The same light, above which an axis lies on paper; and where the dark rims of a glint
are looked for, which is lighter than paper in the middle, in widths from the axis."""


def crossings(strip: Strip, refined: Refined, known_px: Array) -> Array:
    """Return the places where another thing meets the rod, but not those known.

    Returns
    -------
    ndarray, shape (k, 3)
        Middle (x, y) and radius, px.
    """
    limit = _level(strip, _edged(strip, refined), _DARK)
    clear = (strip.s > _CLAMP * strip.width) & (strip.s <= refined.fit.curve.s[-1])
    found = []
    for side in strip.lanes(-_ASIDE, _ASIDE):
        for first, after in _runs((side < limit) & clear):
            points = strip.points[first:after]
            wide = (after - first) / GRID
            if _THICK < wide < _LONG and not covered(points, known_px).any():
                radius = 0.5 * (wide + 1.0) * strip.width
                found.append([*points[len(points) // 2], radius])
    return np.reshape(found, (-1, 3))


def over_paper(strip: Strip, refined: Refined, known_px: Array) -> float:
    """Return how many widths the axis runs over paper at a stretch, without edges.

    Not at places where something else is known to lie across it.
    """
    if refined.good.all():
        return 0.0
    rims = strip.lanes(-_RIM, 0.0, _RIM).min(axis=0)
    along = (strip.s >= 0.0) & (strip.s <= refined.fit.curve.s[-1])
    edged = _edged(strip, refined)
    bare = along & ~edged & (rims > _level(strip, edged, _BARE))
    bare &= ~covered(strip.points, known_px)
    return max((float(after - first) / GRID for first, after in _runs(bare)), default=0)


def _level(strip: Strip, edged: NDArray[np.bool_], share: float) -> float:
    """Return the light at a share of the way from the rod's to the paper's."""
    left, axis, right = strip.lanes(-_ASIDE, 0.0, _ASIDE)[:, edged]
    rod, paper = median(axis), median(np.concatenate([left, right]))
    return rod + share * (paper - rod)


def _edged(strip: Strip, refined: Refined) -> NDArray[np.bool_]:
    """Return at which stations along the rod its edges were used."""
    used = refined.good.astype(np.float64)
    share = np.interp(strip.s, refined.fit.curve.s, used, left=0.0, right=0.0)
    return np.asarray(share > 0.5)


def _runs(dark: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return where stretches begin, and where they are over, shape (n, 2)."""
    if not dark.any():
        return np.empty((0, 2), np.intp)
    ends = np.diff(dark.astype(np.int8), prepend=0, append=0)
    return np.column_stack([np.flatnonzero(ends > 0), np.flatnonzero(ends < 0)])
