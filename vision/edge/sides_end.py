"""Where a rod's two sides end: what tells the clamp's front from any line across it.

A shade's border, a line on the paper, the edge of a chamfer or of the clamp's top cross
a rod or lie beside it as the clamp's front does. But only there do both sides of the
rod end: on this side of it the rod differs from what lies to its left and to its right,
on paper, in shade, and on a face of the clamp that the camera sees behind it; on the
other side nothing does, over a width at least; what is seen farther behind, as a screw
on the clamp, is another thing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.curve import Curve, normals_of, points_at
from ..curve.robust import _median

Array = NDArray[np.float64]

_ON, _BESIDE = (-0.25, 0.0, 0.25), (0.0, 0.5, 1.0)
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
    s, spots = _spots(curve, float(expected), float(width))
    light = np.asarray(light_at(spots), np.float64)
    place, is_clear = _found(light, s, float(expected), float(width), curve.s[-1])
    return None if math.isnan(place) else SidesEnd(place, is_clear)


@njit(cache=True)
def _spots(curve: Curve, expected: float, width: float) -> tuple[Array, Array]:
    """Return arc lengths, (n,), and places on, left and right of a rod, (3, 3, n, 2).

    Three lanes each.
    """
    step = max(width / _STEP, 1.0)
    length = curve.s[-1] - expected
    s = np.arange(
        expected - _BEHIND * width, expected + min(_AHEAD * width, 0.9 * length), step
    )
    first = 0.5 * width + max(_CLEAR * width, _CLEAR_PX)
    room = max(_OUT * width, _OUT_PX)
    points, theta = points_at(curve, s)
    normals = normals_of(theta)
    spots = np.empty((3, 3, s.size, 2))
    for k in range(3):
        aside = first + room * _BESIDE[k]
        for side, across in enumerate((_ON[k] * width, -aside, aside)):
            spots[side, k] = points + across * normals
    return s, spots


@njit(cache=True)
def _found(
    light: Array, s: Array, expected: float, width: float, last: float
) -> tuple[float, bool]:
    """Return where both sides end, NaN if nowhere; and whether that is clear."""
    contrast = _contrast(_lights(light))
    low, high = [
        expected + min(far * width, share * (last - expected)) for far, share in _KNOWN
    ]
    usual = _median(contrast[np.searchsorted(s, low) : np.searchsorted(s, high) + 1])
    if not usual > 0.0:
        return np.nan, False
    seen = np.zeros(s.size + 1)
    seen[1:] = np.cumsum(np.minimum(contrast / (_ENOUGH * usual), 1.0))
    n = max(round(min(width, _STEP)), 2)
    better = (seen[2 * n :] + seen[: -2 * n] - 2.0 * seen[n:-n]) / n
    sure = np.flatnonzero(better > _SURE)
    if sure.size == 0:
        return np.nan, False
    # The first from the tip: what is seen behind a gap is another thing.
    best = sure[-1]
    while best > 0 and better[best - 1] >= better[best]:
        best -= 1
    place, near = n + best, max(n // 2, 2)
    is_clear = _median(contrast[place : place + near]) > _ENOUGH * usual
    return _half_way(s, contrast, place, near), is_clear


@njit(cache=True)
def _half_way(s: Array, contrast: Array, place: int, near: int) -> float:
    """Return where contrast is half way from what it is behind a place to before it."""
    low, high = max(place - near, 0), place + near
    half = 0.5 * (_median(contrast[low:place]) + _median(contrast[place:high]))
    past = contrast[low:high] >= half
    rises = low + np.flatnonzero(~past[:-1] & past[1:])
    if rises.size == 0:
        return float(s[place])
    k = rises[np.argmin(np.abs(rises - place))]
    part = (half - contrast[k]) / (contrast[k + 1] - contrast[k])
    return float(s[k] + part * (s[k + 1] - s[k]))


@njit(cache=True)
def _lights(light: Array) -> Array:
    """Return logarithms of light on a rod and at its left and right, (3, n, c)."""
    lights = np.empty((3, *light.shape[2:]))
    for side in range(3):
        for i in range(light.shape[2]):
            for colour in range(light.shape[3]):
                a, b, c = light[side, :, i, colour]
                middle = max(min(a, b), min(max(a, b), c))
                lights[side, i, colour] = np.log(max(middle, 0.0) + _LEAST_LIGHT)
    return lights


@njit(cache=True)
def _contrast(lights: Array) -> Array:
    """Return by how much a rod differs from both of its sides, alike; 0 if from one.

    The geometric mean: where light changes evenly across, one step is up and one down.
    """
    middle, left, right = lights
    steps = np.sum((middle - left) * (middle - right), axis=-1)
    return np.asarray(np.sqrt(np.maximum(steps, 0.0)))
