"""Parts of one rod on both sides of what lies across it.

A bar over a rod hides a stretch of it. Both parts are of one width and as light, and
where the one leads the other begins: what lies in a gap between that is no paper hides
what is between them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..curve.robust import median
from .binarise import Binary
from .candidate import Candidate
from .straight_on import turn

Array = NDArray[np.float64]

_FAR = 5.0
"""Longest stretch that may be hidden, in widths."""

_ALIKE, _LIGHT = 1.4, 0.15
"""By how much the parts' widths may differ, as a factor, and their light."""

_TURN, _ASTRAY = 0.9, 0.3
"""How far the parts may turn from each other, rad, and the gap from the mean of both:
on a smooth curve a chord is as much aslant to either end."""

_CHORD = 5
"""Points of a part that tell how it runs at its end."""

_NEAR = 3.0
"""Longest stretch hidden of what is held at neither end: else it is held between."""

_BARE = 0.6
"""Light in a gap, from the rod's to the paper's, above which it is bare."""


def joined(parts: list[Candidate], binary: Binary) -> list[Candidate]:
    """Return the candidates, those as one that are parts of one rod.

    Parameters
    ----------
    parts : list of Candidate
        Long thin things at one level.
    binary : Binary
        The working picture.
    """
    if len(parts) < 2:
        return parts
    left: dict[int, Candidate] = {}
    ends = np.full((len(parts), 2, 2), np.inf)
    for k, whole in enumerate(parts):
        while True:
            apart = _apart(_ends(whole), ends)
            near = np.flatnonzero(apart <= _FAR * whole.width_px).tolist()
            wholes = ((m, _joined(left[m], whole, binary)) for m in near)
            m, longer = next((item for item in wholes if item[1]), (k, None))
            if longer is None:
                break
            whole = longer
            del left[m]
            ends[m] = np.inf
        left[k], ends[k] = whole, _ends(whole)
    return list(left.values())


def _ends(part: Candidate) -> Array:
    """Return where a part begins and ends, shape (2, 2), px."""
    return part.points_px[[0, -1]]


def _apart(ends: Array, others: Array) -> Array:
    """Return the least distance of two ends (2, 2) from those of others (n, 2, 2)."""
    gaps = others[:, :, None] - ends
    return np.asarray(np.hypot(*np.moveaxis(gaps, -1, 0)).min(axis=(1, 2)))


def _joined(one: Candidate, other: Candidate, binary: Binary) -> Candidate | None:
    """Return two parts as one, root first; None where they are not of one rod."""
    alike = 1.0 / _ALIKE < one.width_px / other.width_px < _ALIKE
    if not alike or abs(one.ratio - other.ratio) > _LIGHT:
        return None
    width = min(one.width_px, other.width_px)
    for first, second in ((one, other), (other, one)):
        for back, ahead in product((False, True), (False, True)):
            points = first.points_px[::-1] if back else first.points_px
            then = second.points_px[::-1] if ahead else second.points_px
            if not leads_to(points, then, _FAR * width):
                continue
            inner = first.reversed() if back else first
            outer = second.reversed() if ahead else second
            if inner.root == "free" and outer.is_held_at_end:
                continue  # the other way round its root comes first
            far = _FAR if inner.root != "free" else _NEAR
            gap = math.dist(points[-1], then[0])
            if gap <= far * width and not _is_bare(inner, outer, binary):
                return _whole(inner, outer)
    return None


def leads_to(points: Array, then: Array, far: float) -> bool:
    """Whether a part begins where another one leads, no farther than that."""
    if math.dist(points[-1], then[0]) > far:
        return False
    gap = then[0] - points[-1]
    before = points[-1] - points[-min(_CHORD, len(points))]
    after = then[min(_CHORD, len(then)) - 1] - then[0]
    return bool(
        abs(turn(before, after)) < _TURN
        and abs(turn(before, gap) - turn(gap, after)) < 2.0 * _ASTRAY
    )


def _is_bare(one: Candidate, other: Candidate, binary: Binary) -> bool:
    """Whether there is paper between the end of a part and the begin of another."""
    first, last = one.points_px[-1], other.points_px[0]
    places = first + np.linspace(0.2, 0.8, 9)[:, None] * (last - first)
    x, y = np.rint((places + 0.5) / binary.factor - 0.5).astype(int).T
    return median(binary.ratio[y, x]) > one.ratio + _BARE * (1.0 - one.ratio)


def _whole(one: Candidate, other: Candidate) -> Candidate:
    """Return the part at the root and the one behind what hides some of both."""
    inner = one.is_held_at_end + (other.root != "free")
    first, last = one.points_px[-1], other.points_px[0]
    gap = float(np.hypot(*(last - first)))
    hidden = [*(0.5 * (first + last)), 0.5 * gap]
    return replace(
        one,
        points_px=np.vstack([one.points_px, other.points_px]),
        length_px=one.length_px + gap + other.length_px,
        contacts=one.contacts + other.contacts - inner,
        leaves=other.leaves,
        ratio=max(one.ratio, other.ratio),
        hidden_px=np.vstack([one.hidden_px, [hidden], other.hidden_px]),
    )
