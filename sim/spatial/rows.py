"""Many rods in space, one after the other in one call (`batch.space`)."""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import in_reach
from ..planar.contact import touches
from .curve import shape
from .march import STATE, loads_on
from .newton import LOST, room, run, solve_sure, unloaded

REACH_LIMIT = 30.0
"""Largest sum of h sqrt(P / EI): beyond, a tip's pose no longer fixes the root's."""
TURN_LIMIT = 300.0
"""Largest turn of the unloaded rod, in rad."""
STABLE, UNSTABLE, GONE, BEYOND, TOUCHES, LEAVES = range(6)
"""Outcomes (`batch.tips.OUTCOMES`)."""
GOAL = 1e-7
"""Correction of the tip's pose after which Newton ends."""
POINTS = 41
"""Stations at which contact is looked for."""


@njit(cache=True)
def _meets(rod, field, margin, n, curve, s, states):  # type: ignore[no-untyped-def]
    """Tell whether the rod of a curve of n steps touches a source."""
    if not in_reach(field, margin):
        return False
    shape(rod, n, curve, s, states)
    line = np.empty((POINTS, 6))
    for k in range(POINTS):
        for i in range(3):
            line[k, i] = states[k, 12 + i]
            line[k, 3 + i] = states[k, 3 * i + 2]
    return touches(field, margin, s, line)


@njit(cache=True)
def _leaves(rod, n, curve, box, s, states):  # type: ignore[no-untyped-def]
    """Tell whether the rod of a curve of n steps leaves a box (6,)."""
    if not math.isfinite(box[0]):
        return False
    shape(rod, n, curve, s, states)
    for k in range(POINTS):
        for i in range(3):
            if not box[i] <= states[k, 12 + i] <= box[3 + i]:
                return True
    return False


@njit(cache=True, inline="always")
def _solve(rod, field, Rc, margin, box, R, r, s, states):  # type: ignore[no-untyped-def]
    """Return outcome, Morse index and error of one rod, and leave its tip's pose."""
    reach, turn = loads_on(rod, field, Rc[:, 2].copy())
    if not turn <= TURN_LIMIT:
        return BEYOND, -1, math.nan
    if turn > 0.0 or in_reach(field, margin):
        n = 2.0 + 1.5 * turn
        held = room(rod, field, n)
        unloaded(rod, field, n, Rc, R, r, held)
        run(rod, field, 0.0, n, R, r, False, math.inf, held)
        if _meets(rod, field, margin, n, held[1], s, states):
            return TOUCHES, -1, math.nan
        reach, turn = loads_on(rod, field, r)
    if not reach <= REACH_LIMIT:
        return BEYOND, -1, math.nan
    n = 1.7 + 3.0 * reach + 1.4 * turn
    index, _, error, n, held = solve_sure(rod, field, n, Rc, R, r, GOAL)
    if index == LOST:
        return BEYOND, -1, math.nan
    if index < 0 or _meets(rod, field, margin, 2.0 * n, held[1], s, states):
        return GONE, -1, math.nan
    if _leaves(rod, 2.0 * n, held[1], box, s, states):
        return LEAVES, -1, math.nan
    return STABLE if index == 0 else UNSTABLE, index, error


@njit(cache=True, nogil=True)
def solve_rods(rods, fields, Rc, margins, boxes, out, outcome, index):  # type: ignore[no-untyped-def]
    """Solve rods (n, sections, 13) in fields (n, width), clamped along `Rc`.

    `boxes` (n, 6) are those that they must not leave, from least to largest (x, y, z).

    Fills `out` (n, 7) with position and tangent of the tips and errors, `outcome` and
    `index`.
    """
    R, r = np.empty((3, 3)), np.empty(3)
    s = np.linspace(0.0, 1.0, POINTS)
    states = np.empty((POINTS, STATE + 3))
    for i in range(rods.shape[0]):
        outcome[i], index[i], out[i, 6] = _solve(
            rods[i], fields[i], Rc, margins[i], boxes[i], R, r, s, states
        )
        for k in range(3):
            out[i, k] = r[k] if index[i] >= 0 else math.nan
            out[i, 3 + k] = R[k, 2] if index[i] >= 0 else math.nan
