"""A rod that was measured together with its own shade, as one body of two levels.

A hard shade that lies right beside a rod is darker than half of the paper, so that the
edge of both together is clear and smooth. But across a rod alone the light is one level
(or shading without a step, or a streak of gloss with dark on both sides): a step from
one level to another, all along, is where the rod ends and its shade begins.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..curve.robust import median
from ..edge.edges import clear_of
from ..edge.step_line import lanes
from ..find.ground import View
from ..find.rod import Candidate
from ..find.track import Start

Array = NDArray[np.float64]

_PARTS, _LEAST_PARTS = 10, 0.5
"""Parts along the rod that are looked at; and the share of them that tell a step."""

_STEP, _CLEAR = 0.08, 8.0
"""Least step inside a rod, over that from its darkest to the paper; and over the mean
distance of the light from the two levels: it is 4 for a ramp."""

_NARROW = 0.18
"""Narrowest level, in widths; what is less may be a side wall or a rounded edge."""

_EDGE = 0.6
"""Light at the edge of both together, from the darkest to the paper."""

_STATION_PX, _LANE_PX = 2.0, 0.5


def rod_alone(view: View, start: Start, candidate: Candidate) -> Candidate | None:
    """Return the darker one of two bodies that lie along each other.

    Parameters
    ----------
    view : View
        The picture.
    start : Start
        The two as one.
    candidate : Candidate
        As it was found.

    Returns
    -------
    Candidate or None
        None where what starts there has one level.
    """
    curve, clear = start.curve, clear_of(start.blur)
    s = np.arange(0.0, curve.s[-1], _STATION_PX)
    reach = 0.6 * start.width + 2.0 * clear
    across = np.arange(-reach, reach, _LANE_PX)
    light = lanes(view.grey, curve, s, across, view.sign)
    if len(s) < 4 * _PARTS:
        return None
    at, low, high = [], [], []
    for part in np.array_split(np.arange(len(s)), _PARTS):
        profile = np.median(light[:, part], axis=1)
        both = _levels(across, profile, _NARROW * start.width, clear)
        if both is not None:
            at.append(s[part].mean())
            low.append(both[0])
            high.append(both[1])
    if len(at) < _LEAST_PARTS * _PARTS:
        return None
    middle = np.interp(s, at, 0.5 * (np.array(low) + np.array(high)))
    points, theta = curve.at(s)
    points = points + middle[:, None] * np.column_stack([-np.sin(theta), np.cos(theta)])
    wide = median(np.array(high) - np.array(low))
    return replace(candidate, points_px=points, width_px=wide)


def _levels(
    across: Array, profile: Array, narrow: float, clear: float
) -> tuple[float, float] | None:
    """Return where the darker of two levels begins and ends; None where one is seen."""
    dark, paper = float(profile.min()), float(profile.max())
    body = np.flatnonzero(profile < dark + _EDGE * (paper - dark))
    if body[0] == 0 or body[-1] == len(profile) - 1:
        return None  # a soft shade, that no edge was taken for
    low, high = across[body[[0, -1]]]
    inside = (across > low + clear) & (across < high - clear)
    if not inside.any() or np.ptp(profile[inside]) < _STEP * (paper - dark):
        return None  # as nearly all rods are: at no cost
    step = _step(across[inside], profile[inside], paper, narrow, clear)
    if step is None:
        return None
    place, rise = step
    return (float(low), place) if rise > 0.0 else (place, float(high))


def _step(
    across: Array, profile: Array, paper: float, narrow: float, clear: float
) -> tuple[float, float] | None:
    """Return where a profile goes from one level to another, and by how much.

    Each level is `narrow` at least; what lies within `clear` of the step is left out.
    """
    best, found = _CLEAR, None
    least = max(int(narrow / _LANE_PX), 3)
    gap = int(clear / _LANE_PX)
    for k in range(least, len(profile) - least + 1):
        left, right = (
            profile[: max(k - gap, least)],
            profile[min(k + gap, len(profile) - least) :],
        )
        levels = float(np.median(left)), float(np.median(right))
        rest = np.mean(np.abs(np.concatenate([left - levels[0], right - levels[1]])))
        step = levels[1] - levels[0]
        clearness = abs(step) / (float(rest) + 1e-4)
        if clearness > best and abs(step) > _STEP * (paper - min(levels)):
            best, found = clearness, (float(across[k] - 0.5 * _LANE_PX), step)
    return found
