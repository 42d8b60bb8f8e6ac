"""The middle line of a long thin thing, as the centres of its level sets.

A geodesic distance from the root orders the pixels of the thing, so that it may bend as
it likes.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.robust import median
from .discs import opened

Array = NDArray[np.float64]
Mask = NDArray[np.uint8]


_OPENINGS = 0.5, 0.35
"""Discs that hairs are thinner than, in half widths of the thing."""
_FINE_HALF = 8.0
"""Half width, px, that shows all there is to see: of wider things, fewer pixels do."""
_REACHED = 0.5
"""Part of a thing that is reached from its root, at least."""


def level_sets(piece: Mask, seeds: Mask | None, half: float) -> Array | None:
    """Return the centres of the geodesic level sets, shape (n, 2), root to tip."""
    every = int(half / _FINE_HALF)
    if every > 1:
        if seeds is not None:
            square = np.ones((every, every), np.uint8)
            seeds = np.asarray(cv2.dilate(seeds, square), np.uint8)[::every, ::every]
        curve = level_sets(piece[::every, ::every], seeds, half / every)
        return None if curve is None else every * curve
    piece = np.ascontiguousarray(piece)
    for opening in _OPENINGS:
        distance = _from_root(piece, seeds, half, opening)
        if np.count_nonzero(distance >= 0.0) > _REACHED * cv2.countNonZero(piece):
            break  # else it cut the thing in two, at a gap in a yarn
    step = max(1.0, half)
    top = float(distance.max())
    if top < 4.0 * step:
        return None
    sums = np.zeros((int(top / step) + 1, 3))
    _sum_sets(distance, step, sums)
    count = sums[:, 0]
    if np.any(count == 0):
        return None
    curve = sums[:, 1:] / count[:, None]
    return curve[:-1] if count[-1] < 0.5 * median(count) else curve


def _from_root(
    piece: Mask, seeds: Mask | None, half: float, opening: float
) -> NDArray[np.float32]:
    """Return the distance from the root inside a thing without its hairs, else -1."""
    smooth = piece
    if half >= 3.0:
        smooth = opened(piece, int(opening * half))
        if seeds is not None:
            smooth = smooth | (piece & seeds)
    smooth = np.ascontiguousarray(smooth, dtype=np.uint8)
    if seeds is None:
        first = np.argmax(smooth)
        far = np.zeros_like(smooth)
        far.flat[first] = 1
        distance = _geodesic(smooth, far)
        seeds = np.zeros_like(smooth)
        seeds.flat[int(np.argmax(distance))] = 1
    return np.asarray(_geodesic(smooth, np.ascontiguousarray(seeds & smooth)))


@njit(cache=True)
def _sum_sets(distance: NDArray[np.float32], step: float, sums: Array) -> None:
    """Add up number, x and y of the pixels of each level set."""
    height, width = distance.shape
    for i in range(height):
        for j in range(width):
            if distance[i, j] >= 0.0:
                k = int(distance[i, j] / step)
                sums[k, 0] += 1.0
                sums[k, 1] += j
                sums[k, 2] += i


@njit(cache=True)
def _geodesic(mask: Mask, seeds: Mask) -> NDArray[np.float32]:
    """Distance from the seeds inside the mask (8 neighbours); -1 where unreached."""
    height, width = mask.shape
    distance = np.full((height, width), -1.0, dtype=np.float32)
    size = int(mask.sum()) + 1
    queue = np.empty(size, dtype=np.int64)
    waiting = np.zeros(height * width, dtype=np.uint8)
    head, tail = 0, 0
    for i in range(height):
        for j in range(width):
            if seeds[i, j] and mask[i, j]:
                distance[i, j] = 0.0
                queue[tail] = i * width + j
                waiting[i * width + j] = 1
                tail += 1
    while head != tail:
        place = queue[head]
        head = (head + 1) % size
        waiting[place] = 0
        i, j = place // width, place % width
        for di in range(-1, 2):
            for dj in range(-1, 2):
                k, m = i + di, j + dj
                if k < 0 or m < 0 or k >= height or m >= width or mask[k, m] == 0:
                    continue
                step = 1.0 if di == 0 or dj == 0 else 1.41421356
                new = distance[i, j] + np.float32(step)
                old = distance[k, m]
                if old < 0.0 or new < old - 1e-4:
                    distance[k, m] = new
                    spot = k * width + m
                    if waiting[spot] == 0:
                        waiting[spot] = 1
                        queue[tail] = spot
                        tail = (tail + 1) % size
    return distance
