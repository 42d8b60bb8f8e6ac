"""The curve through the middle between the edges that one pass saw."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.curve import Curve, beside, points_at
from ..curve.fit import CurveFit, solve
from ..curve.joints import find_joints
from ..curve.moment import weighed_fit
from ..curve.problem import SHARED, pose
from ..curve.robust import median
from ..curve.spline import Smooth
from ..edge.levels import followed
from ..edge.state import LostError, Seen, State

Array = NDArray[np.float64]

_BIN_PX = 4.0
_BINS = 200
"""Stations are averaged over bins before the fit: so far, or so many on a long rod."""

_WHOLE = 3
"""Power of the arc length up to which a rod moves as a whole."""

ROOT_CLEAR = 0.3
"""Widths next to the clamp that are left out of the fit."""


def fit_midline(
    state: State, seen: Seen, first: float, last: float,
    joints: Callable[[Curve], Sequence[float]], known: Array | None, *, seeking: bool,
    clamped: bool, foreseen: bool,
) -> tuple[CurveFit, NDArray[np.bool_], float, Array | None]:  # fmt: skip
    """Return the curve, points used, how far it moved, and joints as they were found.

    `known` are the joints that a pass before found, from the root on; `foreseen` tells
    that the passes began with a film's forecast, which is off alike in many frames.
    """
    width = state.width
    if last - first < 4.0 * width:
        raise LostError(
            "no_rod",
            f"what looks like a rod is {(last - first) / width:.1f} widths long: no "
            "axis can be laid through so little",
        )
    clear = max(2.0, 2.5 * state.blur)
    # The corner between clamp and paper is dark: edges there are no edges of the rod.
    root = max(clear, ROOT_CLEAR * width) if clamped else clear
    use = seen.good & (seen.s > first + root) & (seen.s < last - clear)
    if use.sum() < 8:
        raise LostError("edges_lost", "too few edges of the rod are seen")
    s, theta, measured, offset, within, weights = _binned(
        state.curve, seen.s, seen.edges.middle, use, first, last
    )
    if foreseen:
        more = _missed(state, s, offset, weights)
        measured, offset = beside(measured, theta, more), offset + more
    # Supple while the rod is sought, then stiff enough not to follow shade; the path
    # of a rough rod (yarn) is no elastica, and stays supple.
    supple = seeking or state.rough or state.scatter > 0.03 * width
    places = np.array(joints(state.curve))
    if not supple and not places.size:
        places = known if known is not None else np.array(find_joints(
            seen.s - first, seen.theta, np.where(use, seen.edges.middle, 0.0),
            use.astype(np.float64), width=width, shared=SHARED,
        ))  # fmt: skip

    spacing = max((1.0 if supple else 1.5) * width, (last - first) / 50.0)
    inner = [x for x in places if spacing < x < last - first - spacing]

    def fitted(weights: Array) -> CurveFit:
        problem = pose(
            s - first, measured, _held_ends(weights, s, width), theta,
            spacing=spacing, joints=inner,
            shared=(3.0 if supple else SHARED) / float(seen.s[1]),
            within=float(within[weights > 0.0].sum()),
        )  # fmt: skip
        if supple:
            return solve(problem, Smooth())
        return weighed_fit(problem, inner, float(weights.sum()) / SHARED)

    fit = fitted(weights)
    if not seeking:
        away = np.where(np.isnan(fit.residual), 0.0, np.abs(fit.residual))
        outlying = away > 4.0 * math.sqrt(away @ away / away.size) + 1e-3
        left = np.where(outlying, 0.0, weights)
        if outlying.any() and left.sum() > 0.5 * weights.sum():
            weights = left
            fit = fitted(weights)
    aside = np.abs(offset - fit.residual)[~np.isnan(fit.residual)].max()
    return (
        fit,
        weights > 0.5 * median(weights),
        float(aside),
        None if supple else places,
    )


def _missed(state: State, s: Array, offset: Array, weights: Array) -> Array:
    """Return by how much farther than it was found the midline lies, px.

    Edges are held back where they were expected: that holds of what moved the rod as a
    whole, not of what scatters about it. It makes more of the noise, too.
    """
    share = 1.0 / followed(state.blur, state.fuzz, 0.5 * state.width) - 1.0
    rows = np.vander((s - s[0]) / (s[-1] - s[0]), _WHOLE + 1)
    weighted = rows.T * weights
    whole = np.linalg.solve(weighted @ rows, weighted @ offset)
    return np.asarray(share * rows @ whole)


@njit(cache=True)
def _binned(
    curve: Curve, s: Array, middle: Array, use: NDArray[np.bool_], first: float,
    last: float,
) -> tuple[Array, Array, Array, Array, Array, Array]:  # fmt: skip
    """Return a midline averaged over bins about the points of an even grid.

    That is arc lengths and angles of the curve there, and of the midline the points,
    their offsets from it, the sums of squares about these, and the numbers of stations.
    """
    bins = max(int((last - first) / max(_BIN_PX, (last - first) / _BINS)), 16)
    at = np.linspace(first, last, bins + 1)
    points, theta = points_at(curve, at)
    mean, within, count = np.zeros((3, at.size))
    for i in range(s.size):
        k = int((s[i] - at[0]) / (at[1] - at[0]) + 0.5)
        if use[i] and s[i] >= at[0] and k < at.size:
            count[k] += 1.0
            change = middle[i] - mean[k]
            mean[k] += change / count[k]
            within[k] += change * (middle[i] - mean[k])
    return at, theta, beside(points, theta, mean), mean, within, count


@njit(cache=True)
def _held_ends(weights: Array, s: Array, width: float) -> Array:
    """Return weights by which a frayed end keeps a little of the shape it had."""
    seen = np.flatnonzero(weights)
    held = weights.copy()
    little = 0.03 * np.max(weights)
    if s[-1] - s[seen[-1]] > 0.6 * width:
        held[seen[-1] + 1 :] = little
    if s[seen[0]] - s[0] > 0.6 * width:
        held[: seen[0]] = little
    return held
