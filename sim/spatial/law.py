"""The law of a solid's section: finite bending, torsion and stretch, and shear.

A row of the rod's table that is wider than `march.WIDTH` goes on with the columns named
here. With the linear strains k_i = C_i m_i and e = T N, the curvatures k_i (1 + f_i),
the stretch and the shears are derivatives of one complementary energy by m, N and Q, so
that work is conserved:

    r_i^2 f_i = r_i^2 (alpha_i e + beta_i e^2) + sum_j P_ij k_j^2
                + S_i (S_1 k_1^2 + S_2 k_2^2)^2 + e (A_i V + B_i U) / 2
    eps       = e + NU e^2 / 2 + sum_i (alpha_i / 2 + beta_i e) r_i^2 k_i^2 + U V / 4
    gamma_i   = G_i Q_i + M_i k_i k_3,    U = sum A_i k_i^2,    V = sum B_i k_i^2

and by the last term curvatures gain C_i M_i Q_i k_3, and twist C_3 sum M_i Q_i k_i; by
D k_1 k_2 k_3 in the energy, which only ends have, each gains C_i D k_j k_l. There r_i^2
is the stiffness of k_i over that of e. Dimensionless as `spatial.march`.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import flux_at

(
    T, G1, G2, BEND, TWIST, STRETCH, R1, R2, R3,
    P11, P22, P12, P13, P23, S1, S2, FACE1, FACE2, BEND2, A1, A2, B1, B2, M1, M2,
    D, P33,
) = range(13, 40)  # fmt: skip
"""Compliances of stretch and shear; alpha of bending and torsion; `NU`; r_i^2; P; S;
where along d1 and d2 the four Gauss points of the end face are; beta; A; B; M; D."""
SOLID_WIDTH = 40
_C1, _WX = 1, 10
"""Where a row's three compliances and its weight begin, as in `march`."""


@njit(cache=True)
def strains(p, y, v, H):  # type: ignore[no-untyped-def]
    """Write curvatures, shears and stretch at the state `y` into `v` (6,).

    `H` (7, 6) receives their derivatives by moment and force in body components, and
    in its last row the force.
    """
    for a in range(3):
        H[6, a] = y[15] * y[a] + y[16] * y[3 + a] + y[17] * y[6 + a]
    k0, k1, k2 = p[_C1] * y[9], p[_C1 + 1] * y[10], p[_C1 + 2] * y[11]
    e = p[T] * H[6, 2]
    b0, b1, b2 = k0 * k0, k1 * k1, k2 * k2
    g = p[S1] * b0 + p[S2] * b1
    f0 = p[P11] * b0 + p[P12] * b1 + p[P13] * b2 + p[S1] * g * g
    f1 = p[P12] * b0 + p[P22] * b1 + p[P23] * b2 + p[S2] * g * g
    f2 = p[P13] * b0 + p[P23] * b1 + p[P33] * b2
    U, V = p[A1] * b0 + p[A2] * b1, p[B1] * b0 + p[B2] * b1
    bend = 1.0 + p[BEND] * e + p[BEND2] * e * e
    f0 = bend + (f0 + 0.5 * e * (p[A1] * V + p[B1] * U)) / p[R1]
    f1 = bend + (f1 + 0.5 * e * (p[A2] * V + p[B2] * U)) / p[R2]
    f2 = 1.0 + p[TWIST] * e + f2 / p[R3]
    q0, q1 = p[M1] * H[6, 0], p[M2] * H[6, 1]
    v[0] = k0 * f0 + p[_C1] * (q0 + p[D] * k1) * k2
    v[1] = k1 * f1 + p[_C1 + 1] * (q1 + p[D] * k0) * k2
    v[2] = k2 * f2 + p[_C1 + 2] * (q0 * k0 + q1 * k1 + p[D] * k0 * k1)
    v[3] = p[G1] * H[6, 0] + p[M1] * k0 * k2
    v[4] = p[G2] * H[6, 1] + p[M2] * k1 * k2
    bent = p[R1] * b0 + p[R2] * b1
    bow = (p[BEND] + 2.0 * p[BEND2] * e) * bent + p[TWIST] * p[R3] * b2 + 0.5 * U * V
    v[5] = e + 0.5 * p[STRETCH] * e * e + 0.5 * bow
    H[:6] = 0.0
    s = 2.0 * g
    g0 = p[P11] + s * p[S1] ** 2 + e * p[A1] * p[B1]
    g1 = p[P22] + s * p[S2] ** 2 + e * p[A2] * p[B2]
    H[0, 0] = p[_C1] * (f0 + 2.0 * b0 * g0 / p[R1])
    H[1, 1] = p[_C1 + 1] * (f1 + 2.0 * b1 * g1 / p[R2])
    H[2, 2] = p[_C1 + 2] * (f2 + 2.0 * b2 * p[P33] / p[R3])
    # C_i r_i^2 = T makes the rest symmetric.
    per = 2.0 * p[T] / (p[R1] * p[R2] * p[R3])
    g2 = p[P12] + s * p[S1] * p[S2] + 0.5 * e * (p[A1] * p[B2] + p[A2] * p[B1])
    H[0, 1] = per * p[R3] * k0 * k1 * g2 + p[_C1] * p[_C1 + 1] * p[D] * k2
    q0, q1 = p[_C1] * (q0 + p[D] * k1), p[_C1 + 1] * (q1 + p[D] * k0)
    H[0, 2] = per * p[R2] * k0 * k2 * p[P13] + q0 * p[_C1 + 2]
    H[1, 2] = per * p[R1] * k1 * k2 * p[P23] + q1 * p[_C1 + 2]
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
    H[0, 3] = H[3, 0] = p[_C1] * p[M1] * k2
    H[1, 4] = H[4, 1] = p[_C1 + 1] * p[M2] * k2
    H[2, 3] = H[3, 2] = p[_C1 + 2] * p[M1] * k0
    H[2, 4] = H[4, 2] = p[_C1 + 2] * p[M2] * k1
    slope = p[BEND] + 2.0 * p[BEND2] * e
    H[0, 5] = slope + 0.5 * (p[A1] * V + p[B1] * U) / p[R1]
    H[1, 5] = slope + 0.5 * (p[A2] * V + p[B2] * U) / p[R2]
    H[0, 5] *= p[T] * k0
    H[1, 5] *= p[T] * k1
    H[5, 0], H[5, 1] = H[0, 5], H[1, 5]
    H[2, 5] = H[5, 2] = p[TWIST] * p[T] * k2
    H[3, 3], H[4, 4] = p[G1], p[G2]
    H[5, 5] = p[T] * (1.0 + p[STRETCH] * e + p[BEND2] * bent)


@njit(cache=True)
def axis(rows, states, directors, curvature):  # type: ignore[no-untyped-def]
    """Write directors whose third is the tangent of the axis, and their curvature.

    Parameters
    ----------
    rows : ndarray, shape (n, 40)
        The section at each station.
    states : ndarray, shape (n, 18)
        The state there, as of `march`.
    directors, curvature : ndarray, shapes (n, 3, 3) and (n, 3)
        The sections tilt against the axis by the shear, which counts to first order.
    """
    v, H = np.empty(6), np.empty((7, 6))
    for k in range(rows.shape[0]):
        p, y = rows[k], states[k]
        strains(p, y, v, H)
        a, c = v[3] / (1.0 + v[5]), v[4] / (1.0 + v[5])
        for i in range(3):
            d1, d2, d3 = y[3 * i], y[3 * i + 1], y[3 * i + 2]
            directors[k, 0, i] = d1 - a * d3
            directors[k, 1, i] = d2 - c * d3
            directors[k, 2, i] = d3 + a * d1 + c * d2
        for j in range(3):
            size = math.sqrt(np.sum(directors[k, j] ** 2))
            directors[k, j] /= size
        # d(Q)/ds = -omega x n - weight, in body components
        q0 = v[2] * H[6, 1] - v[1] * H[6, 2]
        q1 = v[0] * H[6, 2] - v[2] * H[6, 0]
        for i in range(3):
            q0 -= p[_WX + i] * y[3 * i]
            q1 -= p[_WX + i] * y[3 * i + 1]
        curvature[k, 0] = v[0] - a * v[2] - p[G2] * q1
        curvature[k, 1] = v[1] - c * v[2] + p[G1] * q0
        curvature[k, 2] = v[2] + a * v[0] + c * v[1]


@njit(cache=True)
def solid_slope(p, y, f, v, H):  # type: ignore[no-untyped-def]
    """Write dy/dsigma into `f`, as `march` does for a rod; `v` and `H` as `strains`."""
    strains(p, y, v, H)
    w0, w1, w2 = v[0], v[1], v[2]
    u0, u1, u2 = v[3], v[4], 1.0 + v[5]
    n0, n1, n2 = H[6, 0], H[6, 1], H[6, 2]
    for i in range(3):
        e0, e1, e2 = y[3 * i], y[3 * i + 1], y[3 * i + 2]
        f[3 * i] = w1 * e2 - w2 * e1
        f[3 * i + 1] = w2 * e0 - w0 * e2
        f[3 * i + 2] = w0 * e1 - w1 * e0
        f[12 + i] = -(u0 * e0 + u1 * e1 + u2 * e2)
        f[15 + i] = p[_WX + i]
    f[9] = w1 * y[11] - w2 * y[10] + u1 * n2 - u2 * n1
    f[10] = w2 * y[9] - w0 * y[11] + u2 * n0 - u0 * n2
    f[11] = w0 * y[10] - w1 * y[9] + u0 * n1 - u1 * n0


@njit(cache=True)
def solid_columns(y, v, H, Z, F):  # type: ignore[no-untyped-def]
    """Write dZ/dsigma into `F` (12, columns), with `v` and `H` of `strains`."""
    w0, w1, w2 = v[0], v[1], v[2]
    u0, u1, u2 = v[3], v[4], 1.0 + v[5]
    n0, n1, n2 = H[6, 0], H[6, 1], H[6, 2]
    m0, m1, m2 = y[9], y[10], y[11]
    for a in range(Z.shape[1]):
        x0, x1, x2 = Z[0, a], Z[1, a], Z[2, a]
        a0, a1, a2 = Z[3, a], Z[4, a], Z[5, a]
        d0, d1, d2 = Z[9, a], Z[10, a], Z[11, a]
        q0 = n1 * x2 - n2 * x1 + d0 * y[0] + d1 * y[3] + d2 * y[6]
        q1 = n2 * x0 - n0 * x2 + d0 * y[1] + d1 * y[4] + d2 * y[7]
        q2 = n0 * x1 - n1 * x0 + d0 * y[2] + d1 * y[5] + d2 * y[8]
        v0 = H[0, 0] * a0 + H[0, 1] * a1 + H[0, 2] * a2 + H[0, 3] * q0 + H[0, 5] * q2
        v1 = H[1, 0] * a0 + H[1, 1] * a1 + H[1, 2] * a2 + H[1, 4] * q1 + H[1, 5] * q2
        v2 = H[2, 0] * a0 + H[2, 1] * a1 + H[2, 2] * a2 + H[2, 5] * q2
        v2 += H[2, 3] * q0 + H[2, 4] * q1
        g0 = H[3, 0] * a0 + H[3, 2] * a2 + H[3, 3] * q0
        g1 = H[4, 1] * a1 + H[4, 2] * a2 + H[4, 4] * q1
        g2 = H[5, 0] * a0 + H[5, 1] * a1 + H[5, 2] * a2 + H[5, 5] * q2
        F[0, a] = w1 * x2 - w2 * x1 - v0
        F[1, a] = w2 * x0 - w0 * x2 - v1
        F[2, a] = w0 * x1 - w1 * x0 - v2
        F[3, a] = v1 * m2 - v2 * m1 + w1 * a2 - w2 * a1
        F[4, a] = v2 * m0 - v0 * m2 + w2 * a0 - w0 * a2
        F[5, a] = v0 * m1 - v1 * m0 + w0 * a1 - w1 * a0
        F[3, a] += g1 * n2 - g2 * n1 + u1 * q2 - u2 * q1
        F[4, a] += g2 * n0 - g0 * n2 + u2 * q0 - u0 * q2
        F[5, a] += g0 * n1 - g1 * n0 + u0 * q1 - u1 * q0
        g0 += x1 * u2 - x2 * u1
        g1 += x2 * u0 - x0 * u2
        g2 += x0 * u1 - x1 * u0
        for i in range(3):
            F[6 + i, a] = -(y[3 * i] * g0 + y[3 * i + 1] * g1 + y[3 * i + 2] * g2)
            F[9 + i, a] = 0.0


@njit(cache=True)
def face_load(field, m, p, y, Z, b):  # type: ignore[no-untyped-def]
    """Add to a tip's state and columns what a magnetic end face of load m feels.

    Four Gauss points carry the face's mean flux and its moment about the axis.
    """
    at, push = np.zeros(3), np.zeros(3)
    for corner in range(4):
        o0 = p[FACE1] if corner % 2 == 0 else -p[FACE1]
        o1 = p[FACE2] if corner < 2 else -p[FACE2]
        for i in range(3):
            at[i] = y[12 + i] + o0 * y[3 * i] + o1 * y[3 * i + 1]
        flux_at(field, at[0], at[1], at[2], b)
        push[:] = 0.0
        for i in range(3):
            y[15 + i] += 0.25 * m * b[i]
            for a in range(3):
                push[a] += 0.25 * m * b[i] * y[3 * i + a]
        y[9] += o1 * push[2]
        y[10] -= o0 * push[2]
        y[11] += o0 * push[1] - o1 * push[0]
        for a in range(Z.shape[1]):
            x0, x1, x2 = Z[0, a], Z[1, a], Z[2, a]
            g0 = push[1] * x2 - push[2] * x1
            g1 = push[2] * x0 - push[0] * x2
            g2 = push[0] * x1 - push[1] * x0
            for i in range(3):
                turned = 0.0
                for j in range(3):
                    # the corner moves by R (chi x o)
                    moved = Z[6 + j, a] + y[3 * j + 2] * (x0 * o1 - x1 * o0)
                    moved += x2 * (y[3 * j + 1] * o0 - y[3 * j] * o1)
                    turned += 0.25 * m * b[3 + 3 * i + j] * moved
                Z[9 + i, a] += turned
                g0 += y[3 * i] * turned
                g1 += y[3 * i + 1] * turned
                g2 += y[3 * i + 2] * turned
            Z[3, a] += o1 * g2
            Z[4, a] -= o0 * g2
            Z[5, a] += o0 * g1 - o1 * g0
