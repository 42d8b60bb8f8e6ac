"""Where the dark of a rod ends on either side, to about a pixel, shade or not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from .profiles import STEP_PX, _sample

Array = NDArray[np.float64]
Image = NDArray[np.float32]

EDGE_LEVEL, SHADED_LEVEL = 0.27, 0.4
"""Where a rough edge is, from rod to paper, and from rod to shade right beside it."""

LIGHT_LEVEL = 0.88
"""The same of a light rod on a dark board, at first: a round one that a lamp lights
from one side is not much lighter than the board on the other."""

_UNEVEN = 3.0
"""Spread of the widths, px, beyond which the edges are looked at again."""

_BESIDE = 4.0
"""How far from a rough edge the light beside it is taken, px."""


def rough_edges(
    grey: Image, points: Array, normals: Array, *, reach: float, sign: float = 1.0
) -> tuple[Array, Array, float, float]:  # fmt: skip
    """Return where the dark of a rod ends on either side, to about a pixel.

    The level is a quarter of the way from rod to paper, or lower where deep shade lies
    beside the rod, and is looked for from outside, so that a streak of glare on the rod
    does no harm.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    points, normals : ndarray, shape (n, 2)
        Stations inside the rod and unit normals.
    reach : float
        Largest offset, px: the half width with whatever shadow was taken for rod.
    sign : float
        -1 for a light rod.

    Returns
    -------
    low, high : ndarray, shape (n,)
        Offsets of the edges; NaN where the profile is nowhere dark.
    dark, level : float
        Light of the rod, and the level taken, the lower one of both sides.
    """
    found: tuple[Array, Array, float, float] = _rough_edges(
        grey, points, normals, int(np.ceil((reach + 2.0) / STEP_PX)), np.float32(sign)
    )
    return found


@njit(cache=True)
def _rough_edges(
    grey: Image, points: Array, normals: Array, half: int, sign: float
) -> tuple[Array, Array, float, float]:
    """Sample profiles of `half` samples to either side, and find the edges on them."""
    strip = np.empty((len(points), 2 * half), dtype=np.float32)
    _sample(grey, points, normals, np.zeros(len(points)), 1.0, half, sign, strip)
    dark, paper = _dark_and_paper(strip)
    if sign < 0.0:
        low, high, level = _light_edges(strip, half, dark)
        return low, high, dark, level
    low, high, level = _edges_at(strip, half, dark, dark + EDGE_LEVEL * (paper - dark))
    if _spread(low, high) > _UNEVEN:
        # Perhaps a deep shadow is taken for rod: it changes its width along a rod that
        # bends, and the rod, seen at a level below the shadow's light, does not.
        lower = dark + SHADED_LEVEL * EDGE_LEVEL * (paper - dark)
        inner_low, inner_high, lower = _edges_at(strip, half, dark, lower)
        if _spread(inner_low, inner_high) < 0.5 * _spread(low, high):
            return inner_low, inner_high, dark, lower
    return low, high, dark, level


@njit(cache=True)
def _edges_at(
    strip: Image, half: int, dark: float, level: float
) -> tuple[Array, Array, float]:
    """Return the edges at a level, lowered under shade, and the lower side's level."""
    # Again under the shade that lies beside the dark, which may be far from white.
    low, high = _outermost(strip, half, level)
    left = dark + SHADED_LEVEL * (_light_at(strip, half, low - _BESIDE) - dark)
    right = dark + SHADED_LEVEL * (_light_at(strip, half, high + _BESIDE) - dark)
    left, right = min(level, left), min(level, right)
    low, _ = _outermost(strip, half, left)
    _, high = _outermost(strip, half, right)
    return low, high, min(left, right)


@njit(cache=True)
def _light_edges(strip: Image, half: int, dark: float) -> tuple[Array, Array, float]:
    """Return the edges of a light rod, and the level nearer to the board's light.

    Either side has its own board, since a shade is darker; and its own rod: half way to
    the light just inside, which is far from the brightest away from the lamp.
    """
    middle = np.zeros(len(strip))
    board = _light_at(strip, half, middle - half), _light_at(strip, half, middle + half)
    rough = dark + LIGHT_LEVEL * (np.array(board) - dark)
    low, _ = _nearest(strip, half, rough[0])
    _, high = _nearest(strip, half, rough[1])
    left = 0.5 * (board[0] + _light_at(strip, half, low + _BESIDE))
    right = 0.5 * (board[1] + _light_at(strip, half, high - _BESIDE))
    low, _ = _nearest(strip, half, left)
    _, high = _nearest(strip, half, right)
    return low, high, max(left, right)


@njit(cache=True)
def _nearest(strip: Image, half: int, level: float) -> tuple[Array, Array]:
    """Return where that part of each profile ends that is beyond a level at its middle.

    From within, since gloss makes no gap in what is light, and a board may have lines.
    """
    low, high = np.full(len(strip), np.nan), np.full(len(strip), np.nan)
    for i in range(len(strip)):
        profile, middle = strip[i], half
        for away in range(half):
            middle = half - away if profile[half - away] < level else half + away
            if profile[middle] < level:
                break
        if not profile[middle] < level:
            continue
        first = last = middle
        while first > 0 and profile[first - 1] < level:
            first -= 1
        while last < 2 * half - 1 and profile[last + 1] < level:
            last += 1
        low[i], high[i] = (first - half) * STEP_PX, (last + 1 - half) * STEP_PX
    return low, high


@njit(cache=True)
def _spread(low: Array, high: Array) -> float:
    """Return how far apart the widths are between which 70 % of them lie, px."""
    most, least = np.nanquantile(high - low, 0.85), np.nanquantile(high - low, 0.15)
    return float(most - least)


@njit(cache=True)
def _dark_and_paper(strip: Image) -> tuple[float, float]:
    """Return medians of the profiles' darkest fifth and of their brightest sample.

    Of the whole profile: where the curve runs along the edge of a deep shadow, the
    profile's middle is half shadow.
    """
    darkest, brightest = np.full(len(strip), np.nan), np.full(len(strip), np.nan)
    for i in range(len(strip)):
        brightest[i] = np.nanmax(strip[i])
        if i % 8 == 0:
            darkest[i] = np.quantile(strip[i], 0.2)
    return float(np.nanmedian(darkest)), float(np.nanmedian(brightest))


@njit(cache=True)
def _outermost(strip: Image, half: int, level: float) -> tuple[Array, Array]:
    """Return the outermost places of each profile where it is darker than a level."""
    low, high = np.full(len(strip), np.nan), np.full(len(strip), np.nan)
    for i in range(len(strip)):
        first, last = 0, 2 * half - 1
        while first <= last and not strip[i, first] < level:
            first += 1
        while last >= first and not strip[i, last] < level:
            last -= 1
        if first <= last:
            low[i], high[i] = (first - half) * STEP_PX, (last + 1 - half) * STEP_PX
    return low, high


@njit(cache=True)
def _light_at(strip: Image, half: int, place: Array) -> float:
    """Return the median light of the profiles at one place of each."""
    light = np.full(len(strip), np.nan)
    for i in range(len(strip)):
        if not np.isnan(place[i]):
            column = int(place[i] / STEP_PX + half)
            light[i] = strip[i, min(max(column, 0), 2 * half - 1)]
    return float(np.nanmedian(light))
