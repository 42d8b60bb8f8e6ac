"""The march of a rod in space from its free tip, with its variational columns.

Dimensionless as `planar.march`: lengths over L, moments over EI_ref / L, forces over
EI_ref / L^2, fields in T, sigma = L - s. Directors (d1, d2, d3) with d3 the tangent, at
the clamp along (y, z, x). The state, shape (18,), holds

    E   the fixed axes x, y, z in body components (the rows of R): E' = omega x E
    m   the moment in body components:  m' = omega x m + d3 x n + mu x B
    r   the position:                   r' = -d3
    n   the force in fixed components:  n' = grad(mu . B) + w

(derivatives by sigma) with omega = m / (EI_1, EI_2, GJ) + rest curvature. The axial
magnetisation is in n as a pole load, exactly (`planar.march`); `mu` is the transverse
part only, with distributed torque and force (`spatial.across`).

A column holds (chi, dm, dr, dn): dR = R chi^, and the variations of m, r and n. Six of
them, for a turn and a shift of the tip, give Newton's matrix; in a uniform field three,
for the turn. Columns are kept in blocks of six, shape (12 x 6), one after the other.

A section is a row of 13 numbers, named below; a wider one goes on with a solid's law
(`law`). One step of the sixth-order method of
Butcher (J. Austral. Math. Soc. 4, 179, 1964) has seven stages; steps come in pairs, of
which `spatial.curve` makes a curve.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import PART, flux_at, is_uniform
from .across import POSITIVE, add_columns, add_state, look, recall
from .law import SOLID_WIDTH, face_load, solid_columns, solid_slope

H, C1, C2, C3, AXIAL, MU1, MU2, K1, K2, K3, WX, WY, WZ = range(13)
WIDTH = 13
"""Columns of a rod, tip first: length; compliances by d1, d2, d3; magnetic load per
tesla along d3, d1, d2; rest curvature; weight."""
STATE = 18
BLOCK = 72
"""Numbers of a state, and of a block of six columns."""
ROW, BLOCKS = 20, 2
"""Room for a state, a whole number of vectors; most blocks of columns."""
Y = SOLID_WIDTH
Z = Y + ROW
LOOK = Z + BLOCKS * BLOCK
LOOK_Z = LOOK + ROW
SLOPE = LOOK_Z + BLOCKS * BLOCK
SLOPE_Z = SLOPE + 7 * ROW
AROUND = SLOPE_Z + 7 * BLOCKS * BLOCK
WORK = AROUND + ROW
"""Offsets, in one array of work space that begins with the widest row of a section, of
state and columns, of where a stage looks, of all slopes, and of the field there. With
constant distances in one array the compiler knows that nothing overlaps, and runs loops
on vectors (`batch.lanes`)."""
_A = np.array(
    [
        [0, 0, 0, 0, 0, 0, 0],
        [1 / 3, 0, 0, 0, 0, 0, 0],
        [0, 2 / 3, 0, 0, 0, 0, 0],
        [1 / 12, 1 / 3, -1 / 12, 0, 0, 0, 0],
        [25 / 48, -55 / 24, 35 / 48, 15 / 8, 0, 0, 0],
        [3 / 20, -11 / 24, -1 / 8, 1 / 2, 1 / 10, 0, 0],
        [-261 / 260, 33 / 13, 43 / 156, -118 / 39, 32 / 195, 80 / 39, 0],
        [13 / 200, 0, 11 / 40, 11 / 40, 4 / 25, 4 / 25, 13 / 200],
    ]
)
"""Butcher's weights: a row a stage, and the step itself."""
_PLACE = np.array([0, 2, 3, 2, 4, 1, 5])
"""Which of `across.PLACES` each stage looks at, in the first step of a pair."""
FAST = {**PART, "fastmath": {"contract"}}
MARCH = {"cache": True, "error_model": "numpy"}


@njit(**FAST)
def _state_slope(k, w):  # type: ignore[no-untyped-def]
    """Write stage k's dy/dsigma, but for what acts across the rod."""
    y = LOOK
    e00, e01, e02 = w[y], w[y + 1], w[y + 2]
    e10, e11, e12 = w[y + 3], w[y + 4], w[y + 5]
    e20, e21, e22 = w[y + 6], w[y + 7], w[y + 8]
    m0, m1, m2 = w[y + 9], w[y + 10], w[y + 11]
    n0, n1, n2 = w[y + 15], w[y + 16], w[y + 17]
    w0 = w[C1] * m0 + w[K1]
    w1 = w[C2] * m1 + w[K2]
    w2 = w[C3] * m2 + w[K3]
    f = SLOPE + ROW * k
    w[f] = w1 * e02 - w2 * e01
    w[f + 1] = w2 * e00 - w0 * e02
    w[f + 2] = w0 * e01 - w1 * e00
    w[f + 3] = w1 * e12 - w2 * e11
    w[f + 4] = w2 * e10 - w0 * e12
    w[f + 5] = w0 * e11 - w1 * e10
    w[f + 6] = w1 * e22 - w2 * e21
    w[f + 7] = w2 * e20 - w0 * e22
    w[f + 8] = w0 * e21 - w1 * e20
    w[f + 9] = w1 * m2 - w2 * m1 - (n0 * e01 + n1 * e11 + n2 * e21)
    w[f + 10] = w2 * m0 - w0 * m2 + (n0 * e00 + n1 * e10 + n2 * e20)
    w[f + 11] = w0 * m1 - w1 * m0
    w[f + 12] = -e02
    w[f + 13] = -e12
    w[f + 14] = -e22
    w[f + 15] = w[WX]
    w[f + 16] = w[WY]
    w[f + 17] = w[WZ]


@njit(**FAST)
def _column_slope(n, k, w):  # type: ignore[no-untyped-def]
    """Write stage k's dz/dsigma of block n, but for what acts across the rod."""
    y = LOOK
    e00, e01, e02 = w[y], w[y + 1], w[y + 2]
    e10, e11, e12 = w[y + 3], w[y + 4], w[y + 5]
    e20, e21, e22 = w[y + 6], w[y + 7], w[y + 8]
    m0, m1, m2 = w[y + 9], w[y + 10], w[y + 11]
    c1, c2, c3 = w[C1], w[C2], w[C3]
    w0 = c1 * m0 + w[K1]
    w1 = c2 * m1 + w[K2]
    w2 = c3 * m2 + w[K3]
    n0 = w[y + 15] * e00 + w[y + 16] * e10 + w[y + 17] * e20
    n1 = w[y + 15] * e01 + w[y + 16] * e11 + w[y + 17] * e21
    n2 = w[y + 15] * e02 + w[y + 16] * e12 + w[y + 17] * e22
    z = (LOOK_Z + BLOCK * n) & POSITIVE
    f = (SLOPE_Z + BLOCK * (BLOCKS * k + n)) & POSITIVE
    for a in range(6):
        x0, x1, x2 = w[z + a], w[z + 6 + a], w[z + 12 + a]
        u0, u1, u2 = w[z + 18 + a], w[z + 24 + a], w[z + 30 + a]
        d0, d1, d2 = w[z + 54 + a], w[z + 60 + a], w[z + 66 + a]
        v0, v1, v2 = c1 * u0, c2 * u1, c3 * u2
        q0 = n1 * x2 - n2 * x1 + d0 * e00 + d1 * e10 + d2 * e20
        q1 = n2 * x0 - n0 * x2 + d0 * e01 + d1 * e11 + d2 * e21
        w[f + a] = w1 * x2 - w2 * x1 - v0
        w[f + 6 + a] = w2 * x0 - w0 * x2 - v1
        w[f + 12 + a] = w0 * x1 - w1 * x0 - v2
        w[f + 18 + a] = v1 * m2 - v2 * m1 + w1 * u2 - w2 * u1 - q1
        w[f + 24 + a] = v2 * m0 - v0 * m2 + w2 * u0 - w0 * u2 + q0
        w[f + 30 + a] = v0 * m1 - v1 * m0 + w0 * u1 - w1 * u0
        w[f + 36 + a] = x0 * e01 - x1 * e00
        w[f + 42 + a] = x0 * e11 - x1 * e10
        w[f + 48 + a] = x0 * e21 - x1 * e20
        w[f + 54 + a] = 0.0
        w[f + 60 + a] = 0.0
        w[f + 66 + a] = 0.0


@njit(**FAST)
def _look_ahead(k, h, w):  # type: ignore[no-untyped-def]
    """Set the state at which stage k looks, by the slopes so far (7: the step's end).

    All slopes, also those of weight 0: no branch, and one loop on vectors.
    """
    a0, a1, a2, a3 = h * _A[k, 0], h * _A[k, 1], h * _A[k, 2], h * _A[k, 3]
    a4, a5, a6 = h * _A[k, 4], h * _A[k, 5], h * _A[k, 6]
    for i in range(ROW):
        f = SLOPE + i
        w[LOOK + i] = (
            w[Y + i] + a0 * w[f] + a1 * w[f + ROW] + a2 * w[f + 2 * ROW]
            + a3 * w[f + 3 * ROW] + a4 * w[f + 4 * ROW] + a5 * w[f + 5 * ROW]
            + a6 * w[f + 6 * ROW]
        )  # fmt: skip


@njit(**FAST)
def _columns_ahead(k, n, h, w):  # type: ignore[no-untyped-def]
    """Set block n of the columns at which stage k looks."""
    a0, a1, a2, a3 = h * _A[k, 0], h * _A[k, 1], h * _A[k, 2], h * _A[k, 3]
    a4, a5, a6 = h * _A[k, 4], h * _A[k, 5], h * _A[k, 6]
    row = BLOCKS * BLOCK
    at = (BLOCK * n) & POSITIVE
    for i in range(BLOCK):
        f = SLOPE_Z + at + i
        w[LOOK_Z + at + i] = (
            w[Z + at + i] + a0 * w[f] + a1 * w[f + row] + a2 * w[f + 2 * row]
            + a3 * w[f + 3 * row] + a4 * w[f + 4 * row] + a5 * w[f + 5 * row]
            + a6 * w[f + 6 * row]
        )  # fmt: skip


@njit(cache=True)
def _solid_slopes(k, blocks, w):  # type: ignore[no-untyped-def]
    """Write the slopes of stage k of a solid's state and columns."""
    y = w[LOOK : LOOK + STATE]
    f = w[SLOPE + ROW * k : SLOPE + ROW * k + STATE]
    v, H = np.empty(6), np.empty((7, 6))
    solid_slope(w, y, f, v, H)
    for n in range(blocks):
        at, g = LOOK_Z + BLOCK * n, SLOPE_Z + BLOCK * (BLOCKS * k + n)
        columns = w[at : at + BLOCK].reshape(12, 6)
        solid_columns(y, v, H, columns, w[g : g + BLOCK].reshape(12, 6))


@njit(**FAST)
def step(h, field, solid, table, pair, half, blocks, w, jet, b, c):  # type: ignore[no-untyped-def]
    """Advance the state, and the first `blocks` blocks of columns, by `h`.

    The rod is a plain one or a `solid`. The step is the first or second half of a pair,
    whose field is in `table` (`spatial.curve.tabulate`), or looked up where that is
    empty.
    """
    mu1, mu2 = w[MU1], w[MU2]
    tilted = mu1 != 0.0 or mu2 != 0.0
    for k in range(7):
        _look_ahead(k, h, w)
        if solid:
            for n in range(blocks):
                _columns_ahead(k, n, h, w)
            _solid_slopes(k, blocks, w)
            continue
        _state_slope(k, w)
        if tilted:
            if table.shape[0] > 0:
                recall(table, pair, 5 * half + _PLACE[k], AROUND, w)
            elif not is_uniform(field):
                x, y, z = w[LOOK + 12], w[LOOK + 13], w[LOOK + 14]
                look(field, x, y, z, blocks > 0, AROUND, w, jet, b, c)
            add_state(mu1, mu2, AROUND, LOOK, SLOPE + ROW * k, w)
        for n in range(blocks):
            _columns_ahead(k, n, h, w)
            _column_slope(n, k, w)
            if tilted:
                at, f = LOOK_Z + BLOCK * n, SLOPE_Z + BLOCK * (BLOCKS * k + n)
                add_columns(mu1, mu2, AROUND, LOOK, at, f, w)
    _look_ahead(7, h, w)
    for i in range(ROW):
        w[Y + i] = w[LOOK + i]
    for n in range(blocks):
        _columns_ahead(7, n, h, w)
        at = (BLOCK * n) & POSITIVE
        for i in range(BLOCK):
            w[Z + at + i] = w[LOOK_Z + at + i]


@njit(**FAST)
def slope(field, solid, table, pair, w, jet, b, c):  # type: ignore[no-untyped-def]
    """Leave the slope at the end of a pair as that of stage 0."""
    for i in range(STATE):
        w[LOOK + i] = w[Y + i]
    if solid:
        _solid_slopes(0, 0, w)
        return
    _state_slope(0, w)
    if w[MU1] != 0.0 or w[MU2] != 0.0:
        if table.shape[0] > 0:
            recall(table, pair, 10, AROUND, w)
        elif not is_uniform(field):
            x, y, z = w[Y + 12], w[Y + 13], w[Y + 14]
            look(field, x, y, z, False, AROUND, w, jet, b, c)
        add_state(w[MU1], w[MU2], AROUND, LOOK, SLOPE, w)


@njit(**FAST)
def begin(rod, field, load, R, r, blocks, w, b):  # type: ignore[no-untyped-def]
    """Set state and columns at a tip with rotation R (3, 3) and position r (3,)."""
    solid = rod.shape[1] > WIDTH
    flux_at(field, r[0], r[1], r[2], b)
    m = load * rod[0, AXIAL]
    for i in range(Y, WORK):
        w[i] = 0.0
    if solid:
        m = 0.0
    for i in range(3):
        for a in range(3):
            w[Y + 3 * i + a] = R[i, a]
        w[Y + 9 + i] = 0.0
        w[Y + 12 + i] = r[i]
        w[Y + 15 + i] = m * b[i]
        w[AROUND + i] = b[i]  # stays so in a uniform field
    if blocks > 0:
        for a in range(3):
            w[Z + 7 * a] = 1.0
            w[Z + 36 + 7 * a + 3] = 1.0
            for i in range(3):
                w[Z + 54 + 6 * i + 3 + a] = m * b[3 + 3 * i + a]
    if solid:
        columns = (
            w[Z : Z + BLOCK].reshape(12, 6) if blocks > 0 else w[:0].reshape(12, 0)
        )
        m = load * rod[0, AXIAL]
        face_load(field, m, rod[0], w[Y : Y + STATE], columns, b)


@njit(**FAST)
def cross(rod, field, load, i, blocks, w, b):  # type: ignore[no-untyped-def]
    """Add the pole load of the joint between sections i and i + 1 (root side)."""
    m = load * (rod[i + 1, AXIAL] - rod[i, AXIAL])
    if m == 0.0:
        return
    flux_at(field, w[Y + 12], w[Y + 13], w[Y + 14], b)
    for k in range(3):
        w[Y + 15 + k] += m * b[k]
        for j in range(3):
            g = m * b[3 + 3 * k + j]
            for n in range(blocks):
                z = Z + BLOCK * n
                for a in range(6):
                    w[z + 54 + 6 * k + a] += g * w[z + 36 + 6 * j + a]


@njit(**FAST)
def loaded(rod, i, load, w):  # type: ignore[no-untyped-def]
    """Take up section i, with its loads times `load`."""
    for k in range(rod.shape[1]):
        w[k] = rod[i, k]
    for k in (MU1, MU2, WX, WY, WZ):
        w[k] *= load


@njit(**FAST)
def pairs_of(rod, i, n):  # type: ignore[no-untyped-def]
    """Return the pairs of steps of section i when a whole rod takes about n steps."""
    return max(1, math.ceil(0.5 * n * rod[i, H]))


@njit(**FAST)
def all_pairs(rod, n):  # type: ignore[no-untyped-def]
    """Return the pairs of steps of the whole rod."""
    total = 0
    for i in range(rod.shape[0]):
        total += pairs_of(rod, i, n)
    return total


@njit(**MARCH)
def loads_on(rod, field, tip):  # type: ignore[no-untyped-def]
    """Return the load on a rod whose tip is at `tip`, and the turn of its rest shape.

    The load as the sum of h sqrt(P / EI), its reach.
    """
    b = np.zeros(12)
    flux_at(field, tip[0], tip[1], tip[2], b)
    size = math.sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
    load = weight = reach = turn = 0.0
    for p in rod:
        load = max(load, (abs(p[AXIAL]) + abs(p[MU1]) + abs(p[MU2])) * size)
        weight += p[H] * math.sqrt(p[WX] ** 2 + p[WY] ** 2 + p[WZ] ** 2)
        turn += p[H] * math.sqrt(p[K1] ** 2 + p[K2] ** 2 + p[K3] ** 2)
    for p in rod:
        reach += p[H] * math.sqrt(max(p[C1], p[C2], p[C3]) * (load + weight))
    return reach, turn
