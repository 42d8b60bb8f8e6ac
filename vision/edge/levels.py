"""Levels of light at either side of an edge: where they are taken, and how."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from .profiles import STEP_PX

Array = NDArray[np.float64]

_ROUND_PX, _EVEN = 6.0, 2.0
"""Half width of a light rod, px, across which a lamp's shading is seen; and samples,
times px^2, by which it is taken for even until they tell."""

_ROOT_2PI = 2.5066282746310002

_SLOPE_VARIANCE = 0.171
"""Variance, px^2, of the place whose slope the line through four samples tells: 0.9 of
its weight is even over 1.5 px, and 0.1 over 0.5 px."""
_MEAN_VARIANCE = 0.3125
"""And of the places of these samples about their middle."""


@njit(cache=True)
def clear_of(blur: float) -> float:
    """Return how far from an edge its blur hardly reaches, px."""
    return max(1.5, 2.2 * blur)


@njit(cache=True)
def level_spans(blur: float, fuzz: float) -> tuple[float, float, float]:
    """Return where levels are taken, px: close to the edge, clear of it; how far on.

    A little farther than the blur itself asks for: on photographs what is closer to the
    edge is unsure (a rounded edge, the lens's halo).
    """
    wide = max(math.hypot(blur, math.sqrt(_SLOPE_VARIANCE)), fuzz)
    return max(0.6, 1.1 * wide), clear_of(wide), max(4.0, 3.0 * wide)


@njit(cache=True)
def followed(blur: float, fuzz: float, half: float) -> float:
    """Return what part of its way an edge is found to have moved, in one look.

    It is sought by levels about the place where it is expected. If it lies farther out,
    its blur reaches into these: what is found is short by their change, over the slope
    of the edge. And the mean of four samples moves by less than their slope says.

    Parameters
    ----------
    blur, fuzz, half : float
        As for the edges: blur, reach of hairs, and half the width of the rod, px.
    """
    close, gap, window = level_spans(blur, fuzz)
    before = max(int(min(gap + window, half) / STEP_PX + 0.5), 2)
    columns = before + int((gap + window) / STEP_PX) + 1
    inner, outer, rise = _level_filter(columns, before, close, window, blur, False)
    pull = 0.0
    for k in range(columns):
        t = (k - before + 0.5) * STEP_PX / blur
        level = 0.5 * (inner[k] + outer[k]) + rise[k] * blur / _ROOT_2PI
        pull += level * math.exp(-0.5 * t * t)
    slope = 1.0 / math.sqrt(1.0 + _SLOPE_VARIANCE / blur**2)
    return (1.0 / math.sqrt(1.0 + _MEAN_VARIANCE / blur**2) - pull) / slope


@njit(cache=True)
def _level_filters(
    columns: int, before: int, gaps: tuple[float, float], window: float, blur: float,
    shaded: bool,
) -> Array:  # fmt: skip
    """Return the weights of both filters, (6, m): near the edge, then clear of it."""
    filters = np.empty((6, columns))
    filters[:3] = _level_filter(columns, before, gaps[0], window, blur, shaded)
    filters[3:] = _level_filter(columns, before, gaps[1], window, blur, shaded)
    return filters


@njit(cache=True)
def _level_filter(
    columns: int, before: int, gap: float, window: float, blur: float, shaded: bool
) -> Array:
    """Return the weights of samples in inner level, outer level and its slope, (3, m).

    Least squares of a step onto a slope, both blurred by a Gaussian, on samples at
    either side, `gap` clear of the edge: so the blurred edge's own tails count neither
    as rod nor as shade. The outer level is that at the edge. Of a `shaded` rod the
    inner one slopes too, and is that at the edge but for what the blur adds there.
    """
    design = np.zeros((columns, 4 if shaded else 3))
    for k in range(columns):
        t = (k - before + 0.5) * STEP_PX
        if gap <= abs(t) <= gap + window:
            outside = 0.5 * (1.0 + math.erf(t / (blur * math.sqrt(2.0))))
            bell = math.exp(-0.5 * (t / blur) ** 2) / _ROOT_2PI
            design[k, 0] = 1.0 - outside
            design[k, 1] = outside
            design[k, 2] = t * outside + blur * bell
            if shaded:
                design[k, 3] = t * (1.0 - outside) - blur * bell
    normal = design.T @ design
    if shaded:
        normal[3, 3] += _EVEN
    if normal[0, 0] < 0.5:
        # Narrower than the blur: the darkest there is, at the axis.
        design[0, 0] += 1.0
        normal = design.T @ design
    weights = np.linalg.solve(normal, design.T)
    if shaded:
        weights[0] -= 2.0 * blur / _ROOT_2PI * weights[3]
    return np.ascontiguousarray(weights[:3])
