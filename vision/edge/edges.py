"""Sub-pixel side edges of a rod: profiles across it, crossed at half level.

On each side the edge is where the light is half way between the rod just inside and the
paper just outside: each side has its own levels, and the paper's is a straight line
carried to the edge, so that a soft shadow lying along one side does not pull the edge.
For an edge blurred by a Gaussian of standard deviation b on paper with slope g, half
level lies g b / sqrt(2 pi) above the mean of the two levels; that term is kept.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.robust import _median, median
from .levels import (
    _ROOT_2PI,
    _ROUND_PX,
    _SLOPE_VARIANCE,
    _level_filters,
    clear_of,
    level_spans,
)
from .profiles import STEP_PX, _sample

Array = NDArray[np.float64]
Image = NDArray[np.float32]

LEAST = 0.6
"""Distance of a width from the median, px, that is of use in any case."""

_SHADE = 0.003
"""Slope of the paper beside a rod, per px and contrast, that is no shade yet."""


class Edges(NamedTuple):
    """Side edges along a rod, as offsets from a curve along its normals, in px.

    Parameters
    ----------
    low, high : ndarray, shape (n,)
        Offset of the edge on the negative and the positive side; NaN where not found.
    slope_low, slope_high : ndarray, shape (n,)
        Rise of light per px at the edge, outwards.
    inner, outer_low, outer_high : ndarray, shape (n,)
        Level of the rod and of the paper at either edge.
    shade_low, shade_high : ndarray, shape (n,)
        Slope of the paper's level beside the edge, per px outwards.
    growth : ndarray, shape (n,)
        How much farther out edges are with levels clear of the blur than with closer
        ones, px, where the paper has no shade.
    """

    low: Array
    high: Array
    slope_low: Array
    slope_high: Array
    inner: Array
    outer_low: Array
    outer_high: Array
    shade_low: Array
    shade_high: Array
    growth: Array

    @property
    def middle(self) -> Array:
        """Offset of the midline."""
        return 0.5 * (self.low + self.high)

    @property
    def width(self) -> Array:
        """Distance of the edges."""
        return self.high - self.low

    @property
    def contrast(self) -> float:
        """Median difference between paper and rod."""
        paper = 0.5 * (self.outer_low + self.outer_high)
        return median(paper - self.inner)

    @property
    def blur(self) -> float:
        """Standard deviation of the blur, from the slope at the edges, in px."""
        return float(self.blurs(1)[0])

    def blurs(self, parts: int) -> Array:
        """Return the blur of so many parts along the rod, shape (parts,), in px."""
        return np.asarray(_blurs(self, parts))

    def usable(
        self, walls: Array | float = 0.0, *, least: float = LEAST
    ) -> NDArray[np.bool_]:
        """Stations with both edges, of a width like the others' but for side walls.

        Those whose width is within `least` px of the median are of use in any case.
        """
        wide = self.width - walls
        return np.asarray(alike(wide, least))

    def wander(self, lag: int) -> float:
        """How much an edge jumps from one station to the one `lag` stations on, px."""
        return float(_wander(self.low, self.high, lag))

    def relit(self, blur: float) -> Array:
        """How far either edge would move by what the rod's light changes along it, px.

        Were the change all on that side: half of it, over the slope of the edge.
        """
        change = np.abs(self.inner - median(self.inner)) / self.contrast
        return np.nan_to_num(0.5 * _ROOT_2PI * blur * change)

    def shaded(self, blur: float) -> Array:
        """Half the difference of what the paper's slope does to either edge, px."""
        return np.asarray(_shaded(self, 1.5 * clear_of(blur)))


@njit(cache=True)
def _blurs(edges: Edges, parts: int) -> Array:
    bounds = np.linspace(0, edges.low.size, parts + 1)
    low = (edges.outer_low - edges.inner) / edges.slope_low
    high = (edges.outer_high - edges.inner) / edges.slope_high
    out = np.empty(parts)
    for k in range(parts):
        part = slice(int(bounds[k]), int(bounds[k + 1]))
        rise = _median(np.concatenate((low[part], high[part])))
        variance = (rise / _ROOT_2PI) ** 2 - _SLOPE_VARIANCE
        out[k] = np.sqrt(max(variance, 0.01))
    return out


@njit(cache=True)
def alike(width: Array, least: float) -> NDArray[np.bool_]:
    """Whether widths are within 5 deviations of the median, or `least`."""
    away = np.abs(width - _median(width))
    return np.asarray(away < max(5.0 * 1.4826 * _median(away), least))


@njit(cache=True)
def _wander(low: Array, high: Array, lag: int) -> float:
    jumps = np.concatenate((low[lag:] - low[:-lag], high[lag:] - high[:-lag]))
    jump = _median(np.abs(jumps))
    return 1.05 * jump if jump > 0.0 else 0.0


@njit(cache=True)
def _shaded(edges: Edges, reach: float) -> Array:
    low = edges.shade_low / edges.slope_low
    high = edges.shade_high / edges.slope_high
    return np.nan_to_num(0.25 * reach * np.abs(high - low))


def find_edges(
    grey: Image,
    points: Array,
    normals: Array,
    low: Array,
    high: Array,
    *,
    reach: float,
    blur: float | Array,
    fuzz: float = 0.0,
    sign: float = 1.0,
    smooth: int = 6,
) -> Edges:
    """Find both side edges near where they are expected.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    points, normals : ndarray, shape (n, 2)
        Stations (x, y) and unit normals.
    low, high : ndarray, shape (n,)
        Expected offsets of the edges, in px.
    reach : float
        How far from there to look, in px.
    blur : float or ndarray, shape (k,)
        Standard deviation of the blur, in px, of each of so many equal parts: the
        levels are taken clear of it.
    fuzz : float
        How far hairs and burrs reach, in px: the levels are taken clear of these too.
    sign : float
        -1 for a light rod.
    smooth : int
        Stations to either side over which levels are averaged.

    Returns
    -------
    Edges
        NaN where no edge was found.
    """
    edge = np.array([low, high])
    blurs = np.atleast_1d(np.asarray(blur, dtype=np.float64))
    out = _both_sides(
        grey, points, normals, edge, float(reach), blurs, float(fuzz), sign, smooth
    )
    return Edges(
        low=-out[0, 0], high=out[1, 0], slope_low=out[0, 1], slope_high=out[1, 1],
        inner=0.5 * (out[0, 2] + out[1, 2]), outer_low=out[0, 3], outer_high=out[1, 3],
        shade_low=out[0, 4], shade_high=out[1, 4], growth=out[0, 5],
    )  # fmt: skip


@njit(cache=True)
def _both_sides(
    grey: Image, points: Array, normals: Array, edge: Array, reach: float,
    blurs: Array, fuzz: float, sign: float, smooth: int,
) -> Array:  # fmt: skip
    """Return what `_measure_side` finds on each side, (2, 7, n); growth is of both."""
    out = np.empty((2, 7, len(points)))
    bounds = np.linspace(0, len(points), blurs.size + 1)
    for k in range(blurs.size):
        part, blur = slice(int(bounds[k]), int(bounds[k + 1])), blurs[k]
        half = 0.5 * (_median(edge[1, part]) - _median(edge[0, part]))
        close, gap, window = level_spans(blur, fuzz)
        span = max(reach + 1.0, gap + window)
        # Samples lie a quarter of a pixel and more to either side of the expected edge;
        # a profile reaches no further in than the axis.
        before = max(int(min(span, half) / STEP_PX + 0.5), 2)
        strip = np.empty(
            (len(points[part]), before + int(span / STEP_PX) + 1), np.float32
        )
        shaded = sign < 0.0 and half > _ROUND_PX
        filters = _level_filters(
            strip.shape[1], before, (close, gap), window, blur, shaded
        )
        for side in range(2):
            outwards, along = 2.0 * side - 1.0, edge[side, part]
            _sample(
                grey, points[part], normals[part], along, outwards, before,
                np.float32(sign), strip,
            )  # fmt: skip
            found = out[side, :, part]
            _measure_side(strip, before, filters, smooth, reach, blur, found)
            found[0] += outwards * along
    # Levels close to the edges know the shade and so the middle; those clear of the
    # blur, whose shape is not quite a Gaussian's, know the width, on a side without
    # shade.
    growth = (out[0, 5] + out[1, 5]) / (out[0, 6] + out[1, 6])
    out[:, 5] = growth
    out[:, 0] += np.where(np.abs(growth) < 0.5, growth, 0.0)
    return out


@njit(cache=True)
def _smooth(rows: Array, half: int) -> None:
    """Replace each value by the mean over its neighbours in the row, NaN left out."""
    count = rows.shape[1]
    for row in rows:
        old = row.copy()
        total, number = 0.0, 0
        for i in range(-half, count):
            if i + half < count and not np.isnan(old[i + half]):
                total += old[i + half]
                number += 1
            if i - half > 0 and not np.isnan(old[i - half - 1]):
                total -= old[i - half - 1]
                number -= 1
            if i >= 0:
                row[i] = total / number if number else np.nan


@njit(cache=True)
def _levels(strip: Image, filters: Array, levels: Array) -> None:
    """Fill levels, (6, n), with what both filters make of every profile."""
    count, columns = strip.shape
    for i in range(count):
        a, b, c, d, e, f = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(columns):
            g = strip[i, k]
            a += filters[0, k] * g
            b += filters[1, k] * g
            c += filters[2, k] * g
            d += filters[3, k] * g
            e += filters[4, k] * g
            f += filters[5, k] * g
        levels[0, i], levels[1, i], levels[2, i] = a, b, c
        levels[3, i], levels[4, i], levels[5, i] = d, e, f


@njit(cache=True, error_model="numpy")
def _measure_side(
    strip: Image, before: int, filters: Array, smooth: int, reach: float, blur: float,
    out: Array,
) -> None:  # fmt: skip
    """Fill out, (7, n): edge, its slope, the outer filter's levels, growth, certainty.

    Growth is how much farther out the edge is with the outer filter's levels than with
    the inner's, times the certainty that the paper there has no shade.
    """
    count = len(strip)
    levels = np.empty((6, count))
    _levels(strip, filters, levels)
    _smooth(levels, smooth)
    for i in range(count):
        near, far = levels[:3, i], levels[3:, i]
        level = 0.5 * (near[0] + near[1]) + near[2] * blur / _ROOT_2PI
        place, slope = np.nan, np.nan
        if near[1] > near[0]:
            place, slope = _crossing(strip[i], before, level, reach)
        sure = 1.0 / (far[2] ** 2 + (_SHADE * (far[1] - far[0])) ** 2)
        growth = 0.5 * (far[0] + far[1]) + far[2] * blur / _ROOT_2PI - level
        out[0, i], out[1, i] = place, slope
        out[2:5, i] = far
        out[5, i], out[6, i] = sure * growth / slope, sure


@njit(cache=True)
def _crossing(
    profile: Image, before: int, level: float, reach: float
) -> tuple[float, float]:
    """Find the crossing nearest to the expected place; fit a line through 4 samples.

    Returns its place and the slope there; NaN where the profile does not cross.
    """
    best = -1
    for away in range(int(reach / STEP_PX) + 1):
        for k in (before - 1 - away, before - 1 + away):
            inside = 1 <= k < profile.size - 2
            if inside and profile[k] < level <= profile[k + 1]:
                best = k
                break
        if best >= 0:
            break
    if best < 0:
        return np.nan, np.nan
    a, b = profile[best - 1], profile[best]
    c, d = profile[best + 1], profile[best + 2]
    slope = (0.3 * (d - a) + 0.1 * (c - b)) / STEP_PX
    if not slope > 0.0:
        return np.nan, np.nan
    middle = (best - before + 1) * STEP_PX
    place = middle + (level - 0.25 * (a + b + c + d)) / slope
    if abs(place - middle) > STEP_PX:
        place = middle - 0.5 * STEP_PX + (level - b) / (c - b) * STEP_PX
    return place, slope
