"""Whether what was measured is all of the rod, or more of it lies beyond its tip.

A rod whose outer part is paler, or in another colour, seems to end where that begins;
and one that something of the paper's light lies over (a label, a thread, a white mark)
seems to end at the near side of that.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..curve.curve import Curve
from ..curve.robust import median, quantile
from ..edge.edges import clear_of
from ..edge.step_line import lanes
from ..find.ground import View
from ..picture.photo import Photo
from .refine import Refined

Array = NDArray[np.float64]

PALER_TIP, TINTED_TIP = 0.12, 0.15
"""Step to either side beyond the tip, over the rod's, that a shade does not have; and
one in the difference of two colours, over the paper's light in each."""

_FURTHER = (1.5, 2.5)
"""So many widths beyond a tip a paler part still goes on, and hardly a tip's shade."""

_NEAR_EDGE, _SHARP, _SHIFT = 0.15, 0.7, 0.2
"""To either side of its edge, in widths; what of the step over twice that lies between,
at least: a soft shade has half; and how far the edge may lie aside, in widths."""

FAR, _ASIDE = 10.0, 2.5
"""How far beyond the tip another part of the rod is looked for, and how far to either
side of straight on, in widths."""

_LEAST, _MOST = 0.6, 1.5
"""Width of such a part over the rod's: it may be met at a slant."""

_AS_DARK = 0.5
"""Its contrast over the rod's, at least."""

_STEP, _STATIONS, _DRIFT = 0.25, 7, 0.3
"""Profiles are this far apart; so many in a row see it, as more than a speck; and from
one to the next it moves aside by no more than that; in widths."""


def tip_goes_on(photo: Photo, view: View, refined: Refined) -> bool:
    """Whether something as wide as the rod goes on beyond its tip.

    Then it may be the rod, paler or in another colour; a shade has softer edges, and
    darkens all colours alike.
    """
    curve, width = refined.fit.curve, refined.typical_width
    far = np.linspace(max(0.4 * width, 4.0), 1.2 * width + 4.0, 9)
    step, contrast = _beyond_tip(view.grey, curve, width, far, view.sign)
    paler = PALER_TIP * contrast
    if step > paler or _sharp_edge(view, curve, width) > paler:
        return True
    close = clear_of(refined.blur) + np.linspace(0.0, 0.2 * width, 9)
    half = round(2.0 * width) + 12
    x, y = (max(round(float(part)) - half, 0) for part in curve.points[-1])
    around = photo.colour((slice(y, y + 2 * half), slice(x, x + 2 * half)))
    if around is None:
        return False
    near = replace(curve, points=curve.points - np.array([x, y]))
    blue, green, red = np.moveaxis(
        around / np.maximum(np.median(around, axis=(0, 1)), 1e-3), 2, 0
    )
    return any(
        _beyond_tip(one - other, near, width, close, sign)[0] > TINTED_TIP
        for one, other in ((blue, green), (green, red), (red, blue))
        for sign in (-1.0, 1.0)
    )


def _beyond_tip(
    grey: NDArray[np.float32], curve: Curve, width: float, s: Array, sign: float
) -> tuple[float, float]:
    """Return the lesser step to either side, `s` beyond a tip, and that of its rod."""
    beside = 0.5 * width + 4.0
    across = np.array([-beside, -0.25 * width, 0.0, 0.25 * width, beside])
    beyond = lanes(grey, curve, curve.s[-1] + s, across, sign)
    before = lanes(grey, curve, curve.s[-1] - s, across, sign)
    contrast = median(before[::4].ravel()) - median(before[1:4].ravel())
    step = np.minimum(beyond[0], beyond[4]) - beyond[1:4].max(axis=0)
    return quantile(step, 0.25), contrast


def _sharp_edge(view: View, curve: Curve, width: float) -> float:
    """Return the step of an edge that goes on well beyond a tip, in line with one side.

    The other side may lie in the rod's own shade, darker than a paler part itself.
    """
    s = curve.s[-1] + np.linspace(*_FURTHER, 9) * width
    edge = 0.5 + np.linspace(-_SHIFT, _SHIFT, 5)[:, None]
    right = (edge + np.array([-2.0, -1.0, 1.0, 2.0]) * _NEAR_EDGE).ravel() * width
    light = lanes(view.grey, curve, s, np.concatenate([-right, right]), view.sign)
    deep, inner, outer, away = light.reshape(10, 4, -1).swapaxes(0, 1)
    step = outer - inner
    sharp = step > _SHARP * (away - deep)
    return max(quantile(one, 0.25) for one in np.where(sharp, step, 0.0))


def goes_on_after_gap(
    view: View, curve: Curve, width: float, *, far: float = FAR
) -> bool:
    """Whether something as wide and as dark as a rod begins again beyond its end.

    `far` is how far beyond it is looked for, in widths.
    """
    side = 0.5 * width + 4.0
    rod, paper = (
        median(part.ravel())
        for part in np.split(
            lanes(
                view.grey, curve, curve.s[-1] - np.linspace(1.0, 2.0, 5) * width,
                np.array([-0.2 * width, 0.2 * width, -side, side]), view.sign,
            ),
            2,
        )
    )  # fmt: skip
    grid = np.arange(-_ASIDE - 1.0, _ASIDE + 1.01, 0.125) * width
    beyond = curve.s[-1] + np.arange(1.0, far, _STEP) * width
    light = lanes(view.grey, curve, beyond, grid, view.sign)
    dark = light < paper - _AS_DARK * (paper - rod)
    if not dark.any():
        return False
    last, seen = np.nan, 0
    for station in dark.T:
        middles = _middles(station)
        away = np.abs(middles - last)
        if seen and len(middles) and away.min() < _DRIFT:
            last, seen = middles[away.argmin()], seen + 1
        else:
            last, seen = (middles[0], 1) if len(middles) else (np.nan, 0)
        if seen >= _STATIONS:
            return True
    return False


def _middles(dark: NDArray[np.bool_]) -> Array:
    """Return the middles of what is as wide as a rod on a profile, in widths."""
    ends = np.diff(dark.astype(np.int8), prepend=0, append=0)
    first, after = np.flatnonzero(ends > 0), np.flatnonzero(ends < 0)
    inner = (first > 0) & (after < len(dark))  # else it may be of any width
    wide = 0.125 * (after - first)
    alike = inner & (wide > _LEAST) & (wide < _MOST)
    return np.asarray(0.0625 * (first + after)[alike])
