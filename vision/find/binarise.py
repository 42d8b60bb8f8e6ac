"""Rod and clamp from paper: background, ratio, threshold, at a reduced scale.

A single level over a whole frame (Otsu) splits the paper instead of finding the rod:
the rod is half a percent of the picture and the light falls off by a quarter. So the
light on the paper is fitted first (a quadric through the bright parts, dark things
rejected) and the threshold is on the ratio to it. The mask only tells where to look:
edges are measured later in the full picture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit

WORK_PX = 1000
"""The longer side of the working picture, roughly."""

_SAMPLE = 1500
_STRIDE = 8
"""Every so many pixels along rows and columns tell how light a large picture is."""

_LEAST_DARK, _NO_PAPER = 30, 0.7
"""Fewer pixels darker than this share of the paper, in the working picture, are no
rod."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Binary:
    """A reduced picture and its mask.

    Parameters
    ----------
    ratio : ndarray, shape (h, w), float32
        Light relative to the bare background, 1 on paper; inverted for light rods.
    mask : ndarray, shape (h, w), uint8
        1 on rod, clamp and everything else that is dark.
    factor : int
        Pixels of the photograph per pixel here.
    inverted : bool
        True for a light rod on a dark background.
    dark, threshold : float
        Ratio of the darkest things, and the level between.
    """

    ratio: NDArray[np.float32]
    mask: NDArray[np.uint8]
    factor: int
    inverted: bool
    dark: float
    threshold: float


def binarise(grey: NDArray[np.float32], *, invert: bool | None = None) -> Binary | None:
    """Separate dark things from the paper (or light things from a dark board).

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    invert : bool, optional
        True for a light rod on a dark background; detected when not given: the
        background is taken to be the larger part of the picture.

    Returns
    -------
    Binary or None
        None where nothing stands out from the background.
    """
    factor = max(1, round(max(grey.shape) / WORK_PX))
    work = grey if factor == 1 else shrunk(grey, factor)
    sample = work[::_STRIDE, ::_STRIDE] if work.size > 100_000 else work
    low, middle, high = _quantiles(sample, 0.003, 0.5, 0.997)
    if high - low < 0.02 or high < 1.3 * low:
        return None
    if invert is None:
        invert = bool(high - middle > middle - low)
    if invert:
        work = np.float32(max(high, float(sample.max()))) - work
    ratio = work.copy() if work is grey else work
    darker = _divide(ratio, *_background(work))
    if darker.size < _LEAST_DARK // 4:
        return None
    (dark,) = _quantiles(darker, 0.1)
    threshold = min(max(0.4 + 0.6 * dark, 0.35), 0.72)
    return Binary(
        ratio=ratio, mask=_mask(ratio, threshold), factor=factor, inverted=invert,
        dark=dark, threshold=threshold,
    )  # fmt: skip


def shrunk(light: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """Return means of blocks of pixels; what is left over at two sides is dropped."""
    height, width = light.shape[0] // factor, light.shape[1] // factor
    whole = light[: factor * height, : factor * width]
    small = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32)


def rebinarise(binary: Binary, threshold: float) -> Binary:
    """Return the same picture at another level."""
    return replace(binary, mask=_mask(binary.ratio, threshold), threshold=threshold)


def _mask(ratio: NDArray[np.float32], threshold: float) -> NDArray[np.uint8]:
    return np.asarray((ratio < threshold).view(np.uint8))


def _background(
    work: NDArray[np.float32],
) -> tuple[NDArray[np.float32], np.float32]:
    """Fit the light on the bare background: a quadric, dark things rejected.

    Returns its coefficients, for rows and columns from -1 to 1, and the least value.
    """
    height, width = work.shape
    step = max(1, int((height * width / _SAMPLE) ** 0.5))
    sample = work[::step, ::step]
    basis = quadric(*sample.shape)
    value = sample.astype(np.float64).ravel()
    lower, typical, upper = _quantiles(value, 0.4, 0.6, 0.7)
    coefficients = _fit_quadric(basis, value, lower, upper)
    floor = max(0.2 * typical, 1e-4)
    return coefficients.astype(np.float32), np.float32(floor)


@njit(cache=True)
def _fit_quadric(
    basis: NDArray[np.float64], value: NDArray[np.float64], lower: float, upper: float
) -> NDArray[np.floating]:
    """Fit what lies above `lower` and then in ever closer bands; else flat `upper`."""
    coefficients: NDArray[np.floating] = np.zeros(6)
    inside = value > lower
    for band in (0.25, 0.15, 0.1, 0.1):
        design = basis[inside]
        normal = design.T @ design + 1e-9 * np.eye(6)
        coefficients = np.linalg.solve(normal, design.T @ value[inside])
        fit = basis @ coefficients
        inside = np.abs(value - fit) < band * np.maximum(fit, 1e-3)
        if inside.sum() < 60:
            coefficients[:] = 0.0
            coefficients[0] = upper
            break
    return coefficients


@lru_cache(maxsize=8)
def quadric(height: int, width: int) -> NDArray[np.float64]:
    """Return the terms of a quadric at the points of a grid from -1 to 1."""
    rows, columns = np.linspace(-1.0, 1.0, height), np.linspace(-1.0, 1.0, width)
    y, x = np.meshgrid(rows, columns, indexing="ij")
    terms = (np.ones_like(x), x, y, x * x, x * y, y * y)
    return np.stack([term.ravel() for term in terms], axis=1)


def _quantiles(values: NDArray[np.floating], *parts: float) -> list[float]:
    """Return the values that these parts of all are below, to the nearest value."""
    places = [round(part * (values.size - 1)) for part in parts]
    ordered = np.partition(values, places, axis=None)
    return [float(ordered[place]) for place in places]


@njit(cache=True, error_model="numpy")
def _divide(
    ratio: NDArray[np.float32], c: NDArray[np.float32], floor: np.float32
) -> NDArray[np.float32]:
    """Divide by the quadric, which is at least `floor`; return each fourth dark one.

    In place: another picture would take its room in the cache.
    """
    height, width = ratio.shape
    x = np.linspace(-1.0, 1.0, width).astype(np.float32)
    y = np.linspace(-1.0, 1.0, height).astype(np.float32)
    darker = np.empty(((height + 1) // 2) * ((width + 1) // 2), np.float32)
    count = 0
    for i in range(height):
        level, slope = c[0] + y[i] * (c[2] + c[5] * y[i]), c[1] + c[4] * y[i]
        row = ratio[i]
        for j in range(width):
            light = level + x[j] * (slope + c[3] * x[j])
            row[j] /= light if light > floor else floor
        if i % 2 == 0:
            for j in range(0, width, 2):
                if row[j] < _NO_PAPER:
                    darker[count] = row[j]
                    count += 1
    return darker[:count]
