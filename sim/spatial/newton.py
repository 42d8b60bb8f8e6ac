"""Equilibria of the rod in space: Newton on the tip's pose, load continuation.

Dimensionless as `spatial.march`.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import blocked
from ..magnet.jet import JET
from .across import NEAR, PLACES
from .curve import KEPT, march, runs_along, shape, tabulate
from .index import matrix, morse_index, solve6
from .march import K1, K3, WORK, Y, Z, all_pairs

CONVERGED = 1e-9
"""Correction after which the next, by the matrix kept, is rounding."""
CLOSE = 1e-3
"""Correction after which the coarse steps have done their part."""
COARSE = 0.5
"""Share of the steps that brings Newton near, and is enough for its matrix."""
STILL = 3e-5
"""Move of the tip up to which the table of the field along a curve serves Newton; the
last march, by 2 n steps, has a new one."""
CHORD = 4e-2
"""Correction after which the matrix is kept."""
MIN_LOAD_STEP = 1e-7
SHORT, PASSING = 1e-5, 1e-6
"""Step of the load, and the correction then enough on the way to the full load: so near
to where a direction becomes unstable rounding leaves more than `CONVERGED`."""
SURE = 1e-6
"""Step of the load too short for a jump to another branch."""
AGREED, ROUGH = 1e-3, 3e-5
"""Difference of two loads at which a branch ends, by n and 2 n steps, that is none; the
error of a shape from which on finer steps are to find the same index."""
POLISH = 4
"""Most marches by 2 n steps that correct a pose: one, unless the root moves far more
than the tip."""
MOST_STEPS = 3000.0
MOST_LOADS = 4000
"""Trials of a load on one way; a branch that asks for more is lost. How far it came
after fewer tells nothing: a rod nearly against a field creeps only where it buckles."""
LOST, STEEP = -2, 1e6
"""Index where a branch is lost, fold or not: the root moves so many times as the tip,
and what rounding leaves of the tip's pose no longer fixes the rest."""
LONGEST = 0.5
"""Largest predicted move of the tip."""


@njit(cache=True)
def _turn(Ra, Rb, x):  # type: ignore[no-untyped-def]
    """Write the turn from Ra to Rb into `x[:3]` (its sine, in Ra); return the trace."""
    M = np.zeros((3, 3))
    for a in range(3):
        for c in range(3):
            for i in range(3):
                M[a, c] += Ra[i, a] * Rb[i, c]
    x[0, 0] = 0.5 * (M[2, 1] - M[1, 2])
    x[1, 0] = 0.5 * (M[0, 2] - M[2, 0])
    x[2, 0] = 0.5 * (M[1, 0] - M[0, 1])
    return M[0, 0] + M[1, 1] + M[2, 2]


@njit(cache=True)
def _miss(w, Rc, x):  # type: ignore[no-untyped-def]
    """Write minus the root's turn and shift into `x`; return the trace."""
    trace = _turn(Rc, w[Y : Y + 9].reshape(3, 3), x)
    for i in range(3):
        x[i, 0] = -x[i, 0]
        x[3 + i, 0] = -w[Y + 12 + i]
    return trace


@njit(cache=True)
def _move(R, r, x):  # type: ignore[no-untyped-def]
    """Turn and shift the tip by the solution `x`; return its size."""
    size = 0.0
    for i in range(6):
        size = max(size, abs(x[i, 0]))
    angle = math.sqrt(x[0, 0] ** 2 + x[1, 0] ** 2 + x[2, 0] ** 2)
    s = math.sin(angle) / angle if angle > 1e-8 else 1.0
    c = (1.0 - math.cos(angle)) / angle**2 if angle > 1e-4 else 0.5
    x0, x1, x2 = x[0, 0], x[1, 0], x[2, 0]
    for i in range(3):
        e0, e1, e2 = R[i, 0], R[i, 1], R[i, 2]
        t0, t1, t2 = x1 * e2 - x2 * e1, x2 * e0 - x0 * e2, x0 * e1 - x1 * e0
        R[i, 0] = e0 - s * t0 + c * (x1 * t2 - x2 * t1)
        R[i, 1] = e1 - s * t1 + c * (x2 * t0 - x0 * t2)
        R[i, 2] = e2 - s * t2 + c * (x0 * t1 - x1 * t0)
        r[i] += x[3 + i, 0]
    return size


@njit(cache=True)
def _put(R, r, Rb, rb):  # type: ignore[no-untyped-def]
    """Put the tip's pose (R, r) to (Rb, rb)."""
    for i in range(3):
        r[i] = rb[i]
        for j in range(3):
            R[i, j] = Rb[i, j]


@njit(cache=True)
def room(rod, field, n):  # type: ignore[no-untyped-def]
    """Return what marches of up to n steps work in and leave.

    Work space of `march` (four arrays); the curve of the last march, the table of the
    field along a curve; how many steps the one has (0: there is none), how many pairs
    of steps the other, and how far the tip has moved since.
    """
    pairs = all_pairs(rod, n)
    along = pairs if runs_along(rod, field) else 0
    work = np.zeros(WORK), np.zeros(JET), np.zeros(12), np.zeros(12)
    curve = np.zeros((pairs, 3, KEPT))
    return work, curve, np.zeros((along, PLACES, NEAR)), np.zeros(3)


@njit(cache=True)
def run(rod, field, load, n, R, r, columns, moved, held):  # type: ignore[no-untyped-def]
    """March in the field along the curve of the march before, and keep the curve.

    The table of that field is used again where the tip has hardly `moved` since.
    """
    work, curve, table, known = held
    blocks = 1 if columns else 0
    if table.shape[0] > 0 and known[0] > 0.0:
        pairs = all_pairs(rod, n)
        known[2] += moved
        if known[2] > STILL or known[1] != pairs:
            tabulate(rod, field, known[0], curve, n, table)
            known[1] = pairs
            known[2] = moved
    else:
        table = table[:0]
    known[0] = n
    return march(rod, field, load, n, R, r, blocks, table, curve, *work)


@njit(cache=True)
def unloaded(rod, field, n, Rc, R, r, held):  # type: ignore[no-untyped-def]
    """Set the tip's pose (R, r) to that of the unloaded rod, and keep its curve.

    Without load a march from any pose gives the rod but for a rigid motion.
    """
    work, _, table, known = held
    for i in range(3):
        r[i] = Rc[i, 2]
        for j in range(3):
            R[i, j] = Rc[i, j]
    if np.any(rod[:, K1 : K3 + 1]):
        r[:] = 0.0
        run(rod, field, 0.0, n, R, r, False, math.inf, held)
        _carry(work[0], Rc, R, r)
    if table.shape[0] > 0:
        known[0] = 0.0
        run(rod, field, 0.0, n, R, r, False, math.inf, held)


@njit(cache=True)
def _carry(w, Rc, R, r):  # type: ignore[no-untyped-def]
    """Carry a rod from a tip at the origin to the clamp, by its root's state."""
    for i in range(3):
        for j in range(3):
            R[i, j] = 0.0
            for a in range(3):
                for b in range(3):
                    R[i, j] += Rc[i, a] * w[Y + 3 * b + a] * Rc[b, j]
        for a in range(3):
            for b in range(3):
                r[i] -= Rc[i, a] * w[Y + 3 * b + a] * w[Y + 12 + b]
    for a in range(3):  # what the march's steps have bent of the axes
        for b in range(a):
            R[:, a] -= (R[:, a] * R[:, b]).sum() * R[:, b]
        R[:, a] /= math.sqrt((R[:, a] * R[:, a]).sum())


@njit(cache=True)
def newton(rod, field, load, n, Rc, R, r, first, goal, J, held):  # type: ignore[no-untyped-def]
    """Iterate the tip's pose (R, r) until the corrections are below `goal`.

    Coarse steps bring it near and give the matrix, which stays in `J`; then n steps.
    Where the root moves far more than the tip, the coarse matrix is too rough for them,
    and each gets its own.

    Returns
    -------
    tuple of bool
        Whether it converged; whether at the first and at the last matrix no direction
        is unstable for sure.
    """
    A, x = np.zeros((6, 6)), np.zeros((6, 1))
    w = held[0][0]
    before = size = math.inf
    fine = all_pairs(rod, COARSE * n) == all_pairs(rod, n)
    start = end = own = False
    for k in range(24):
        if blocked(field, r[0], r[1], r[2], 0.0):
            return False, start, end
        if own or before > CHORD:
            steps = n if own else COARSE * n
            end = run(rod, field, load, steps, R, r, True, size, held)
            start = end if k == 0 else start
            matrix(w, Z, J)
        else:
            steps = n if fine else COARSE * n
            run(rod, field, load, steps, R, r, False, size, held)
        trace = _miss(w, Rc, x)
        A[:] = J
        if trace < 1.0 or not solve6(A, x):
            return False, start, end
        size = _move(R, r, x)
        if not size < first:
            return False, start, end
        if k > 0 and size > max(0.25 * before, goal):
            if own or before > CHORD:
                return False, start, end
            own = fine = True
        if fine and size < goal:
            return True, start, end
        before = size
        if not fine and size < CLOSE:
            fine = True
            before = CHORD
    return False, start, end


@njit(cache=True, inline="always")
def follow(rod, field, bends, n, Rc, R, r, goal, J, held):  # type: ignore[no-untyped-def]
    """Follow the equilibrium from no load, at (R, r), to full load.

    Returns the Morse index and the load reached.

    Predictions go along the secant, or with `bends` of 1 along the parabola through the
    last three poses: a tangent would leave the plane where a planar rod begins to
    swing, and Newton's matrix is singular. A parabola misses where a rod that is all
    but symmetric buckles; a secant, where the root moves a million times as far as the
    tip.

    A branch changes its index at single loads only: a step over which it changes is
    taken again in halves, until it is too short to have jumped to another branch.
    """
    Rb, rb = R.copy(), r.copy()
    secant, bend, x = np.zeros((6, 1)), np.zeros((6, 1)), np.zeros((6, 1))
    load, last, jump, index, eager = 0.0, 0.0, 0.125, 0, True
    for _ in range(MOST_LOADS):
        if load == 1.0:
            return index, 1.0
        jump = min(jump, 1.0 - load)
        ahead = 1.0 if jump == 1.0 - load else load + jump
        _put(Rb, rb, R, r)
        for i in range(6):
            x[i, 0] = jump * secant[i, 0]
            x[i, 0] += bends * jump * (jump + last) * bend[i, 0]
        there = -1
        if _move(R, r, x) < LONGEST:
            held[3][0] = 0.0
            end = PASSING if jump < SHORT and ahead < 1.0 else goal
            found, _, sure = newton(rod, field, ahead, n, Rc, R, r, 0.1, end, J, held)
            if found and sure:
                there = 0
            elif found:
                there = morse_index(rod, field, ahead, COARSE * n, R, r)
        if there == index or (there >= 0 and jump < SURE):
            for i in range(6):
                bend[i, 0] = secant[i, 0]
            _turn(Rb, R, secant)
            for i in range(3):
                secant[3 + i, 0] = r[i] - rb[i]
            share = 1.0 / (jump + last) if last > 0.0 else 0.0
            for i in range(6):
                secant[i, 0] /= jump
                bend[i, 0] = (secant[i, 0] - bend[i, 0]) * share
            index, load, last = there, ahead, jump
            jump *= 2.0 if eager else 1.0
            eager = True
        else:
            _put(R, r, Rb, rb)
            jump *= 0.5
            eager = False
            if jump < MIN_LOAD_STEP:
                return index, load
    return index if load == 1.0 else LOST, load


@njit(cache=True, inline="always")
def solve_pose(rod, field, n, Rc, R, r, goal, held):  # type: ignore[no-untyped-def]
    """Find the tip's pose (R, r) at full load, by n steps and once by 2 n.

    Newton from the unloaded rod is believed where it must lead to the branch from zero
    load (see `planar`): no direction is unstable there under the full load.

    Parameters
    ----------
    goal : float
        Correction by n steps after which that by 2 n steps leaves next to nothing.
    held : tuple
        Of `room`, for 2 n steps.

    Returns
    -------
    tuple
        Morse index (-1: no equilibrium; `LOST`), load reached, error (dimensionless).
    """
    J, x = np.zeros((6, 6)), np.zeros((6, 1))
    coarse = COARSE * n
    unloaded(rod, field, coarse, Rc, R, r, held)
    R0, r0 = R.copy(), r.copy()
    index = -1
    found, start, end = newton(rod, field, 1.0, n, Rc, R, r, 1.0, goal, J, held)
    if found and (start or morse_index(rod, field, 1.0, coarse, R0, r0) == 0):
        index = 0 if end else morse_index(rod, field, 1.0, coarse, R, r)
    if index != 0:
        load, lost = 0.0, True
        for bends in (0.0, 1.0):
            if lost:
                _put(R, r, R0, r0)
                index, load = follow(rod, field, bends, n, Rc, R, r, goal, J, held)
                steep = load < 1.0 and np.max(np.abs(J)) > STEEP
                lost = index == LOST or steep
        if load < 1.0:
            return LOST if lost else -1, load, 0.0
    for k in range(POLISH):
        moved = math.inf if k > 0 else 0.0
        run(rod, field, 1.0, 2.0 * n, R, r, False, moved, held)
        _miss(held[0][0], Rc, x)
        error = 0.0
        for i in range(6):
            error += abs(x[i, 0])
        solve6(J.copy(), x)
        error += _move(R, r, x)
        if error < ROUGH:
            break
    if k > 0:
        index = morse_index(rod, field, 1.0, n, R, r)
    return index, 1.0, error + 1e-15 * n


@njit(cache=True)
def solve_sure(rod, field, n, Rc, R, r, goal):  # type: ignore[no-untyped-def]
    """Find the pose as `solve_pose`; believe what finer steps agree on.

    A rod that is drawn to a magnet feels far more there than what its steps are for: so
    if there is none, or if it is a rough one.

    Returns
    -------
    tuple
        Index, load and error, the steps n that found them, and their `room`.
    """
    seen, before = -1, -1.0
    while True:
        held = room(rod, field, 2.0 * n)
        index, load, error = solve_pose(rod, field, n, Rc, R, r, goal, held)
        sure = error < ROUGH if index >= 0 else abs(load - before) < AGREED
        if sure or (index >= 0 and index == seen) or n > MOST_STEPS:
            return index, load, error, n, held
        seen, before = index, load if index < 0 else -1.0
        n *= 2.0


@njit(cache=True)
def solve_rod(rod, field, n, Rc, R, r, s, out):  # type: ignore[no-untyped-def]
    """Find the pose as `solve_sure`, and fill `out` (m, 21) with states at `s`."""
    index, load, error, n, held = solve_sure(rod, field, n, Rc, R, r, CONVERGED)
    if index >= 0:
        run(rod, field, 1.0, 2.0 * n, R, r, False, 0.0, held)
        shape(rod, 2.0 * n, held[1], s, out)
    return index, load, error


@njit(cache=True)
def march_from(rod, field, n, Rc, R, r, x, s, out):  # type: ignore[no-untyped-def]
    """March from the tip's pose (R, r), turned and shifted by `x` (6,).

    Returns by how much the root misses the clamp, and fills `out` as `solve_rod`.
    """
    held = room(rod, field, n)
    turned, moved = R.copy(), r.copy()
    miss = np.zeros((6, 1))
    miss[:, 0] = x
    _move(turned, moved, miss)
    run(rod, field, 1.0, n, turned, moved, False, math.inf, held)
    _miss(held[0][0], Rc, miss)
    shape(rod, n, held[1], s, out)
    return miss[:, 0].copy()
