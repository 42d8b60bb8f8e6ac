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
part only, with distributed torque and force.

A column, shape (12,), holds (chi, dm, dr, dn): dR = R chi^, and the variations of m, r
and n. Six of them, for a turn and a shift of the tip, give Newton's matrix; in a
uniform field three, for the turn.

A section is a row of 13 numbers, named below; a wider one goes on with a solid's law
(`law`). One step of the sixth-order method of Butcher (J. Austral. Math. Soc. 4, 179,
1964) has seven stages.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import flux_at, is_uniform
from .law import face_load, solid_slope

H, C1, C2, C3, AXIAL, MU1, MU2, K1, K2, K3, WX, WY, WZ = range(13)
WIDTH = 13
"""Columns of a rod, tip first: length; compliances by d1, d2, d3; magnetic load per
tesla along d3, d1, d2; rest curvature; weight."""
STATE, COLUMN = 18, 12
PROBE = 1e-4
"""Step, in lengths of the rod, of the differences of the field's gradient."""

_A = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 3, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 2 / 3, 0.0, 0.0, 0.0, 0.0],
        [1 / 12, 1 / 3, -1 / 12, 0.0, 0.0, 0.0],
        [25 / 48, -55 / 24, 35 / 48, 15 / 8, 0.0, 0.0],
        [3 / 20, -11 / 24, -1 / 8, 1 / 2, 1 / 10, 0.0],
        [-261 / 260, 33 / 13, 43 / 156, -118 / 39, 32 / 195, 80 / 39],
    ]
)
_B = np.array([13 / 200, 0.0, 11 / 40, 11 / 40, 4 / 25, 4 / 25, 13 / 200])


@njit(cache=True)
def _slope(p, field, y, f, b):  # type: ignore[no-untyped-def]
    """Write dy/dsigma into `f`; leave B and gradient in `b` where mu acts."""
    w0 = p[C1] * y[9] + p[K1]
    w1 = p[C2] * y[10] + p[K2]
    w2 = p[C3] * y[11] + p[K3]
    n0 = n1 = n2 = 0.0
    for i in range(3):
        e0, e1, e2 = y[3 * i], y[3 * i + 1], y[3 * i + 2]
        f[3 * i] = w1 * e2 - w2 * e1
        f[3 * i + 1] = w2 * e0 - w0 * e2
        f[3 * i + 2] = w0 * e1 - w1 * e0
        f[12 + i] = -e2
        n0 += y[15 + i] * e0
        n1 += y[15 + i] * e1
        n2 += y[15 + i] * e2
        f[15 + i] = p[WX + i]
    f[9] = w1 * y[11] - w2 * y[10] - n1
    f[10] = w2 * y[9] - w0 * y[11] + n0
    f[11] = w0 * y[10] - w1 * y[9]
    if p[MU1] != 0.0 or p[MU2] != 0.0:
        flux_at(field, y[12], y[13], y[14], b)
        b0 = b[0] * y[0] + b[1] * y[3] + b[2] * y[6]
        b1 = b[0] * y[1] + b[1] * y[4] + b[2] * y[7]
        b2 = b[0] * y[2] + b[1] * y[5] + b[2] * y[8]
        f[9] += p[MU2] * b2
        f[10] -= p[MU1] * b2
        f[11] += p[MU1] * b1 - p[MU2] * b0
        for j in range(3):
            mu = p[MU1] * y[3 * j] + p[MU2] * y[3 * j + 1]
            for i in range(3):
                f[15 + i] += mu * b[3 + 3 * j + i]


@njit(cache=True)
def _column_slope(p, field, y, b, Z, F, b2):  # type: ignore[no-untyped-def]
    """Write dZ/dsigma into `F` (12, columns) at the state `y` with field `b`."""
    w0 = p[C1] * y[9] + p[K1]
    w1 = p[C2] * y[10] + p[K2]
    w2 = p[C3] * y[11] + p[K3]
    n0 = y[15] * y[0] + y[16] * y[3] + y[17] * y[6]
    n1 = y[15] * y[1] + y[16] * y[4] + y[17] * y[7]
    n2 = y[15] * y[2] + y[16] * y[5] + y[17] * y[8]
    m0, m1, m2 = y[9], y[10], y[11]
    for a in range(Z.shape[1]):
        x0, x1, x2 = Z[0, a], Z[1, a], Z[2, a]
        u0, u1, u2 = Z[3, a], Z[4, a], Z[5, a]
        v0, v1, v2 = p[C1] * u0, p[C2] * u1, p[C3] * u2
        F[0, a] = w1 * x2 - w2 * x1 - v0
        F[1, a] = w2 * x0 - w0 * x2 - v1
        F[2, a] = w0 * x1 - w1 * x0 - v2
        d0, d1, d2 = Z[9, a], Z[10, a], Z[11, a]
        q0 = n1 * x2 - n2 * x1 + d0 * y[0] + d1 * y[3] + d2 * y[6]
        q1 = n2 * x0 - n0 * x2 + d0 * y[1] + d1 * y[4] + d2 * y[7]
        F[3, a] = v1 * m2 - v2 * m1 + w1 * u2 - w2 * u1 - q1
        F[4, a] = v2 * m0 - v0 * m2 + w2 * u0 - w0 * u2 + q0
        F[5, a] = v0 * m1 - v1 * m0 + w0 * u1 - w1 * u0
        for i in range(3):
            F[6 + i, a] = x0 * y[3 * i + 1] - x1 * y[3 * i]
            F[9 + i, a] = 0.0
    if p[MU1] != 0.0 or p[MU2] != 0.0:
        _distributed(p, field, y, b, Z, F, b2)


@njit(cache=True)
def _distributed(p, field, y, b, Z, F, b2):  # type: ignore[no-untyped-def]
    """Add what the transverse magnetisation does to the columns."""
    c0 = b[0] * y[0] + b[1] * y[3] + b[2] * y[6]
    c1 = b[0] * y[1] + b[1] * y[4] + b[2] * y[7]
    c2 = b[0] * y[2] + b[1] * y[5] + b[2] * y[8]
    for a in range(Z.shape[1]):
        x0, x1, x2 = Z[0, a], Z[1, a], Z[2, a]
        g0 = c1 * x2 - c2 * x1
        g1 = c2 * x0 - c0 * x2
        g2 = c0 * x1 - c1 * x0
        size = max(abs(Z[6, a]), abs(Z[7, a]), abs(Z[8, a]))
        scale = PROBE / size if size > 0.0 and not is_uniform(field) else 0.0
        if scale > 0.0:
            flux_at(
                field, y[12] + scale * Z[6, a], y[13] + scale * Z[7, a],
                y[14] + scale * Z[8, a], b2,
            )  # fmt: skip
            h2 = b2.copy()
            flux_at(
                field, y[12] - scale * Z[6, a], y[13] - scale * Z[7, a],
                y[14] - scale * Z[8, a], b2,
            )  # fmt: skip
        for j in range(3):
            e0, e1, e2 = y[3 * j], y[3 * j + 1], y[3 * j + 2]
            db = (
                b[3 + 3 * j] * Z[6, a] + b[4 + 3 * j] * Z[7, a] + b[5 + 3 * j] * Z[8, a]
            )
            g0 += db * e0
            g1 += db * e1
            g2 += db * e2
            turned = -(p[MU1] * (x1 * e2 - x2 * e1) + p[MU2] * (x2 * e0 - x0 * e2))
            mu = p[MU1] * e0 + p[MU2] * e1
            for i in range(3):
                F[9 + i, a] += turned * b[3 + 3 * j + i]
                if scale > 0.0:
                    bend = (h2[3 + 3 * j + i] - b2[3 + 3 * j + i]) / (2.0 * scale)
                    F[9 + i, a] += mu * bend
        F[3, a] += p[MU2] * g2
        F[4, a] -= p[MU1] * g2
        F[5, a] += p[MU1] * g1 - p[MU2] * g0


@njit(cache=True)
def step(h, p, field, y, Z, K, KZ, ys, Zs, b, b2):  # type: ignore[no-untyped-def]
    """Advance the state `y` and the columns `Z` (12, c; c may be 0) by `h`."""
    z, zs, kz = Z.reshape(-1), Zs.reshape(-1), KZ.reshape(7, -1)
    for stage in range(7):
        ys[:] = y
        zs[:] = z
        for j in range(stage):
            c = h * _A[stage, j]
            if c != 0.0:
                for i in range(STATE):
                    ys[i] += c * K[j, i]
                for i in range(z.shape[0]):
                    zs[i] += c * kz[j, i]
        if p.shape[0] > WIDTH:
            solid_slope(p, ys, K[stage], Zs, KZ[stage])
            continue
        _slope(p, field, ys, K[stage], b)
        if z.shape[0] > 0:
            _column_slope(p, field, ys, b, Zs, KZ[stage], b2)
    for j in range(7):
        c = h * _B[j]
        if c != 0.0:
            for i in range(STATE):
                y[i] += c * K[j, i]
            for i in range(z.shape[0]):
                z[i] += c * kz[j, i]


@njit(cache=True)
def begin(rod, field, load, R, r, y, Z, b):  # type: ignore[no-untyped-def]
    """Set state and columns at a tip with rotation R (3, 3) and position r (3,)."""
    m = load * rod[0, AXIAL]
    solid = rod.shape[1] > WIDTH
    if not solid:
        flux_at(field, r[0], r[1], r[2], b)
    y[9:12] = 0.0
    for i in range(3):
        for a in range(3):
            y[3 * i + a] = R[i, a]
        y[12 + i] = r[i]
        y[15 + i] = 0.0 if solid else m * b[i]
    if Z.shape[1] > 0:
        Z[:] = 0.0
        for a in range(3):
            Z[a, a] = 1.0
            if Z.shape[1] > 3:
                Z[6 + a, 3 + a] = 1.0
                for i in range(3):
                    Z[9 + i, 3 + a] = 0.0 if solid else m * b[3 + 3 * i + a]
    if solid:
        face_load(field, m, rod[0], y, Z, b)


@njit(cache=True)
def cross(rod, field, load, i, y, Z, b):  # type: ignore[no-untyped-def]
    """Add the pole load of the joint between sections i and i + 1 (root side)."""
    m = load * (rod[i + 1, AXIAL] - rod[i, AXIAL])
    if m == 0.0:
        return
    flux_at(field, y[12], y[13], y[14], b)
    for k in range(3):
        y[15 + k] += m * b[k]
        for a in range(Z.shape[1]):
            for j in range(3):
                Z[9 + k, a] += m * b[3 + 3 * k + j] * Z[6 + j, a]


@njit(cache=True)
def loaded(rod, i, load, p):  # type: ignore[no-untyped-def]
    """Write section i, with its loads times `load`, into `p`."""
    p[:] = rod[i]
    for k in (MU1, MU2, WX, WY, WZ):
        p[k] *= load


@njit(cache=True)
def steps_of(rod, i, n):  # type: ignore[no-untyped-def]
    """Return the steps of section i when a whole rod takes about n per unit."""
    return max(1, math.ceil(n * rod[i, H]))


@njit(cache=True)
def march(rod, field, load, n, R, r, y, Z, work):  # type: ignore[no-untyped-def]
    """March from the tip (R, r) to the root; state and columns end in `y` and `Z`."""
    K, KZ, ys, Zs, b, b2, p = work
    begin(rod, field, load, R, r, y, Z, b)
    for i in range(rod.shape[0]):
        loaded(rod, i, load, p)
        count = steps_of(rod, i, n)
        h = rod[i, H] / count
        for _ in range(count):
            step(h, p, field, y, Z, K, KZ, ys, Zs, b, b2)
        if i + 1 < rod.shape[0]:
            cross(rod, field, load, i, y, Z, b)


@njit(cache=True)
def workspace(columns, width):  # type: ignore[no-untyped-def]
    """Return what `march` and `step` work in, for rods of that many numbers a row."""
    return (
        np.zeros((7, STATE)),
        np.zeros((7, COLUMN, columns)),
        np.zeros(STATE),
        np.zeros((COLUMN, columns)),
        np.zeros(12),
        np.zeros(12),
        np.zeros(width),
    )
