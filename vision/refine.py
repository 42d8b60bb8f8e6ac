"""Edge passes: edges, ends and curve in turn, until nothing moves any more."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..core.jit import njit
from .centreline_fit import SHARED, CurveFit, fit_curve
from .clamp import ClampLines, find_clamp
from .curve import Curve
from .edges import Edges, find_edges, level_span
from .joints import find_joints
from .moment import weighed_fit
from .robust import median
from .rod import Root
from .spline import Smooth
from .tip import EndFace, find_tip
from .track import Start

Array = NDArray[np.float64]
Image = NDArray[np.float32]
Walls = Callable[[Array, Array, float], Array]

_PASSES = 5
_ROUGH_PASSES = 2
"""Passes that only seek the rod, on every other station and with a supple curve."""
_STILL_PX = 0.1
_BIN_PX = 4.0
_BINS = 200
"""Stations are averaged over bins before the fit: so far, or so many on a long rod."""

APART_PX = 2.0
"""The two lines at a clamp tell different things if they are farther apart."""

ROOT_CLEAR = 0.3
"""Widths next to the clamp that are left out of the fit."""

WALL_LIGHT = 0.17
"""Light of a side wall that is seen: above the top's, over the paper's above the top's.

The camera grazes the wall, which there mirrors the paper (Fresnel); beside the clamp it
mirrors the dark clamp, and the light grows from there as 1 - exp(-s / width). Found on
35 path-traced photographs by two renderers.
"""
WALL_PLACES = 25


class LostError(Exception):
    """The edges or an end of the rod got lost; private to this package.

    Parameters
    ----------
    flag, reason : str
        As in `Measurement`.
    """

    def __init__(self, flag: str, reason: str) -> None:
        super().__init__(reason)
        self.flag = flag
        self.reason = reason


@dataclass(frozen=True, slots=True, kw_only=True)
class Refined:
    """A rod measured in pixels.

    Parameters
    ----------
    fit : CurveFit
        The axis from where the clamp line was taken (s = 0) to the tip's face.
    shaded : ndarray, shape (n,)
        By how much shade on the paper would have moved the midline, uncorrected, px.
    good : ndarray of bool, shape (n,)
        Points of the fit whose edges were used.
    width : ndarray, shape (n,)
        Smoothed width.
    sigma_width : ndarray, shape (n,)
        Its standard deviation.
    tip : EndFace
        The free end; s counts as in `fit`.
    clamp : ClampLines or None
        Lines at the clamp; None for a rod that enters at the border or floats.
    """

    fit: CurveFit
    shaded: Array
    good: NDArray[np.bool_]
    width: Array
    sigma_width: Array
    tip: EndFace
    clamp: ClampLines | None

    @property
    def typical_width(self) -> float:
        """Median width where edges were used."""
        return median(self.width[self.good])


@dataclass(slots=True)
class _State:
    """What a pass hands to the next: the curve, half widths along it, and the ends."""

    curve: Curve
    half: Array
    width: float
    first: float
    last: float
    face_px: float
    blur: float = 1.0
    scatter: float = 0.0
    fuzz: float = 0.0


@dataclass(frozen=True, slots=True)
class _Seen:
    """Edges at stations along a curve, and which of them are to be trusted."""

    s: Array
    theta: Array
    edges: Edges
    good: NDArray[np.bool_]


def refine(
    grey: Image,
    start: Start,
    *,
    root: Root,
    sign: float,
    joints: Callable[[Curve], Sequence[float]] = lambda _curve: (),
    walls: Walls | None = None,
    face_px: float = 0.0,
) -> Refined:
    """Measure axis, edges and ends.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    start : Start
        Curve within a pixel or two of the axis.
    root : {"clamp", "border", "free"}
        What the rod grows from.
    sign : float
        -1 for a light rod.
    joints : callable
        Arc lengths in px, from the root, of joints on a given curve.
    walls : callable, optional
        How wide the side walls are seen at points and angles of the axis, for a given
        width of the rod, px; positive where seen on the left.
    face_px : float
        How much of a clamp's face the camera may see, along the rod.

    Raises
    ------
    LostError
        If edges or ends cannot be found.
    """
    half = np.full(len(start.curve.s), 0.5 * start.width)
    last = float(start.curve.s[-1])
    state = _State(start.curve, half, start.width, 0.0, last, face_px)
    for turn in range(_PASSES):
        length = state.last
        result, first = _pass(grey, state, root, sign, joints, walls, turn)
        still = abs(state.last - length) + abs(first) < _STILL_PX
        if turn >= _ROUGH_PASSES and still:
            break
    return result


def _pass(
    grey: Image, state: _State, root: Root, sign: float,
    joints: Callable[[Curve], Sequence[float]], walls: Walls | None, turn: int,
) -> tuple[Refined, float]:  # fmt: skip
    """Return what is seen along the curve, and where on it the rod begins."""
    seen = _look(grey, state, sign, turn)
    tip, lines, first = _ends(grey, state, seen, root, sign, turn)
    clamped = root == "clamp"
    if walls is not None:
        seen = _to_wall_ends(state, seen, first, walls, clamped=clamped)
    fit, used = _fit(state, seen, first, tip.s, joints, turn, clamped=clamped)
    at = fit.curve.s + first
    smooth, sigma = _smooth_width(seen, at, state.width)
    shaded = np.interp(at, seen.s, seen.edges.shaded(state.blur))
    state.curve, state.half = fit.curve, 0.5 * smooth
    state.first, state.last = 0.0, float(fit.curve.s[-1])
    return Refined(
        fit=fit, shaded=shaded, good=used, width=smooth, sigma_width=sigma,
        tip=replace(tip, s=tip.s - first),
        clamp=None if lines is None else _shifted(lines, first),
    ), first  # fmt: skip


def _look(grey: Image, state: _State, sign: float, turn: int) -> _Seen:
    """Find the edges along the curve; know its width, blur and roughness after."""
    width = state.width
    step = 2.0 if turn < _ROUGH_PASSES else 1.0
    s = np.linspace(0.0, state.curve.s[-1], int(state.curve.s[-1] / step) + 1)
    points, theta = state.curve.at(s)
    normals = np.column_stack([-np.sin(theta), np.cos(theta)])
    half = np.interp(s, state.curve.s, state.half)
    # At first the edges lie where they are expected to a pixel or two.
    reach, fuzz = min(0.35 * width, 6.0 + 0.1 * width), min(0.1 * width, 3.0)
    if turn:
        fuzz = 4.0 * state.scatter
        reach = min(max(3.0, 3.0 * state.blur, 3.0 * fuzz), 0.45 * width)
    state.fuzz = fuzz
    edges = find_edges(
        grey, points, normals, -half, half,
        reach=reach, blur=state.blur, fuzz=fuzz, sign=sign, smooth=int(6.0 / step),
    )  # fmt: skip
    good = edges.usable()
    if good.sum() < max(8.0, 0.4 * len(good)):
        raise LostError(
            "edges_lost",
            "less than half of the rod has two edges that can be told from the paper",
        )
    state.width = median(edges.width[good])
    blur = edges.blur
    state.blur = float(np.clip(blur, 0.3, 0.5 * state.width)) if blur > 0 else 1.0
    state.scatter = _scatter(edges, int(5.0 / step))
    return _Seen(s, theta, edges, good)


def _scatter(edges: Edges, lag: int) -> float:
    """Return how much an edge jumps from one station to one about 5 px on, px."""
    low, high = edges.low, edges.high
    jump = median(
        np.abs(np.concatenate([low[lag:] - low[:-lag], high[lag:] - high[:-lag]]))
    )
    return 1.05 * jump if jump > 0.0 else 0.0


def _ends(
    grey: Image, state: _State, seen: _Seen, root: Root, sign: float, turn: int
) -> tuple[EndFace, ClampLines | None, float]:  # fmt: skip
    curve, width = state.curve, state.width
    outwards = 0.4 * width if turn == 0 else 0.0
    reach = 1.3 * width if turn == 0 else 0.3 * width + 2.0
    edges = seen.edges
    near = seen.good & (seen.s > curve.s[-1] - 3.0 * width)
    middle = median(edges.middle[near]) if near.any() and turn == 0 else 0.0
    end = seen.good & (seen.s > curve.s[-1] - 1.5 * width)
    taper = median(edges.width[end]) if end.sum() > 3 else width
    tip = find_tip(
        grey, curve, expected=state.last + outwards, width=min(width, taper),
        blur=state.blur, reach=reach, middle=middle, sign=sign,
    )  # fmt: skip
    if tip is None:
        raise LostError("no_tip", "the free end of the rod has no edge")
    if root == "border":
        return tip, None, _border_crossing(grey, curve)
    if root == "free":
        return tip, None, _other_end(grey, state, sign, outwards, reach)
    lines = find_clamp(
        grey, curve, expected=state.first - (0.25 * width if turn == 0 else 0.0),
        width=width, blur=state.blur, contrast=edges.contrast,
        reach=1.3 * width if turn == 0 else 0.3 * width + 3.0, sign=sign,
    )  # fmt: skip
    line = lines.face or lines.front
    if line is None:
        raise LostError("no_clamp", "it is not seen where the rod leaves the clamp")
    if lines.front is not None and is_face(lines.front.s - line.s, state.face_px):
        line = lines.front  # what has edges between them is no rod
    return tip, lines, line.s


def is_face(apart: float, face_px: float) -> bool:
    """Whether what lies between the two lines at a clamp is its face, seen obliquely.

    It may be as dark as the rod, which then seems to end at the face's top edge.
    """
    return APART_PX < apart < APART_PX + face_px


def _other_end(
    grey: Image, state: _State, sign: float, outwards: float, reach: float
) -> float:
    curve = state.curve
    back = Curve(
        s=-curve.s[::-1], points=curve.points[::-1], theta=curve.theta[::-1] + np.pi,
        kappa=-curve.kappa[::-1],
    )  # fmt: skip
    end = find_tip(
        grey, back, expected=outwards - state.first, width=state.width,
        blur=state.blur, reach=reach, sign=sign,
    )  # fmt: skip
    if end is None:
        raise LostError("no_tip", "an end of the rod has no edge")
    return -end.s


def _border_crossing(grey: Image, curve: Curve) -> float:
    """Return the arc length at which the axis enters the picture."""
    s = np.arange(-80.0, min(80.0, curve.s[-1]), 0.25)
    points, _ = curve.at(s)
    height, width = grey.shape
    inside = (
        (points[:, 0] >= 0.0) & (points[:, 0] <= width - 1.0)
        & (points[:, 1] >= 0.0) & (points[:, 1] <= height - 1.0)
    )  # fmt: skip
    outside = np.flatnonzero(~inside)
    return (
        float(s[outside[-1] + 1]) if outside.size and outside[-1] + 1 < len(s) else 0.0
    )


def _to_wall_ends(
    state: _State, seen: _Seen, first: float, walls: Walls, *, clamped: bool
) -> _Seen:
    """Move edges from half level to where the side walls end, which are lighter."""
    places = np.linspace(seen.s[0], seen.s[-1], WALL_PLACES)
    wall = walls(*state.curve.at(places), state.width)
    light = np.full(WALL_PLACES, WALL_LIGHT)
    if clamped:
        light *= 1.0 - np.exp(-np.maximum(places - first, 0.0) / state.width)
    gap, window = level_span(state.blur, state.fuzz)
    short = np.interp(
        seen.s, places, _short_of_end(np.abs(wall), light, state.blur, gap, window)
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
def _short_of_end(
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


def _fit(
    state: _State, seen: _Seen, first: float, last: float,
    joints: Callable[[Curve], Sequence[float]], turn: int, *, clamped: bool,
) -> tuple[CurveFit, NDArray[np.bool_]]:  # fmt: skip
    width = state.width
    if last - first < 4.0 * width:
        raise LostError("no_rod", "what looks like a rod is shorter than four widths")
    clear = max(2.0, 2.5 * state.blur)
    # The corner between clamp and paper is dark: edges there are no edges of the rod.
    root = max(clear, ROOT_CLEAR * width) if clamped else clear
    use = seen.good & (seen.s > first + root) & (seen.s < last - clear)
    if use.sum() < 8:
        raise LostError("edges_lost", "too few edges of the rod are seen")
    count = max(int((last - first) / max(_BIN_PX, (last - first) / _BINS)), 16)
    s = np.linspace(first, last, count + 1)
    offset, within, weights = np.zeros((3, count + 1))
    _average(seen.s, seen.edges.middle, use, s, offset, within, weights)
    points, theta = state.curve.at(s)
    measured = points + offset[:, None] * np.column_stack(
        [-np.sin(theta), np.cos(theta)]
    )
    # Supple while the rod is sought, then stiff enough not to follow shade; the path
    # of a rough rod (yarn) is no elastica, and stays supple.
    supple = turn < _ROUGH_PASSES or state.scatter > 0.03 * width
    places = joints(state.curve)
    if not supple and not places:
        places = find_joints(
            seen.s - first, seen.theta, np.where(use, seen.edges.middle, 0.0),
            use.astype(np.float64), width=width, shared=SHARED,
        )  # fmt: skip

    spacing = max((1.0 if supple else 1.5) * width, (last - first) / 50.0)
    places = [x for x in places if spacing < x < last - first - spacing]

    def fitted(weights: Array) -> CurveFit:
        def fit(smooth: Smooth) -> CurveFit:
            return fit_curve(
                s - first, measured, _held_ends(weights, s, width), theta=theta,
                spacing=spacing, joints=places, iterations=1, smooth=smooth,
                shared=(3.0 if supple else SHARED) / float(seen.s[1]),
                within=float(within[weights > 0.0].sum()),
            )  # fmt: skip

        if supple:
            return fit(Smooth())
        return weighed_fit(fit, places, float(weights.sum()) / SHARED)

    fit = fitted(weights)
    if turn >= _ROUGH_PASSES:
        away = np.abs(np.nan_to_num(fit.residual))
        outlying = away > 4.0 * np.sqrt(np.mean(away**2)) + 1e-3
        left = np.where(outlying, 0.0, weights)
        if outlying.any() and left.sum() > 0.5 * weights.sum():
            weights = left
            fit = fitted(weights)
    return fit, weights > 0.5 * median(weights)


@njit(cache=True)
def _average(
    s: Array, value: Array, use: NDArray[np.bool_], at: Array,
    mean: Array, within: Array, count: Array,
) -> None:  # fmt: skip
    """Average values over the bins about the points of an even grid.

    `within` becomes the sum of squares about the mean, `count` the number of values.
    """
    step = at[1] - at[0]
    for i in range(s.size):
        k = int((s[i] - at[0]) / step + 0.5)
        if use[i] and s[i] >= at[0] and k < at.size:
            count[k] += 1.0
            change = value[i] - mean[k]
            mean[k] += change / count[k]
            within[k] += change * (value[i] - mean[k])


def _held_ends(weights: Array, s: Array, width: float) -> Array:
    """Return weights by which a frayed end keeps a little of the shape it had."""
    seen = np.flatnonzero(weights)
    held = weights.copy()
    little = 0.03 * weights.max()
    if s[-1] - s[seen[-1]] > 0.6 * width:
        held[seen[-1] + 1 :] = little
    if s[seen[0]] - s[0] > 0.6 * width:
        held[: seen[0]] = little
    return held


def _smooth_width(seen: _Seen, at: Array, typical: float) -> tuple[Array, Array]:
    """Return the width as a running mean over one rod width, and its deviation."""
    s, good, width = seen.s, seen.good, seen.edges.width
    half = max(2, int(0.5 * typical / s[1]))
    window = np.ones(2 * half + 1)
    total = np.convolve(np.where(good, width, 0.0), window)[half:-half]
    count = np.convolve(good.astype(np.float64), window)[half:-half]
    known = count >= 0.3 * len(window)
    mean = np.interp(s, s[known], total[known] / count[known])
    scatter = 1.4826 * median(np.abs(width - mean)[good])
    sigma = scatter * np.sqrt(2.0 / np.maximum(count, 1.0))
    return np.interp(at, s, mean), np.interp(at, s, sigma)


def _shifted(lines: ClampLines, first: float) -> ClampLines:
    return ClampLines(
        face=None
        if lines.face is None
        else replace(lines.face, s=lines.face.s - first),
        front=None
        if lines.front is None
        else replace(lines.front, s=lines.front.s - first),
    )
