"""Flanks of edges beside what is white: place, and the light that was cut off.

A sensor holds so much light and no more. Beside an over-exposed paper the half level of
what is left lies within the rod, but the flank below it is whole: half a step's lower
part tells where its middle is, if its blur is known. Many flanks of one lens tell
their blur, since one that is cut off is a Gaussian's all the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit

Array = NDArray[np.float64]

WHITE = 0.97
"""Light of what is as light as a picture can tell, but for noise."""

HELD = 1.0 + 1e-5

_NODES = np.array([-2.0, -1.0, 0.0, 1.0, 2.0]) * 0.412
_SHARES = np.array([0.06, 0.25, 0.38, 0.25, 0.06])
"""What interpolation between pixels, after the sensor, blurs: by 0.17 px^2."""
_LEVEL_SD, _OUTLYING = 0.02, 4.0
"""Misfit of a sample, in the light that a sensor holds; of how many it counts less."""
_PAPER, _PAPER_SD = 1.4, 0.4
"""What may be expected of the light of white paper."""
_TURNS, _STILL = 25, 1e-4
_UNSURE = 0.05
"""Paper with so much less than this above what is held is hardly white."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flanks:
    """Steps that were fitted to profiles.

    Parameters
    ----------
    place : ndarray, shape (n,)
        Half level of the whole step, or where its wall ends, px.
    rod, paper : ndarray, shape (n,)
        Light on either side; what a sensor holds is 1.
    blur : float
        Standard deviation of the blur, px.
    """

    place: Array
    rod: Array
    paper: Array
    blur: float

    def moves(self, sides: int = 1) -> Array:
        """By how much to move edges at 0 that are half levels of what is left, px.

        What was cut off moves each of an equal number of pieces of all sides, (sides,
        pieces), by itself; what else the fit finds, one side as a whole. Nothing moves
        where the paper is not white.
        """
        from scipy.special import ndtri

        held, whole = 1.0 - self.rod, np.maximum(self.paper, 1.0) - self.rod
        cut = -self.blur * ndtri(np.clip(0.5 * held / whole, 0.01, 0.5))
        rest = np.median((self.place - cut).reshape(sides, -1), axis=1, keepdims=True)
        white = np.clip((self.paper - 1.0) / _UNSURE, 0.0, 1.0).reshape(sides, -1)
        share = white.mean(axis=1, keepdims=True)
        return np.asarray(cut.reshape(sides, -1) + share * rest)


def is_held(light: NDArray[np.floating]) -> bool:
    """Whether light comes up to what a sensor holds, and nowhere exceeds it.

    Where paper was made 1, as by division by an empty picture, noise exceeds it.
    """
    return bool(WHITE < np.fmax.reduce(light, axis=None) <= HELD)


@njit(cache=True)
def median_profiles(profiles: NDArray[np.floating], bounds: NDArray[np.int64]) -> Array:
    """Return the medians, (k, m), of k pieces of profiles, (n, m), NaN left out.

    `bounds` are the first rows of the pieces, and the end of the last.
    """
    count, columns = bounds.size - 1, profiles.shape[1]
    middle = np.full((count, columns), np.nan)
    for i in range(count):
        for k in range(columns):
            middle[i, k] = np.nanmedian(profiles[bounds[i] : bounds[i + 1], k])
    return middle


def fit_flanks(
    x: Array, light: Array, *, blur: float, known: bool = False,
    wall: Array | None = None, mirrored: Array | None = None, sky: float = 1.0,
    near: Flanks | None = None,
) -> Flanks:  # fmt: skip
    """Fit blurred steps, cut off at white, to profiles from rod to paper.

    Levenberg and Marquardt's method. All share the blur, and the weight of a sample
    falls where it does not fit, as Cauchy's does.

    Parameters
    ----------
    x : ndarray, shape (m,)
        Places of samples, px, outwards.
    light : ndarray, shape (n, m)
        Profiles; NaN is left out.
    blur : float
        Standard deviation of the blur, px: a first guess, unless `known`.
    wall, mirrored : ndarray, shape (n,), optional
        How wide side walls are seen, px; what they mirror of the paper.
    sky : float
        Their own light over the rod's.
    near : Flanks, optional
        What was found in the same profiles before, from which to set out.
    """
    count = len(light)
    wide = np.zeros(count) if wall is None else wall
    share = np.zeros(count) if mirrored is None else mirrored
    at = np.column_stack(
        [np.zeros(count), np.fmin.reduce(light, axis=1), np.full(count, _PAPER)]
    )
    if near is not None:
        at, blur = np.column_stack([near.place, near.rod, near.paper]), near.blur
    at, blur = _fit(
        x, np.ascontiguousarray(light, np.float64), np.nan_to_num(at), float(blur),
        known, wide, share, float(sky),
    )  # fmt: skip
    return Flanks(place=at[:, 0], rod=at[:, 1], paper=at[:, 2], blur=blur)


@njit(cache=True)
def _fit(
    x: Array, light: Array, at: Array, blur: float, known: bool, wall: Array,
    mirrored: Array, sky: float,
) -> tuple[Array, float]:  # fmt: skip
    """Return place, rod and paper of each profile, (n, 3), and the blur of all."""
    equations, best = _equations(x, light, at, blur, wall, mirrored, sky)
    damping = 1e-3
    for _ in range(_TURNS):
        step, wider = _step(equations, damping, known)
        to, blurred = at + step, max(blur + wider, 0.7 * blur)
        there, cost = _equations(x, light, to, blurred, wall, mirrored, sky)
        if cost < best:
            done = best - cost < _STILL * best
            at, blur, equations, best = to, blurred, there, cost
            damping = max(0.2 * damping, 1e-6)
            if done:
                break
        else:
            damping *= 8.0
    return at, blur


@njit(cache=True)
def _equations(
    x: Array, light: Array, at: Array, blur: float, wall: Array, mirrored: Array,
    sky: float,
) -> tuple[Array, float]:  # fmt: skip
    """Return J^T W J with J^T W r in the last column, (n, 4, 5), and the cost."""
    equations, cost = np.zeros((len(light), 4, 5)), 0.0
    change = np.empty(5)
    for i in range(len(light)):
        for k in range(x.size):
            if np.isnan(light[i, k]):
                continue
            _flank(x[k], at[i], blur, wall[i], mirrored[i], sky, change)
            change[4] = change[4] - light[i, k]
            change /= _LEVEL_SD
            square = (change[4] / _OUTLYING) ** 2
            cost += _OUTLYING**2 * math.log1p(square)
            for a in range(4):
                for b in range(a, 5):
                    equations[i, a, b] += change[a] * change[b] / (1.0 + square)
        off = (at[i, 2] - _PAPER) / _PAPER_SD
        cost += off * off
        equations[i, 2, 2] += 1.0 / _PAPER_SD**2
        equations[i, 2, 4] += off / _PAPER_SD
        for a in range(4):
            for b in range(a):
                equations[i, a, b] = equations[i, b, a]
    return equations, cost


@njit(cache=True)
def _flank(
    x: float, at: Array, blur: float, wall: float, mirrored: float, sky: float,
    change: Array,
) -> None:  # fmt: skip
    """Fill in how a picture's light changes by place, rod, paper and blur; and itself.

    A step from rod by wall to paper, cut off at 1.
    """
    place, rod, paper = at
    above = mirrored * paper + (sky - 1.0) * rod if wall > 0.0 else 0.0
    change[:] = 0.0
    for n in range(_NODES.size):
        share, t = _SHARES[n], (x + _NODES[n] - place) / blur
        outside, bell = _phi(t)
        edge, rim, wider = outside, bell, t + wall / blur
        if wall > 0.0:
            edge, rim = _phi(wider)
        whole = rod + (paper - rod - above) * outside + above * edge
        if whole >= 1.0:
            change[4] += share
            continue
        steep, mirror = (paper - rod - above) * bell, above * rim
        change[0] -= share * (steep + mirror) / blur
        change[1] += share * (1.0 - outside)
        change[2] += share * outside
        change[3] -= share * (steep * t + mirror * wider) / blur
        change[4] += share * whole
        if wall > 0.0:
            change[1] += share * (sky - 1.0) * (edge - outside)
            change[2] += share * mirrored * (edge - outside)


@njit(cache=True)
def _phi(t: float) -> tuple[float, float]:
    """Return the normal distribution below t, and its density there."""
    bell = math.exp(-0.5 * t * t) / math.sqrt(2.0 * math.pi)
    return 0.5 * (1.0 + math.erf(t / math.sqrt(2.0))), bell


@njit(cache=True)
def _step(equations: Array, damping: float, known: bool) -> tuple[Array, float]:
    """Return the step of each profile's numbers, (n, 3), and of the blur they share.

    The blur is eliminated: the normal matrix is block diagonal but for it.
    """
    solved = np.empty((len(equations), 3, 2))
    left, right = 0.0, 0.0
    for i in range(len(equations)):
        own, sides = equations[i, :3, :3].copy(), equations[i, :3, 3:].copy()
        for a in range(3):
            own[a, a] += damping * own[a, a] + 1e-6
        solved[i] = np.linalg.solve(own, sides)
        left += equations[i, 3, 3] * (1.0 + damping) - np.sum(
            sides[:, 0] * solved[i, :, 0]
        )
        right += equations[i, 3, 4] - np.sum(sides[:, 0] * solved[i, :, 1])
    wider = 0.0 if known else -right / left
    step = np.empty((len(equations), 3))
    for i in range(len(equations)):
        for a in range(3):
            move = -solved[i, a, 1] - wider * solved[i, a, 0]
            step[i, a] = min(max(move, -0.5), 0.5)
    return step, wider
