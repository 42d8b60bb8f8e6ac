"""Many rods in space side by side: Newton on vectors of rods.

Dimensionless as `spatial.march`; `batch.space_room` has the equations. The unknowns are
the tip's turn and shift. Newton starts from the unloaded rod, with a matrix of its own
until corrections are small. A last march with steps half as long corrects the result,
and by the order of the steps tells what it leaves: 1/63 of its correction, which is
added. The bound given is half of that correction, and what the matrix kept leaves of it
by the rate of the ones before; more where it is large.

A rod leaves this fast lane (its outcome is `HARD`) when it needs more than `MOST_STEPS`
steps in a section, is before more than one cuboid, might touch it or is very far from
it, when corrections do not shrink as they should, or when it is not surely stable
(`spatial.sure`) at a pose on the way, also not by smaller steps of the load:
`spatial.rows` decides those.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import CUBOID, UNIFORM, WIDTH, blocked, in_reach
from ..spatial.march import (  # fmt: skip
    AXIAL,
    C1,
    C2,
    C3,
    K1,
    K2,
    K3,
    MU1,
    MU2,
    WX,
    WY,
    WZ,
    H,
    loads_on,
)
from ..spatial.march import WIDTH as SECTION_WIDTH
from ..spatial.rows import REACH_LIMIT, STABLE, TURN_LIMIT
from .lanes import HARD
from .space_march import march
from .space_matrix import correct, factor, move
from .space_room import (
    BEFORE,
    CLAMP,
    HALF,
    LANES,
    LAST,
    MATRIX,
    MISS,
    OPTIONS,
    PACK,
    RATE,
    SIZE,
    SURE,
    TIP,
    TRACE,
)  # fmt: skip

STEP = 0.65
"""What one step takes of h sqrt(P / EI), and of the turn of the unloaded rod."""
MOST_STEPS = 6
"""Most steps in a section."""
FIRST = 2.0
"""Largest first correction. Twice this and the next is what `spatial.newton` allows,
which does not look whether a rod is surely stable at each pose on the way."""
LOADS, PREDICTED = 8, 0.2
"""Steps of the load by which those rods are followed that do not converge at once, and
the largest first correction of the pose predicted."""
SHRINK = 0.5
"""Largest ratio of a correction to the one before."""
CHORD = 4e-2
"""Correction after which the matrix is kept."""
CLOSE = 2e-3
"""Correction after which a matrix of the pose before leaves a millionth."""
COARSE = 3e-5
"""Largest correction by steps half as long."""
LEFT = 1.0 / 63.0
"""What those steps leave of that correction, by their order."""
FARTHEST = 40.0
"""Distance, in half sides, from which too many digits of a cuboid's gradient cancel."""
ROUNDING = 1e-13


@njit(**OPTIONS)
def _judge(rows, w, outcome):  # type: ignore[no-untyped-def]
    """Return the largest correction; rods that do not converge well are `HARD`."""
    largest = 0.0
    for i in range(rows.shape[0]):
        size = w[SIZE + i]
        if not (size < w[BEFORE + i] and w[TRACE + i] >= 1.0):
            outcome[rows[i]] = HARD
        if outcome[rows[i]] != HARD:
            largest = max(largest, size)
        w[RATE + i] = SHRINK * size / w[BEFORE + i]
        w[BEFORE + i] = max(SHRINK * size, CLOSE)
    return largest


@njit(**OPTIONS)
def _unsure(rows, w, outcome):  # type: ignore[no-untyped-def]
    """Leave rods that are not surely stable; return whether all are left."""
    left = True
    for i in range(rows.shape[0]):
        if w[SURE + i] == 0.0:
            outcome[rows[i]] = HARD
        left = left and outcome[rows[i]] == HARD
    return left


@njit(**OPTIONS)
def _unloaded(rod, D, r):  # type: ignore[no-untyped-def]
    """Carry directors (columns of D) and position from clamp to unloaded tip."""
    v, e, f = np.empty(3), np.empty(3), np.empty(3)
    for k in range(rod.shape[0] - 1, -1, -1):
        h = rod[k, H]
        for a in range(3):
            v[a] = h * rod[k, K1 + a]
        size = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        if size < 1e-8:
            for a in range(3):
                r[a] += h * D[a, 2]
            continue
        s, c = math.sin(size) / size, (1.0 - math.cos(size)) / size**2
        t = (1.0 - s) / size**2
        # By turning the fixed axes' body components, rows of D, the other way.
        e[0], e[1], e[2] = v[1], -v[0], 0.0
        f[0] = v[1] * e[2] - v[2] * e[1]
        f[1] = v[2] * e[0] - v[0] * e[2]
        f[2] = v[0] * e[1] - v[1] * e[0]
        for a in range(3):
            for j in range(3):
                r[a] += h * D[a, j] * (c * e[j] + t * f[j])
            r[a] += h * D[a, 2]
            x, y, z = D[a, 0], D[a, 1], D[a, 2]
            ex, ey, ez = v[1] * z - v[2] * y, v[2] * x - v[0] * z, v[0] * y - v[1] * x
            D[a, 0] = x - s * ex + c * (v[1] * ez - v[2] * ey)
            D[a, 1] = y - s * ey + c * (v[2] * ex - v[0] * ez)
            D[a, 2] = z - s * ez + c * (v[0] * ey - v[1] * ex)


@njit(**OPTIONS)
def _frame(field, Q, at, own):  # type: ignore[no-untyped-def]
    """Set the axes (rows of Q) and place of the frame of a field, and it there."""
    own[:] = 0.0
    own[0:4] = field[0:4]
    at[:] = 0.0
    for a in range(3):
        for j in range(3):
            Q[a, j] = (
                field[7 + 3 * a + j] if field[0] == CUBOID else (1.0 if a == j else 0.0)
            )
            own[7 + 3 * a + j] = 1.0 if a == j else 0.0
        if field[0] == CUBOID:
            at[a] = field[4 + a]
    own[16] = field[16]


@njit(**OPTIONS)
def _fill(rows, rods, fields, Rc, own, w):  # type: ignore[no-untyped-def]
    """Take up to LANES rods into the lanes; the last one also into those left over."""
    Q, at, D, r = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty(3)
    w[:] = 0.0
    for i in range(LANES):
        row = rows[min(i, rows.shape[0] - 1)]
        field, rod = fields[row], rods[row]
        _frame(field, Q, at, own[i])
        for a in range(3):
            r[a] = 0.0
            w[HALF + LANES * a + i] = field[1 + a]
            for j in range(3):
                r[a] -= Q[a, j] * at[j]
                D[a, j] = Q[a, 0] * Rc[0, j] + Q[a, 1] * Rc[1, j] + Q[a, 2] * Rc[2, j]
        w[HALF + LANES * 3 + i] = field[16] / (4.0 * math.pi)
        _pose(D, r, CLAMP, i, w)
        _unloaded(rod, D, r)
        _pose(D, r, TIP, i, w)
        for k in range(rod.shape[0]):
            to = PACK + SECTION_WIDTH * LANES * k + i
            for j in range(WX):
                w[to + LANES * j] = rod[k, j]
            for a in range(3):
                w[to + LANES * (WX + a)] = (
                    Q[a, 0] * rod[k, WX] + Q[a, 1] * rod[k, WY] + Q[a, 2] * rod[k, WZ]
                )
        for k in range(12 * LANES):
            w[LAST + k] = w[TIP + k]


@njit(**OPTIONS)
def _pose(D, r, to, i, w):  # type: ignore[no-untyped-def]
    """Write a pose into a lane."""
    for a in range(3):
        for j in range(3):
            w[to + LANES * (3 * a + j) + i] = D[j, a]
        w[to + LANES * (9 + a) + i] = r[a]


@njit(**OPTIONS)
def _scale(sections, factor, w):  # type: ignore[no-untyped-def]
    """Multiply all loads."""
    for k in range(sections):
        at = PACK + SECTION_WIDTH * LANES * k
        for i in range(AXIAL * LANES, (MU2 + 1) * LANES):
            w[at + i] *= factor
        for i in range(WX * LANES, (WZ + 1) * LANES):
            w[at + i] *= factor


@njit(**OPTIONS)
def _predict(w):  # type: ignore[no-untyped-def]
    """Move the tips on by as much as they have moved since the last call."""
    for i in range(LANES):
        for a in range(3):
            w[MISS + LANES * a + i] = 0.0
            r = LANES * (9 + a) + i
            w[MISS + LANES * (3 + a) + i] = w[TIP + r] - w[LAST + r]
            d, c = LAST + 3 * LANES * a + i, TIP + 3 * LANES * a + i
            dx, dy, dz = w[d], w[d + LANES], w[d + 2 * LANES]
            cx, cy, cz = w[c], w[c + LANES], w[c + 2 * LANES]
            w[MISS + i] += 0.5 * (dy * cz - dz * cy)
            w[MISS + LANES + i] += 0.5 * (dz * cx - dx * cz)
            w[MISS + 2 * LANES + i] += 0.5 * (dx * cy - dy * cx)
    for i in range(12 * LANES):
        w[LAST + i] = w[TIP + i]
    move(w)


@njit(**OPTIONS, inline="always")
def _newton(rows, steps, kind, first, own, b, w, outcome):  # type: ignore[no-untyped-def]
    """Find the tips by `steps` steps a section; return whether any is left.

    `kind` says how many sections and columns there are, whether rods are tilted, and
    whether the field is not the same all along them.
    """
    sections, columns, tilted, along = kind
    for i in range(LANES):
        w[BEFORE + i] = first
    largest = math.inf
    for _ in range(8):
        fresh = largest > CHORD
        march(sections, steps, columns if fresh else 0, tilted, along, own, b, w)
        if fresh:
            if _unsure(rows, w, outcome):
                return False
            factor(6, MATRIX, w)
        correct(w)
        largest = _judge(rows, w, outcome)
        if largest < CLOSE:
            break
    left = False
    for i in range(rows.shape[0]):
        if not w[SIZE + i] < CLOSE:
            outcome[rows[i]] = HARD
        left = left or outcome[rows[i]] != HARD
    return left


@njit(**OPTIONS)
def _near(field, tip, margin):  # type: ignore[no-untyped-def]
    """Tell whether a rod clamped at the origin might touch its cuboid.

    A curve of length 1 stays within sqrt(1 - d^2) / 2 of the straight line between its
    ends, d apart; eight pieces of that line are checked.
    """
    if not in_reach(field, margin):
        return False
    d2 = tip[0] * tip[0] + tip[1] * tip[1] + tip[2] * tip[2]
    far = 0.5 * math.sqrt(max(0.0, 1.0 - d2)) + math.sqrt(d2) / 16.0 + margin
    for k in range(9):
        at = k / 8.0
        if blocked(field, at * tip[0], at * tip[1], at * tip[2], far):
            return True
    return False


@njit(**OPTIONS, inline="always")
def _solve_block(  # type: ignore[no-untyped-def]
    rows, rods, fields, Rc, margins, steps, loads, own, b, w, out, outcome
):
    """Solve up to LANES rods, of one kind of field, by so many steps of the load."""
    along = fields[rows[0], 0] != UNIFORM
    sections = rods.shape[1]
    _fill(rows, rods, fields, Rc, own, w)
    tilted = False
    for row in rows:
        outcome[row] = STABLE
        for k in range(sections):
            tilted = tilted or rods[row, k, MU1] != 0.0 or rods[row, k, MU2] != 0.0
    kind = sections, 6 if along else 3, tilted, along
    first = FIRST if loads == 1 else PREDICTED
    for k in range(loads):
        _scale(sections, (k + 1.0) / k if k > 0 else 1.0 / loads, w)
        _predict(w)
        if not _newton(rows, steps, kind, first, own, b, w, outcome):
            return
    march(sections, 2 * steps, 0, tilted, along, own, b, w)
    correct(w)
    for i in range(6 * LANES):
        w[MISS + i] *= LEFT
    change = w[SIZE : SIZE + LANES].copy()
    move(w)
    for i in range(rows.shape[0]):
        row = rows[i]
        _leave(fields[row], i, w, out[row])
        if not change[i] < COARSE or _near(fields[row], out[row], margins[row]):
            outcome[row] = HARD
        out[row, 6] = change[i] * (0.5 + w[RATE + i] + 200.0 * change[i]) + ROUNDING


@njit(**OPTIONS)
def _leave(field, i, w, out):  # type: ignore[no-untyped-def]
    """Write position and tangent of a tip in the specimen's frame."""
    for a in range(3):
        if field[0] == CUBOID:
            out[a], out[3 + a] = field[4 + a], 0.0
            for j in range(3):
                out[a] += field[7 + 3 * j + a] * w[TIP + LANES * (9 + j) + i]
                out[3 + a] += field[7 + 3 * j + a] * w[TIP + LANES * (6 + j) + i]
        else:
            out[a] = w[TIP + LANES * (9 + a) + i]
            out[3 + a] = w[TIP + LANES * (6 + a) + i]


@njit(**OPTIONS)
def _steps_of(rod, field, Rc, margin):  # type: ignore[no-untyped-def]
    """Return the steps that each section of a rod needs; 0: not for the lanes."""
    if field[0] == CUBOID:
        if in_reach(field, margin):
            D, r = Rc.copy(), np.zeros(3)
            _unloaded(rod, D, r)
            if _near(field, r, margin):
                return 0
        most = max(field[1], field[2], field[3])
        away = math.sqrt(field[4] ** 2 + field[5] ** 2 + field[6] ** 2)
        if away + 1.0 > FARTHEST * most:
            return 0
    elif field[0] != UNIFORM:
        return 0
    reach, turn = loads_on(rod, field, Rc[:, 2])
    if not (reach <= REACH_LIMIT and turn <= TURN_LIMIT):
        return 0
    total = longest = 0.0
    for p in rod:
        total += p[H] * math.sqrt(max(p[C1], p[C2], p[C3]))
    for p in rod:
        z = reach * p[H] * math.sqrt(max(p[C1], p[C2], p[C3])) / total
        z += p[H] * math.sqrt(p[K1] ** 2 + p[K2] ** 2 + p[K3] ** 2)
        longest = max(longest, z)
    steps = math.ceil(longest / STEP)
    return max(1, steps) if steps <= MOST_STEPS else 0


@njit(**OPTIONS)
def solve_space_lanes(rods, fields, Rc, margins, out, outcome):  # type: ignore[no-untyped-def]
    """Solve rods (n, sections, 13) in fields (n, width), clamped along `Rc`.

    Fills `out` (n, 7) with position and tangent of the tips and errors; `outcome` is
    `STABLE` (and the Morse index 0) or `HARD`.
    """
    steps = np.empty(rods.shape[0], dtype=np.int64)
    for i in range(rods.shape[0]):
        steps[i] = _steps_of(rods[i], fields[i], Rc, margins[i])
    outcome[:] = HARD
    w = np.zeros(PACK + SECTION_WIDTH * rods.shape[1] * LANES)
    own, b = np.zeros((LANES, WIDTH)), np.zeros(12)
    for loads in (1, LOADS):
        for number in range(1, MOST_STEPS + 1):
            rows = np.flatnonzero((steps == number) & (outcome == HARD))
            more = number if loads == 1 else number + 1
            for k in range(0, rows.shape[0], LANES):
                _solve_block(
                    rows[k : k + LANES], rods, fields, Rc, margins, more, loads, own,
                    b, w, out, outcome,
                )  # fmt: skip
