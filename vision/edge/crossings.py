"""Where lanes along a rod cross an end, and the straight line through the crossings."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit

Array = NDArray[np.float64]

UNEVEN, BY_NOISE = 5.0, 0.5
"""Deviation of a place over how far it moves with half as much more of the paper before
it, by shade that is not straight: there is more such shade nearer by. Noise alone moves
it by so much of the lanes' deviation."""


class EndFace(NamedTuple):
    """Where lanes along a rod cross an end.

    Parameters
    ----------
    s : float
        Arc length at which the axis meets the line through the crossings, px.
    sigma : float
        Its standard deviation, px.
    skew, skew_sd : float
        Slope of the line against the normal, px per px, and its standard deviation.
    scatter : float
        RMS distance of the crossings from the line, px.
    found : float
        Part of the lanes that crossed.
    rise, blur : float
        Light behind the line minus light before it, and standard deviation of the blur
        along the rod, px, of the step that was fitted; 0 where none was.
    uneven : float
        How far it moves with more of the paper before it, px; 0 where its lanes have
        no levels of their own.
    bulge : float
        How far its middle stands out over its ends, as a parabola through the lanes,
        px; 0 where it is straight as far as they tell, or none was fitted.
    """

    s: float
    sigma: float
    skew: float
    scatter: float
    found: float
    rise: float = 0.0
    blur: float = 0.0
    skew_sd: float = 0.0
    uneven: float = 0.0
    bulge: float = 0.0

    @property
    def place_sd(self) -> float:
        """Standard deviation of the place, px."""
        uneven = max(self.uneven - BY_NOISE * self.sigma, 0.0)
        return math.hypot(self.sigma, UNEVEN * uneven)


class Crossed(NamedTuple):
    """Lanes along a rod where they cross an end.

    Parameters
    ----------
    light : ndarray, shape (k, m)
        Lanes, as from `lanes.lanes`.
    s : ndarray, shape (m,)
        Even grid of arc length, rising from rod to paper.
    across, crossing : ndarray, shape (k,)
        Offsets of the lanes, and where they cross half level; NaN where one does not.
    line : EndFace
        Through the crossings; its place is NaN where fewer than half of the lanes
        cross.
    """

    light: Array
    s: Array
    across: Array
    crossing: Array
    line: EndFace


NOT_SEEN = EndFace(np.nan, np.nan, np.nan, np.nan, 0.0, 0.0, 0.0, np.nan, 0.0, 0.0)


@njit(cache=True)
def line_through(light: Array, s: Array, across: Array, crossing: Array) -> Crossed:
    """Fit a line to lane crossings, the worst ones dropped."""
    line, found = NOT_SEEN, np.sum(np.isfinite(crossing))
    if found > 0 and found >= 0.5 * crossing.size:
        place, slope, scatter, used, spread = _fit_line(across, crossing)
        sigma, part = scatter / np.sqrt(used) + 0.005, found / crossing.size
        line = EndFace(
            place, sigma, slope, scatter, part, 0.0, 0.0, sigma / spread, 0.0, 0.0
        )
    return Crossed(light, s, across, crossing, line)


@njit(cache=True)
def _fit_line(across: Array, crossing: Array) -> tuple[float, float, float, int, float]:
    """Return place, slope, scatter and number of crossings of the line's last fit.

    And the standard deviation of where the lanes are.
    """
    good = np.isfinite(crossing)
    residual = np.empty(len(across))
    place, slope, used = 0.0, 0.0, 0
    for _ in range(3):
        x, y = across[good], crossing[good]
        used = len(x)
        centre, mean = x.mean(), y.mean()
        slope = np.sum((x - centre) * y) / np.sum((x - centre) * x)
        place = mean - slope * centre
        residual = crossing - place - slope * across
        distance = np.abs(residual)
        spread = 1.4826 * np.sort(distance[good])[used // 2] + 0.02
        kept = distance < 3.5 * spread  # false where a lane does not cross
        if np.sum(kept) < 4 or np.all(kept == good):
            break
        good = kept
    left = residual[good]
    spread = float(np.std(across))
    return place, slope, np.sqrt(np.mean(left**2)), len(left), spread


@njit(cache=True)
def crossings_of(
    light: Array, s: Array, place: float, near: float, inner: float, outer: float,
    reach: float,
) -> Array:  # fmt: skip
    """Return where lanes cross half level near `place`, going outwards (s rising).

    Parameters
    ----------
    light : ndarray, shape (k, m)
        Lanes, as from `lanes.lanes`.
    s : ndarray, shape (m,)
        Even grid of arc length.
    place, reach : float
        Where to look (nowhere if NaN), and how far to either side.
    near, inner, outer : float
        The level before is a mean over `inner`, the level behind a line through
        `outer` carried to `place`, both `near` px clear of it.

    Returns
    -------
    ndarray, shape (k,)
        NaN where a lane does not cross.
    """
    out = np.full(len(light), np.nan)
    if np.isnan(place):
        return out
    step = s[1] - s[0]
    place, near, reach = (place - s[0]) / step, near / step, reach / step
    count, columns = light.shape
    for i in range(count):
        low = _mean(light, i, place - near - inner / step, place - near)
        high = _line(light, i, place + near, place + near + outer / step, place)
        if not high > low:
            continue
        level = 0.5 * (low + high)
        best = -1
        for k in range(columns - 1):
            away = abs(k + 0.5 - place)
            rises = light[i, k] < level <= light[i, k + 1] and away <= reach
            if rises and (best < 0 or away < abs(best + 0.5 - place)):
                best = k
        if best < 1 or best + 2 >= columns:
            continue
        a, b = light[i, best - 1], light[i, best]
        c, d = light[i, best + 1], light[i, best + 2]
        slope = 0.3 * (d - a) + 0.1 * (c - b)
        at = best + (level - b) / (c - b)
        if slope > 0.0:
            line = best + 0.5 + (level - 0.25 * (a + b + c + d)) / slope
            if abs(line - best - 0.5) <= 1.0:
                at = line
        out[i] = s[0] + step * at
    return out


@njit(cache=True)
def _line(light: Array, i: int, first: float, last: float, at: float) -> float:
    """Value at a place of the straight line through samples beside it."""
    n, st, sg, stt, stg = 0, 0.0, 0.0, 0.0, 0.0
    for k in range(max(int(np.ceil(first)), 0), min(int(last), light.shape[1] - 1) + 1):
        if np.isfinite(light[i, k]):
            t, g = k - at, light[i, k]
            n += 1
            st += t
            sg += g
            stt += t * t
            stg += t * g
    if n < 4:
        return np.nan
    return (stt * sg - st * stg) / (n * stt - st * st)


@njit(cache=True)
def _mean(light: Array, i: int, first: float, last: float) -> float:
    total, number = 0.0, 0
    for k in range(max(int(np.ceil(first)), 0), min(int(last), light.shape[1] - 1) + 1):
        if np.isfinite(light[i, k]):
            total += light[i, k]
            number += 1
    return total / number if number >= 3 else np.nan
