"""Long thin things at every level: the branches of a component tree, and their worth.

At one level a rod may be joined to a shade, at another cut off from a pale clamp; over
all levels it is what keeps its width and its place. Each candidate of each level is
laid to those of other levels that it covers; what is seen at many levels is a thing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .binarise import Binary, rebinarise
from .candidate import Candidate
from .rod import find_candidates

_RANK = {"clamp": 2, "border": 1, "free": 0}
_ALIKE_WIDTH, _ALIKE_LENGTH = 1.7, 0.6
_THIN = 25.0
"""Length over width above which a thing is no more like a rod: lines are longer."""
LEAST_LEVELS = 2
"""Seen at fewer levels, a thing is a pattern of noise."""
_STROKES, _PARALLEL, _STRAIGHT, _LONGER = 3, 0.05, 0.93, 1.5
"""So many alike, parallel to so many radians and so straight (as pixels tell), are
strokes of a scale beside a thing that is so many times longer."""


@dataclass(slots=True)
class Thing:
    """One thing at all levels at which it is seen, the strictest first.

    Parameters
    ----------
    seen : list of Candidate
        How each level shows it.
    is_shade : bool
        Whether it may be the shade of another.
    """

    seen: list[Candidate] = field(default_factory=list)
    is_shade: bool = False

    @property
    def best(self) -> Candidate:
        """How it is seen best: from its root on, and with the least of its shade."""
        rank = max(_rank(item) for item in self.seen)
        longest = max(item.length_px for item in self.seen if _rank(item) == rank)
        return next(
            item
            for item in self.seen
            if _rank(item) == rank and item.length_px > 0.93 * longest
        )

    @property
    def worth(self) -> float:
        """How likely it is the rod: seen at many levels, held, and whole."""
        best = self.best
        whole = 0.5 if best.contacts > 1 else 1.0
        thin = math.sqrt(min(best.slenderness, _THIN))
        return whole * (len(self.seen) + 3.0 * _RANK[best.root]) * thin

    def covers(self, other: Candidate) -> bool:
        """Whether a candidate of another level is this thing."""
        for item in (self.seen[-1], self.seen[0]):
            width = max(item.width_px, other.width_px)
            middle = item.points_px[len(item.points_px) // 2]
            other_middle = other.points_px[len(other.points_px) // 2]
            near = item.away(other_middle) < width or other.away(middle) < width
            if near and _within(item.width_px, other.width_px, 1.0 / _ALIKE_WIDTH):
                return _within(item.length_px, other.length_px, _ALIKE_LENGTH)
        return False


@dataclass(frozen=True, slots=True)
class Levels:
    """What is long and thin at each level of a picture, looked for once.

    Parameters
    ----------
    binary : Binary
        The picture; its `ratio` is below a threshold on things.
    """

    binary: Binary
    _known: dict[float, list[Candidate]] = field(default_factory=dict)

    def below(self, threshold: float) -> list[Candidate]:
        """Return the long thin things at a level, longest first."""
        if threshold not in self._known:
            at_level = rebinarise(self.binary, threshold)
            self._known[threshold] = find_candidates(at_level)
        return self._known[threshold]


def find_things(
    levels: Levels, thresholds: Iterable[float], least_px: float
) -> list[Thing]:
    """Return the long thin things of a picture, the likeliest rod first.

    Parameters
    ----------
    levels : Levels
        The picture.
    thresholds : iterable of float
        The levels, the strictest first.
    least_px : float
        Length of the shortest.
    """
    things: list[Thing] = []
    for threshold in thresholds:
        for item in levels.below(threshold):
            if item.length_px < least_px:
                continue
            held = next((thing for thing in things if thing.covers(item)), None)
            if held is None:
                things.append(Thing([item]))
            else:
                held.seen.append(item)
    stable = _joined([thing for thing in things if len(thing.seen) >= LEAST_LEVELS])
    return sorted(stable, key=lambda thing: -thing.worth)


def without_strokes(things: list[Thing]) -> list[Thing]:
    """Leave out the strokes of a ruler's scale where something longer is left."""
    best = [thing.best for thing in things]
    strokes = [_alike_beside(item, best) >= _STROKES for item in best]
    longest = max(
        (item.length_px for item, stroke in zip(best, strokes, strict=True) if stroke),
        default=0.0,
    )
    rest = [thing for thing, stroke in zip(things, strokes, strict=True) if not stroke]
    longer = any(thing.best.length_px > _LONGER * longest for thing in rest)
    return rest if longer else things


def _alike_beside(one: Candidate, things: list[Candidate]) -> int:
    """Return how many straight things lie like one, itself among them, side by side."""
    along = one.points_px[-1] - one.points_px[0]
    along = along / np.hypot(*along)
    count = 0
    for other in things:
        chord = other.points_px[-1] - other.points_px[0]
        across = abs(along[0] * chord[1] - along[1] * chord[0])
        beside = other.points_px[len(other.points_px) // 2] - one.points_px[0]
        shift = float(beside @ along) / one.length_px
        count += (
            np.hypot(*chord) > _STRAIGHT * other.length_px
            and across < _PARALLEL * np.hypot(*chord)
            and _within(one.length_px, other.length_px, 0.5)
            and _within(one.width_px, other.width_px, 0.4)
            and -0.5 < shift < 1.5
        )
    return count


def _joined(things: list[Thing]) -> list[Thing]:
    """Lay what floats free at strict levels to its outer part that a clamp holds.

    Where deep shade joins rod and clamp, at the levels that show the clamp only the
    part outside the shade is thin. But what has two such parts, one to either end, is
    held by neither: there it lies across something.
    """
    left = list(things)
    for free in things:
        whole = free.best
        if whole.root != "free":
            continue
        outer = [
            thing
            for thing in things
            if thing.best.root == "clamp" and _is_outer_part(thing.best, whole)
        ]
        if not outer:
            continue
        tips = [thing.best.points_px[-1] for thing in outer]
        if any(np.hypot(*(tip - tips[0])) > 0.5 * whole.length_px for tip in tips):
            left = [thing for thing in left if thing not in outer]
            continue
        held = [_held(item, tips[0]) for item in free.seen]
        outer[0].seen[:0] = held
        left.remove(free)
    return left


def _is_outer_part(part: Candidate, whole: Candidate) -> bool:
    near = 1.5 * max(part.width_px, whole.width_px)
    middle, tip = part.points_px[len(part.points_px) // 2], part.points_px[-1]
    return (
        part.length_px < whole.length_px
        and whole.away(tip) < near
        and whole.away(middle) < 0.5 * near
        and _within(part.width_px, whole.width_px, 1.0 / _ALIKE_WIDTH)
    )


def _held(item: Candidate, tip: NDArray[np.float64]) -> Candidate:
    """Return a free thing as held at its other end than that next to a tip."""
    first, last = (np.hypot(*(item.points_px[k] - tip)) for k in (0, -1))
    points = item.points_px[::-1] if first < last else item.points_px
    return replace(item, points_px=points, root="clamp", contacts=1)


def _rank(item: Candidate) -> float:
    """Return how it is held; touching something else is half a step worse."""
    return _RANK[item.root] - 0.5 * (item.contacts > 1)


def _within(one: float, other: float, ratio: float) -> bool:
    return bool(ratio < np.divide(one, other) < 1.0 / ratio)
