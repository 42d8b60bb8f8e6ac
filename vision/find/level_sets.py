"""The level sets of a long thin thing, by the distance from its root inside it.

A geodesic distance from the root orders the pixels of the thing, so that it may bend as
it likes. Each connected part of a level set has one before it, nearer to the root: the
parts are a tree, which branches where something else crosses the thing. Those on both
sides of a slit in it are one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from .discs import opened

Array = NDArray[np.float64]
Mask = NDArray[np.uint8]
Places = NDArray[np.intp]


_OPENINGS = 0.5, 0.35
"""Discs that hairs are thinner than, in half widths of the thing."""
_FINE_HALF = 8.0
"""Half width, px, that shows all there is to see: of wider things, fewer pixels do."""
_SLIT = 4.0
"""Half widths between the middles of what a slit parts, at most."""
_REACHED = 0.5
"""Part of a thing that is reached from its root, at least."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelSets:
    """The parts of the level sets of a thing, numbered from 0.

    Parameters
    ----------
    part : ndarray of int, shape (h, w)
        Number of the part of each pixel (of each `every`-th one); -1 outside.
    every : int
        Pixels of the thing per pixel here.
    centres : ndarray, shape (n, 2)
        Centres (x, y) of the parts, in pixels of the thing.
    size : ndarray, shape (n,)
        Pixels of each part, of those here.
    level, before : ndarray of int, shape (n,)
        Level of each part, 0 at the root, and the part before it; -1 at the root.
    step : float
        Distance of levels, in pixels of the thing.
    """

    part: NDArray[np.int32]
    every: int
    centres: Array
    size: Array
    level: Places
    before: Places
    step: float

    def parts_at(self, mask: Mask) -> Places:
        """Return the numbers of the parts under a mask of the thing's size."""
        parts = np.unique(self.part[thinned(mask, self.every) > 0])
        return np.asarray(parts[parts >= 0], np.intp)

    def where(self, part: int, shape: tuple[int, ...]) -> Mask:
        """Return the mask of a part, of the thing's shape."""
        mask = np.zeros(shape, np.uint8)
        mask[:: self.every, :: self.every] = self.part == part
        return mask


def level_sets(piece: Mask, seeds: Mask | None, half: float) -> LevelSets | None:
    """Return the level sets of a thing; None where it is too short for any.

    Parameters
    ----------
    piece : ndarray, shape (h, w)
        1 on the thing, which a frame of 1 px surrounds.
    seeds : ndarray, shape (h, w), or None
        1 at its root; None begins at one of its ends.
    half : float
        Its half width, px.
    """
    every = max(1, int(half / _FINE_HALF))
    small = np.ascontiguousarray(piece[::every, ::every])
    seeds = None if seeds is None else thinned(seeds, every)
    half /= every
    for opening in _OPENINGS:
        distance = _from_root(small, seeds, half, opening)
        if np.count_nonzero(distance >= 0.0) > _REACHED * cv2.countNonZero(small):
            break  # else it cut the thing in two, at a gap in a yarn
    step = max(1.0, half)
    if float(distance.max()) < 4.0 * step:
        return None
    part, sums, pairs = _parts(distance, step)
    part, sums = _without_slits(part, sums, np.unique(pairs, axis=0), _SLIT * half)
    return LevelSets(
        part=part, every=every, centres=every * sums[:, 1:3] / sums[:, :1],
        size=sums[:, 0], level=sums[:, 3].astype(np.intp),
        before=sums[:, 4].astype(np.intp), step=every * step,
    )  # fmt: skip


def thinned(mask: Mask, every: int) -> Mask:
    """Return every so many pixels of a mask, none of which gets lost."""
    if every == 1:
        return mask
    grown = cv2.dilate(mask, np.ones((every, every), np.uint8))
    return np.ascontiguousarray(np.asarray(grown, np.uint8)[::every, ::every])


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
def _parts(
    distance: NDArray[np.float32], step: float
) -> tuple[NDArray[np.int32], Array, NDArray[np.int32]]:
    """Return the part of each pixel; size, sums of x and y, level and part before.

    And pairs of parts that are before one part both.
    """
    height, width = distance.shape
    part = np.full((height, width), np.int32(-1))
    stack = np.empty(height * width, np.int64)
    sums = np.zeros((64, 5))
    count = 0
    for place in range(height * width):
        i, j = place // width, place % width
        if distance[i, j] < 0.0 or part[i, j] >= 0:
            continue
        if count == len(sums):
            sums = np.concatenate((sums, np.zeros_like(sums)))
        level = int(distance[i, j] / step)
        sums[count, 3], sums[count, 4] = level, -1.0
        part[i, j], stack[0], waiting = count, place, 1
        while waiting:
            waiting -= 1
            i, j = stack[waiting] // width, stack[waiting] % width
            sums[count, 0] += 1.0
            sums[count, 1] += j
            sums[count, 2] += i
            for k in range(max(i - 1, 0), min(i + 2, height)):
                for m in range(max(j - 1, 0), min(j + 2, width)):
                    if distance[k, m] < 0.0 or part[k, m] >= 0:
                        continue
                    if int(distance[k, m] / step) == level:
                        part[k, m], stack[waiting] = count, k * width + m
                        waiting += 1
        count += 1
    pairs, found = np.zeros((16, 2), np.int32), 0
    for i in range(height):
        for j in range(width):
            own = part[i, j]
            if own < 0:
                continue
            for k in range(max(i - 1, 0), min(i + 2, height)):
                for m in range(max(j - 1, 0), min(j + 2, width)):
                    other = part[k, m]
                    if other < 0 or sums[other, 3] != sums[own, 3] - 1.0:
                        continue
                    first = int(sums[own, 4])
                    if first < 0:
                        sums[own, 4] = other
                    elif first != other:
                        if found == len(pairs):
                            pairs = np.concatenate((pairs, np.zeros_like(pairs)))
                        pairs[found, 0], pairs[found, 1] = first, other
                        found += 1
    return part, sums[:count], pairs[:found]


def _without_slits(
    part: NDArray[np.int32], sums: Array, pairs: NDArray[np.int32], near: float
) -> tuple[NDArray[np.int32], Array]:
    """Return the parts once more, those as one that lie so near and join again."""
    same = np.arange(len(sums))
    centres, before = sums[:, 1:3] / sums[:, :1], sums[:, 4].astype(np.intp)
    for first, other in pairs:
        sides = []
        while first >= 0 and same[first] != same[other]:
            if math.dist(centres[first], centres[other]) >= near:
                break  # the loop of a mesh, or of a rod: no slit
            sides.append((first, other))
            first, other = before[first], before[other]
        else:
            for one, two in sides:
                same[same == same[two]] = same[one]
    kept, number = np.unique(same, return_inverse=True)
    if len(kept) == len(sums):
        return part, sums
    joined = sums[kept]
    joined[:, :3] = 0.0
    np.add.at(joined, number, np.pad(sums[:, :3], ((0, 0), (0, 2))))
    joined[:, 4] = np.where(joined[:, 4] < 0.0, -1.0, number[before[kept]])
    return np.where(part < 0, part, number[part]).astype(np.int32), joined


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
