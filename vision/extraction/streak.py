"""A rod that a streak of gloss parts along its length, and which was found in part.

A smooth rod mirrors the lamp in a line as long as itself, and may be as light there as
the paper. What is left and right of the line is dark, narrow, and parallel all along,
which two rods are not unless they are alike and bent alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..curve.robust import median, quantile
from ..find.ground import View
from ..find.rod import Candidate
from ..find.track import smooth_curve
from .strip import PARTS, Strip, profiles

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_MOST_PARTS = 0.7
"""Share of the parts along the rod that see a streak."""

_GAP = 0.8
"""Widest streak, over the wider of what lies beside it."""

_AS_DARK, _AS_DARK_RIM, _STEADY = 0.12, 0.4, 0.12
"""How far the light of both may differ, over that from dark to paper, and where one is
so narrow that blur makes it paler; and how much the outer edges may wander along the
rod, in widths of the whole."""

_RIM, _NARROW = 0.4, 0.6
"""Widths of the second part, over that of the first: of a rim, and above which it may
be a rod."""

_LIGHTER, _FLANK = 0.3, 0.6
"""A streak is lighter than what lies beside it by this share of its own light, and that
is darker than this share."""

_PAD = 4
"""Lanes beside a streak into which its blur reaches."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Streak:
    """A streak of gloss along a strip, and the dark to either side of it.

    Parameters
    ----------
    s : ndarray, shape (n,)
        Arc lengths of the parts in which it is seen, px.
    edges : ndarray, shape (4, n)
        Offsets from the strip's axis, px: low edge of the rod, both edges of the
        streak, in which its blur lies, and high edge.
    likeness : float
        Width of the narrower dark part over that of the wider one.
    dark : float
        Light of the rod.
    """

    s: Array
    edges: Array
    likeness: float
    dark: float


def find_streak(strip: Strip) -> Streak | None:
    """Return the streak of gloss that parts a rod all along; None where there is none.

    Parameters
    ----------
    strip : Strip
        Along a rod, or along the part of one on one side of a streak.
    """
    across = strip.across * strip.width
    light = profiles(strip)
    darkest = np.fmin.reduce(light, axis=1)
    paper = np.array([quantile(profile, 0.9) for profile in light])
    below = np.zeros((PARTS, len(across) + 2), np.bool_)
    below[:, 1:-1] = light < 0.5 * (darkest + paper)[:, None]
    parted = np.flatnonzero((below[:, 1:] & ~below[:, :-1]).sum(axis=1) > 1)
    if len(parted) < _MOST_PARTS * PARTS:
        return None  # as nearly all rods are: at no cost
    middle = strip.s.reshape(PARTS, -1).mean(axis=1)
    found = []
    for k in parted:
        runs = np.flatnonzero(below[k, 1:] != below[k, :-1]).reshape(-1, 2)
        both = _both_sides(across, light[k], runs, paper[k] - darkest[k])
        if both is not None:
            found.append((middle[k], *both, darkest[k]))
    if len(found) < _MOST_PARTS * PARTS:
        return None
    s, *edges, likeness, dark = np.array(found).T
    wide = median(edges[3] - edges[0])
    if max(np.std(edges[0]), np.std(edges[3])) >= _STEADY * wide:
        return None
    return Streak(
        s=s, edges=np.array(edges), likeness=median(likeness), dark=median(dark)
    )


def whole_rod(
    view: View, candidate: Candidate, strip: Strip, streak: Streak
) -> tuple[View, Candidate]:
    """Return a rod with all that a streak of gloss parted from it, the streak painted.

    Parameters
    ----------
    view, candidate : View, Candidate
        The picture, and a rod, or the part of one on one side of a streak.
    strip, streak : Strip, Streak
        The strip along the candidate, and the streak in it.

    Returns
    -------
    View
        The picture in which the streak is as dark as the rod.
    Candidate
        `rivalled` where the part beyond the streak is so wide that it may be another
        rod.
    """
    low, _, _, high = streak.edges
    middle = 0.5 * (low + high)
    whole = replace(
        candidate, points_px=strip.beside(np.interp(strip.s, streak.s, middle)),
        width_px=median(high - low),
        rivalled=candidate.rivalled or streak.likeness > _NARROW,
    )  # fmt: skip
    aside = replace(streak, edges=streak.edges - middle)
    return replace(view, grey=_painted(view, whole, strip.s[-1], aside)), whole


def _painted(view: View, whole: Candidate, length: float, streak: Streak) -> Image:
    """Return a picture in which a streak is as dark as its rod, from end to end.

    `length` is that of the strip in which the streak was found: the rod may be longer,
    and the streak is where it lies between dark parts.
    """
    width, room = whole.width_px, 3.0 * whole.width_px
    curve = smooth_curve(whole.points_px, spacing=max(2.0 * width, 16.0))
    s = np.arange(-room, curve.s[-1] + room)
    points, theta = curve.at(s)
    normals = np.column_stack([-np.sin(theta), np.cos(theta)])
    at = streak.s * (curve.s[-1] / length)
    low, first, last, high = (np.interp(s, at, edge) for edge in streak.edges)

    def light(offset: Array) -> Array:
        x, y = np.rint(points + offset[:, None] * normals).astype(int).T
        height, width = view.grey.shape
        seen = view.grey[y.clip(0, height - 1), x.clip(0, width - 1)]
        return np.asarray(view.sign * seen, np.float64)

    beside = np.maximum(light(0.5 * (low + first)), light(0.5 * (last + high)))
    inside = light(0.5 * (first + last))
    dark, span = streak.dark, median(inside) - streak.dark
    on = (inside - beside > _LIGHTER * span) & (beside - dark < _FLANK * span)
    grey = view.grey.copy()
    ends = np.flatnonzero(np.diff(on.astype(np.int8), prepend=0, append=0))
    for begin, end in ends.reshape(-1, 2):
        left, right = (
            (points + offset[:, None] * normals)[begin:end] for offset in (first, last)
        )
        corners = np.round(np.vstack([left, right[::-1]]) * 16.0).astype(np.int32)
        cv2.fillPoly(grey, [corners.reshape(-1, 1, 2)], view.sign * dark, shift=4)
    return grey


def _both_sides(
    across: Array, profile: Array, runs: NDArray[np.intp], span: float
) -> tuple[float, ...] | None:
    """Return low edge, streak, high edge, and likeness of two dark runs of a profile.

    Of the streak both edges, in which its blur lies; likeness is the narrower part's
    width over the wider one's. None where there are not two such parts.
    """
    middle = int(np.searchsorted(across, 0.0))
    away = np.maximum(runs[:, 0] - middle, middle - runs[:, 1])
    nearest = int(np.argmin(away))
    found = None
    for low in (nearest - 1, nearest):
        if (
            low < 0
            or low + 1 >= len(runs)
            or not _one_rod(runs[low : low + 2], profile, span)
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
            sizes[0] / sizes[1],
        )  # fmt: skip
    return found


def _one_rod(runs: NDArray[np.intp], profile: Array, span: float) -> bool:
    """Whether two runs of dark are what a streak of gloss leaves of a rod."""
    (first, last), (begin, end) = runs
    narrow, wide = sorted([last - first, end - begin])
    levels = abs(profile[first:last].min() - profile[begin:end].min())
    differ = _AS_DARK_RIM if narrow < _RIM * wide else _AS_DARK
    inside = first > 0 and end < len(profile)
    return bool(inside and levels < differ * span and begin - last < _GAP * wide)
