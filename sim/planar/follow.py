"""Newton from a given tip, and load continuation of the planar rod.

Dimensionless as `planar.march`. The equilibrium is followed from no load to full load
with tangent predictors; where Newton would have to jump, the step is halved. A branch
changes its Morse index at single loads only, so a step over which that changes counts
as a jump until it is too short for one. The load at which no smaller step helps is a
fold: beyond it the rod is pulled in.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import PART, blocked, field_at
from .march import MAX_ORDER, SPARED, STATE, SWING, M, march

SHRINK = 0.25
"""How each correction must shrink, as the theorem of Kantorovich asks for."""
SMALL = 1e-7
"""Correction after which the next would be of the size of rounding."""
MAX_TRIALS = 400
"""Most Newton runs along a branch; a branch that needs more is given up."""
MIN_LOAD_STEP = 1e-7
SURE = 1e-6
"""Step of the load too short for a jump to another branch."""


@njit(**PART)
def solve3(D, rt, rx, ry, out):  # type: ignore[no-untyped-def]
    """Solve the 3x3 Newton system for minus the residual; return False if singular."""
    a = D[2, 1] * D[3, 2] - D[2, 2] * D[3, 1]
    b = D[2, 2] * D[3, 0] - D[2, 0] * D[3, 2]
    c = D[2, 0] * D[3, 1] - D[2, 1] * D[3, 0]
    det = D[0, 0] * a + D[0, 1] * b + D[0, 2] * c
    if det == 0.0 or not math.isfinite(det):
        return False
    f = -1.0 / det
    out[0] = f * (
        a * rt
        + (D[0, 2] * D[3, 1] - D[0, 1] * D[3, 2]) * rx
        + (D[0, 1] * D[2, 2] - D[0, 2] * D[2, 1]) * ry
    )
    out[1] = f * (
        b * rt
        + (D[0, 0] * D[3, 2] - D[0, 2] * D[3, 0]) * rx
        + (D[0, 2] * D[2, 0] - D[0, 0] * D[2, 2]) * ry
    )
    out[2] = f * (
        c * rt
        + (D[0, 1] * D[3, 0] - D[0, 0] * D[3, 1]) * rx
        + (D[0, 0] * D[2, 1] - D[0, 1] * D[2, 0]) * ry
    )
    return True


@njit(**PART)
def residual(u, clamp, X):  # type: ignore[no-untyped-def]
    """Return how far the root is from the clamp: angle, and position turned by -phi."""
    cf = math.cos(u[3])
    sf = math.sin(u[3])
    return (
        X[0] + u[3] - clamp,
        X[2] + cf * u[1] + sf * u[2],
        X[3] - sf * u[1] + cf * u[2],
    )


@njit(**PART)
def correction(clamp, u, X, D, d):  # type: ignore[no-untyped-def]
    """Set d to Newton's correction (of gamma, x_L, y_L, theta_L) after a march at u.

    Return the residual, infinite if the matrix is singular. Along a long rod the angle
    from the load grows as a pendulum's does: tan(angle / 4) at the root is nearly
    proportional to that at the tip (`planar.one_sided`). So Newton runs on tan(theta /
    4) of the root; of the angle itself it would see only the bend.
    """
    rt, rx, ry = residual(u, clamp, X)
    turn = rt
    goal = clamp - u[3]
    if abs(X[0]) < 3.0 and abs(goal) < 3.0:
        c = math.cos(0.25 * X[0])
        turn = 4.0 * c * c * (math.tan(0.25 * X[0]) - math.tan(0.25 * goal))
    if not solve3(D, turn, rx, ry, d):
        return math.inf
    d[0] -= D[SPARED, 1] * d[1] + D[SPARED, 2] * d[2]
    d[3] = d[0] + D[SWING, 1] * d[1] + D[SWING, 2] * d[2]
    return abs(rt) + abs(rx) + abs(ry)


@njit(**PART)
def _tangent(D, d):  # type: ignore[no-untyped-def]
    """Set d to what gamma, x_L and y_L do per load, after the march of a solution."""
    solve3(D, D[0, 3], D[2, 3], D[3, 3], d)
    d[0] -= D[SPARED, 1] * d[1] + D[SPARED, 2] * d[2] + D[SPARED, 3]


@njit(**PART)
def move(rod, field, step, d, u):  # type: ignore[no-untyped-def]
    """Move the tip by `step` times d = (gamma, x, y), the frame with its load."""
    u[1] += step * d[1]
    u[2] += step * d[2]
    b = field_at(field, u[1], u[2])
    if rod[0, M] != 0.0 and (b[0] != 0.0 or b[1] != 0.0):
        sign = -1.0 if rod[0, M] < 0.0 else 1.0
        turn = math.atan2(sign * b[1], sign * b[0]) - u[3]
        u[3] += turn - 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    turn = step * d[0]
    if abs(turn) < abs(u[0]) < 0.1:
        u[0] *= math.exp(turn / u[0])
    else:
        u[0] += turn


@njit(**PART)
def face(rod, field, u):  # type: ignore[no-untyped-def]
    """Turn the frame into the load at the tip, keeping the tip's direction."""
    b = field_at(field, u[1], u[2])
    if rod[0, M] != 0.0 and (b[0] != 0.0 or b[1] != 0.0):
        sign = -1.0 if rod[0, M] < 0.0 else 1.0
        turn = math.atan2(sign * b[1], sign * b[0]) - u[3]
        turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
        u[3] += turn
        u[0] -= turn


@njit(cache=True, error_model="numpy")
def straight(clamp, u):  # type: ignore[no-untyped-def]
    """Set u to the unloaded rod, keeping its frame."""
    u[0] = clamp - u[3]
    u[1] = math.cos(clamp)
    u[2] = math.sin(clamp)


@njit(cache=True, error_model="numpy")
def newton(rod, field, load, clamp, u, order, step, first, X, D, T, C):  # type: ignore[no-untyped-def]
    """Iterate u to an equilibrium; return its Morse index, or -1.

    Gives up, rather than jump to another branch, when the first correction is above
    `first` or a correction does not shrink to a quarter of the one before.
    """
    d = np.empty(4)
    nowhere = np.empty(0)
    nothing = np.empty((4, 0))
    before = math.inf
    columns = D.shape[1]
    for _ in range(16):
        if blocked(field, u[1], u[2], 0.0, 0.0):
            return -1
        index = march(
            rod, field, load, u, order, step, columns, math.inf, nowhere, 0,
            X, D, T, C, nothing,
        )  # fmt: skip
        if not correction(clamp, u, X, D, d) < math.inf:
            return -1
        size = max(abs(d[0]), abs(d[1]), abs(d[2]))
        if not size < SMALL and (not size < first or size > SHRINK * before):
            return -1
        move(rod, field, 1.0, d, u)
        if size < SMALL:
            return index
        before = size
    return -1


@njit(cache=True, nogil=True, error_model="numpy")
def follow_load(rod, field, clamp, u, order, step):  # type: ignore[no-untyped-def]
    """Follow the equilibrium from no load to full load in u; return (index, load).

    The index is -1 where the branch folds back, -2 where it takes too many steps.
    """
    X = np.empty(STATE)
    D = np.empty((STATE, 4))
    T = np.empty((4, MAX_ORDER + 1))
    C = np.empty((MAX_ORDER + 1, 4, 4))
    tangent = np.zeros(3)
    u[3] = 0.0
    straight(clamp, u)
    face(rod, field, u)
    here = u.copy()
    trials = 0
    index = 0
    load = 0.0
    jump = 0.0
    while True:
        for i in range(4):
            u[i] = here[i]
        move(rod, field, jump, tangent, u)
        bend = jump * max(abs(tangent[0]), abs(tangent[1]), abs(tangent[2]))
        trial = -1
        if bend < 0.5:
            first = 0.1 if jump > 0.0 else 1.0
            trial = newton(
                rod, field, load + jump, clamp, u, order, step, first, X, D, T, C
            )
        if trial == index or (trial >= 0 and jump < SURE):
            if jump == 1.0 - load:
                return trial, 1.0
            index = trial
            load += jump
            for i in range(4):
                here[i] = u[i]
            _tangent(D, tangent)
            jump = 2.0 * jump if jump > 0.0 else 0.25
        else:
            jump *= 0.5
            trials += 1
            if trials > MAX_TRIALS:
                return -2, load
            if jump < MIN_LOAD_STEP:
                return -1, load
        jump = min(jump, 1.0 - load)
