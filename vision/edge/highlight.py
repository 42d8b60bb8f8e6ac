"""A highlight on a rod: profiles across both are fitted whole.

A smooth rod mirrors the lamp in a line as long as itself. The picture's blur carries
that line's light into the dark rims beside it, which moves the half levels of the rod's
own edges, the more the narrower a rim is. A profile of both, rod and line, tells how
much: a dark bar between two pieces of paper, with a light bar in it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .flank import WHITE

Array = NDArray[np.float64]

_TURNS, _STILL = 30, 1e-4
_SPREAD_PX = 0.5
"""By how much a lamp's line is blurred of itself, about; as a factor, e^0.7."""
_FACTOR_SD = 0.7
_LEVEL_SD = 0.01
"""Misfit of a sample."""
_LIGHT_SD, _SLOPE_SD = 1.0, 0.03
"""Doubt of the line's light, as it seems at first; slope of the paper, per px; both in
the span of a profile's light."""

_HELD = 1e6
"""Weight of a number that is not sought."""


class Bars(NamedTuple):
    """Numbers of profiles, each of shape (n,): places and blurs px, levels of light.

    Parameters
    ----------
    low, high : ndarray
        Edges of the rod.
    first, last : ndarray
        Edges of the highlight.
    blur, spread : ndarray
        Logarithms of the picture's blur, and of the highlight's own, px.
    dark, light : ndarray
        Light of the rod, and what the highlight adds to it.
    left, left_slope, right, right_slope : ndarray
        Paper beside either edge, and its rise per px.
    """

    low: Array
    high: Array
    first: Array
    last: Array
    blur: Array
    spread: Array
    dark: Array
    light: Array
    left: Array
    left_slope: Array
    right: Array
    right_slope: Array

    def at(self, places: Array, wanted: Array) -> Bars:
        """Return the bars at other places along a rod."""
        return Bars(*(np.interp(wanted, places, one) for one in self))

    def rows(self, which: NDArray[np.intp]) -> Bars:
        """Return some of the bars, in another order."""
        return Bars(*(one[which] for one in self))

    def highlight(self, x: Array) -> Array:
        """Return what the highlight adds to a profile at places x, (n,) or (n, m).

        A sensor holds so much light and no more.
        """
        bars = Bars(*(one[:, None] for one in self)) if x.ndim > 1 else self
        shares, _ = _shares(bars, x)
        bare = _bare(bars, x, shares)
        whole = bare + bars.light * (shares[2] - shares[3])
        return np.asarray(np.minimum(whole, np.maximum(bare, 1.0)) - bare)


_NUMBERS = len(Bars._fields)
_BLUR, _LIGHT = Bars._fields.index("blur"), Bars._fields.index("light")
_OF_HIGHLIGHT = [Bars._fields.index(k) for k in ("first", "last", "spread", "light")]


def fit_bars(
    x: Array, light: Array, near: Array, *, blur: float, known: bool = False
) -> Bars:
    """Fit a dark bar with a light one in it, or without, to profiles across a rod.

    Levenberg and Marquardt's method, each profile by itself. Where a sensor holds no
    more, a profile may be lighter than the picture tells.

    Parameters
    ----------
    x : ndarray, shape (m,)
        Places of samples, px.
    light : ndarray, shape (n, m)
        Profiles; NaN is left out.
    near : ndarray, shape (n, 4) or (n, 2)
        About where the rod and the highlight begin and end: low, first, last, high; or
        the rod alone, if it has none.
    blur : float
        Standard deviation of the blur, px: about, unless `known`.
    """
    matt = near.shape[1] == 2
    at, weights = _start(x, light, near[:, [0, 0, 1, 1]] if matt else near, blur)
    if matt:
        at[:, _LIGHT] = 0.0
        weights[:, _OF_HIGHLIGHT] = _HELD
    if known:
        weights[:, _BLUR] = _HELD
    expected, damping = at.copy(), np.full(len(at), 1e-2)
    change, misfit = _misfit(x, light, at)
    best = _cost(misfit, at - expected, weights)
    own = np.arange(_NUMBERS)
    for _ in range(_TURNS):
        normal = np.swapaxes(change, 1, 2) @ change
        right = np.einsum("nmk,nm->nk", change, misfit) + weights * (at - expected)
        normal[:, own, own] = (normal[:, own, own] + weights) * (
            1.0 + damping[:, None]
        ) + 1e-9
        step = -np.linalg.solve(normal, right[..., None])[..., 0]
        step[:, :6] = np.clip(step[:, :6], -1.0, 1.0)
        to = at + step
        to_change, to_misfit = _misfit(x, light, to)
        cost = _cost(to_misfit, to - expected, weights)
        better = cost < best
        still = ~better | (best - cost < _STILL * best)
        at[better], best[better] = to[better], cost[better]
        change[better], misfit[better] = to_change[better], to_misfit[better]
        damping = np.where(better, 0.2 * damping, 10.0 * damping).clip(1e-7, 1e8)
        if still.all():
            break
    return Bars(*at.T)


def _start(x: Array, light: Array, near: Array, blur: float) -> tuple[Array, Array]:
    """Return numbers to set out from, and how sure they are, (n, 12) each."""
    low, first, last, high = near.T[..., None]
    most, least = np.fmax.reduce(light, axis=1), np.fmin.reduce(light, axis=1)

    def median(inside: NDArray[np.bool_]) -> Array:
        seen = inside & np.isfinite(light)
        rows = zip(light, seen, most, strict=True)
        return np.array([np.median(a[k]) if k.any() else top for a, k, top in rows])

    inside = np.where((x > first) & (x < last), light, -np.inf).max(axis=1)
    zero = np.zeros(len(light))
    at = np.column_stack(Bars(
        low=near[:, 0], high=near[:, 3], first=near[:, 1], last=near[:, 2],
        blur=zero + math.log(blur), spread=zero + math.log(_SPREAD_PX), dark=least,
        light=np.where(np.isfinite(inside), inside, most) - least,
        left=median(x < low - blur), left_slope=zero,
        right=median(x > high + blur), right_slope=zero,
    ))  # fmt: skip
    span, none = np.maximum(most - least, 1e-3), zero + np.inf
    sd = np.column_stack(Bars(
        low=none, high=none, first=none, last=none, blur=zero + _FACTOR_SD,
        spread=zero + _FACTOR_SD, dark=none, light=_LIGHT_SD * span, left=none,
        left_slope=_SLOPE_SD * span, right=none, right_slope=_SLOPE_SD * span,
    ))  # fmt: skip
    return at, (_LEVEL_SD / sd) ** 2


def _cost(misfit: Array, off: Array, weights: Array) -> Array:
    return np.asarray((misfit**2).sum(axis=1) + (weights * off**2).sum(axis=1))


def _misfit(x: Array, light: Array, at: Array) -> tuple[Array, Array]:
    """Return how profiles change by their numbers, (n, m, 12), and the misfit, (n, m).

    Both are 0 where there is no sample, or a whole one may be as light as it likes.
    """
    bars = Bars(*at.T[..., None])
    shares, bells = _shares(bars, x)
    misfit = _bare(bars, x, shares) + bars.light * (shares[2] - shares[3]) - light
    known = ~(np.isnan(misfit) | ((light > WHITE) & (misfit > 0.0)))
    change = np.where(known, _changes(bars, x, shares, bells), 0.0)
    return np.moveaxis(change, 0, -1), np.where(known, misfit, 0.0)


def _shares(bars: Bars, x: Array) -> tuple[Array, Array]:
    """Return the parts of light beyond low, high, first, last, and their densities."""
    from scipy.special import ndtr

    blur = np.exp(bars.blur)
    wide = np.hypot(blur, np.exp(bars.spread))
    t = np.array([
        (x - bars.low) / blur, (x - bars.high) / blur,
        (x - bars.first) / wide, (x - bars.last) / wide,
    ])  # fmt: skip
    return ndtr(t), np.exp(-0.5 * t * t) / math.sqrt(2.0 * math.pi)


def _bare(bars: Bars, x: Array, shares: Array) -> Array:
    """Return the light of profiles without their highlights."""
    low, high = shares[0], shares[1]
    left = bars.left + bars.left_slope * (x - bars.low)
    right = bars.right + bars.right_slope * (x - bars.high)
    return np.asarray(left * (1.0 - low) + bars.dark * (low - high) + right * high)


def _changes(bars: Bars, x: Array, shares: Array, bells: Array) -> Array:
    """Return how profiles change by each of their numbers, (12, n, m)."""
    (low, high, first, last), blur = shares, np.exp(bars.blur)
    spread = np.exp(bars.spread)
    wide = np.hypot(blur, spread)
    left = bars.left + bars.left_slope * (x - bars.low)
    right = bars.right + bars.right_slope * (x - bars.high)
    fall = (left - bars.dark) * bells[0] / blur
    rise = (bars.dark - right) * bells[1] / blur
    up, down = bars.light * bells[2] / wide, bars.light * bells[3] / wide
    wider = (down * (x - bars.last) - up * (x - bars.first)) / wide**2
    return np.array(Bars(
        low=fall - bars.left_slope * (1.0 - low), high=rise - bars.right_slope * high,
        first=-up, last=down,
        blur=fall * (x - bars.low) + rise * (x - bars.high) + wider * blur**2,
        spread=wider * spread**2, dark=low - high, light=first - last,
        left=1.0 - low, left_slope=(x - bars.low) * (1.0 - low),
        right=high, right_slope=(x - bars.high) * high,
    ))  # fmt: skip
