"""The picture straightened along a rod: its light across and along, sampled once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.robust import median
from ..edge.lanes import sample_lanes
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

_BLACK = 0.02
"""Light that is told from none."""

GRID = 8
"""Lanes and stations a width along what was measured."""

ASIDE, BEHIND, BEYOND = 3.5, 6.0, 10.0
"""How far from its axis, its root and its tip they go, in widths."""


@dataclass(frozen=True, kw_only=True)
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

    @cached_property
    def profiles(self) -> Array:
        """The mean light across each part of a candidate, shape (PARTS, k)."""
        parts = self.light.reshape(len(self.across) * PARTS, -1)
        share = np.full(parts.shape[1], 1.0 / parts.shape[1])
        return np.ascontiguousarray((parts @ share).reshape(-1, PARTS).T)

    def between(self, first: float, last: float) -> slice:
        """Return the stations from one arc length to another, the nearest at least."""
        low, high = _nearest(self.s, first, last)
        return slice(low, high + 1)

    def lanes(self, *across: float) -> Array:
        """Return the light on the lanes nearest to offsets in widths, (m, n)."""
        return np.asarray(self.light[_nearest(self.across, *across)])


def _nearest(grid: Array, *values: float) -> list[int]:
    """Return the indices of the values of an even grid that are nearest."""
    first, second = grid[:2].tolist()
    step, last = second - first, len(grid) - 1
    return [min(max(round((float(x) - first) / step), 0), last) for x in values]


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


def blur_of(strip: Strip) -> tuple[float, float, float]:
    """Return blur, width, and how much that jumps, px, as the sides' slopes show them.

    A step that is blurred by b rises from a quarter to three quarters of its height
    over 1.35 b; of a rod that is hardly wider than its blur, less of both is seen.
    """
    light = strip.light
    if median(light[0]) < 0.0:
        # Of a light rod the lamp makes slopes as well, but all of its light is far from
        # the board's.
        light = -np.log(np.maximum(_BLACK - light, _BLACK))
    step = strip.width * (strip.across[1] - strip.across[0])
    first, end = np.searchsorted(strip.across, (-_INSIDE, _INSIDE)).tolist()
    quarter, half, most = step * _sides(light, first, end)
    width, typical = half.sum(axis=0), median(half.sum(axis=0))
    jumps = np.minimum(np.abs(np.diff(width)), 0.5 * typical)
    rises = (most - quarter).min(axis=0)
    return median(rises) / _QUARTILES, typical, float(jumps.mean())


@njit(cache=True)
def _sides(light: Array, first: int, end: int) -> Array:
    """Return how many lanes from the axis each side rises by a quarter, half and more.

    The axis is the darkest lane from `first` to `end`. Shape (3, 2, n).
    """
    lanes, stations = light.shape
    away = np.full((3, 2, stations), float(lanes))
    for k in range(stations):
        axis = first
        for i in range(first, end):
            if not light[i, k] >= light[axis, k]:
                axis = i
        for side in range(2):
            beside = light[axis:, k] if side else light[axis::-1, k]
            height = np.nanmax(beside) - beside[0]
            for part in range(3):
                level = beside[0] + 0.25 * (part + 1) * height
                for i in range(beside.size):
                    if beside[i] > level:
                        away[part, side, k] = i
                        break
    return away


def along_rod(view: View, refined: Refined) -> Strip:
    """Return the strip along what was measured, from behind its root to beyond its tip.

    The tip is on the grid; where the root is, s is 0.
    """
    curve, width = refined.fit.curve, refined.typical_width
    before = int(GRID * (curve.s[-1] / width + BEHIND)) + 1
    s = curve.s[-1] + np.arange(-before, GRID * BEYOND + 1.0) * (width / GRID)
    across = np.arange(-ASIDE * GRID, ASIDE * GRID + 1.0) / GRID
    return _sampled(view, width, s, *curve.at(s), across)
