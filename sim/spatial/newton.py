"""Equilibria of the rod in space: Newton on the tip's pose, load continuation.

Dimensionless as `spatial.march`.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import blocked
from .index import matrix, morse_index, solve6, unknowns
from .march import (  # fmt: skip
    COLUMN,
    STATE,
    begin,
    cross,
    loaded,
    march,
    step,
    workspace,
)

CONVERGED = 1e-9
"""Correction after which the next, by the matrix kept, is rounding."""
NEAR = 1e-4
"""Correction after which the coarse steps have done their part."""
COARSE = 0.5
"""Share of the steps that brings Newton near, and is enough for its matrix."""
CHORD = 1e-2
"""Correction after which the matrix is kept."""
MIN_LOAD_STEP = 1e-6
SURE = 1e-3
"""Step of the load too short for a jump to another branch."""
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
def _miss(y, Rc, x):  # type: ignore[no-untyped-def]
    """Write minus the root's turn and shift into `x`; return the trace."""
    trace = _turn(Rc, y[:9].reshape(3, 3), x)
    for i in range(3):
        x[i, 0] = -x[i, 0]
        x[3 + i, 0] = -y[12 + i]
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
def _unloaded(rod, field, n, Rc, R, r, y, none, bare):  # type: ignore[no-untyped-def]
    """Set the tip's pose (R, r) to that of the unloaded rod, whatever its rest shape.

    Without load a march from any pose gives the rod but for a rigid motion.
    """
    R[:] = Rc
    r[:] = 0.0
    march(rod, field, 0.0, n, R, r, y, none, bare)
    for i in range(3):
        for j in range(3):
            R[i, j] = 0.0
            for a in range(3):
                for b in range(3):
                    R[i, j] += Rc[i, a] * y[3 * b + a] * Rc[b, j]
        for a in range(3):
            for b in range(3):
                r[i] -= Rc[i, a] * y[3 * b + a] * y[12 + b]
    for a in range(3):  # what the march's steps have bent of the axes
        for b in range(a):
            R[:, a] -= (R[:, a] * R[:, b]).sum() * R[:, b]
        R[:, a] /= math.sqrt((R[:, a] * R[:, a]).sum())


@njit(cache=True)
def newton(rod, field, load, n, Rc, R, r, first, y, Z, J, none, work, bare):  # type: ignore[no-untyped-def]
    """Iterate the tip's pose (R, r); False if the corrections do not contract.

    Coarse steps bring it near and give the matrix, which stays in `J`; then n steps.
    """
    A, x = np.zeros((6, 6)), np.zeros((6, 1))
    before = math.inf
    fine = False
    for k in range(24):
        if blocked(field, r[0], r[1], r[2], 0.0):
            return False
        steps = n if fine else COARSE * n
        if before > CHORD:
            march(rod, field, load, steps, R, r, y, Z, work)
            matrix(Z, J)
        else:
            march(rod, field, load, steps, R, r, y, none, bare)
        trace = _miss(y, Rc, x)
        A[:] = J
        if trace < 1.0 or not solve6(A, x):
            return False
        size = _move(R, r, x)
        if not size < first or (k > 0 and size > max(0.25 * before, CONVERGED)):
            return False
        if fine and size < CONVERGED:
            return True
        before = size
        if not fine and size < NEAR:
            fine = True
            before = CHORD
    return False


@njit(cache=True)
def follow(rod, field, n, Rc, R, r, y, Z, J, none, work, bare):  # type: ignore[no-untyped-def]
    """Follow the equilibrium from no load, at (R, r), to full load.

    Returns the Morse index and the load reached.

    Predictions go along the secant: a tangent would leave the plane where a planar
    rod begins to swing, and Newton's matrix is singular.

    A branch changes its index at single loads only: a step over which it changes is
    taken again in halves, until it is too short to have jumped to another branch.
    """
    Rb, rb = R.copy(), r.copy()
    secant, x = np.zeros((6, 1)), np.zeros((6, 1))
    load, jump, index = 0.0, 0.125, 0
    while load < 1.0:
        jump = min(jump, 1.0 - load)
        ahead = 1.0 if jump == 1.0 - load else load + jump
        Rb[:], rb[:] = R, r
        x[:] = jump * secant
        there = -1
        if _move(R, r, x) < LONGEST and newton(
            rod, field, ahead, n, Rc, R, r, 0.1, y, Z, J, none, work, bare
        ):
            there = morse_index(rod, field, ahead, COARSE * n, R, r)
        if there == index or (there >= 0 and jump < SURE):
            _turn(Rb, R, secant)
            secant[3:, 0] = r - rb
            secant /= jump
            index, load = there, ahead
            jump *= 2.0
        else:
            R[:], r[:] = Rb, rb
            jump *= 0.5
            if jump < MIN_LOAD_STEP:
                return index, load
    return index, 1.0


@njit(cache=True)
def solve_pose(rod, field, n, Rc, R, r):  # type: ignore[no-untyped-def]
    """Find the tip's pose (R, r) at full load.

    Newton from the unloaded rod is believed where it must lead to the branch from zero
    load (see `planar`): no direction is unstable there under the full load.

    Returns
    -------
    tuple
        Morse index (-1: no equilibrium), load reached, error (dimensionless).
    """
    columns = unknowns(field)
    y, Z, none = np.zeros(STATE), np.zeros((COLUMN, columns)), np.zeros((COLUMN, 0))
    work, bare = workspace(columns, rod.shape[1]), workspace(0, rod.shape[1])
    J, x = np.zeros((6, 6)), np.zeros((6, 1))
    _unloaded(rod, field, n, Rc, R, r, y, none, bare)
    R0, r0 = R.copy(), r.copy()
    index = morse_index(rod, field, 1.0, COARSE * n, R, r)
    if index == 0:
        index = -1
        if newton(rod, field, 1.0, n, Rc, R, r, 1.0, y, Z, J, none, work, bare):
            index = morse_index(rod, field, 1.0, COARSE * n, R, r)
    if index != 0:
        R[:], r[:] = R0, r0
        index, load = follow(rod, field, n, Rc, R, r, y, Z, J, none, work, bare)
        if load < 1.0:
            return -1, load, 0.0
    march(rod, field, 1.0, 2.0 * n, R, r, y, none, bare)
    _miss(y, Rc, x)
    error = np.sum(np.abs(x))
    solve6(J, x)
    return index, 1.0, error + _move(R, r, x) + 1e-15 * n


@njit(cache=True)
def shape(rod, field, n, R, r, s, out):  # type: ignore[no-untyped-def]
    """Fill `out` (m, 18) with the state at the ascending stations `s`, root to tip."""
    y, Z = np.zeros(STATE), np.zeros((COLUMN, 0))
    K, KZ, ys, Zs, b, b2, p = workspace(0, rod.shape[1])
    begin(rod, field, 1.0, R, r, y, Z, b)
    k = s.shape[0] - 1
    here = 0.0
    for i in range(rod.shape[0]):
        loaded(rod, i, 1.0, p)
        last = i + 1 == rod.shape[0]
        end = 1.0 if last else here + rod[i, 0]
        while True:
            while k >= 0 and 1.0 - s[k] <= here + 1e-14:
                out[k] = y
                k -= 1
            if here >= end - 1e-14:
                break
            goal = end if k < 0 else min(end, max(1.0 - s[k], here))
            count = max(1, math.ceil(n * (goal - here)))
            for _ in range(count):
                step((goal - here) / count, p, field, y, Z, K, KZ, ys, Zs, b, b2)
            here = goal
        here = end
        if not last:
            cross(rod, field, 1.0, i, y, Z, b)
    while k >= 0:
        out[k] = y
        k -= 1
