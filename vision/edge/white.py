"""Side edges of a rod beside white paper, or white itself: light is fitted, not seen.

A white rod on a dark board is a dark rod's edge seen from outside: its half level lies
outside it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..curve.curve import beside, normals_of
from .flank import WHITE, Flanks, fit_flanks, is_held, median_profiles
from .profiles import STEP_PX, _sample
from .state import Seen, State
from .wall_light import MIRRORED, SKY, Walls, reflectance

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_PIECES = 20
"""A rod's sides are fitted in so many pieces: shade beside it may change the light."""
SOME = 0.02
"""Part of a rod whose edges must be cut off for them to be moved."""


def saturated(seen: Seen, sign: float) -> float:
    """Return the part of the rod whose light side is as light as can be.

    That is the paper, or with `sign` -1 the rod itself.
    """
    edges = seen.edges
    light = np.maximum(edges.outer_low, edges.outer_high) if sign > 0 else -edges.inner
    white = int(np.count_nonzero((light > WHITE) & seen.good))
    return white / max(int(np.count_nonzero(seen.good)), 1)


def is_cut_off(grey: Image, white: float) -> bool:
    """Whether so much of a rod lies beside what the sensor could not hold."""
    return white > SOME and is_held(grey)


def to_whole_edges(
    grey: Image, state: State, seen: Seen, walls: Walls | None, sign: float, *,
    anew: bool,
) -> Seen:  # fmt: skip
    """Move edges that are cut off at white to where they are with all the light.

    And know the blur, which an edge that is cut off seems to have too little of. Unless
    `anew`, by what was fitted before.
    """
    bounds = np.linspace(0, len(seen.s), _PIECES + 1).astype(np.int64)
    if anew or state.flanks is None:
        state.flanks = _flanks(grey, state, seen, bounds, walls, sign)
    state.blur, state.blurs = state.flanks.blur, None
    middles = _means(seen.s, bounds)
    low, high = (np.interp(seen.s, middles, sign * by) for by in state.flanks.moves(2))
    moved = seen.edges._replace(low=seen.edges.low - low, high=seen.edges.high + high)
    return replace(seen, edges=moved)


def _flanks(
    grey: Image, state: State, seen: Seen, bounds: NDArray[np.int64],
    walls: Walls | None, sign: float,
) -> Flanks:  # fmt: skip
    """Return the steps at the pieces of both sides, from their dark to their light."""
    x, light = _sides(grey, state, seen, bounds)
    if sign < 0.0:
        x, light = -x[::-1], light[:, ::-1]
    wall = np.zeros(len(seen.s))
    if walls is not None:
        wall, _ = walls(*state.curve.at(seen.s), state.width)
    mean = _means(wall, bounds)
    wide = np.maximum(np.concatenate([mean, -mean]), 0.0)
    share = MIRRORED * reflectance(wide / np.maximum(state.width - wide, 1.0))
    return fit_flanks(
        x, light, blur=state.blur, wall=wide, mirrored=share, sky=SKY,
        near=state.flanks,
    )  # fmt: skip


def _sides(
    grey: Image, state: State, seen: Seen, bounds: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Return places of samples, px outwards, and the profiles of pieces of both sides.

    Medians of a piece's profiles, each laid at its own edge.
    """
    curve, edges = state.curve, seen.edges
    points, theta = curve.at(seen.s)
    bend = np.interp(seen.s, curve.s, curve.kappa)
    points = beside(points, theta, 0.5 * state.blur**2 * bend)
    normals = normals_of(theta)
    reach = 4.0 * max(state.blur, 0.6) + 1.0
    before = int(min(reach, 0.45 * state.width) / STEP_PX)
    strip = np.empty((len(points), before + int(reach / STEP_PX)), np.float32)
    out = []
    for outwards, edge in ((-1.0, edges.low), (1.0, edges.high)):
        _sample(grey, points, normals, edge, outwards, before, np.float32(1.0), strip)
        strip[~seen.good] = np.nan
        out.append(median_profiles(strip, bounds))
    x = np.asarray((np.arange(strip.shape[1]) - before + 0.5) * STEP_PX, np.float64)
    return x, np.concatenate(out)


def _means(values: Array, bounds: NDArray[np.int64]) -> Array:
    """Return the means of the pieces between bounds."""
    return np.asarray(np.add.reduceat(values, bounds[:-1]) / np.diff(bounds))
