"""A rod that was measured together with its own shade, as one body of two levels.

A hard shade that lies right beside a rod is darker than half of the paper, so that the
edge of both together is clear and smooth. But across a rod alone the light is one level
(or shading without a step, or a streak of gloss with dark on both sides): a step from
one level to another, all along, is where the rod ends and its shade begins. That holds
where shade is nearer to the rod's light than the paper is: not beside a light rod.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.curve import beside
from ..curve.robust import median
from ..edge.levels import clear_of
from ..find.candidate import Candidate
from .strip import PARTS, Strip

Array = NDArray[np.float64]

_LEAST_PARTS = 0.5
"""Share of the parts along the rod that tell a step."""

_STEP, _CLEAR = 0.08, 8.0
"""Least step inside a rod, over that from its darkest to the paper; and over the mean
distance of the light from the two levels: it is 4 for a ramp."""

_NARROW = 0.18
"""Narrowest level, in widths; what is less may be a side wall or a rounded edge."""

_EDGE = 0.6
"""Light at the edge of both together, from the darkest to the paper."""


def rod_alone(strip: Strip, candidate: Candidate, width: float) -> Candidate | None:
    """Return the darker one of two bodies that lie along each other.

    Parameters
    ----------
    strip : Strip
        The two as one.
    candidate : Candidate
        As it was found.
    width : float
        Width of both, px.

    Returns
    -------
    Candidate or None
        None where what lies there has one level.
    """
    clear = clear_of(1.0)
    across = strip.across * strip.width
    near = np.abs(across) < 0.6 * width + 2.0 * clear
    across, light = across[near], strip.profiles[:, near]
    if (
        median(light.max(axis=1)) < 0.0
    ):  # a light rod, farther from shade than from the board
        return None
    middle = strip.s.reshape(PARTS, -1).mean(axis=1)
    found = _steps(across, light, middle, float(width), clear)
    if len(found) < _LEAST_PARTS * PARTS:
        return None
    s, low, high = found.T
    aside = np.interp(strip.s, s, 0.5 * (low + high))
    points = beside(strip.points, strip.theta, aside)
    return replace(candidate, points_px=points, width_px=median(high - low))


@njit(cache=True)
def _steps(
    across: Array, light: Array, middle: Array, width: float, clear: float
) -> Array:
    """Return middle, low and high edge of the darker body in each part with a step."""
    found, count = np.empty((len(light), 3)), 0
    for k in range(len(light)):
        dark, paper = np.min(light[k]), np.max(light[k])
        body = np.flatnonzero(light[k] < dark + _EDGE * (paper - dark))
        if body.size == 0 or body[0] == 0 or body[-1] == across.size - 1:
            continue  # beyond the picture; or a soft shade, no edge was taken for
        low, high = across[body[0]], across[body[-1]]
        inside = (across > low + clear) & (across < high - clear)
        profile = light[k][inside]
        if not (profile.size and np.ptp(profile) > _STEP * (paper - dark)):
            continue  # as in nearly all rods
        place, rise = _step(across[inside], profile, paper, _NARROW * width, clear)
        if rise != 0.0:
            ends = (low, place) if rise > 0.0 else (place, high)
            found[count] = middle[k], ends[0], ends[1]
            count += 1
    return found[:count]


@njit(cache=True)
def _step(
    across: Array, profile: Array, paper: float, narrow: float, clear: float
) -> tuple[float, float]:
    """Return where a profile goes from one level to another, and by how much; or by 0.

    Each level is `narrow` at least; what lies within `clear` of the step is left out.
    """
    best, place, rise = _CLEAR, 0.0, 0.0
    lane = across[1] - across[0]
    least = max(int(narrow / lane), 3)
    gap = int(clear / lane)
    for k in range(least, len(profile) - least + 1):
        left = profile[: max(k - gap, least)]
        right = profile[min(k + gap, len(profile) - least) :]
        near, far = np.median(left), np.median(right)
        step = far - near
        if abs(step) <= _STEP * (paper - min(near, far)):
            continue
        rest = np.abs(left - near).sum() + np.abs(right - far).sum()
        clearness = abs(step) / (rest / (left.size + right.size) + 1e-4)
        if clearness > best:
            best, place, rise = clearness, across[k] - 0.5 * lane, step
    return place, rise
