"""The light in which a clamp is seen, whatever its colour: not the rod's, not paper's.

What tells a rod from the paper need not tell either from a clamp: a blue clamp on a
black board is as dark as the board beside a white rod, and in the colour of a red rod a
blue clamp is as light as paper. Where the rod's own colour ends something else begins;
weights of blue, green and red tell it from the rod, others tell it from the paper. A
shade takes a share of the light of either and must not count: it is part of what both
scatter by (the linear discriminant, R. A. Fisher, 1936).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..curve.curve import Curve, normals_of
from ..picture.photo import Photo

Array = NDArray[np.float64]
Image = NDArray[np.float32]

STEP = 0.65
"""Light of either step at the clamp, from rod to clamp and from clamp to paper."""

_BEFORE, _BEHIND = 4.0, 5.0
"""How far before a rough root the rod is known, and behind it a clamp is sought; in
widths."""

_ON, _BESIDE = 0.3, (0.9, 2.0)
"""Lanes on the rod, and beside it, in widths from the axis."""

_LEAST = 20
"""Pixels that tell a colour."""

_CLEAR, _FOR, _SEEN = 8.0, 1.0, 1.0
"""Deviations of what is rod by which something else is told from it, and widths at a
stretch over which it is; and deviations that do where it is known to begin."""

_SHADE, _LAMP, _NOISE = 0.4, 0.15, 0.004
"""Shares of the light, as deviations: what shade takes, and by how much paper may be
lighter than beside the rod, where nothing shades it; and least noise of the light."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampLight:
    """Two mixes of colours about a root, and where the clamp begins in them.

    Parameters
    ----------
    rod, paper : ndarray, shape (height, width), float32
        Light in which the clamp is `STEP` lighter than the rod, and `STEP` darker than
        the paper; NaN farther away.
    root : float
        About where on its axis the rod ends, px.
    """

    rod: Image
    paper: Image
    root: float


def clamp_light(
    photo: Photo, curve: Curve, first: float, width: float, root: float | None = None
) -> ClampLight | None:
    """Return the light in which the clamp of a rod is seen.

    Parameters
    ----------
    photo : Photo
        The photograph; a grey one tells nothing.
    curve : Curve
        The axis, from about the clamp to the tip.
    first, width : float
        About where the rod begins on it, and its width, px.
    root : float, optional
        Where it begins, if that is known better; else where its colour ends.

    Returns
    -------
    ClampLight or None
        None where nothing behind the rod is of another colour than rod and paper.
    """
    s = first + width * np.arange(-_BEHIND, _BEFORE, 0.125)
    points, theta = curve.at(s)
    shape = photo.grey.shape
    window = _window(points, 3.0 * width + 8.0, shape)
    light = photo.colour(window)
    if light is None or light.size == 0:
        return None
    on = _sampled(light, window, points, theta, width * np.linspace(-_ON, _ON, 5))
    aside = width * np.linspace(*_BESIDE, 5)
    left, right = (_sampled(light, window, points, theta, x) for x in (-aside, aside))
    ahead = s > first + 0.5 * width
    rod = _Kind.of(on[ahead])
    if rod is None:
        return None
    least = _CLEAR if root is None else _SEEN
    if root is None:
        other = rod.away(np.median(on, axis=1)) > _CLEAR
        root = _begins(other, s, _FOR * width)
    if root is None:
        return None
    behind = (s > root - 2.0 * width) & (s < root - 0.25 * width)
    near = (s > root + width) & (s < root + 4.0 * width)
    clamp = np.nanmedian(on[behind].reshape(-1, 3), axis=0)
    papers = [_Kind.of(side[near]) for side in (left, right)]
    known = [paper for paper in papers if paper is not None]
    paper = max(known, key=lambda kind: float(kind.middle.sum()), default=None)
    if paper is None:
        return None
    share = _LAMP if clamp.sum() > paper.middle.sum() else _SHADE
    if paper.away(clamp, share) < least or rod.away(clamp) < _SEEN:
        return None
    seen = np.full((2, *shape), np.nan, np.float32)
    for image, mix in zip(
        seen, (rod.mix(clamp), -paper.mix(clamp, share)), strict=True
    ):
        image[window] = light @ mix.astype(np.float32)
    return ClampLight(rod=seen[0], paper=seen[1], root=root)


@dataclass(frozen=True, slots=True)
class _Kind:
    """What is of one colour, in light and in shade: its middle and how it scatters."""

    middle: Array
    within: Array

    @classmethod
    def of(cls, light: Array) -> _Kind | None:
        flat = light.reshape(-1, 3)
        flat = flat[np.isfinite(flat).all(axis=1)]
        if len(flat) < _LEAST:
            return None
        middle = np.median(flat, axis=0)
        aside = flat - middle
        typical = 1.4826 * np.median(np.abs(aside), axis=0) + _NOISE
        usual = (np.abs(aside) < 3.0 * typical).all(axis=1)
        scatter = (
            np.cov(aside[usual].T) if usual.sum() >= _LEAST else np.diag(typical**2)
        )
        return cls(middle, scatter + _NOISE**2 * np.eye(3))

    def away(self, light: Array, share: float = _SHADE) -> Array:
        """Return how far colours are from this one, in deviations.

        Where they may have `share` of its light more or less, as a deviation.
        """
        aside = (light - self.middle).reshape(-1, 3).T
        squares = np.sum(aside * self._weighed(aside, share), axis=0)
        return np.asarray(np.sqrt(squares).reshape(light.shape[:-1]))

    def mix(self, other: Array, share: float = _SHADE) -> Array:
        """Return weights in which another colour is `STEP` lighter."""
        aside = other - self.middle
        mix = self._weighed(aside, share)
        return np.asarray(STEP * mix / (mix @ aside))

    def _weighed(self, aside: Array, share: float) -> Array:
        shade = share * self.middle
        within = self.within + np.outer(shade, shade)
        return np.asarray(np.linalg.solve(within, aside), np.float64)


def _begins(other: NDArray[np.bool_], s: Array, least: float) -> float | None:
    """Return where the run of other colour next before the rod ends, if long enough."""
    run = 0
    for k in range(len(s) - 1, -1, -1):
        run = run + 1 if other[k] else 0
        if run * (s[1] - s[0]) >= least:
            return float(s[min(k + run, len(s) - 1)])
    return None


def _window(
    points: Array, beside: float, shape: tuple[int, ...]
) -> tuple[slice, slice]:
    """Return the rows and columns about points that lie in a picture."""
    low = np.maximum(points.min(axis=0) - beside, 0.0).astype(int)
    high = points.max(axis=0) + beside + 1.0
    last = np.minimum(high, (shape[1], shape[0])).astype(int)
    return slice(int(low[1]), int(last[1])), slice(int(low[0]), int(last[0]))


def _sampled(
    light: Image, window: tuple[slice, slice], points: Array, theta: Array, aside: Array
) -> Array:
    """Return colours of lanes beside an axis, (n, k, 3); NaN outside the window."""
    normals = normals_of(theta)
    spots = points[:, None] + aside[:, None] * normals[:, None]
    x, y = np.moveaxis(np.rint(spots).astype(int), -1, 0)
    x, y = x - window[1].start, y - window[0].start
    inside = (x >= 0) & (y >= 0) & (x < light.shape[1]) & (y < light.shape[0])
    found = np.full((*x.shape, 3), np.nan)
    found[inside] = light[y[inside], x[inside]]
    return found
