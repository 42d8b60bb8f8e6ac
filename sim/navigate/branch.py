"""Where a branch goes that the rod left in a snap: folds, contacts, stable states."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .arc import (
    STIFF,
    advanced,
    beside,
    further,
    gaps,
    index_of,
    matrix,
    meshed,
    metric,
    own,
    tangent,
)
from .case import Case
from .in_plane import PlanarWalk, State
from .passage import Branch, Step

Array = NDArray[np.float64]

MOST = 160
"""States of a branch."""
FIRST, LONGEST, LEAST = 0.1, 0.5, 1e-4
"""Arcs between them: the first, the longest, and the one that is given up on."""
TURN = 0.8
"""Least cosine between the ways on before and after a step."""
TOUCH = 1e-6, 4e-6
"""How deep a point is behind a wall where it becomes a contact, in rod's lengths."""
HALVINGS = 40
PROBE = 1e-3
"""Arc over which gaps are seen to open or close."""
WEAK = 3.0
"""A contact whose force would be gone within so many arcs may be what is in the way."""
BEYOND = "stable, further than before"
OUT = "at the rod's end"
LONG = "goes on"
LOST = "lost"

Way = tuple[State, Array]


def branches_of(walk: PlanarWalk) -> tuple[Branch, ...]:
    """Return the branches that a rod left on its way; snaps in a row are one."""
    found = []
    last = math.inf
    for left, step in walk.left:
        if abs(left.insertion_mm - last) > walk.step_mm:
            way = math.copysign(1.0, step)
            found.append(follow_branch(walk.case, left, way, walk.step_mm, walk.seen))
        last = left.insertion_mm
    return tuple(found)


def follow_branch(
    case: Case, left: State, way: float, step_mm: float, read: Callable[[State], Step]
) -> Branch:
    """Follow the branch of a state that the rod snapped from.

    Parameters
    ----------
    case : Case
        Without friction.
    left : State
        The last state before the snap.
    way : float
        1 if the rod was pushed, -1 if it was drawn back.
    step_mm : float
        Step of the insertion.
    read : callable
        Makes a `Step` of a state.
    """
    state = own(left)
    state.energy, state.rubbing = left.energy, left.rubbing
    row = np.zeros(len(state.u) + 1)
    row[-1] = way
    towards = tangent(case, state, row, metric(case, state, step_mm))
    steps, indices = [read(state)], [index_of(case, state)]
    arc, end = FIRST, LONG
    while len(steps) < MOST:
        try:
            found = _next(case, state, towards, metric(case, state, step_mm), arc)
        except np.linalg.LinAlgError:  # branches cross here: take another arc
            found = None
        if found is None:
            arc *= 0.5
            if arc < LEAST:
                end = LOST
                break
            continue
        same = found[0].touches.used[0] == state.touches.used[0]
        state, towards = meshed(case, *found)
        if not 0.0 < state.insertion_mm < case.length_mm:
            end = OUT
            break
        state.energy = matrix(case, state, STIFF)[2]
        state.rubbing = np.zeros(state.touches.used[0])
        steps.append(read(state))
        indices.append(index_of(case, state))
        arc = min(1.5 * arc, LONGEST) if same else FIRST
        beyond = max(way * step.insertion_mm for step in steps[:-1])
        if indices[-1] == 0 and any(indices) and way * state.insertion_mm > beyond:
            end = BEYOND
            break
    return Branch(
        from_mm=left.insertion_mm, end=end, steps=tuple(steps), indices=tuple(indices)
    )


def _next(
    case: Case, state: State, towards: Array, weights: Array, arc: float
) -> Way | None:
    """Return the next state and its way on; None if the arc is too long."""
    new = further(case, state, towards, weights, arc)
    if new is None:
        return _released(case, state, towards, weights, arc)
    if beside(case, new)[0] > TOUCH[1]:
        return _touched(case, state, towards, weights, arc)
    onwards = tangent(case, new, weights * towards, weights)
    if (weights * towards) @ onwards < TURN:
        return None
    return new, onwards


def _touched(
    case: Case, state: State, towards: Array, weights: Array, arc: float
) -> Way | None:
    """Return the state within an arc where the rod first touches, and its way on.

    There the branch has a corner, and may turn back: the wall's new force grows.
    """
    low, high = 0.0, arc
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        new = further(case, state, towards, weights, middle)
        if new is None:
            return None
        deep, touching = beside(case, new)
        if deep < TOUCH[0]:
            low = middle
        elif deep > TOUCH[1]:
            high = middle
        else:
            break
    else:
        return None
    force = touching.touches.force[: touching.touches.used[0]]
    added = np.flatnonzero(force == 0.0)
    if len(added) == 0:
        return None
    k = added[-1]
    onwards = tangent(case, touching, weights * towards, weights)
    return touching, -onwards if _opening(case, touching, onwards)[k] > 0.0 else onwards


def _released(
    case: Case, state: State, towards: Array, weights: Array, arc: float
) -> Way | None:
    """Return the state without the contact that is about to let go; None if none is.

    There, too, the branch has a corner: the gap grows.
    """
    n = state.touches.used[0]
    force, fall = state.touches.force[:n], STIFF * _opening(case, state, towards)
    left = np.where(fall > 0.0, force / np.maximum(fall, 1e-30), np.inf)
    if n == 0 or left.min() > WEAK * arc or arc > 4.0 * LEAST:
        return None
    k = int(left.argmin())
    new = own(state)
    for array in new.touches[1:]:
        array[k : n - 1] = array[k + 1 : n].copy()
    new.touches.used[0] = n - 1
    onwards = tangent(case, new, weights * towards, weights)
    opens = _opening(case, state, onwards)[k] > 0.0
    return new, onwards if opens else -onwards


def _opening(case: Case, state: State, towards: Array) -> Array:
    """Return how fast the gaps of a state's contacts grow along a way."""
    ahead, behind = (
        gaps(case, advanced(case, state, way * towards)) for way in (PROBE, -PROBE)
    )
    return np.asarray((ahead - behind) / (2.0 * PROBE))
