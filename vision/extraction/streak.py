"""A rod that a streak of gloss parts along its length, and which was found in part.

A smooth rod mirrors the lamp in a line as long as itself, and may be as light there as
the paper. What is left and right of the line is dark, narrow, and parallel all along,
which two rods are not unless they are alike and bent alike.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..curve.curve import Curve
from ..curve.robust import median
from ..edge.step_line import lanes
from ..find.ground import View
from ..find.rod import Candidate
from ..find.track import smooth_curve

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_PARTS, _MOST_PARTS = 10, 0.7
"""Parts along the rod that are looked at; and the share of them that see a streak."""

_GAP = 0.8
"""Widest streak, over the wider of what lies beside it."""

_AS_DARK, _AS_DARK_RIM, _STEADY = 0.12, 0.4, 0.12
"""How far the light of both may differ, over that from dark to paper, and where one is
so narrow that blur makes it paler; and how much the outer edges may wander along the
rod, in widths of the whole."""

_RIM, _NARROW = 0.4, 0.6
"""Widths of the second part, over that of the first: of a rim, and above which it may
be a rod."""

_LANE_PX, _STATION_PX = 0.5, 3.0

_LIGHTER, _FLANK = 0.3, 0.6
"""A streak is lighter than what lies beside it by this share of its own light, and that
is darker than this share."""

_PAD = 4
"""Lanes beside a streak into which its blur reaches."""


def whole_rod(view: View, candidate: Candidate) -> tuple[View, Candidate]:
    """Return a rod with all that a streak of gloss parted from it, the streak painted.

    Parameters
    ----------
    view : View
        The picture.
    candidate : Candidate
        A rod, or the part of one on one side of a streak.

    Returns
    -------
    View
        The picture in which the streak is as dark as the rod.
    Candidate
        `rivalled` where the part beyond the streak is so wide that it may be another
        rod. Both are the same where there is no streak.

    """
    width = candidate.width_px
    curve = smooth_curve(candidate.points_px, spacing=max(2.0 * width, 16.0))
    s = np.arange(0.0, curve.s[-1], _STATION_PX)
    reach = 2.5 * width + 6.0
    across = np.arange(-reach, reach, _LANE_PX)
    light = lanes(view.grey, curve, s, across, view.sign)
    found = []
    for part in np.array_split(np.arange(len(s)), min(_PARTS, len(s))):
        both = _both_sides(across, np.median(light[:, part], axis=1))
        if both is not None:
            found.append((s[part].mean(), *both))
    one = replace(candidate, rivalled=candidate.rivalled or candidate.halved)
    if len(found) < _MOST_PARTS * _PARTS:
        return view, one
    at, low, first, last, high, second, dark = np.array(found).T
    wide = median(high - low)
    if max(np.std(low), np.std(high)) >= _STEADY * wide:
        return view, one
    points, theta = curve.at(s)
    normals = np.column_stack([-np.sin(theta), np.cos(theta)])

    def along(offset: Array) -> Array:
        return np.asarray(points + np.interp(s, at, offset)[:, None] * normals)

    offsets = np.array([low, first, last, high])
    grey = _painted(view, curve, at, offsets, median(dark))
    rivalled = candidate.rivalled or median(second) > _NARROW
    whole = replace(
        candidate, points_px=along(0.5 * (low + high)), width_px=wide,
        rivalled=rivalled,
    )  # fmt: skip
    return replace(view, grey=grey), whole


def _painted(view: View, curve: Curve, at: Array, offsets: Array, dark: float) -> Image:
    """Return a picture in which a streak is as dark as its rod, from end to end.

    `offsets`, shape (4, n), are those of low edge, streak and high edge at `at`; the
    curve may be shorter than the rod: the streak is where it lies between dark parts.
    """
    room = 3.0 * float(np.median(offsets[3] - offsets[0]))
    s = np.arange(-room, curve.s[-1] + room)
    points, theta = curve.at(s)
    normals = np.column_stack([-np.sin(theta), np.cos(theta)])
    low, first, last, high = (np.interp(s, at, offset) for offset in offsets)

    def light(offset: Array) -> Array:
        x, y = np.rint(points + offset[:, None] * normals).astype(int).T
        height, width = view.grey.shape
        inside = view.grey[y.clip(0, height - 1), x.clip(0, width - 1)]
        return np.asarray(view.sign * inside, np.float64)

    beside = np.maximum(light(0.5 * (low + first)), light(0.5 * (last + high)))
    streak = light(0.5 * (first + last))
    span = median(streak) - dark
    on = (streak - beside > _LIGHTER * span) & (beside - dark < _FLANK * span)
    grey = view.grey.copy()
    ends = np.flatnonzero(np.diff(on.astype(np.int8), prepend=0, append=0))
    for begin, end in ends.reshape(-1, 2):
        left, right = (
            (points + offset[:, None] * normals)[begin:end] for offset in (first, last)
        )
        corners = np.round(np.vstack([left, right[::-1]]) * 16.0).astype(np.int32)
        cv2.fillPoly(grey, [corners.reshape(-1, 1, 2)], view.sign * dark, shift=4)
    return grey


def _both_sides(across: Array, profile: Array) -> tuple[float, ...] | None:
    """Return low edge, streak, high edge, likeness and light of two dark parts.

    Of the streak both edges, in which its blur lies; likeness is the narrower part's
    width over the wider one's. None where there are not two such parts.
    """
    if np.isnan(profile).all():
        return None  # the part lies beyond the picture
    dark, paper = float(np.nanmin(profile)), float(np.nanquantile(profile, 0.9))
    below = np.concatenate([[False], profile < 0.5 * (dark + paper), [False]])
    runs = np.flatnonzero(np.diff(below.astype(np.int8))).reshape(-1, 2)
    if len(runs) < 2:
        return None
    middle = int(np.searchsorted(across, 0.0))
    away = np.maximum(runs[:, 0] - middle, middle - runs[:, 1])
    nearest = int(np.argmin(away))
    found = None
    for low in (nearest - 1, nearest):
        if (
            low < 0
            or low + 1 >= len(runs)
            or not _one_rod(runs[low : low + 2], profile)
        ):
            continue
        if found is not None:
            return None  # dark on both sides of what is dark: lines, no streak
        (first, last), (begin, end) = runs[low], runs[low + 1]
        sizes = sorted([last - first, end - begin])
        pads = [min(_PAD, size - _PAD) for size in (last - first, end - begin)]
        inner = max(last - max(pads[0], 0), first), min(begin + max(pads[1], 0), end)
        found = (
            float(across[first]), float(across[inner[0]]),
            float(across[inner[1] - 1]), float(across[end - 1]),
            sizes[0] / sizes[1], dark,
        )  # fmt: skip
    return found


def _one_rod(runs: NDArray[np.intp], profile: Array) -> bool:
    """Whether two runs of dark are what a streak of gloss leaves of a rod."""
    (first, last), (begin, end) = runs
    narrow, wide = sorted([last - first, end - begin])
    levels = abs(profile[first:last].min() - profile[begin:end].min())
    span = float(np.nanquantile(profile, 0.9)) - float(np.nanmin(profile))
    differ = _AS_DARK_RIM if narrow < _RIM * wide else _AS_DARK
    inside = first > 0 and end < len(profile)
    return bool(inside and levels < differ * span and begin - last < _GAP * wide)
