"""Edge passes: edges, ends and curve in turn, until nothing moves any more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .centreline_fit import SHARED, Curve, CurveFit, fit_curve
from .clamp import ClampLines, find_clamp
from .edges import Edges, find_edges
from .joints import find_joints
from .rod import Root
from .tip import EndFace, find_tip
from .track import Start

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_PASSES = 5
_STILL_PX = 0.1

ROOT_CLEAR = 0.3
"""Widths next to the clamp that are left out of the fit."""


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
    edges : Edges
        Side edges at the stations of the fit.
    shaded : ndarray, shape (n,)
        By how much shade on the paper would have moved the midline, uncorrected, px.
    good : ndarray of bool, shape (n,)
        Stations whose edges were used.
    width : ndarray, shape (n,)
        Smoothed width.
    sigma_width : ndarray, shape (n,)
        Its standard deviation.
    tip : EndFace
        The free end; s counts as in `fit`.
    clamp : ClampLines or None
        Lines at the clamp; None for a rod that enters at the border or floats.
    blur, contrast : float
        Blur in px and paper minus rod in linear light.
    """

    fit: CurveFit
    edges: Edges
    shaded: Array
    good: NDArray[np.bool_]
    width: Array
    sigma_width: Array
    tip: EndFace
    clamp: ClampLines | None
    blur: float
    contrast: float


@dataclass(slots=True)
class _State:
    curve: Curve
    low: Array
    high: Array
    width: float
    blur: float
    first: float
    last: float
    scatter: float = 0.0
    moved: float = 0.0


def refine(
    grey: Image,
    start: Start,
    *,
    root: Root,
    sign: float,
    joints: Callable[[Curve], Sequence[float]] = lambda _curve: (),
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

    Raises
    ------
    LostError
        If edges or ends cannot be found.
    """
    half = np.full(len(start.curve.s), 0.5 * start.width)
    state = _State(start.curve, -half, half, start.width, 1.0, 0.0, start.curve.s[-1])
    result = None
    for turn in range(_PASSES):
        length = float(state.curve.s[-1])
        result = _pass(grey, state, root, sign, joints, turn)
        still = abs(state.curve.s[-1] - length) + abs(state.moved) < _STILL_PX
        if turn >= 2 and still:
            break
    if result is None:
        raise LostError("no_rod", "nothing was measured")
    return result


def _pass(
    grey: Image, state: _State, root: Root, sign: float,
    joints: Callable[[Curve], Sequence[float]], turn: int,
) -> Refined:  # fmt: skip
    curve, width = state.curve, state.width
    reach = min(0.35 * width, 6.0 + 0.1 * width)
    if turn:
        reach = min(max(3.0, 3.0 * state.blur, 4.0 * state.scatter), 0.45 * width)
    edges = find_edges(
        grey, curve.points, curve.normals, state.low, state.high,
        reach=reach, blur=state.blur, sign=sign,
    )  # fmt: skip
    good = _usable(edges)
    if good.sum() < max(8.0, 0.4 * len(good)):
        raise LostError(
            "edges_lost",
            "less than half of the rod has two edges that can be told from the paper",
        )
    state.width = float(np.median(edges.width[good]))
    blur = edges.blur
    state.blur = float(np.clip(blur, 0.3, 0.5 * state.width)) if blur > 0 else 1.0
    state.scatter = _scatter(edges)
    tip, lines, first = _ends(grey, state, edges, good, root, sign, turn)
    fit, used = _fit(
        state, edges, good, first, tip.s, joints, turn, clamped=root == "clamp"
    )
    shift = replace(tip, s=tip.s - first)
    at = fit.curve.s + first
    smooth, sigma = _smooth_width(curve.s, edges, good, at, state.width)
    state.curve, state.first, state.last = fit.curve, 0.0, float(fit.curve.s[-1])
    state.moved = first
    state.low, state.high = -0.5 * smooth, 0.5 * smooth
    kept = _at_stations(edges, curve.s, at)
    return Refined(
        fit=fit, edges=kept, shaded=_shaded(kept, state.blur), good=used,
        width=smooth, sigma_width=sigma, tip=shift,
        clamp=None if lines is None else _shifted(lines, first),
        blur=state.blur, contrast=edges.contrast,
    )  # fmt: skip


def _usable(edges: Edges) -> NDArray[np.bool_]:
    """Stations with both edges, of a width like their neighbours'."""
    width = edges.width
    found = np.isfinite(width)
    if found.sum() < 8:
        return found
    centre = float(np.median(width[found]))
    spread = 1.4826 * float(np.median(np.abs(width[found] - centre)))
    return found & (np.abs(width - centre) < max(5.0 * spread, 0.6))


def _scatter(edges: Edges) -> float:
    """Return how much an edge jumps from one station to the next but four, px."""
    jump = np.concatenate(
        [edges.low[5:] - edges.low[:-5], edges.high[5:] - edges.high[:-5]]
    )
    jump = jump[np.isfinite(jump)]
    return 1.05 * float(np.median(np.abs(jump))) if jump.size else 0.0


def _ends(
    grey: Image, state: _State, edges: Edges, good: NDArray[np.bool_],
    root: Root, sign: float, turn: int,
) -> tuple[EndFace, ClampLines | None, float]:  # fmt: skip
    curve, width = state.curve, state.width
    outwards = 0.4 * width if turn == 0 else 0.0
    reach = 1.3 * width if turn == 0 else 0.3 * width + 2.0
    near = good & (curve.s > curve.s[-1] - 3.0 * width)
    middle = float(np.median(edges.middle[near])) if near.any() and turn == 0 else 0.0
    end = good & (curve.s > curve.s[-1] - 1.5 * width)
    taper = float(np.median(edges.width[end])) if end.sum() > 3 else width
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
    return tip, lines, line.s


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


def _fit(
    state: _State, edges: Edges, good: NDArray[np.bool_], first: float, last: float,
    joints: Callable[[Curve], Sequence[float]], turn: int, *, clamped: bool,
) -> tuple[CurveFit, NDArray[np.bool_]]:  # fmt: skip
    curve, width = state.curve, state.width
    if last - first < 4.0 * width:
        raise LostError("no_rod", "what looks like a rod is shorter than four widths")
    count = max(round(last - first), 16)
    s = np.linspace(first, last, count + 1)
    points, theta = curve.at(s)
    offset = np.interp(s, curve.s[good], edges.middle[good])
    share = np.interp(s, curve.s, good.astype(np.float64), left=0.0, right=0.0)
    clear = max(2.0, 2.5 * state.blur)
    # The corner between clamp and paper is dark: edges there are no edges of the rod.
    root = max(clear, ROOT_CLEAR * width) if clamped else clear
    used = (share > 0.99) & (s > first + root) & (s < last - clear)
    if used.sum() < 8:
        raise LostError("edges_lost", "too few edges of the rod are seen")
    measured = points + np.where(used, offset, 0.0)[:, None] * np.column_stack(
        [-np.sin(theta), np.cos(theta)]
    )
    weights = _weights(used, width)
    # Supple while the rod is sought, then stiff enough not to follow shade; the path
    # of a rough rod (yarn) is no elastica, and stays supple.
    supple = turn < 2 or state.scatter > 0.03 * width
    options = {
        "spacing": max((1.0 if supple else 1.5) * width, (last - first) / 50.0),
        "joints": joints(curve),
        "shared": 3.0 if supple else SHARED,
    }
    if not supple and not options["joints"]:
        options["joints"] = find_joints(
            s - first, theta, np.where(used, offset, 0.0), weights,
            width=width, shared=SHARED,
        )  # fmt: skip
    fit = fit_curve(s - first, measured, weights, theta=theta, **options)  # type: ignore[arg-type]
    if turn >= 2:
        outlying = np.abs(np.nan_to_num(fit.residual)) > 4.0 * fit.noise + 1e-3
        if outlying.any() and (used & ~outlying).sum() > 0.5 * used.sum():
            used = used & ~outlying
            weights = _weights(used, width)
            fit = fit_curve(s - first, measured, weights, theta=theta, **options)  # type: ignore[arg-type]
    return fit, used


def _weights(used: NDArray[np.bool_], width: float) -> Array:
    """Weigh stations: a frayed end keeps a little of the shape it had before."""
    weights = used.astype(np.float64)
    seen = np.flatnonzero(used)
    if len(used) - seen[-1] > 0.6 * width:
        weights[seen[-1] + 1 :] = 0.03
    if seen[0] > 0.6 * width:
        weights[: seen[0]] = 0.03
    return weights


def _smooth_width(
    s: Array, edges: Edges, good: NDArray[np.bool_], at: Array, typical: float
) -> tuple[Array, Array]:
    """Return the width as a running mean over one rod width, and its deviation."""
    value = np.where(good, edges.width, 0.0)
    half = max(2, int(0.5 * typical))
    window = np.ones(2 * half + 1)
    total = np.convolve(value, window, mode="full")[half:-half]
    count = np.convolve(good.astype(np.float64), window, mode="full")[half:-half]
    known = count >= 0.3 * len(window)
    mean = np.interp(s, s[known], total[known] / count[known])
    rest = np.where(good, edges.width - mean, np.nan)
    scatter = 1.4826 * float(np.nanmedian(np.abs(rest)))
    sigma = scatter * np.sqrt(2.0 / np.maximum(count, 1.0))
    return np.interp(at, s, mean), np.interp(at, s, sigma)


def _at_stations(edges: Edges, s: Array, at: Array) -> Edges:
    values = {}
    for name in Edges.__slots__:
        values[name] = np.interp(at, s, getattr(edges, name), left=np.nan, right=np.nan)
    return Edges(**values)


def _shaded(edges: Edges, blur: float) -> Array:
    """Half the difference of what the paper's slope does to either edge."""
    reach = 1.5 * max(1.5, 2.2 * blur)
    with np.errstate(invalid="ignore", divide="ignore"):
        low = edges.shade_low / edges.slope_low
        high = edges.shade_high / edges.slope_high
    return np.nan_to_num(0.25 * reach * np.abs(high - low))


def _shifted(lines: ClampLines, first: float) -> ClampLines:
    return ClampLines(
        face=None
        if lines.face is None
        else replace(lines.face, s=lines.face.s - first),
        front=None
        if lines.front is None
        else replace(lines.front, s=lines.front.s - first),
    )
