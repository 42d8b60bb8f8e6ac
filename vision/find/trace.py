"""The middle line of a thin piece of the mask, from what it grows from to its end."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..curve.robust import median
from ..edge.state import Root
from .binarise import Binary
from .candidate import Candidate
from .level_sets import LevelSets, Places, level_sets
from .straight_on import Way, straight_on

Mask = NDArray[np.uint8]

_MOST_ACROSS = 4
"""Arms that are followed of those that branch off."""

_SHORTEST = 2.0
"""Shortest piece, in widths, that may be a part of a rod."""


def traced(
    piece: Mask, fat: Mask, place: tuple[int, int], half: float, binary: Binary
) -> list[Candidate]:
    """Return the rod in a piece of the mask, or those in it that cross each other.

    Parameters
    ----------
    piece, fat : ndarray, shape (h, w)
        1 on the piece, which a frame surrounds, and on what is too thick for a rod.
    place : tuple of int
        Column and row of both in the working picture.
    half : float
        Half width of the piece there, px.
    binary : Binary
        The working picture.
    """
    if cv2.countNonZero(piece) < 4.0 * _SHORTEST * half * half:
        return []
    held = _contacts(piece & _grown(fat))
    leaving = _contacts(piece & _border(piece.shape, place, binary))
    root: Root = "clamp" if held else "border" if leaving else "free"
    ends = held or leaving
    ways: list[tuple[LevelSets, Way]] = []
    found: list[Candidate] = []

    def follow(seeds: Places | None, root: Root) -> bool:
        """Add what begins at an end; tell whether anything crosses it."""
        sets = level_sets(piece, seeds, half)
        if sets is None:
            return False
        x, y = np.rint(sets.centres + place).astype(int).T
        light = np.asarray(binary.ratio[y, x], np.float64)
        touching = set().union(*map(sets.parts_at, held))
        way = straight_on(sets, light, touching)
        if len(way.points) < 2:
            return way.branched
        at_clamp, at_border = (
            [spot for spot in spots if spot is seeds or _lies_on(spot, way, sets)]
            for spots in (held, leaving)
        )
        part = _candidate(way, place, half, binary, root, len(at_clamp), len(at_border))
        held_there = root == "free" and (at_clamp or at_border)
        found.append(part.reversed() if held_there else part)
        ways.append((sets, way))
        return way.branched

    if not follow(ends[0] if ends else None, root):
        return found
    for seeds in ends[1:]:
        if not any(_lies_on(seeds, way, sets) for sets, way in ways):
            follow(seeds, root)
    for sets, way in tuple(ways):
        for part in way.passed[:_MOST_ACROSS]:
            seeds = sets.where(part)
            if not any(_lies_on(seeds, way, sets) for sets, way in ways):
                follow(seeds, "free")
    return found


def _lies_on(places: Places, way: Way, sets: LevelSets) -> bool:
    """Whether places touch any of the parts that a way leads through."""
    return not sets.parts_at(places).isdisjoint(way.parts)


def _candidate(
    way: Way, place: tuple[int, int], half: float, binary: Binary, root: Root,
    at_clamp: int, at_border: int,
) -> Candidate:  # fmt: skip
    points = way.points + place
    steps = np.hypot(*np.diff(points, axis=0).T)
    length = float(steps.sum()) + (2.0 if root == "free" else 1.0) * half
    x, y = np.rint(points).astype(int).T
    f = binary.factor
    shift = 0.5 * f - 0.5
    return Candidate(
        points_px=f * points + shift,
        width_px=max(2.0 * half, 1.0) * f,
        length_px=length * f,
        root=root,
        contacts=at_clamp + at_border + way.barred,
        leaves=at_border > (root == "border"),
        ratio=median(binary.ratio[y, x]),
        hidden_px=f * (way.hidden + [*place, 0.0]) + [shift, shift, 0.0],  # noqa: RUF005
    )


def _contacts(both: Mask) -> list[Places]:
    """Return the places (row, column) where two masks meet, those that touch as one."""
    x, y, w, h = cv2.boundingRect(both)
    if w == 0:
        return []
    # Far fewer pixels than the whole, and a frame for them to grow into.
    small = np.zeros((h + 4, w + 4), np.uint8)
    small[2:-2, 2:-2] = both[y : y + h, x : x + w]
    count, labels = cv2.connectedComponents(_grown(small))
    places = np.argwhere(small)
    label = labels[tuple(places.T)]
    places += [y - 2, x - 2]
    return [places[label == k] for k in range(1, count)]


def _grown(mask: Mask) -> Mask:
    """Grow a mask by two pixels."""
    return np.asarray(cv2.dilate(mask, np.ones((5, 5), np.uint8)), dtype=np.uint8)


def _border(shape: tuple[int, ...], place: tuple[int, int], binary: Binary) -> Mask:
    """Mark the outermost pixels of the picture inside a window."""
    height, width = binary.mask.shape
    x, y = place
    inside = np.zeros(shape, np.uint8)
    inside[: max(1 - y, 0)] = 1
    inside[max(height - 1 - y, 0) :] = 1
    inside[:, : max(1 - x, 0)] = 1
    inside[:, max(width - 1 - x, 0) :] = 1
    return inside
