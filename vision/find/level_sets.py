"""The level sets of a long thin thing, by the distance from its root inside it.

A geodesic distance from the root orders the pixels of the thing, so that it may bend as
it likes. Each connected part of a level set has one before it, nearer to the root: the
parts are a tree, which branches where something else crosses the thing. Those on both
sides of a slit in it are one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

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
_END = 4.0
"""Steps from a mask to the parts next to it, at most."""
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

    def parts_at(self, places: Places) -> set[int]:
        """Return the numbers of the parts at places (row, column) of the thing.

        Of an end so thin that it was taken for a hair, those next to it.
        """
        flat = _thinned(places, self.every, self.part.shape[1])
        found = set(self.part.ravel()[flat].tolist()) - {-1}
        if not found and len(places):
            rows, columns = np.nonzero(self.part >= 0)
            row, column = places.mean(axis=0) / self.every
            away = np.hypot(rows - row, columns - column)
            near = away < _END * self.step / self.every
            found = set(self.part[rows[near], columns[near]].tolist())
        return found

    def where(self, part: int) -> Places:
        """Return the places (row, column) of a part in the thing."""
        return np.asarray(self.every * np.argwhere(self.part == part))


def level_sets(piece: Mask, seeds: Places | None, half: float) -> LevelSets | None:
    """Return the level sets of a thing; None where it is too short for any.

    Parameters
    ----------
    piece : ndarray, shape (h, w)
        1 on the thing, which a frame of 1 px surrounds.
    seeds : ndarray of int, shape (k, 2), or None
        Places (row, column) of its root; None begins at one of its ends.
    half : float
        Its half width, px.
    """
    every = max(1, int(half / _FINE_HALF))
    few = piece[::every, ::every]
    small = np.asarray(
        cv2.copyMakeBorder(few, 0, 1, 0, 1, cv2.BORDER_CONSTANT), np.uint8
    )
    root = None if seeds is None else _thinned(seeds, every, small.shape[1])
    half /= every
    for opening in _OPENINGS:
        distance = _from_root(small, root, half, opening)
        reached = np.flatnonzero(distance >= 0.0)
        if len(reached) > _REACHED * cv2.countNonZero(small):
            break  # else it cut the thing in two, at a gap in a yarn
    step = max(1.0, half)
    if float(distance.max()) < 4.0 * step:
        return None
    part, sums, pairs = _parts(distance, reached, step)
    part, sums = _without_slits(part, sums, pairs, _SLIT * half)
    return LevelSets(
        part=part, every=every, centres=every * sums[:, 1:3] / sums[:, :1],
        size=sums[:, 0], level=sums[:, 3].astype(np.intp),
        before=sums[:, 4].astype(np.intp), step=every * step,
    )  # fmt: skip


def _thinned(places: Places, every: int, width: int) -> Places:
    """Return where places are among every so many rows and columns, as flat indices.

    To either side, since a thing may end between one of them and the next.
    """
    low, high = places // every, -(-places // every)
    return np.concatenate(
        [y[:, 0] * width + x[:, 1] for y, x in product((low, high), repeat=2)]
    )


def _from_root(
    piece: Mask, seeds: Places | None, half: float, opening: float
) -> NDArray[np.float32]:
    """Return the distance from the root inside a thing without its hairs, else -1."""
    smooth = piece
    if half >= 3.0:
        smooth = opened(piece, int(opening * half))
        if seeds is not None:
            smooth.ravel()[seeds] = piece.ravel()[seeds]
    if seeds is None:
        distance = _geodesic(smooth, np.array([np.argmax(smooth)]))
        seeds = np.array([np.argmax(distance)])
    return np.asarray(_geodesic(smooth, seeds))


@njit(cache=True)
def _parts(
    distance: NDArray[np.float32], reached: Places, step: float
) -> tuple[NDArray[np.int32], Array, NDArray[np.int32]]:
    """Return the part of each pixel; size, sums of x and y, level and part before.

    And pairs of parts that are before one part both. Distances of the pixels reached,
    given by flat indices, are not negative.
    """
    far, width = distance.ravel(), distance.shape[1]
    around, _ = _neighbours(width)
    part = np.full(far.size, np.int32(-1))
    for place in reached:  # by its level, as long as its part is not known
        part[place] = -2 - int(far[place] / step)
    stack = np.empty(len(reached), np.int64)
    sums = np.zeros((64, 5))
    count = 0
    for first in reached:
        level = part[first]
        if level >= 0:
            continue
        if count == len(sums):
            sums = np.concatenate((sums, np.zeros_like(sums)))
        sums[count, 3], sums[count, 4] = -2 - level, -1.0
        part[first], stack[0], waiting = count, first, 1
        while waiting:
            waiting -= 1
            place = stack[waiting]
            row = place // width
            sums[count, 0] += 1.0
            sums[count, 1] += place - row * width
            sums[count, 2] += row
            for off in around:
                if part[place + off] == level:
                    part[place + off], stack[waiting] = count, place + off
                    waiting += 1
        count += 1
    pairs, found = np.zeros((16, 2), np.int32), 0
    for place in reached:
        own = part[place]
        level = sums[own, 3] - 1.0
        for off in around:
            other = part[place + off]
            if other < 0 or other == own or sums[other, 3] != level:
                continue
            first = int(sums[own, 4])
            if first < 0:
                sums[own, 4] = other
            elif first != other:
                if found == len(pairs):
                    pairs = np.concatenate((pairs, np.zeros_like(pairs)))
                pairs[found, 0], pairs[found, 1] = first, other
                found += 1
    return part.reshape(distance.shape), sums[:count], pairs[:found]


def _without_slits(
    part: NDArray[np.int32], sums: Array, pairs: NDArray[np.int32], near: float
) -> tuple[NDArray[np.int32], Array]:
    """Return the parts once more, those as one that lie so near and join again."""
    same = np.arange(len(sums))
    centres, before = sums[:, 1:3] / sums[:, :1], sums[:, 4].astype(np.intp)
    for first, other in sorted(set(map(tuple, pairs.tolist()))):
        sides = []
        while first >= 0 and same[first] != same[other]:
            if math.dist(centres[first], centres[other]) >= near:
                break  # the loop of a mesh, or of a rod: no slit
            sides.append((first, other))
            first, other = before[first], before[other]
        else:
            for one, two in sides:
                same[same == same[two]] = same[one]
    if np.array_equal(same, np.arange(len(sums))):
        return part, sums
    kept, number = np.unique(same, return_inverse=True)
    joined = sums[kept]
    joined[:, :3] = 0.0
    np.add.at(joined, number, np.pad(sums[:, :3], ((0, 0), (0, 2))))
    joined[:, 4] = np.where(joined[:, 4] < 0.0, -1.0, number[before[kept]])
    return np.where(part < 0, part, number[part]).astype(np.int32), joined


@njit(cache=True)
def _geodesic(mask: Mask, seeds: Places) -> NDArray[np.float32]:
    """Distance from the seeds inside the mask (8 neighbours); -1 where unreached.

    Seeds are flat indices; of those outside the mask nothing sets out.
    """
    inside = mask.ravel()
    around, far = _neighbours(mask.shape[1])
    distance = np.full(mask.size, np.float32(-1.0))
    size = int(inside.sum()) + 1
    queue = np.empty(size, dtype=np.int64)
    waiting = np.zeros(mask.size, dtype=np.uint8)
    head, tail = 0, 0
    for place in seeds:
        if inside[place] and not waiting[place]:
            distance[place] = 0.0
            queue[tail] = place
            waiting[place] = 1
            tail += 1
    while head != tail:
        place = queue[head]
        head = head + 1 if head + 1 < size else 0
        waiting[place] = 0
        for k in range(8):
            spot = place + around[k]
            if not inside[spot]:
                continue
            new, old = distance[place] + far[k], distance[spot]
            if old < 0.0 or new < old - 1e-4:
                distance[spot] = new
                if not waiting[spot]:
                    waiting[spot] = 1
                    queue[tail] = spot
                    tail = tail + 1 if tail + 1 < size else 0
    return distance.reshape(mask.shape)


@njit(cache=True)
def _neighbours(width: int) -> tuple[Places, NDArray[np.float32]]:
    """Return where the neighbours of a pixel are, flat, and how far away."""
    beside = np.array([-width - 1, -width, -width + 1, -1])
    far = np.array([1.41421356, 1.0, 1.41421356, 1.0], np.float32)
    return np.append(beside, -beside[::-1]), np.append(far, far[::-1])
