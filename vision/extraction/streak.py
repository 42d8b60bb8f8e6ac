"""A rod that a streak of gloss parts along its length, and which was found in part.

A smooth rod mirrors the lamp in a line as long as itself, and may be as light there as
the paper. What is left and right of the line is dark and parallel all along, and the
width of both with the line between is the same everywhere. The light that the lamp adds
is fitted and taken off the picture: the rod is then seen as if it were matt.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.curve import Curve
from ..curve.robust import median, quantile
from ..edge.flank import median_profiles
from ..edge.highlight import fit_bars
from ..edge.lanes import lanes
from ..find.candidate import Candidate
from ..find.ground import View
from ..find.track import smooth_curve, start_curve
from .matt import Streak, matt
from .strip import Strip

Array = NDArray[np.float64]

_PARTS, _MOST_PARTS = 16, 0.6
"""Parts along the rod that are looked at; and the share of them that see a streak."""

_LOOKS, _LONGER_PX = 3, 1.0
"""So often a streak is looked at, along an axis that is known better each time, while
that becomes longer."""

_DEEP, _AS_DARK, _UNRESOLVED, _THIN_PX = 0.12, 0.12, 0.75, 5.0
"""How much darker than what is beside it a part must be, of the light from dark to
paper; by how much the light of both may differ, and where one is so thin that it is not
as dark as it is."""

_GAP, _STEADY, _SHADED = 1.0, 0.25, 1.15
"""Widest streak, over the wider of what lies beside it; how much its width may wander;
and the width of the whole, over that where it is least, that a shade makes."""

_LEAST_REACH_PX, _SLENDER = 40.0, 8.0
"""What is found may be a thin rim of a wide rod: how far across that is looked for, but
in a length of the rod so many times at most."""

_PAPER_PX, _BLUR_PX = 8.0, 1.2
_LANE_PX, _STATION_PX = 0.5, 3.0

_TWIN, _BRIGHT, _TURN = 0.6, 1.08, 0.5
"""Two rods side by side: of like width; the gap between them is hardly lighter than
paper; and where they are bent, by radians, their ends are not flush."""


class _Look(NamedTuple):
    """Profiles across a curve: medians of parts at arc lengths `at`, (parts, m)."""

    curve: Curve
    at: Array
    across: Array
    profiles: Array


def is_parted(strip: Strip) -> bool:
    """Whether most profiles have dark beyond something light, as seen from the axis.

    A quick question, to which nearly all rods say no.

    Parameters
    ----------
    strip : Strip
        Along a rod, or along the part of one on one side of a streak.
    """
    middle = int(np.searchsorted(strip.across, 0.0))
    fall = _falls(strip.profiles, middle)
    return bool((np.mean(fall > _DEEP, axis=1) >= _MOST_PARTS).any())


@njit(cache=True, error_model="numpy")
def _falls(profiles: Array, middle: int) -> Array:
    """Return by how much light falls at most outwards on each side, over its span."""
    most = np.zeros((2, len(profiles)))
    for k in range(len(profiles)):
        span = np.nanmax(profiles[k]) - np.nanmin(profiles[k])
        for side in range(2):
            outwards = profiles[k, middle:] if side else profiles[k, middle::-1]
            lightest = -np.inf
            for light in outwards:
                if light > lightest:
                    lightest = light
                elif lightest - light > most[side, k] * span:
                    most[side, k] = (lightest - light) / span
    return most


def whole_rod(view: View, candidate: Candidate) -> tuple[View, Candidate]:
    """Return a rod with all that a streak of gloss parted from it, without the streak.

    Parameters
    ----------
    view : View
        The picture.
    candidate : Candidate
        A rod, or the part of one on one side of a streak.

    Returns
    -------
    View
        The picture without the light of the streak.
    Candidate
        `rivalled` where what lies beyond the streak may be another rod. Both are the
        same where there is no streak.

    """
    one = replace(candidate, rivalled=candidate.rivalled or candidate.halved)
    if view.sign < 0.0:
        return view, one  # gloss makes a light rod lighter
    found, along, length = (view, one), candidate.points_px, 0.0
    for _ in range(_LOOKS):
        look = _look(view, along, candidate.width_px)
        streak = _streak(look)
        if streak is None:
            break
        whole = replace(
            candidate, points_px=streak.axis(), width_px=streak.width,
            rivalled=candidate.rivalled or _is_doubtful(streak),
        )  # fmt: skip
        found = matt(view, streak), whole
        start = start_curve(
            found[0].grey, whole.points_px, whole.width_px, sign=view.sign,
            follow=candidate.root == "clamp",
        )  # fmt: skip
        if start is None or start.curve.s[-1] < length + _LONGER_PX:
            break
        along, length = start.curve.points, float(start.curve.s[-1])
    return found


def _look(view: View, along: Array, width: float) -> _Look:
    """Return profiles across a polyline, as far out as the whole rod may reach."""
    curve = smooth_curve(along, spacing=max(2.0 * width, 16.0))
    s = np.arange(0.0, curve.s[-1], _STATION_PX)
    least = min(curve.s[-1] / _SLENDER, _LEAST_REACH_PX)
    reach = max(2.5 * width + 6.0, least)
    across = np.arange(-reach, reach, _LANE_PX)
    light = lanes(view.grey, curve, s, across, view.sign)
    bounds = np.linspace(0, len(s), min(_PARTS, len(s)) + 1).astype(np.int64)
    middle = 0.5 * (s[bounds[:-1]] + s[bounds[1:] - 1])
    return _Look(curve, middle, across, median_profiles(light.T, bounds))


def _streak(look: _Look) -> Streak | None:
    """Return the streak that most parts of a rod show."""
    sides = [_both_sides(look.across, profile) for profile in look.profiles]
    rows = np.array([k for k, both in enumerate(sides) if both is not None], np.intp)
    if len(rows) < _MOST_PARTS * _PARTS:
        return None
    near = np.array([both for both in sides if both is not None])
    gap = near[:, 2] - near[:, 1]
    alike = np.abs(gap - median(gap)) < _STEADY * median(gap) + 1.0
    rows, near = rows[alike], _narrowed(near[alike])
    wide = near[:, 3] - near[:, 0]
    steady = np.abs(wide - median(wide)) < _STEADY * median(wide)
    if np.count_nonzero(steady) < _MOST_PARTS * _PARTS:
        return None
    rows, near = rows[steady], near[steady]
    profiles, x = look.profiles[rows], look.across
    beyond = (x < near[:, :1] - _PAPER_PX) | (x > near[:, 3:] + _PAPER_PX)
    bars = fit_bars(x, np.where(beyond, np.nan, profiles), near, blur=_BLUR_PX)
    fitted = _narrowed(np.column_stack([bars.low, bars.first, bars.last, bars.high]))
    bars = bars._replace(low=fitted[:, 0], high=fitted[:, 3])
    return Streak(curve=look.curve, at=look.at[rows], bars=bars)


def _narrowed(edges: Array) -> Array:
    """Return low, first, last, high without the shade beside some parts of a rod."""
    low, first, last, high = edges.T
    wide = high - low
    width = quantile(wide, 0.25)
    shaded, below = wide > _SHADED * width, first - low > high - last
    low = np.where(shaded & below, high - width, low)
    high = np.where(shaded & ~below, low + width, high)
    return np.column_stack([low, first, last, high])


def _both_sides(across: Array, profile: Array) -> tuple[float, ...] | None:
    """Return low edge, both edges of the streak, and high edge of a parted rod.

    None where there are not two dark parts, or more than two that fit each other.
    """
    seen = np.isfinite(profile)
    if not seen.any():
        return None
    x, light = across[seen], profile[seen]
    least = _DEEP * float(np.ptp(light))
    turns, found = _turns(light, least), None
    for k in range(0, len(turns) - 4, 2):
        both = _parted(x, light, turns[k : k + 5])
        if both is not None and found is not None:
            return None  # dark on both sides of what is dark: lines, no streak
        found = found or both
    return found


def _turns(light: Array, least: float) -> list[int]:
    """Return where a profile is lightest and darkest in turn, by `least` and more.

    It begins and ends with a lightest place.
    """
    turns, lightest, darkest, rises = [], 0, 0, True
    for k, value in enumerate(light):
        if rises and value > light[lightest]:
            lightest = k
        elif rises and value < light[lightest] - least:
            turns.append(lightest)
            darkest, rises = k, False
        elif not rises and value < light[darkest]:
            darkest = k
        elif not rises and value > light[darkest] + least:
            turns.append(darkest)
            lightest, rises = k, True
    return [*turns, lightest] if rises else turns


def _parted(x: Array, light: Array, turns: list[int]) -> tuple[float, ...] | None:
    """Return the edges of two dark parts of one rod near 0; None if they are none.

    `turns` are paper, dark, streak, dark, paper. The wider part tells how dark it is.
    """
    left, one, streak, two, right = turns

    def crossing(dark: int, to: int) -> float:
        level, step = 0.5 * (light[dark] + light[to]), 1 if to > dark else -1
        k = dark
        while light[k] < level:
            k += step
        share = (level - light[k - step]) / (light[k] - light[k - step])
        return float(x[k - step] + share * (x[k] - x[k - step]))

    low, first = crossing(one, left), crossing(one, streak)
    last, high = crossing(two, streak), crossing(two, right)
    ends = sorted([(first - low, light[one]), (high - last, light[two])])
    (narrow, other), (wide, dark) = ends
    span = max(light[left], light[right]) - dark
    paler = _UNRESOLVED if narrow < _THIN_PX else _AS_DARK
    alike = -_AS_DARK * span < other - dark < paler * span
    here = low - 2.0 < 0.0 < high + 2.0
    if not (alike and here and last - first < _GAP * wide):
        return None
    return low, first, last, high


def _is_doubtful(streak: Streak) -> bool:
    """Whether what lies beyond a streak may be another rod, or a line beside this one.

    A line is all that can be told of what is thinner than the picture's blur.
    """
    bars = streak.bars
    thin, wide = sorted(streak.rims)
    paper = median(np.maximum(bars.left, bars.right))
    turn = abs(streak.curve.theta[-1] - streak.curve.theta[0])
    gap = median(bars.dark + bars.light) < _BRIGHT * paper and turn < _TURN
    return bool(thin < median(np.exp(bars.blur)) or (gap and thin > _TWIN * wide))
