"""The light on a rod's side walls, within which half level lies, taken out.

A camera that looks down at a small angle a from the vertical sees a wall of height h at
grazing incidence, 90 deg - a. The wall mirrors the paper beside it, by Fresnel's
formula, for a rough rubber a share of that. The mirrored ray goes down as steeply as it
came: to a point of the wall z above the paper it comes from the paper z tan(a) beside
the wall. In the picture that is a reflection about the line where the wall's plane
meets the paper: the wall's middle shows the paper at twice the gap below the rod plus
half the wall, as far outside the wall's end as the gap and the wall are seen wide. So
the light is local, that of shade where shade lies beside the rod. A diffuse wall sees
half the sky that the top sees.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from .edges import LEAST, Edges, alike
from .levels import level_spans
from .state import Seen, State

Array = NDArray[np.float64]
Walls = Callable[[Array, Array, float], tuple[Array, Array]]

MIRRORED = 0.35
"""What a wall mirrors, over what Fresnel's formula gives a smooth one.

Known from 35 path-traced photographs by two renderers, in light and in shade: 0.25 to
0.4 do about as well."""
REFRACTION = 1.45
"""Refractive index of rubbers (silicone 1.41, natural rubber 1.52)."""
SKY = 0.5
"""Diffuse light of a wall, over that of the top: half the sky."""
WALL_PLACES = 25
_MOST_SLOPE = 0.5
"""Shade is carried on to the mirrored paper as a line, by this share of it at most."""
_LEAST, _MOST = -0.3, 0.6
"""Light of a wall above the top's, over the paper's above the top's."""
_MANY_MORE = 1.06
"""Places of use with one section over those with the other that tell which a rod has:
in a deep shade 4 % more of a square one seem to be a round one's."""


def to_wall_ends(state: State, seen: Seen, walls: Walls) -> Seen:
    """Move edges from half level to where the side walls end, which are lighter.

    And find out anew which are of use: the width less the walls is one now, or all of
    the width of a round rod, whose section nobody told.
    """
    places = np.linspace(seen.s[0], seen.s[-1], WALL_PLACES)
    wall, gap = walls(*state.curve.at(places), state.width)
    low, high, good = _moved(
        seen.edges, wall, gap, state.width, float(seen.s[1]), state.blur, state.fuzz,
        MIRRORED, SKY,
    )  # fmt: skip
    return replace(seen, edges=seen.edges._replace(low=low, high=high), good=good)


@njit(cache=True)
def _moved(
    edges: Edges, wall: Array, gap: Array, width: float, step: float, blur: float,
    fuzz: float, mirrored: float, sky: float,
) -> tuple[Array, Array, NDArray[np.bool_]]:  # fmt: skip
    """Return both edges moved to the ends of walls, and which are of use."""
    top, paper, slope = _levels_at(
        wall, 0.5 * width / step, edges.inner, edges.outer_low, edges.outer_high,
        edges.shade_low, edges.shade_high,
    )  # fmt: skip
    away = 2.0 * np.abs(gap) + 0.5 * np.abs(wall)
    light = wall_light(np.abs(wall), away, width, top, paper, slope, mirrored, sky)
    close, _, window = level_spans(blur, fuzz)
    short = short_of_end(np.abs(wall), light, blur, close, window)
    low, high = edges.low.copy(), edges.high.copy()
    wide = np.empty(low.size)
    step = (wall.size - 1) / (low.size - 1)
    for k in range(low.size):
        i = min(int(k * step), wall.size - 2)
        part = k * step - i
        at = (1.0 - part) * wall[i] + part * wall[i + 1]
        by = (1.0 - part) * short[i] + part * short[i + 1]
        if at > 0.0:
            low[k] -= by
        else:
            high[k] += by
        wide[k] = abs(at)
    flat, round_ = alike(high - low - wide, LEAST), alike(high - low, LEAST)
    more = np.sum(round_) > _MANY_MORE * np.sum(flat)
    return low, high, round_ if more else flat


@njit(cache=True)
def wall_light(
    wall: Array, away: Array, width: float, top: Array, paper: Array, slope: Array,
    mirrored: float, sky: float,
) -> Array:  # fmt: skip
    """Return the light of walls above the top's, over the paper's above the top's.

    Parameters
    ----------
    wall, away : ndarray, shape (n,)
        How wide the walls are seen, and how far outside their ends the paper lies that
        they mirror, px.
    width : float
        Width of the rod with its walls, px.
    top, paper, slope : ndarray, shape (n,)
        Light of the rod's top and of the paper beside the wall, and the rise of the
        latter outwards, per px. NaN gives 0.
    mirrored : float
        What a wall mirrors, over what Fresnel's formula gives.
    sky : float
        Its own light over the top's.
    """
    light = np.zeros_like(wall)
    share = mirrored * reflectance(wall / np.maximum(width - wall, 1.0))
    for i in range(wall.size):
        within = _MOST_SLOPE * abs(paper[i])
        facing = paper[i] + min(max(slope[i] * away[i], -within), within)
        above = share[i] * facing + sky * top[i] - top[i]
        above /= max(paper[i] - top[i], 0.1 * abs(paper[i]) + 1e-6)
        if not np.isnan(above):
            light[i] = min(max(above, _LEAST), _MOST)
    return light


@njit(cache=True)
def reflectance(steep: Array) -> Array:
    """Return Fresnel's reflectance of upright walls for light that is not polarised.

    `steep` is the tangent of the rays' angle with the vertical, towards the wall.
    """
    into = steep / np.sqrt(1.0 + steep**2)
    inside = np.sqrt(1.0 - (1.0 - into**2) / REFRACTION**2)
    across = (into - REFRACTION * inside) / (into + REFRACTION * inside)
    along = (REFRACTION * into - inside) / (REFRACTION * into + inside)
    return np.asarray(0.5 * (across**2 + along**2))


@njit(cache=True)
def _levels_at(
    wall: Array, half: float, inner: Array, outer_low: Array,
    outer_high: Array, shade_low: Array, shade_high: Array,
) -> Array:  # fmt: skip
    """Return means of rod, paper and shade beside the wall that is seen, (3, n).

    Over `half` a number of stations to either side of each wall, which are spread
    evenly over all stations.
    """
    out = np.empty((3, wall.size))
    step = (inner.size - 1) / (wall.size - 1)
    for i in range(wall.size):
        paper = outer_low if wall[i] > 0.0 else outer_high
        shade = shade_low if wall[i] > 0.0 else shade_high
        low = max(int(i * step - half), 0)
        high = min(int(i * step + half) + 1, inner.size)
        count = 0
        a, b, c = 0.0, 0.0, 0.0
        for k in range(low, high):
            if not np.isnan(inner[k] + paper[k] + shade[k]):
                a, b, c = a + inner[k], b + paper[k], c + shade[k]
                count += 1
        scale = 1.0 / count if count else np.nan
        out[0, i], out[1, i], out[2, i] = scale * a, scale * b, scale * c
    return out


@njit(cache=True)
def short_of_end(
    wall: Array, light: Array, blur: float, gap: float, window: float
) -> Array:
    """Return how far half level lies within a wall of some width and light, px.

    Of two blurred steps, one at the wall's end and one `wall` before it:
    (1 - light) Phi(-x / blur) + light Phi((wall - x) / blur) = (1 + light part) / 2,
    by Newton's method. `part` is the wall's in the rod's level, which is the mean over
    a `window` that begins `gap` clear of the edge, less the edge's own tail.
    """
    short = np.zeros_like(wall)
    tail = _step_within(-gap - window, -gap, blur)
    for i in range(wall.size):
        part = _step_within(wall[i] - gap - window, wall[i] - gap, blur) - tail
        x = 0.0
        for _ in range(5):
            a, b = (wall[i] - x) / blur, -x / blur
            excess = light[i] * (math.erf(a / math.sqrt(2.0)) - part)
            excess += (1.0 - light[i]) * math.erf(b / math.sqrt(2.0))
            slope = light[i] * math.exp(-0.5 * a * a)
            slope += (1.0 - light[i]) * math.exp(-0.5 * b * b)
            x += blur * math.sqrt(0.5 * math.pi) * excess / max(slope, 0.2)
        short[i] = min(max(x, -2.0 * blur), 2.0 * blur)
    return short


@njit(cache=True)
def _step_within(start: float, stop: float, blur: float) -> float:
    """Return the mean of a blurred step at 0 from start to stop."""
    total = 0.0
    for x, sign in ((stop, 1.0), (start, -1.0)):
        z = x / blur
        bell = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
        total += sign * (bell + 0.5 * z * (1.0 + math.erf(z / math.sqrt(2.0))))
    return total * blur / (stop - start)
