"""The light on a rod's side walls, within which half level lies, taken out."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core.jit import njit
from .edges import level_span
from .state import Seen, State

Array = NDArray[np.float64]
Walls = Callable[[Array, Array, float], Array]

WALL_LIGHT = 0.17
"""Light of a side wall that is seen: above the top's, over the paper's above the top's.

The camera grazes the wall, which there mirrors the paper (Fresnel); beside the clamp it
mirrors the dark clamp, and the light grows from there as 1 - exp(-s / width). Found on
35 path-traced photographs by two renderers.
"""
WALL_PLACES = 25


def to_wall_ends(
    state: State, seen: Seen, first: float, walls: Walls, *, clamped: bool
) -> Seen:
    """Move edges from half level to where the side walls end, which are lighter."""
    places = np.linspace(seen.s[0], seen.s[-1], WALL_PLACES)
    wall = walls(*state.curve.at(places), state.width)
    light = np.full(WALL_PLACES, WALL_LIGHT)
    if clamped:
        light *= 1.0 - np.exp(-np.maximum(places - first, 0.0) / state.width)
    gap, window = level_span(state.blur, state.fuzz)
    short = np.interp(
        seen.s, places, short_of_end(np.abs(wall), light, state.blur, gap, window)
    )
    left = np.interp(seen.s, places, wall) > 0.0
    edges = seen.edges
    return replace(
        seen,
        edges=replace(
            edges,
            low=edges.low - np.where(left, short, 0.0),
            high=edges.high + np.where(left, 0.0, short),
        ),
    )


@njit(cache=True)
def short_of_end(
    wall: Array, light: Array, blur: float, gap: float, window: float
) -> Array:
    """Return how far half level lies within a wall of some width and light, px.

    Of two blurred steps, one at the wall's end and one `wall` before it:
    (1 - light) Phi(-x / blur) + light Phi((wall - x) / blur) = (1 + light part) / 2,
    by Newton's method. A `part` of the `window` in which the rod's level is taken,
    `gap` clear of the edge, lies on a wide wall.
    """
    short = np.zeros_like(wall)
    for i in range(wall.size):
        x = 0.0
        part = min(max((wall[i] - gap) / window, 0.0), 1.0)
        for _ in range(4):
            a, b = (wall[i] - x) / blur, -x / blur
            excess = light[i] * math.erf(a / math.sqrt(2.0))
            excess += (1.0 - light[i]) * math.erf(b / math.sqrt(2.0))
            excess -= light[i] * part
            slope = light[i] * math.exp(-0.5 * a * a)
            slope += (1.0 - light[i]) * math.exp(-0.5 * b * b)
            x += blur * math.sqrt(0.5 * math.pi) * excess / slope
        short[i] = x
    return short
