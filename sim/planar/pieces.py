"""Load continuation of rods whose tip hardly fixes their root, in pieces.

Dimensionless as `planar.march`. Where sections are magnetised in unlike ways, or weight
bends a rod between its ends, its angle from the load need not be small anywhere near
the tip, and still grows by the exponential of its length in boundary layers: Newton on
the tip alone then sees but a sliver of the load at a time. So the rod is cut into
pieces, in each of which little grows; angle, moment and place at every cut are unknown,
and that they go on from piece to piece is what Newton solves for (multiple shooting).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..magnet.flux import blocked, field_at, in_reach
from .contact import touches_in_plane
from .follow import MIN_LOAD_STEP, SHRINK, SURE
from .march import MAX_ORDER, STATE, WX, WY, E, H, M, jacobi, spare
from .outcomes import GONE, OK_STABLE, OK_UNSTABLE, ROUNDING
from .taylor import advance, column_step, sample, series, substeps

Array = NDArray[np.float64]
Cuts = NDArray[np.int64]
Pieces = tuple[Cuts, Array, Array]

LONG = 2.0
"""Length of a piece in boundary layers, about."""
MOST_PIECES = 40
"""In a section."""
STRONGER = 1.5
"""How much stronger the field may become than where it was looked at."""
FIRST = 0.5
"""Largest first correction of an angle in rad, or a place in lengths of the rod."""
CLOSE = 1e-10
MOST_TRIALS = 300


@njit(cache=True, error_model="numpy")
def _assemble(rod, field, load, clamp, section, h, z, order, step, F, J):  # type: ignore[no-untyped-def]
    """Fill the residual F (4 n,) and its derivative J; False if a pole is blocked.

    Row 0 is that no moment acts on the tip. Of each piece follow theta, q, x and y at
    its end less those of the next, and of the last theta, x, y less the clamp's.
    """
    n = h.shape[0]
    X, D = np.zeros(STATE), np.zeros((STATE, 4))
    T, C = np.empty((4, MAX_ORDER + 1)), np.empty((MAX_ORDER + 1, 4, 4))
    pole = np.zeros(rod.shape[0], dtype=np.int64)
    slope = np.zeros((rod.shape[0], 3))
    goal = np.zeros(4)
    px = py = 0.0
    J[:] = 0.0
    F[0] = z[0, 1]
    J[0, 1] = 1.0
    row = 1
    for j in range(n):
        i = section[j]
        if j == 0 or section[j - 1] != i:
            m = rod[i, M] - rod[i - 1, M] if i > 0 else rod[i, M]
            if blocked(field, z[j, 2], z[j, 3], 0.0, 0.0):
                return False
            b = field_at(field, z[j, 2], z[j, 3])
            px += m * b[0]
            py += m * b[1]
            pole[i] = j
            slope[i, 0], slope[i, 1], slope[i, 2] = m * b[2], m * b[3], m * b[4]
        _enter(rod, i, load, px, py, z[j], X)
        D[:] = 0.0
        D[0, 0] = D[1, 1] = D[4, 2] = D[5, 3] = 1.0
        for _ in range(_steps(h[j], X, step)):
            series(X[9], order, X, T)
            column_step(X[9], order, X, T, D, C)
            advance(X[9], order, X, T)
        px += h[j] * rod[i, WX]
        py += h[j] * rod[i, WY]
        last = j + 1 == n
        goal[0] = clamp
        for c in range(4):
            if last and c == 1:
                continue
            F[row] = X[c] - (goal[c] if last else z[j + 1, c])
            J[row, 4 * j] = D[c, 0]
            J[row, 4 * j + 1] = D[c, 1]
            if c > 1:
                J[row, 4 * j + c] = 1.0
            for s in range(i + 1):
                k = 4 * pole[s]
                ax, ay = load * D[c, 2], load * D[c, 3]
                J[row, k + 2] += ax * slope[s, 0] + ay * slope[s, 1]
                J[row, k + 3] += ax * slope[s, 1] + ay * slope[s, 2]
            if not last:
                J[row, 4 * j + 4 + c] -= 1.0
            row += 1
    return True


@njit(cache=True, error_model="numpy")
def _enter(rod, i, load, px, py, z, X):  # type: ignore[no-untyped-def]
    """Set the state where a piece of section `i` begins."""
    for c in range(4):
        X[c] = z[c]
    X[4], X[5] = load * px, load * py
    X[6], X[7], X[8] = rod[i, E], load * rod[i, WX], load * rod[i, WY]


@njit(cache=True, error_model="numpy")
def _steps(h, X, step):  # type: ignore[no-untyped-def]
    """Return how many steps a piece takes, and leave their length in X."""
    count = substeps(h, X, step)
    X[9] = h / count
    return count


@njit(cache=True, error_model="numpy")
def _index(rod, field, load, section, h, z, order, step):  # type: ignore[no-untyped-def]
    """Return the Morse index: sign changes of the Jacobi determinant from the tip."""
    X, D = np.zeros(STATE), np.zeros((STATE, 4))
    T, C = np.empty((4, MAX_ORDER + 1)), np.empty((MAX_ORDER + 1, 4, 4))
    D[0, 0] = D[2, 1] = D[3, 2] = 1.0
    px = py = 0.0
    zeros = 0
    positive = True
    for j in range(h.shape[0]):
        i = section[j]
        if j == 0 or section[j - 1] != i:
            m = rod[i, M] - rod[i - 1, M] if i > 0 else rod[i, M]
            b = field_at(field, z[j, 2], z[j, 3])
            px += m * b[0]
            py += m * b[1]
            for a in range(3):
                D[4, a] += load * m * (b[2] * D[2, a] + b[3] * D[3, a])
                D[5, a] += load * m * (b[3] * D[2, a] + b[4] * D[3, a])
        _enter(rod, i, load, px, py, z[j], X)
        for _ in range(_steps(h[j], X, step)):
            series(X[9], order, X, T)
            column_step(X[9], order, X, T, D, C)
            advance(X[9], order, X, T)
            spare(X, D)
            if (jacobi(D, 4) > 0.0) != positive:
                positive = not positive
                zeros += 1
        px += h[j] * rod[i, WX]
        py += h[j] * rod[i, WY]
    return zeros


@njit(cache=True, error_model="numpy")
def _flux(field, x, y):  # type: ignore[no-untyped-def]
    b = field_at(field, x, y)
    return b[0], b[1]


def _cut(rod: Array, flux_T: float) -> tuple[Cuts, Array]:
    """Return section and length of every piece, tip first."""
    load = np.abs(rod[:, M]) * flux_T + np.hypot(rod[:, WX], rod[:, WY])
    long = rod[:, H] * np.sqrt(rod[:, E] * load)
    count = np.clip(np.ceil(long / LONG), 1, MOST_PIECES).astype(np.int64)
    section = np.repeat(np.arange(len(rod)), count)
    return section, np.repeat(rod[:, H] / count, count)


def follow_pieces(
    rod: Array, field: Array, clamp: float, u: Array, order: int, step: float
) -> tuple[int, float, Pieces]:
    """Follow the equilibrium from no load to full load, as `follow.follow_load` does.

    Parameters
    ----------
    rod, field, clamp, order, step
        As of `solver.solve_rows`, of one rod.
    u : ndarray, shape (4,)
        Where another try has ended; receives the unknowns (gamma, x_L, y_L, phi).

    Returns
    -------
    int
        The Morse index; -1 where the branch folds back, -2 if it takes too many steps.
    float
        The load reached.
    tuple
        Section and length of every piece, and what is known at its tip's end.
    """
    c, s = math.cos(clamp), math.sin(clamp)
    flux_T = STRONGER * max(
        math.hypot(*_flux(field, u[1], u[2])), math.hypot(*_flux(field, c, s))
    )
    section, h = _cut(rod, flux_T)
    left = 1.0 - np.concatenate([[0.0], np.cumsum(h)[:-1]])
    z = np.column_stack([np.full(len(h), clamp), 0.0 * left, c * left, s * left])
    slope = np.zeros_like(z)
    index, load, jump, trials = 0, 0.0, 0.25, 0
    while load < 1.0:
        ahead = min(1.0, load + jump)
        case = rod, field, ahead, clamp, section, h
        found = _newton(*case, z + (ahead - load) * slope, order, step)
        there = -1
        if found is not None:
            there = _index(rod, field, ahead, section, h, found, order, step)
        if found is not None and (there == index or jump < SURE):
            slope = (found - z) / (ahead - load)
            z, index, load = found, there, ahead
            jump *= 2.0
            continue
        jump *= 0.5
        trials += 1
        if jump < MIN_LOAD_STEP or trials > MOST_TRIALS:
            index = -1 if jump < MIN_LOAD_STEP else -2
            return index, load, (section, h, z)
    bx, by = _flux(field, z[0, 2], z[0, 3])
    sign = -1.0 if rod[0, M] < 0.0 else 1.0
    phi = math.atan2(sign * by, sign * bx) if rod[0, M] != 0.0 else 0.0
    turn = z[0, 0] - phi
    phi += 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    u[:] = z[0, 0] - phi, z[0, 2], z[0, 3], phi
    return index, 1.0, (section, h, z)


def fill(
    rod: Array, field: Array, clamp: float, margin: float, pieces: Pieces, s: Array,
    order: int, step: float, found: Array, out: Array,
) -> bool:  # fmt: skip
    """Fill the row and the shape of `solver.solve_rows` from pieces at full load.

    The error is what four more orders change, and rounding as the pieces pass it on.
    Return False where the pieces have no equilibrium of the higher order.
    """
    section, h, z = pieces
    case = rod, field, 1.0, clamp, section, h
    finer = _newton(*case, z, order + 4, step)
    if finer is None:
        return False
    F, J = np.empty(z.size), np.empty((z.size, z.size))
    _assemble(*case, finer, order + 4, step, F, J)
    passed_on = float(np.abs(np.linalg.inv(J)).sum(axis=1).max())
    change = float(np.max(np.abs(finer - z)[:, [0, 2, 3]]))
    moment, touching = _shape(
        rod, field, margin, section, h, finer, s, order + 4, step, out
    )
    index = _index(rod, field, 1.0, section, h, finer, order + 4, step)
    bx, by = _flux(field, finer[0, 2], finer[0, 3])
    outcome = GONE if touching else OK_STABLE if index == 0 else OK_UNSTABLE
    found[:] = outcome, index, change + ROUNDING * passed_on, bx, by, moment, 1.0
    return True


@njit(cache=True, error_model="numpy")
def _shape(rod, field, margin, section, h, z, s, order, step, out):  # type: ignore[no-untyped-def]
    """Fill x, y, theta, curvature (4, n); return root moment and whether it touches."""
    X, T = np.zeros(STATE), np.empty((4, MAX_ORDER + 1))
    px = py = reached = 0.0
    k = s.shape[0] - 1
    for j in range(h.shape[0]):
        i = section[j]
        if j == 0 or section[j - 1] != i:
            m = rod[i, M] - rod[i - 1, M] if i > 0 else rod[i, M]
            b = field_at(field, z[j, 2], z[j, 3])
            px += m * b[0]
            py += m * b[1]
        _enter(rod, i, 1.0, px, py, z[j], X)
        count = _steps(h[j], X, step)
        for n in range(count):
            x0, y0 = X[2], X[3]
            series(X[9], order, X, T)
            advance(X[9], order, X, T)
            last = j + 1 == h.shape[0] and n + 1 == count
            k = sample(s, k, reached, X[9], last, order, x0, y0, 0.0, X, T, out)
            reached += X[9]
        px += h[j] * rod[i, WX]
        py += h[j] * rod[i, WY]
    near = in_reach(field, margin)
    return -X[1], near and touches_in_plane(field, margin, s, out)


def _newton(
    rod: Array, field: Array, load: float, clamp: float, section: Cuts, h: Array,
    z: Array, order: int, step: float,
) -> Array | None:  # fmt: skip
    """Iterate from `z` (n, 4): angle, moment and place at the cuts; None if it fails.

    The rules are those of `follow.newton`.
    """
    F, J = np.empty(z.size), np.empty((z.size, z.size))
    before = math.inf
    for _ in range(16):
        if not _assemble(
            rod, field, load, clamp, section, h, z, order, step, F, J
        ) or not np.all(np.isfinite(F)):
            return None
        try:
            change = np.linalg.solve(J, -F).reshape(z.shape)
        except np.linalg.LinAlgError:
            return None
        size = float(np.max(np.abs(change[:, [0, 2, 3]])))
        if not size < CLOSE and (not size < FIRST or size > SHRINK * before):
            return None
        z = z + change
        if size < CLOSE:
            return z
        before = size
    return None
