"""Whether something else, as dark as the rod, crosses it or lies against it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..curve.robust import median
from ..edge.step_line import lanes
from ..find.ground import View
from .refine import Refined

_CLAMP, _ASIDE = 3.0, 0.9
"""Nearer to the clamp its own sides may be beside the rod; and how far from the axis
another thing is looked for, in widths: clear of an edge that is blurred, and nearer
than the next turn of a coil."""

_DARK = 0.2
"""Light, from the rod's to the paper's, below which it is no shade."""

_THICK, _LONG = 0.5, 5.0
"""Widths along the rod that a thing must hide: a thread is less, its shade is more."""


def crossed_at(view: View, refined: Refined) -> float | None:
    """Return the arc length in px where another thing meets the rod; None for none.

    Its edges are lost there, and what is measured beyond may be the other thing's.
    """
    curve, width = refined.fit.curve, refined.typical_width
    aside = _ASIDE * width
    left, axis, right = lanes(
        view.grey, curve, curve.s, np.array([-aside, 0.0, aside]), view.sign
    )
    rod = median(axis[refined.good])
    paper = median(np.concatenate([left[refined.good], right[refined.good]]))
    limit = rod + _DARK * (paper - rod)
    step = float(curve.s[1] - curve.s[0])
    for side in (left, right):
        dark = (side < limit) & (curve.s > _CLAMP * width)
        for first, after in _runs(dark):
            if _THICK < (after - first) * step / width < _LONG:
                return float(curve.s[(first + after) // 2])
    return None


def _runs(dark: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return where stretches begin, and where they are over, shape (n, 2)."""
    ends = np.diff(dark.astype(np.int8), prepend=0, append=0)
    return np.column_stack([np.flatnonzero(ends > 0), np.flatnonzero(ends < 0)])
