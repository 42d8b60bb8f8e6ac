"""Side edges of a rod on paper that is over-exposed: its light is fitted, not seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .edges import STEP_PX, _sample
from .flank import WHITE, fit_flanks, median_profiles
from .state import Seen, State
from .wall_light import MIRRORED, SKY, Walls, reflectance

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_PIECES = 20
"""A rod's sides are fitted in so many pieces: shade beside it may change the light."""
_SOME = 0.02
"""Part of a rod beside which paper must be white."""


def saturated(seen: Seen) -> float:
    """Return the part of the rod beside which the paper is as light as can be."""
    paper = np.maximum(seen.edges.outer_low, seen.edges.outer_high)[seen.good]
    return float(np.mean(paper > WHITE))


def are_cut_off(seen: Seen) -> bool:
    """Whether edges of a dark rod are cut off where a sensor holds no more light."""
    return saturated(seen) > _SOME


def to_whole_edges(grey: Image, state: State, seen: Seen, walls: Walls | None) -> Seen:
    """Move edges beside white paper to where they are with all its light.

    And know the blur, which an edge that is cut off seems to have too little of. The
    edges of other rods stay as they are.
    """
    if not are_cut_off(seen):
        return seen
    bounds = np.linspace(0, len(seen.s), _PIECES + 1).astype(np.int64)
    x, light = _sides(grey, state, seen, bounds)
    wall = np.zeros(len(seen.s))
    if walls is not None:
        wall, _ = walls(*state.curve.at(seen.s), state.width)
    mean = _means(wall, bounds)
    wide = np.maximum(np.concatenate([mean, -mean]), 0.0)
    share = MIRRORED * reflectance(wide / np.maximum(state.width - wide, 1.0))
    flanks = fit_flanks(
        x, light, blur=state.blur, wall=wide, mirrored=share, sky=SKY,
        near=state.flanks,
    )  # fmt: skip
    state.flanks, state.blur = flanks, flanks.blur
    middles = _means(seen.s, bounds)
    low, high = (np.interp(seen.s, middles, by) for by in flanks.moves(2))
    moved = replace(seen.edges, low=seen.edges.low - low, high=seen.edges.high + high)
    return replace(seen, edges=moved)


def _sides(
    grey: Image, state: State, seen: Seen, bounds: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Return places of samples, px outwards, and the profiles of pieces of both sides.

    Medians of a piece's profiles, each laid at its own edge.
    """
    curve, edges = state.curve, seen.edges
    points, theta = curve.at(seen.s)
    normals = np.column_stack([-np.sin(theta), np.cos(theta)])
    bend = np.interp(seen.s, curve.s, curve.kappa)
    points += (0.5 * state.blur**2 * bend)[:, None] * normals
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
