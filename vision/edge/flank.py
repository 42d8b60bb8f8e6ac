"""Flanks of edges beside what is white: place, and the light that was cut off.

A sensor holds so much light and no more. Beside an over-exposed paper the half level of
what is left lies within the rod, but the flank below it is whole: half a step's lower
part tells where its middle is, if its blur is known. Many flanks of one lens tell
their blur, since one that is cut off is a Gaussian's all the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WHITE = 0.97
"""Light of what is as light as a picture can tell, but for noise."""

_HELD = 1.0 + 1e-5

_NODES = np.array([-2.0, -1.0, 0.0, 1.0, 2.0]) * 0.412
_SHARES = np.array([0.06, 0.25, 0.38, 0.25, 0.06])
"""What interpolation between pixels, after the sensor, blurs: by 0.17 px^2."""
_LEVEL_SD, _OUTLYING = 0.02, 4.0
"""Misfit of a sample, in the light that a sensor holds; of how many it counts less."""
_PAPER, _PAPER_SD = 1.4, 0.4
"""What may be expected of the light of white paper."""
_TURNS, _STEP = 25, 1e-4
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
    return bool(WHITE < np.fmax.reduce(light, axis=None) <= _HELD)


def median_profile(profiles: NDArray[np.floating]) -> Array:
    """Return the median, (m,), of those profiles, (n, m), that have no NaN."""
    whole = profiles[np.isfinite(profiles).all(axis=1)]
    if not len(whole):
        return np.full(profiles.shape[1], np.nan)
    return np.asarray(np.median(whole, axis=0), np.float64)


def fit_flanks(
    x: Array, light: Array, *, blur: float, known: bool = False,
    wall: Array | None = None, mirrored: Array | None = None, sky: float = 1.0,
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
    """
    count = len(light)
    wide = np.zeros(count) if wall is None else wall
    share = np.zeros(count) if mirrored is None else mirrored
    at = np.column_stack(
        [np.zeros(count), np.fmin.reduce(light, axis=1), np.full(count, _PAPER)]
    )
    at = np.nan_to_num(at)

    def misfit(at: Array, blur: float) -> Array:
        place, rod, paper = at.T
        whole = _flank(x, place, rod, paper, blur, wide, share, sky)
        away = (whole - light) / _LEVEL_SD
        return np.nan_to_num(away)

    def cost(away: Array, at: Array) -> float:
        loss = _OUTLYING**2 * np.log1p((away / _OUTLYING) ** 2)
        return float(loss.sum() + (((at[:, 2] - _PAPER) / _PAPER_SD) ** 2).sum())

    away, damping = misfit(at, blur), 1e-3
    best = cost(away, at)
    for _ in range(_TURNS):
        slopes = [misfit(at + move, blur) - away for move in _STEP * np.eye(3)]
        slopes.append(misfit(at, blur + _STEP) - away)
        change = np.stack(slopes, axis=2) / _STEP
        step, wider = _step(change, away, at, damping, known=known)
        to, blurred = at + step, max(blur + wider, 0.7 * blur)
        there = misfit(to, blurred)
        if (less := cost(there, to)) < best:
            done = best - less < 1e-4 * best
            at, blur, away, best = to, blurred, there, less
            damping = max(0.2 * damping, 1e-6)
            if done:
                break
        else:
            damping *= 8.0
    return Flanks(place=at[:, 0], rod=at[:, 1], paper=at[:, 2], blur=blur)


def _flank(
    x: Array, place: Array, rod: Array, paper: Array, blur: float, wall: Array,
    mirrored: Array, sky: float,
) -> Array:  # fmt: skip
    """Return the light of steps from rod by wall to paper as a picture holds it."""
    from scipy.special import ndtr

    t = (x[:, None] + _NODES - place[:, None, None]) / blur
    above = np.where(wall > 0.0, mirrored * paper + (sky - 1.0) * rod, 0.0)
    light = (paper - rod - above)[:, None, None] * ndtr(t) + rod[:, None, None]
    if wall.any():
        light += above[:, None, None] * ndtr(t + (wall / blur)[:, None, None])
    return np.asarray(np.minimum(light, 1.0) @ _SHARES)


def _step(
    change: Array, away: Array, at: Array, damping: float, *, known: bool
) -> tuple[Array, float]:
    """Return the step of each profile's numbers, (n, 3), and of the blur they share.

    The blur is eliminated: the normal matrix is block diagonal but for it.
    """
    weight = 1.0 / (1.0 + (away / _OUTLYING) ** 2)
    weighed = change * weight[:, :, None]
    normal = np.einsum("nmi,nmj->nij", weighed, change)
    right = np.einsum("nmi,nm->ni", weighed, away)
    normal[:, 2, 2] += 1.0 / _PAPER_SD**2
    right[:, 2] += (at[:, 2] - _PAPER) / _PAPER_SD**2
    own, shared = normal[:, :3, :3], normal[:, :3, 3]
    diagonal = np.einsum("nii->ni", own)
    damped = own + (damping * diagonal + 1e-6)[:, :, None] * np.eye(3)
    solved = np.linalg.solve(damped, np.stack([shared, right[:, :3]], axis=2))
    wider = 0.0
    if not known:
        left = normal[:, 3, 3].sum() * (1.0 + damping) - (shared * solved[..., 0]).sum()
        wider = -float(right[:, 3].sum() - (shared * solved[..., 1]).sum()) / left
    return np.clip(-solved[..., 1] - wider * solved[..., 0], -0.5, 0.5), wider
