"""The way of a rod through what crosses it: straight on, in the same light.

Where two long thin things lie across each other, their dark is one, with four arms. An
elastic rod has no corners, so that of the arms beyond a crossing the one is its own
that lies where its curve leads.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from ..curve.robust import median
from .level_sets import LevelSets
from .track import predict

Array = NDArray[np.float64]

_ARM, _ARM_PX = 3, 6.0
"""Levels, each half a width, and pixels that an arm is longer than; less is a rag."""

_AHEAD, _RECENT = 7, 12
"""Levels ahead at which an arm is compared with where the curve leads, and levels
behind from which that is known."""

_MOST_ARMS = 8
"""What has more arms is a web of noise or of grains."""

_ASTRAY = 0.55
"""How far an arm may lie off that way, rad."""

_LAG, _SHARP = 4, 1.4
"""Levels that a chord spans, and by how much the next one turns at a corner, rad: a rod
bent to a radius of three levels turns by less."""

_OTHER_LIGHT = 3.0
"""What a difference of light, over the paper's, counts as, rad."""

_BULGED = 1.3
"""Size of a level set, over the median, that another thing has part in."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """The middle line of a thing from its root on, and what crosses it.

    Parameters
    ----------
    parts : list of int
        The parts of the level sets that it leads through, where nothing crosses.
    points : ndarray, shape (n, 2)
        Their centres, but none where something crosses.
    hidden : ndarray, shape (k, 3)
        Places (x, y, radius) where something crosses.
    passed : list of int
        The last part of each arm that branches off.
    branched, barred : bool
        Whether anything branches off; and whether the way ends there, for no arm leads
        straight on.
    """

    parts: list[int]
    points: Array
    hidden: Array
    passed: list[int]
    branched: bool
    barred: bool


def straight_on(sets: LevelSets, light: Array, touching: set[int]) -> Way:
    """Follow a thing from its root through the parts of its level sets.

    Parameters
    ----------
    sets : LevelSets
        The parts.
    light : ndarray, shape (n,)
        Light at their centres, over the paper's.
    touching : set of int
        Parts that touch something thick, as a crossing is: at a corner there the way
        leads round into what crosses the thing.
    """
    after, height = _tree(sets)
    way = [_highest(np.flatnonzero(sets.level == 0).tolist(), height)]
    crossed: list[tuple[int, int]] = []
    passed: list[int] = []
    barred = False
    least = max(_ARM, int(_ARM_PX / sets.step))
    while after[way[-1]]:
        at, later = way[-1], after[way[-1]]
        if len(later) == 1:
            way += later
            continue
        if sum(height[part] >= least for part in later) < 2:
            way.append(_highest(later, height))
            continue
        arms = _ways_from(at, sets, after)
        arm = _straightest(sets, light, way, arms)
        passed += [_end(other[-1], after, height) for other in arms if other is not arm]
        if arm is None:
            barred = True
            break
        crossed.append((len(way) - 1, len(way) + _branches(arm, after, height)))
        way.extend(arm)
    corner = _corner(sets.centres[way])
    if corner is not None and not touching.isdisjoint(_near(way, corner)):
        passed.append(way[-1])
        way, barred = way[: max(corner - _LAG // 2, 1)], True
        crossed = [(k, m) for k, m in crossed if m < corner]
    return _way(sets, way, crossed, passed, barred=barred)


def _corner(centres: Array) -> int | None:
    """Return where a way turns sharply: into what crosses the rod aslant."""
    chords = centres[_LAG:] - centres[:-_LAG]
    turns = np.abs(turn(chords[:-_LAG], chords[_LAG:]))
    if turns.max(initial=0.0) < _SHARP:
        return None
    return int(np.argmax(turns)) + _LAG


def _near(way: list[int], place: int) -> list[int]:
    return way[max(place - _LAG, 1) : place + _LAG + 1]


def _tree(sets: LevelSets) -> tuple[list[list[int]], list[int]]:
    """Return the parts after each, and the levels that follow it."""
    all_before = sets.before.tolist()
    after: list[list[int]] = [[] for _ in all_before]
    height = [0] * len(all_before)
    for part in np.argsort(-sets.level, kind="stable").tolist():
        before = all_before[part]
        if before >= 0:
            after[before].append(part)
            if height[part] >= height[before]:
                height[before] = height[part] + 1
    return after, height


def _ways_from(at: int, sets: LevelSets, after: list[list[int]]) -> list[list[int]]:
    """Return the ways that lead so many levels ahead of a part, or end as arms do.

    None of a web.
    """
    ended, open_ways = [], [[at]]
    for level in range(1, _AHEAD + 1):
        longer = []
        for way in open_ways:
            if not after[way[-1]] and level > _ARM:
                ended.append(way)
            longer += [[*way, part] for part in after[way[-1]]]
        open_ways = longer
        if len(ended) + len(open_ways) > _MOST_ARMS:
            return []
    return [way[1:] for way in (*ended, *open_ways)]


def _highest(parts: list[int], height: list[int]) -> int:
    """Return the part that most levels follow."""
    return max(parts, key=height.__getitem__)


def _end(part: int, after: list[list[int]], height: list[int]) -> int:
    """Return the end of the longest way from a part on."""
    while after[part]:
        part = _highest(after[part], height)
    return part


def _branches(way: list[int], after: list[list[int]], height: list[int]) -> int:
    """Return the place of the last part on a way at which an arm branches off."""
    at = [
        k
        for k, part in enumerate(way)
        if sum(height[later] >= _ARM for later in after[part]) > 1
    ]
    return max(at, default=-1)


def _straightest(
    sets: LevelSets, light: Array, way: list[int], arms: list[list[int]]
) -> list[int] | None:
    """Return the arm that lies where a way leads; None where none does.

    If it is right, the two others of a crossing lead to each other as well.
    """
    recent = np.asarray(way[::-1][1 : _RECENT + 1])
    if len(recent) < 2:
        return max(arms, key=len, default=None)
    path, own = sets.centres[recent], median(light[recent])
    best, found = np.inf, None
    for arm in arms:
        end = arm[-1]
        far = (sets.level[end] - sets.level[recent[0]]) * sets.step
        x, y, _, _ = predict(path, far)
        off = abs(float(turn(sets.centres[end] - path[0], np.array([x, y]) - path[0])))
        astray = off + _OTHER_LIGHT * abs(light[end] - own)
        others = [other for other in arms if other is not arm]
        if len(others) == 2:
            astray += _bend(*(sets.centres[other] for other in others))
        if off < _ASTRAY and astray < best:
            best, found = astray, arm
    return found


def _bend(one: Array, other: Array) -> float:
    """Return by how much a line along two arms bends, rad."""
    half = slice(min(len(one), len(other)) // 2, None)
    inwards, outwards = one[half][0] - one[-1], other[-1] - other[half][0]
    across = other[half][0] - one[half][0]
    return float(abs(turn(inwards, across)) + abs(turn(across, outwards)))


def turn(one: Array, other: Array) -> Array:
    """Return the angle from directions to others, (..., 2), rad."""
    (x, y), (u, v) = one.T, other.T
    return np.asarray(np.arctan2(x * v - y * u, x * u + y * v))


def _way(
    sets: LevelSets, parts: list[int], crossed: list[tuple[int, int]],
    passed: list[int], *, barred: bool,
) -> Way:  # fmt: skip
    """Leave the centres out that lie in a crossing, and say where it is."""
    size = sets.size[parts]
    typical = median(size)
    if not (crossed or barred) and len(size) > 1 and size[-1] < 0.5 * typical:
        size = size[:-1]
    points = sets.centres[parts[: len(size)]]
    bulged = size > _BULGED * typical
    kept, hidden = np.ones(len(points), np.bool_), []
    for first, last in crossed:
        low, high = first - 1, last + 2
        while low > 0 and bulged[low]:
            low -= 1
        while high < len(points) - 1 and bulged[high]:
            high += 1
        low, high = max(low, 0), min(high, len(points) - 1)
        kept[low + 1 : high] = False
        chord = points[high] - points[low]
        hidden.append([*(points[low] + 0.5 * chord), 0.5 * float(np.hypot(*chord))])
    return Way(
        parts=[
            part for part, bare in zip_longest(parts, kept, fillvalue=True) if bare
        ],
        points=points[kept], hidden=np.reshape(hidden, (-1, 3)),
        passed=passed, branched=bool(crossed) or barred, barred=barred,
    )  # fmt: skip
