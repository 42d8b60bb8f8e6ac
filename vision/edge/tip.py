"""The free end of a rod: a flat face, found sub-pixel.

Skeletons end half a width early or fork into the corners. Here the curve is carried
past the end, and lanes along it, over the middle of the width, give the line of a step
(`step_line`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.curve import Curve
from ..curve.robust import _median, _quantile
from .crossings import Crossed, EndFace, crossings_of, line_through
from .lanes import lanes_along
from .levels import clear_of
from .step_line import SPAN, STEP_PX, fit_step

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_SHARE = 0.62
"""Part of the width that the lanes cover: clear of blurred or rounded corners."""
_SHADE, _DEEPEST = 0.15, 0.03
"""Light, over paper's above the rod's, that is half way to a deep shade on paper, and
to the deepest that can be told from the rod."""
_LEVEL, _FLAT = 2.0, 0.4
"""How far before an end the level of a shade is looked at, in what its blur reaches;
and by how much of itself it may vary there, which a blurred end does by more."""
_FAINT = 0.2
"""Part of a rod's contrast below which there is no end: it is paper, or rod, alone."""
_STEP_SIDE_PX, _SOFTER, _FACE_SEEN = 2.0, 1.8, 1.3
"""How far about a place its slope is looked for; how much less steep a shade ends than
its rod; and how much more of an end face may be seen than its width tells."""
_LANES = np.linspace(-0.5, 0.5, 13) * _SHARE
ROUND_END = float(np.sqrt(1.0 - (2.0 * _LANES) ** 2).mean())
"""How far the lanes of a round rod end beyond its axis, over what those of a square one
do, where its end is seen aslant."""


def find_tip(
    grey: Image,
    curve: Curve,
    *,
    expected: float,
    width: float,
    blur: float,
    reach: float,
    contrast: float,
    middle: float = 0.0,
    face: float | None = None,
    sign: float = 1.0,
    fine: bool = True,
) -> EndFace | None:
    """Find the end face near an expected arc length.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    curve : Curve
        The axis, from clamp to about the tip.
    expected, reach : float
        Where to look along s, and how far to either side, px.
    width, blur : float
        Width of the rod and standard deviation of the blur, px.
    contrast : float
        Light of the paper less that of the rod, along it.
    middle : float
        Offset of the lanes' centre from the curve, px.
    face : float or None
        How much of the end face is seen, px; None where that is not known.
    sign : float
        -1 for a light rod.
    fine : bool
        Whether to fit a step after taking the half level.

    Returns
    -------
    EndFace or None
        None where fewer than half of the lanes cross.
    """
    near = clear_of(blur)
    inner = max(4.0, 0.5 * width)
    outer = max(4.0, SPAN * blur)
    seen = _crossed(
        grey, curve, _LANES * width, middle, expected, reach, near, inner, outer,
        max(4.0, 3.0 * blur), 0.5 * width, math.nan if face is None else face,
        _FAINT * contrast, sign,
    )  # fmt: skip
    return fit_step(seen, blur=blur, inner=inner, outer=outer, fine=fine)


@njit(cache=True)
def _crossed(
    grey: Image, curve: Curve, across: Array, middle: float, expected: float,
    reach: float, near: float, inner: float, outer: float, level: float, half: float,
    face: float, least_rise: float, sign: float,
) -> Crossed:  # fmt: skip
    """Return lanes where they cross the end, seen in a rough look at their mean."""
    s = np.arange(
        expected - reach - near - inner, expected + reach + near + outer + STEP_PX,
        STEP_PX,
    )  # fmt: skip
    light = lanes_along(grey, curve, s, middle + across, sign)
    inside = light[3:-3]
    profile = np.sum(inside, axis=0) / len(inside)
    place = _rough_end(profile, s, expected, reach, near, inner, face, least_rise)
    crossing = crossings_of(light, s, place, near, inner, level, half)
    crossed: Crossed = line_through(light, s, across, crossing)
    return crossed


@njit(cache=True)
def _rough_end(
    profile: Array, s: Array, expected: float, reach: float, near: float, inner: float,
    face: float, least_rise: float,
) -> float:  # fmt: skip
    """Find where the mean lane leaves the rod: the first time, going outwards.

    Between rod and paper may lie the rod's shade, darker than half: then the rod ends
    where the shade begins. So may its end face, but no farther than it is seen; where
    that is not known, NaN, a shade ends less steeply. NaN where there is no end.
    """
    rod = _median(profile[s < expected - reach - near])
    paper = _quantile(profile[s > expected], 0.75)
    if not paper - rod > least_rise:
        return np.nan
    light = (profile - rod) / (paper - rod)
    within = (s >= expected - reach) & (s <= expected + reach)
    hits = np.flatnonzero((light > 0.5) & within)
    if hits.size == 0:
        return np.nan
    end = float(s[hits[0]])
    least = _half_way(light[(s < end - near) & (s > end - near - _LEVEL * near)])
    dark = np.flatnonzero((light < least) & (s < end))
    shade = float(s[dark[-1] + 1] if dark.size else s[within][0])
    if light[np.searchsorted(s, shade - near)] > 0.5 * least:
        return end  # paler little by little, as a tail that tapers: no shade
    if np.isnan(face):
        soft = _SOFTER * _rise(light, s, end) < _rise(light, s, shade)
        face = 0.0 if soft else inner
    return shade if end - shade > near + _FACE_SEEN * face else end


@njit(cache=True)
def _half_way(before: Array) -> float:
    """Return half of the level right before an end, if there is one; else `_SHADE`."""
    if len(before) < 2:
        return _SHADE
    low, level, high = np.quantile(before, np.array([0.1, 0.5, 0.9]))
    deep = _DEEPEST < 0.5 * level < _SHADE and high - low < _FLAT * level
    return float(0.5 * level) if deep else _SHADE


@njit(cache=True)
def _rise(light: Array, s: Array, place: float) -> float:
    """Return the steepest rise near a place, per sample."""
    return float(np.max(np.diff(light[np.abs(s - place) <= _STEP_SIDE_PX])))
