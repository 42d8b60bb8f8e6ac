"""The picture straightened along a rod: its light across and along, sampled once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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


def along_rod(view: View, refined: Refined) -> Strip:
    """Return the strip along what was measured, from behind its root to beyond its tip.

    The tip is on the grid; where the root is, s is 0.
    """
    curve, width = refined.fit.curve, refined.typical_width
    before = int(GRID * (curve.s[-1] / width + BEHIND)) + 1
    s = curve.s[-1] + np.arange(-before, GRID * BEYOND + 1.0) * (width / GRID)
    across = np.arange(-ASIDE * GRID, ASIDE * GRID + 1.0) / GRID
    return _sampled(view, width, s, *curve.at(s), across)
