"""Edge passes: edges, ends and curve in turn, until nothing moves any more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.curve import Curve, normals_of, points_at
from ..curve.fit import CurveFit
from ..curve.robust import _median, median
from ..edge.clamp import ClampLines
from ..edge.clamp_light import clamp_light
from ..edge.crossings import EndFace
from ..edge.edges import LEAST, find_edges
from ..edge.ends import find_ends
from ..edge.own_width import to_own_width
from ..edge.state import LostError, Root, Seen, State
from ..edge.wall_light import Walls, to_wall_ends
from ..edge.white import is_cut_off, saturated, to_whole_edges
from ..find.track import FLARED, Start
from ..picture.photo import Photo
from .midline import fit_midline

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_PASSES = 5
_NEAR_PX, _NEAR_FORESEEN_PX = 0.4, 1.5
"""The first pass, or the first two, only seek the rod: on every other station, with a
supple curve. Two where the first moved it by more, which in a film, where what it
missed is known, leaves a twentieth of that; its ends can wait, there until it is found.
"""
_SURE_PX = 0.25
"""A start that is so sure need not be sought."""
_STILL_PX, _NEAR_STILL_PX = (0.05, 0.5), (0.08, 1.0)
"""By how much the curve and its ends may move when all is found, and in a film, where
time counts: the next pass would move it by a tenth of that. The ends are those of the
curve as it is then, which an arc carries on so far."""
_PULLED_STILL_PX, _PULLED_PX = 0.02, 0.02
"""By how much where half of the midline is pulled by so much, by shade, or by blur
where it is bent: the blur is found slowly there, and both hang on it."""
_KEPT_PX = 0.05
"""A curve that moves by less keeps its joints, and the light beside white paper."""
_BLUR_PARTS, _UNEVEN = 8, 0.35
"""Parts of a rod whose blur is known by itself where it differs by that share."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Refined:
    """A rod measured in pixels.

    Parameters
    ----------
    fit : CurveFit
        The axis from where the clamp line was taken (s = 0) to the tip's face.
    shaded : ndarray, shape (n,)
        By how much shade on the paper would have moved the midline, uncorrected, px.
    relit : ndarray, shape (n,)
        By how much its edges may move where the light on it changes, px.
    good : ndarray of bool, shape (n,)
        Points of the fit whose edges were used.
    width : ndarray, shape (n,)
        Smoothed width.
    sigma_width : ndarray, shape (n,)
        Its standard deviation.
    typical_width : float
        Median width where edges were used.
    tip : EndFace
        The free end; s counts as in `fit`.
    clamp : ClampLines or None
        Lines at the clamp; None for a rod that enters at the border or floats.
    rough : bool
        Whether its edges wander, as a yarn's.
    blur : float
        Standard deviation of the blur, as its edges show it, px.
    saturated : float
        Part of it beside which the paper is white, as far as the picture can tell; or
        where it is white itself.
    joints : ndarray or None
        Arc lengths of its joints; None where none were sought.
    whole : bool
        Whether edges that are cut off there were moved to half of all the light.
    walled : float
        By how far the light on its side walls had moved the midline, px.
    growth : float
        How much farther out its edges are with levels that lie farther from them, px.
    settled : bool
        Whether the last pass still moved nothing.
    """

    fit: CurveFit
    shaded: Array
    relit: Array
    good: NDArray[np.bool_]
    width: Array
    sigma_width: Array
    typical_width: float
    tip: EndFace
    clamp: ClampLines | None
    rough: bool
    blur: float
    saturated: float
    joints: Array | None = None
    whole: bool = False
    walled: float = 0.0
    growth: float = 0.0
    settled: bool = True


def refine(
    grey: Image,
    start: Start,
    *,
    root: Root,
    sign: float,
    joints: Callable[[Curve], Sequence[float]] = lambda _curve: (),
    walls: Walls | None = None,
    face_px: float = 0.0,
    foot_px: float = 0.0,
    sd_px: float = np.inf,
    known_joints: Array | None = None,
    plain: Image | None = None,
    photo: Photo | None = None,
    hidden_px: Array | None = None,
    from_front: bool = False,
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
        width of the rod, px, and the gap between them and the paper; positive where
        seen on the left.
    face_px : float
        How much of a clamp's face the camera may see, along the rod.
    foot_px : float
        And how far along the rod the line on the paper where it stands lies ahead of
        where the rod leaves it.
    sd_px : float
        Standard deviation of the start where it tells the ends too, as in a film.
    known_joints : ndarray, optional
        Arc lengths in px, from the root, of joints that were found before.
    plain : ndarray, shape (height, width), float32, optional
        The picture's own light where `grey` is a mix of its colours: what a clamp that
        has no colour is seen in.
    photo : Photo, optional
        The photograph, whose colours may show a clamp that `grey` does not.
    hidden_px : ndarray, shape (k, 3), optional
        Places (x, y, radius) where something lies across the rod.
    from_front : bool
        Whether the start begins at the front of a clamp that `grey` does not show.

    Raises
    ------
    LostError
        If edges or ends cannot be found.
    """
    half = np.full(len(start.curve.s), 0.5 * start.width)
    last = float(start.curve.s[-1])
    state = State(
        start.curve, half, start.width, 0.0, last, face_px, start.rough, start.blur,
        hidden=hidden_px, plain=plain, photo=photo, from_front=from_front,
        foot_px=foot_px,
    )  # fmt: skip
    if from_front and photo is not None:
        state.clamp_light = clamp_light(photo, start.curve, 0.0, start.width, root=0.0)
    seeking = sd_px > _SURE_PX
    seen = _look(grey, state, sign, 0, seeking=seeking)
    first, end, in_film = 0.0, last, bool(np.isfinite(sd_px))
    near_px = _NEAR_FORESEEN_PX if in_film else _NEAR_PX
    if not in_film:
        tip, lines, first = find_ends(grey, state, seen, root, sign, walls, fine=False)
        end = tip.s
    places, aside, walled, settled = None, np.inf, 0.0, False
    for turn in range(_PASSES):
        if turn:
            seen = _look(grey, state, sign, turn, seeking=seeking)
        if walls is not None:
            half_way = seen.edges.middle
            seen = to_wall_ends(state, seen, walls)
            walled = median(np.abs(seen.edges.middle - half_way))
        if not seeking and is_cut_off(grey, saturated(seen, sign)):
            seen = to_whole_edges(grey, state, seen, walls, sign, anew=aside > _KEPT_PX)
        if not (seeking or state.rough):
            seen = to_own_width(grey, state, seen, sign)
        known = known_joints
        if known is None and places is not None and aside <= _KEPT_PX:
            known = places - first
        fit, used, aside, places = fit_midline(
            state, seen, first, end, joints, known, seeking=seeking,
            clamped=root == "clamp", foreseen=in_film,
        )  # fmt: skip
        at = fit.curve.s + first
        width, sigma_width = _smooth_width(
            seen.s, seen.edges.width, seen.good, at, state.width
        )
        state.curve, state.half = fit.curve, 0.5 * width
        state.first, state.last = 0.0, float(fit.curve.s[-1])
        sought, seeking = seeking, seeking and not turn and aside > near_px
        if sought and (in_film or not turn):
            first, end = 0.0, state.last
            continue
        # The ends of the curve as it is now: often they move when it does not.
        tip, lines, first = find_ends(grey, state, seen, root, sign, walls, fine=True)
        end = tip.s
        moved = abs(first) + abs(end - state.last)
        still_px, ends_px = _NEAR_STILL_PX if in_film else _STILL_PX
        shaded = np.interp(at, seen.s, seen.edges.shaded(state.blur))
        pulled = shaded + 0.5 * state.blur**2 * np.abs(fit.curve.kappa)
        if not in_film and median(pulled) > _PULLED_PX:
            still_px = _PULLED_STILL_PX
        settled = aside < still_px and moved < ends_px and not sought
        if settled:
            break
    curve = fit.curve._replace(s=fit.curve.s - first)
    white = saturated(seen, sign)
    return Refined(
        fit=replace(fit, curve=curve), shaded=shaded,
        relit=np.interp(at, seen.s, seen.edges.relit(state.blur)), good=used,
        width=width, sigma_width=sigma_width, typical_width=median(width[used]),
        tip=tip._replace(s=tip.s - first),
        clamp=None if lines is None else lines.shifted(first), rough=state.rough,
        blur=state.blur, joints=None if places is None else places - first,
        saturated=white, whole=is_cut_off(grey, white), walled=walled,
        growth=abs(median(seen.edges.growth[seen.good])), settled=settled,
    )  # fmt: skip


def _look(grey: Image, state: State, sign: float, turn: int, *, seeking: bool) -> Seen:
    """Find the edges along the curve; know its width, blur and roughness after."""
    width = state.width
    step = 2.0 if seeking else 1.0
    s, points, theta, normals, half = _stations(
        state.curve, state.half, step, state.blur
    )
    # At first the edges lie where they are expected to a pixel or two.
    reach, fuzz = min(0.35 * width, 6.0 + 0.1 * width), min(0.1 * width, 3.0)
    if turn:
        fuzz = 4.0 * state.scatter
        reach = min(max(3.0, 3.0 * state.blur, 3.0 * fuzz), 0.45 * width)
    state.fuzz = fuzz
    edges = find_edges(
        grey, points, normals, -half, half, reach=reach,
        blur=state.blur if state.blurs is None else state.blurs, fuzz=fuzz, sign=sign,
        smooth=int(6.0 / step),
    )  # fmt: skip
    good = edges.usable(least=FLARED * width if state.rough else LEAST)
    bare = ~covered(points, state.hidden)
    good &= bare
    if good.sum() < max(8.0, 0.4 * bare.sum()):
        raise LostError(
            "edges_lost",
            "less than half of the rod has two edges that can be told from the paper: "
            "lay it on plain paper of another colour",
        )
    state.width = median(edges.width[good])
    blur = edges.blur
    state.blur = min(max(blur, 0.3), 0.5 * state.width) if blur > 0 else 1.0
    if (turn == 1 or state.blurs is not None) and not state.rough:
        local = np.clip(edges.blurs(_BLUR_PARTS), 0.3, 0.5 * state.width)
        state.blurs = local if np.ptp(local) > _UNEVEN * state.blur else None
    state.scatter = edges.wander(int(5.0 / step))
    return Seen(s, theta, edges, good)


@njit(cache=True)
def _stations(
    curve: Curve, half: Array, step: float, blur: float
) -> tuple[Array, Array, Array, Array, Array]:
    """Return arc lengths along a curve, points, angles, normals and half widths there.

    Where the blur, of variance v, moves edges of curvature k, the points move: k v / 2.
    """
    s = np.linspace(0.0, curve.s[-1], int(curve.s[-1] / step) + 1)
    points, theta = points_at(curve, s)
    aside = 0.5 * blur**2 * np.interp(s, curve.s, curve.kappa)
    normals = normals_of(theta)
    for k in range(2):
        points[:, k] += aside * normals[:, k]
    return s, points, theta, normals, np.interp(s, curve.s, half)


def covered(points: Array, places: Array | None) -> NDArray[np.bool_]:
    """Return which points lie within places (x, y, radius)."""
    inside = np.zeros(len(points), np.bool_)
    for x, y, radius in () if places is None else places:
        inside |= np.hypot(points[:, 0] - x, points[:, 1] - y) < radius
    return inside


@njit(cache=True)
def _smooth_width(
    s: Array, width: Array, good: NDArray[np.bool_], at: Array, typical: float
) -> tuple[Array, Array]:
    """Return the width as a running mean over one rod width, and its deviation."""
    half = max(2, int(0.5 * typical / s[1]))
    window = 2 * half + 1
    total = _window_sums(np.where(good, width, 0.0), half)
    count = _window_sums(np.where(good, 1.0, 0.0), half)
    known = count >= 0.3 * window
    mean = np.interp(s, s[known], total[known] / count[known])
    # From means that share no station: neighbours share samples and levels.
    jump = _median(np.abs(mean[window:] - mean[:-window]))
    sigma = 1.05 * jump * np.sqrt(window / np.maximum(count, 1.0))
    return np.interp(at, s, mean), np.interp(at, s, sigma)


@njit(cache=True)
def _window_sums(values: Array, half: int) -> Array:
    """Return the sum of each value and of `half` neighbours to either side."""
    sums = np.concatenate((np.zeros(half + 1), np.cumsum(values), np.zeros(half)))
    sums[sums.size - half :] = sums[sums.size - half - 1]
    return sums[2 * half + 1 :] - sums[: values.size]
