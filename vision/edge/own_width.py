"""How wide a rod is whose two edges feel each other in the blur.

Half the light between rod and paper lies outside the edge of a rod that is not much
wider than its blur, for nowhere is it seen as dark as it is. Profiles across the whole
rod are fitted: both edges, the rod's light and the blur, which all profiles share.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..curve.curve import beside
from ..curve.robust import median
from .flank import median_profiles
from .highlight import fit_bars
from .lanes import sample_lanes
from .profiles import STEP_PX
from .state import Seen, State

Array = NDArray[np.float64]
Image = NDArray[np.float32]

FELT = 0.2
"""Blur, in widths, from which two edges feel each other by more than 6e-3 of a width.

Below, one blur for the whole rod is no better, where it moved."""

_PIECES, _SHOWN, _PAPER = 20, 0.5, 4.0
"""Pieces along a rod, the share of them, and of each, that must be seen; and how far
beside the rod its paper is looked at, in blurs."""


def to_own_width(grey: Image, state: State, seen: Seen, sign: float) -> Seen:
    """Move edges apart, or together, where half level is not where they are.

    The midline stays. Known after are the blur that one edge alone would have, and the
    slopes of the paper without the blur's.
    """
    if not FELT * state.width < state.blur:
        return seen
    bounds = np.linspace(0, len(seen.s), _PIECES + 1).astype(np.int64)
    x, light = _profiles(grey, state, seen, bounds, sign)
    shown = np.isfinite(light).mean(axis=1) > _SHOWN
    if np.count_nonzero(shown) < _SHOWN * _PIECES:
        return seen
    middle = 0.5 * (seen.s[bounds[:-1]] + seen.s[bounds[1:] - 1])[shown]
    half = np.full(len(middle), 0.5 * state.width)
    near = np.column_stack([-half, half])
    blur = median(np.exp(fit_bars(x, light[shown], near, blur=state.blur).blur))
    bars = fit_bars(x, light[shown], near, blur=blur, known=True)
    width, left, right = (
        np.interp(seen.s, middle, one)
        for one in (bars.high - bars.low, bars.left_slope, bars.right_slope)
    )
    more = 0.5 * (width - seen.edges.width)
    edges = seen.edges._replace(
        low=seen.edges.low - more, high=seen.edges.high + more,
        shade_low=-left, shade_high=right,
    )  # fmt: skip
    state.blur, state.blurs, state.width = blur, None, median(edges.width[seen.good])
    return replace(seen, edges=edges)


def _profiles(
    grey: Image, state: State, seen: Seen, bounds: NDArray[np.int64], sign: float
) -> tuple[Array, Array]:
    """Return places across, px, and the profiles of pieces about the midline."""
    points, theta = state.curve.at(seen.s)
    bend = np.interp(seen.s, state.curve.s, state.curve.kappa)
    middle = np.nan_to_num(seen.edges.middle) + 0.5 * state.blur**2 * bend
    points = beside(points, theta, middle)
    reach = 0.5 * state.width + _PAPER * state.blur
    x = np.arange(-reach, reach, max(STEP_PX, 0.2 * state.blur))
    light = sample_lanes(grey, points, theta, x, sign).T.copy()
    light[~seen.good] = np.nan
    return x, median_profiles(light, bounds)
