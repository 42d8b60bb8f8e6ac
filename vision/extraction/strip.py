"""The picture straightened along a rod: its light across and along, sampled once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..curve.robust import median
from ..edge.step_line import sample_lanes
from ..find.candidate import Candidate
from ..find.ground import View
from ..find.track import resample
from .refine import Refined

Array = NDArray[np.float64]

PARTS = 10
"""Parts along a candidate whose light across is looked at."""

_IN_PART, _LANE_PX, _LANES = 10, 0.5, 64
"""Stations in each; and the distance of lanes, px, or so many a width on a wide one."""

_REACH, _REACH_PX = 2.5, 6.0
"""How far to either side of a candidate there are lanes: widths, and px on top."""

_INSIDE = 0.6
"""How far from a candidate's axis the middle of its rod may be, in its widths."""

_QUARTILES = 1.349
"""Distance of the quartiles of a normal distribution, in its standard deviation."""

GRID = 8
"""Lanes and stations a width along what was measured."""

ASIDE, BEHIND, BEYOND = 3.5, 6.0, 10.0
"""How far from its axis, its root and its tip they go, in widths."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Strip:
    """Light on lanes beside an axis.

    Parameters
    ----------
    width : float
        Width of the rod, px: the unit across.
    s : ndarray, shape (n,)
        Arc lengths of the stations, px, evenly spaced.
    points : ndarray, shape (n, 2)
        These in the picture (x, y).
    theta : ndarray, shape (n,)
        Angle of the axis there.
    across : ndarray, shape (k,)
        Offsets of the lanes to the right in the picture, in widths, evenly spaced.
    light : ndarray, shape (k, n)
        Light, dark for a rod of any colour; NaN outside the picture.
    """

    width: float
    s: Array
    points: Array
    theta: Array
    across: Array
    light: Array

    def beside(self, offset: Array) -> Array:
        """Return points at offsets from the axis, px, shape (n,), as (n, 2)."""
        normals = np.column_stack([-np.sin(self.theta), np.cos(self.theta)])
        return np.asarray(self.points + offset[:, None] * normals)

    def between(self, first: float, last: float) -> slice:
        """Return the stations from one arc length to another, the nearest at least."""
        low, high = _nearest(self.s, first), _nearest(self.s, last)
        return slice(low, high + 1)

    def lanes(self, *across: float) -> Array:
        """Return the light on the lanes nearest to offsets in widths, (m, n)."""
        return np.asarray(self.light[[_nearest(self.across, x) for x in across]])


def _nearest(grid: Array, value: float) -> int:
    """Return the index of the value of an even grid that is nearest."""
    place = round((value - grid[0]) / (grid[1] - grid[0]))
    return int(min(max(place, 0), len(grid) - 1))


def _sampled(
    view: View, width: float, s: Array, points: Array, theta: Array, across: Array
) -> Strip:
    light = sample_lanes(view.grey, points, theta, across * width, view.sign)
    return Strip(
        width=width, s=s, points=points, theta=theta, across=across, light=light
    )


def along_candidate(view: View, candidate: Candidate) -> Strip:
    """Return the strip along what was found, before anything of it is measured."""
    width = candidate.width_px
    s, points, theta = resample(candidate.points_px, 0.6 * width)
    few = np.linspace(0, len(s) - 1, PARTS * _IN_PART).astype(int)
    reach = _REACH + _REACH_PX / width
    across = np.arange(-reach, reach, max(_LANE_PX / width, 1.0 / _LANES))
    return _sampled(view, width, s[few], points[few], theta[few], across)


def profiles(strip: Strip) -> Array:
    """Return the mean light across each part of a candidate, shape (PARTS, k)."""
    parts = strip.light.reshape(len(strip.across), PARTS, -1)
    return np.ascontiguousarray(parts.mean(axis=2).T)


def blur_of(strip: Strip) -> tuple[float, float, float]:
    """Return blur, width, and how much that jumps, px, as the sides' slopes show them.

    A step that is blurred by b rises from a quarter to three quarters of its height
    over 1.35 b; of a rod that is hardly wider than its blur, less of both is seen.
    """
    light, columns = strip.light.T, np.arange(len(strip.across))
    step = strip.width * (strip.across[1] - strip.across[0])
    inside = np.where(np.abs(strip.across) < _INSIDE, light, np.nan)
    axis = np.argmin(np.where(np.isnan(inside), np.inf, inside), axis=1)[:, None]
    dark = np.take_along_axis(light, axis, axis=1)
    away = step * (columns - axis)
    reach = step * len(columns)
    rises, width = np.full((2, len(light)), np.inf), np.zeros(len(light))
    for side, outwards in enumerate((-1.0, 1.0)):
        beside = np.where(outwards * away >= 0.0, light, np.nan)
        height = np.fmax.reduce(beside, axis=1)[:, None] - dark
        quarter, half, most = (
            np.where(beside > dark + part * height, np.abs(away), reach).min(axis=1)
            for part in (0.25, 0.5, 0.75)
        )
        width += half
        rises[side] = most - quarter
    jumps = np.minimum(np.abs(np.diff(width)), 0.5 * median(width))
    return median(rises.min(axis=0)) / _QUARTILES, median(width), float(jumps.mean())


def along_rod(view: View, refined: Refined) -> Strip:
    """Return the strip along what was measured, from behind its root to beyond its tip.

    The tip is on the grid; where the root is, s is 0.
    """
    curve, width = refined.fit.curve, refined.typical_width
    before = int(GRID * (curve.s[-1] / width + BEHIND)) + 1
    s = curve.s[-1] + np.arange(-before, GRID * BEYOND + 1.0) * (width / GRID)
    across = np.arange(-ASIDE * GRID, ASIDE * GRID + 1.0) / GRID
    return _sampled(view, width, s, *curve.at(s), across)
