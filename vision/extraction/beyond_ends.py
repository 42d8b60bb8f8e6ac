"""What lies beyond the two ends of what was measured: a clamp and paper, or more rod.

A rod whose outer part is paler, or in another colour, seems to end where that begins;
one that something of the paper's light lies over (a label, a thread, a white mark)
seems to end at the near side of that; and a bar that lies across it, or a clamp too
pale to be seen, leaves only a part of it, or turns it round.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.robust import median, quantile, quantiles
from ..edge.lanes import lanes
from ..edge.levels import clear_of
from ..edge.state import LostError, Root
from ..find.ground import View
from ..find.held import seen_behind
from ..picture.photo import Photo
from .refine import Refined
from .strip import GRID, Strip, along_rod

Array = NDArray[np.float64]

PALER_TIP, TINTED_TIP = 0.12, 0.15
"""Step to either side beyond the tip, over the rod's, that a shade does not have; and
one in the difference of two colours, over the paper's light in each."""

_FURTHER = 1.5, 2.5
"""So many widths beyond a tip a paler part still goes on, and hardly a tip's shade."""

_SHARP = 0.7
"""What of the step over twice an edge's breadth lies in it, at least: a soft shade has
half."""

_LEAST, _MOST = 0.6 * GRID, 1.5 * GRID
"""Width of another part of the rod, in lanes: it may be met at a slant."""

_AS_DARK = 0.5
"""Its contrast over the rod's, at least."""

_STATIONS, _DRIFT = 13, 0.15 * GRID
"""So many profiles in a row see it, as more than a speck; and from one to the next it
moves aside by no more lanes than that."""

_BEHIND = 0.6, 1.5
"""How far beyond an end a body is looked for, in widths."""

_FORE = 1.0, 3.0
"""Where along the rod, from its end, there is paper beside it, in widths."""

_WIDE = 1.25
"""A body reaches so far to either side of the axis, in widths."""

_OTHER, _OTHER_DARK = 0.12, 0.3
"""Its light differs from the paper's by more than this share of the rod's contrast; or,
on a dark board, of the board's own light: a black clamp there is far from a pale rod,
and so is the board.
"""

_BODY_PX = 4.0
"""How much of a body is looked at."""

_BODY_DARK, _EVEN = 0.3, 0.2
"""A body at a tip is darker than the paper by more than this share, all across; and so
even, as a share of the contrast, or of its own step where that may be faint."""


def check_ends(
    photo: Photo, view: View, strip: Strip, refined: Refined, *, root: Root
) -> None:
    """Refuse a rod in a clamp whose root is on bare paper, or whose tip meets a body.

    A clamp may be as light as the paper in the light that tells the rod best, but
    hardly in all colours; and what goes on behind it is no rod where they say so. What
    enters at the border and ends at a body is a rod whose tip is not in the picture,
    turned round.

    Raises
    ------
    LostError
        With flag and reason.
    """
    axis, width = refined.fit.curve.points, refined.typical_width
    goes_on = refined.clamp is not None and (refined.rough or _goes_on_behind(strip))
    if goes_on and seen_behind(photo, axis, width):
        raise LostError(
            "touches_object",
            "what looks like a rod goes on behind what it grows from: something "
            "crosses it, or is crossed by it",
        )
    if refined.rough:
        return
    if root == "border" and _ends_at_front(strip, refined):
        raise LostError(
            "touches_border",
            "the rod runs from the picture's border to something wide, such as a "
            "clamp: take its free end into the picture, or what lies there away",
        )
    if refined.clamp is None:
        return
    if _on_paper([strip], refined) and _on_paper(
        _colours(photo, view, refined), refined
    ):
        raise LostError(
            "no_clamp",
            "what looks like a rod begins on bare paper: no clamp is seen there",
        )
    if _tip_at_body(strip, refined):
        raise LostError(
            "touches_object",
            "something as dark as the rod lies at its tip: take it away",
        )


def _colours(photo: Photo, view: View, refined: Refined) -> list[Strip]:
    """Return strips in each colour, or in the grey of a picture that has none."""
    colour = photo.colour()
    light = [photo.grey] if colour is None else np.moveaxis(colour, 2, 0)
    return [
        along_rod(replace(view, grey=np.ascontiguousarray(each)), refined)
        for each in light
    ]


def _on_paper(strips: list[Strip], refined: Refined) -> bool:
    """Whether there is paper, in no shade, on both sides behind a root.

    What is seen in several colours is as far from the paper as all of them tell.
    """
    width = refined.typical_width
    off, rod, ground = [], [], []
    for strip in strips:
        sides = _sides(strip, refined)
        along = strip.between(0.0, refined.fit.curve.s[-1])
        behind = strip.between(-_BEHIND[1] * width, -_BEHIND[0] * width)
        paper = quantile(sides[:, :, along].ravel(), 0.8)
        off.append([median(side[:, behind].ravel()) - paper for side in sides])
        rod.append(paper - median(strip.lanes(0.0)[0, along]))
        ground.append(paper)
    away, least = np.linalg.norm(off, axis=0), _OTHER * np.linalg.norm(rod)
    if max(ground) < 0.0:  # of a light rod, light is counted downwards
        least = min(least, _OTHER_DARK * np.linalg.norm(ground))
    return bool(np.all(away < least))


def _tip_at_body(strip: Strip, refined: Refined) -> bool:
    """Whether all is dark right beyond a tip, from one side to the other."""
    rod, beside, level = _around_tip(strip, refined)
    paper = quantile(beside.ravel(), 0.5)
    contrast = paper - rod
    dark = np.all(paper - level > _BODY_DARK * contrast)
    return bool(dark and np.ptp(level) < _EVEN * contrast)


def _ends_at_front(strip: Strip, refined: Refined) -> bool:
    """Whether beyond a tip, from one side to the other, lies evenly another light.

    It differs from the paper on either side of the rod: one may be in shade, which
    ends where the rod does. The shade of a tip is no even one.
    """
    rod, beside, level = _around_tip(strip, refined)
    papers = np.array([median(side.ravel()) for side in beside])
    least = _OTHER * (papers.mean() - rod)
    if papers.mean() < 0.0:  # see `_OTHER_DARK`
        least = min(least, -_OTHER_DARK * papers.mean())
    step = float(np.abs(papers - median(level)).min())
    return bool(step > least and np.ptp(level) < _EVEN * step)


def _around_tip(strip: Strip, refined: Refined) -> tuple[float, Array, Array]:
    """Return the light on a rod before its tip, beside it there, and right beyond."""
    width, end = refined.typical_width, refined.fit.curve.s[-1]
    fore = strip.between(end - _FORE[1] * width, end - _FORE[0] * width)
    near = end + clear_of(refined.blur) + 1.0
    body = strip.between(near, near + _BODY_PX)
    across = strip.lanes(*np.linspace(-_WIDE, _WIDE, 7))
    level = quantiles(across[:, body], 0.5)
    rod = median(strip.lanes(0.0)[0, fore])
    return rod, _sides(strip, refined)[:, :, fore], level


def _sides(strip: Strip, refined: Refined) -> Array:
    """Return the light on three lanes at both sides of the axis, shape (2, 3, n)."""
    away = 0.5 + (clear_of(refined.blur) + 2.0) / strip.width
    far = np.linspace(away, max(away + 2.0 / strip.width, _WIDE), 3)
    return strip.lanes(*-far, *far).reshape(2, 3, -1)


def tip_goes_on(photo: Photo, strip: Strip, refined: Refined) -> bool:
    """Whether something as wide as the rod goes on beyond its tip.

    Then it may be the rod, paler, in another colour, or on the other side of the
    paper's light; a shade has softer edges, and darkens all colours alike.
    """
    width, end = refined.typical_width, refined.fit.curve.s[-1]
    beside = 0.5 + 4.0 / width
    across = strip.lanes(-beside, -0.25, 0.0, 0.25, beside)
    near, far = max(0.4 * width, 4.0), 1.2 * width + 4.0
    before = across[:, strip.between(end - far, end - near)]
    paler = PALER_TIP * (median(before[::4].ravel()) - median(before[1:4].ravel()))
    beyond = across[:, strip.between(end + near, end + far)]
    if max(_step_aside(beyond), _lit_aside(beyond)) > paler:
        return True
    return _sharp_edge(strip, end) > paler or _tinted(photo, refined)


def _step_aside(light: Array) -> float:
    """Return the lesser step from the middle three of five lanes to either side."""
    step = np.minimum(light[0], light[4]) - light[1:4].max(axis=0)
    return quantile(step, 0.25)


def _lit_aside(light: Array) -> float:
    """Return the same downwards; a lamp leaves one of the three as light as paper."""
    step = np.median(light[1:4], axis=0) - np.maximum(light[0], light[4])
    return quantile(step, 0.25)


def _sharp_edge(strip: Strip, end: float) -> float:
    """Return the step of an edge that goes on well beyond a tip, in line with one side.

    The other side may lie in the rod's own shade, darker than a paler part itself.
    """
    first, last = _FURTHER
    beyond = strip.between(end + first * strip.width, end + last * strip.width)
    # Lanes from within the rod to clear of it, over which five places of the edge lie.
    out = np.arange(0.0, 1.0 + 0.5 / GRID, 1.0 / GRID)
    light = strip.lanes(*-out, *out)[:, beyond].reshape(2, len(out), -1)
    deep, inner, outer, away = (
        light[:, lane : lane + 5] for lane in (0, 1, 3, 4)
    )  # fmt: skip
    step = outer - inner
    sharp = np.where(step > _SHARP * (away - deep), step, 0.0)
    return float(quantiles(sharp.reshape(-1, sharp.shape[2]), 0.25).max())


def _tinted(photo: Photo, refined: Refined) -> bool:
    """Whether something in another colour, as wide as the rod, goes on beyond a tip.

    Or lighter in each colour than what lies beside it: a white part is no shade, and
    looks like the paper where shade does.
    """
    curve, width = refined.fit.curve, refined.typical_width
    half = round(2.0 * width) + 12
    x, y = (max(round(float(part)) - half, 0) for part in curve.points[-1])
    around = photo.colour((slice(y, y + 2 * half), slice(x, x + 2 * half)))
    if around is None:
        return False
    near = curve._replace(points=curve.points - np.array([x, y]))
    beside = 0.5 * width + 4.0
    across = np.array([-beside, -0.25 * width, 0.0, 0.25 * width, beside])
    s = curve.s[-1] + clear_of(refined.blur) + np.linspace(0.0, 0.2 * width, 9)
    light = around / np.maximum(np.median(around, axis=(0, 1)), 1e-3)
    blue, green, red = (
        lanes(np.ascontiguousarray(each), near, s, across)
        for each in np.moveaxis(light, 2, 0)
    )
    if _lit_aside(np.minimum(np.minimum(blue, green), red)) > TINTED_TIP:
        return True
    return any(
        _step_aside(sign * (one - other)) > TINTED_TIP
        for one, other in ((blue, green), (green, red), (red, blue))
        for sign in (-1.0, 1.0)
    )


def goes_on_after_gap(strip: Strip, refined: Refined) -> bool:
    """Whether something as wide and as dark as a rod begins again beyond its tip."""
    tip = int(np.searchsorted(strip.s, refined.fit.curve.s[-1] - 1e-6))
    return _begins_again(strip.light[:, tip - 2 * GRID :])


def _goes_on_behind(strip: Strip) -> bool:
    """Whether a rod begins again behind its root, which is then crossed there."""
    root = strip.between(0.0, 2.0 * strip.width).stop
    return _begins_again(strip.light[:, root - 1 :: -1])


def _begins_again(light: Array) -> bool:
    """Whether beyond the last two widths of a rod, on which lanes begin, is another."""
    axis = len(light) // 2
    rod, paper = (
        median(light[[axis - aside, axis + aside], : GRID + 1].ravel())
        for aside in (GRID // 4, GRID)
    )
    dark = light[:, 3 * GRID :] < paper - _AS_DARK * (paper - rod)
    return bool(dark.any() and _followed(np.ascontiguousarray(dark)) >= _STATIONS)


@njit(cache=True)
def _followed(dark: NDArray[np.bool_]) -> int:
    """Return over how many profiles in a row something as wide as a rod goes on."""
    lanes, stations = dark.shape
    last, seen, most = np.nan, 0, 0
    for j in range(stations):
        first, nearest, i = np.nan, np.nan, 0
        while i < lanes:
            begin = i
            while i < lanes and dark[i, j]:
                i += 1
            # What reaches an end of the profile may be of any width.
            if begin > 0 and i < lanes and _LEAST < i - begin < _MOST:
                middle = 0.5 * (begin + i)
                if np.isnan(first):
                    first = middle
                if np.isnan(nearest) or abs(middle - last) < abs(nearest - last):
                    nearest = middle
            i += 1
        if seen > 0 and abs(nearest - last) < _DRIFT:
            last, seen = nearest, seen + 1
        else:
            last, seen = first, 0 if np.isnan(first) else 1
        most = max(most, seen)
    return most
