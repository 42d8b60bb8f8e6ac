"""Where a rod's two sides end: what tells the clamp's front from any line across it.

A shade's border, a line on the paper, the edge of a chamfer or of the clamp's top cross
a rod or lie beside it as the clamp's front does. But only there do both sides of the
rod end: on this side of it the rod differs from what lies to its left and to its right,
on paper, in shade, and on a face of the clamp that the camera sees behind it; on the
other side nothing does, over a width at least; what is seen farther behind, as a screw
on the clamp, is another thing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..curve.curve import Curve, normals_of
from ..curve.robust import median

Array = NDArray[np.float64]

_ON, _BESIDE = np.array([-0.25, 0.0, 0.25]), np.array([0.0, 0.5, 1.0])
"""Lanes on the rod, in widths from its axis, and beside it, as parts of the room."""

_CLEAR, _CLEAR_PX, _OUT, _OUT_PX = 0.15, 2.0, 0.6, 4.0
"""How far from its sides that room begins, and how wide it is, in widths or px at
least."""

_BEHIND, _AHEAD, _STEP = 7.0, 4.0, 10.0
"""Widths behind and before where the clamp is expected in which it is sought, and steps
to a width, of a px at least."""

_KNOWN = ((1.5, 0.3), (4.0, 0.6))
"""From where to where a rod is known, in widths from there and as parts of its length
at most."""

_LEAST_LIGHT = 0.006
"""Light that is added before logarithms are taken: less is noise."""

_ENOUGH, _SURE = 0.5, 0.35
"""Share of a rod's usual contrast by which it is fully seen; and by how much better, as
a part of that, it must be seen in the width before its end than in the one behind."""


class SidesEnd(NamedTuple):
    """Where both sides of a rod end.

    Parameters
    ----------
    s : float
        Arc length, px, to a fraction of a width.
    is_clear : bool
        Whether the rod is fully seen up to there. On paper it is, in any shade; before
        a dark face of the clamp, on which it and its own shade lie, it is not.
    """

    s: float
    is_clear: bool


def sides_end(
    light_at: Callable[[Array], Array], curve: Curve, expected: float, width: float
) -> SidesEnd | None:
    """Return where along its axis both sides of a rod end.

    Parameters
    ----------
    light_at : callable
        Linear light, (..., c), at places (x, y) in px, (..., 2): no mix of colours, for
        in the logarithms of light a shade changes nothing.
    curve : Curve
        The axis, from about the clamp to the tip.
    expected : float
        About where the clamp is, px.
    width : float
        Width of the rod, px.

    Returns
    -------
    SidesEnd or None
        None where no place tells.
    """
    step = max(width / _STEP, 1.0)
    length = float(curve.s[-1]) - expected
    s = np.arange(
        expected - _BEHIND * width, expected + min(_AHEAD * width, 0.9 * length), step
    )
    contrast = _contrast(light_at, curve, s, width)
    low, high = (expected + min(far * width, share * length) for far, share in _KNOWN)
    usual = median(contrast[np.searchsorted(s, low) : np.searchsorted(s, high) + 1])
    if not usual > 0.0:
        return None
    seen = np.append(0.0, np.cumsum(np.minimum(contrast / (_ENOUGH * usual), 1.0)))
    n = max(round(width / step), 2)
    middle = seen[n:-n]
    better = (seen[2 * n :] + seen[: -2 * n] - 2.0 * middle) / n
    sure = np.flatnonzero(better > _SURE)
    if sure.size == 0:
        return None
    # The first from the tip: what is seen behind a gap is another thing.
    best = int(sure[-1])
    while best > 0 and better[best - 1] >= better[best]:
        best -= 1
    place, near = n + best, max(n // 2, 2)
    is_clear = median(contrast[place : place + near]) > _ENOUGH * usual
    return SidesEnd(_half_way(s, contrast, place, near), is_clear)


def _half_way(s: Array, contrast: Array, place: int, near: int) -> float:
    """Return where contrast is half way from what it is behind a place to before it."""
    low, high = max(place - near, 0), place + near
    half = 0.5 * (median(contrast[low:place]) + median(contrast[place:high]))
    past = contrast[low:high] >= half
    rises = low + np.flatnonzero(~past[:-1] & past[1:])
    if rises.size == 0:
        return float(s[place])
    k = int(rises[np.argmin(np.abs(rises - place))])
    part = (half - contrast[k]) / (contrast[k + 1] - contrast[k])
    return float(s[k] + part * (s[k + 1] - s[k]))


def _contrast(
    light_at: Callable[[Array], Array], curve: Curve, s: Array, width: float
) -> Array:
    """Return by how much a rod differs from both of its sides, alike; 0 if from one.

    The geometric mean: where light changes evenly across, one step is up and one down.
    """
    first = 0.5 * width + max(_CLEAR * width, _CLEAR_PX)
    beside = first + max(_OUT * width, _OUT_PX) * _BESIDE
    across = np.array((_ON * width, -beside, beside))
    points, theta = curve.at(s)
    spots = points + across[..., None, None] * normals_of(theta)
    light = np.log(np.maximum(light_at(spots), 0.0) + _LEAST_LIGHT)
    middle, left, right = np.sort(light, axis=1)[:, 1]  # the medians of three
    steps = np.sum((middle - left) * (middle - right), axis=-1)
    return np.asarray(np.sqrt(np.maximum(steps, 0.0)))
