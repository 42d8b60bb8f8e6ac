"""A rod in space in finite elements of high order: its rotation as a quaternion.

Dimensionless as `spatial.march`: lengths over the rod's length L, moments over
EI_ref / L, forces over EI_ref / L^2, fields in T; but s runs from the clamp. On an
element, with xi from 0 to 1, the rotation is that of the quaternion

    d = (1 - xi) q0 + (xi^2 - xi) c0 + (2 xi - 1)(xi^2 - xi) c1 + xi q1

whose length does not matter: turn and twist are w = 2 vec(conj(d) d') / d.d in the
rod's own axes, the tangent is t = R(d) e3. Interpolating in the space around, and
projecting, keeps the order of the polynomials and does not depend on the frame
(Grohs, Hardering and Sander 2015). Nodes turn by q (1, v / 2), normalised; inside,
c = (q0 + q1) / 2 (0, v / 2), so that a rod turned as a whole, or in itself, is the
same to the last digit. That makes twelve unknowns an element.

The energy is int sum_a C_a (w_a - k_a)^2 / 2 - m t . B(r) - W . t ds with W the weight
beyond s. Because curl B = 0, the derivative of the magnetic part is that of poles at
joints and tip (DESIGN, section 5), whose flux is taken there and nowhere else.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..magnet.flux import PART, blocked, flux_at, is_uniform

Array = NDArray[np.float64]

GAUSS = 5
_X, _W = np.polynomial.legendre.leggauss(GAUSS)
POINTS: Array = 0.5 * (_X + 1.0)
WEIGHTS: Array = 0.5 * _W
_POWERS = np.arange(GAUSS)
UP_TO: Array = np.ascontiguousarray(
    np.linalg.solve(
        np.vander(POINTS, increasing=True).T,
        (POINTS[:, None] ** (_POWERS + 1) / (_POWERS + 1)).T,
    ).T,
    dtype=np.float64,
)
"""Integral from 0 to each point, by the values at all points, shape (5, 5)."""
STEP = 9
"""Unknowns of an element that the next does not share."""


class Rod(NamedTuple):
    """What is in the tube of a rod, and its mesh.

    Parameters
    ----------
    s : ndarray, shape (n + 1,)
        Arc length of the nodes from the clamp.
    stiff, rest : ndarray, shape (n, 3)
        Stiffness and rest curvature of the elements about d1, d2 and the axis.
    m : ndarray, shape (n,)
        Magnetic load per tesla.
    pole : ndarray, shape (n + 1,)
        Pole at each node: the fall of m there, and at the last node m itself.
    beyond : ndarray, shape (n + 1, 3)
        Weight of what lies beyond each node.
    root : ndarray, shape (3,)
        Place of the clamp; its rotation is that of the first node.
    """

    s: Array
    stiff: Array
    rest: Array
    m: Array
    pole: Array
    beyond: Array
    root: Array


class Turn(NamedTuple):
    """The rotation of a rod.

    Parameters
    ----------
    q : ndarray, shape (n + 1, 4)
        Quaternions of the nodes.
    v : ndarray, shape (n, 2, 3)
        What bends the elements inside.
    c : ndarray, shape (n, 2, 4)
        Inner quaternions, by `fill_inner`.
    """

    q: Array
    v: Array
    c: Array


@njit(**PART)
def shapes(xi):  # type: ignore[no-untyped-def]
    """Return the four shapes at xi."""
    b = xi * xi - xi
    return 1.0 - xi, b, (2.0 * xi - 1.0) * b, xi


@njit(**PART)
def blend(turn, e, xi, d, v):  # type: ignore[no-untyped-def]
    """Fill the quaternion of element `e` at xi, and its derivative by xi."""
    f0, f1, f2, f3 = shapes(xi)
    g1 = 2.0 * xi - 1.0
    g2 = 6.0 * xi * (xi - 1.0) + 1.0
    for i in range(4):
        a = turn.q[e, i]
        b = turn.q[e + 1, i]
        d[i] = f0 * a + f1 * turn.c[e, 0, i] + f2 * turn.c[e, 1, i] + f3 * b
        v[i] = b - a + g1 * turn.c[e, 0, i] + g2 * turn.c[e, 1, i]


@njit(**PART)
def tangent(d, t):  # type: ignore[no-untyped-def]
    """Fill the tangent of a quaternion; return the square of its length."""
    n = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + d[3] * d[3]
    t[0] = 2.0 * (d[1] * d[3] + d[0] * d[2]) / n
    t[1] = 2.0 * (d[2] * d[3] - d[0] * d[1]) / n
    t[2] = (d[0] * d[0] - d[1] * d[1] - d[2] * d[2] + d[3] * d[3]) / n
    return n


@njit(**PART)
def cross_terms(d, v, J):  # type: ignore[no-untyped-def]
    """Fill rows of J with J_a v, where vec(conj(d) v)_a = d . J_a v; shape (3, 4)."""
    J[0, 0], J[0, 1], J[0, 2], J[0, 3] = v[1], -v[0], -v[3], v[2]
    J[1, 0], J[1, 1], J[1, 2], J[1, 3] = v[2], v[3], -v[0], -v[1]
    J[2, 0], J[2, 1], J[2, 2], J[2, 3] = v[3], -v[2], v[1], -v[0]


@njit(**PART)
def strain(rod, e, d, v, J, w):  # type: ignore[no-untyped-def]
    """Fill w with turn and twist less those at rest; return d . d."""
    cross_terms(d, v, J)
    n = 0.0
    for i in range(4):
        n += d[i] * d[i]
    h = rod.s[e + 1] - rod.s[e]
    for a in range(3):
        b = 0.0
        for i in range(4):
            b += d[i] * J[a, i]
        w[a] = 2.0 * b / (n * h) - rod.rest[e, a]
    return n


@njit(**PART)
def nodes(rod, turn, X):  # type: ignore[no-untyped-def]
    """Fill the places of the nodes, shape (n + 1, 3)."""
    d, v, t = np.empty(4), np.empty(4), np.empty(3)
    X[0] = rod.root
    for e in range(rod.m.shape[0]):
        h = rod.s[e + 1] - rod.s[e]
        X[e + 1] = X[e]
        for g in range(GAUSS):
            blend(turn, e, POINTS[g], d, v)
            tangent(d, t)
            for i in range(3):
                X[e + 1, i] += h * WEIGHTS[g] * t[i]


@njit(**PART)
def element_at(rod, s):  # type: ignore[no-untyped-def]
    """Return the element in which s is, and xi."""
    n = rod.m.shape[0]
    e = max(0, min(np.searchsorted(rod.s, s, side="right") - 1, n - 1))
    return e, (s - rod.s[e]) / (rod.s[e + 1] - rod.s[e])


@njit(**PART)
def station(rod, turn, X, s, r, t, k, d, v):  # type: ignore[no-untyped-def]
    """Fill place r, tangent t and its derivative k along the rod; return e and xi."""
    e, xi = element_at(rod, s)
    h = rod.s[e + 1] - rod.s[e]
    for i in range(3):
        r[i] = X[e, i]
    for g in range(GAUSS):
        blend(turn, e, xi * POINTS[g], d, v)
        tangent(d, t)
        for i in range(3):
            r[i] += h * xi * WEIGHTS[g] * t[i]
    blend(turn, e, xi, d, v)
    n = tangent(d, t)
    k[0] = d[1] * v[3] + d[3] * v[1] + d[0] * v[2] + d[2] * v[0]
    k[1] = d[2] * v[3] + d[3] * v[2] - d[0] * v[1] - d[1] * v[0]
    k[2] = d[0] * v[0] - d[1] * v[1] - d[2] * v[2] + d[3] * v[3]
    along = d[0] * v[0] + d[1] * v[1] + d[2] * v[2] + d[3] * v[3]
    for i in range(3):
        k[i] = 2.0 * (k[i] - t[i] * along) / (n * h)
    return e, xi


@njit(cache=True, nogil=True, error_model="numpy")
def own_energy(rod, field, turn, X):  # type: ignore[no-untyped-def]
    """Fill the places of the nodes; return the energy of bending, magnet and weight."""
    nodes(rod, turn, X)
    d, v, w, J = np.empty(4), np.empty(4), np.empty(3), np.empty((3, 4))
    T, r, b = np.empty((GAUSS, 3)), np.empty(3), np.zeros(12)
    total = 0.0
    for i in range(3):
        b[i] = field[1 + i]
        total -= rod.beyond[0, i] * rod.root[i]
    for e in range(rod.m.shape[0]):
        h = rod.s[e + 1] - rod.s[e]
        for g in range(GAUSS):
            blend(turn, e, POINTS[g], d, v)
            tangent(d, T[g])
            strain(rod, e, d, v, J, w)
            for a in range(3):
                total += 0.5 * h * WEIGHTS[g] * rod.stiff[e, a] * w[a] * w[a]
        for g in range(GAUSS):
            if rod.m[e] != 0.0 and not is_uniform(field):
                for i in range(3):
                    r[i] = X[e, i]
                    for k in range(GAUSS):
                        r[i] += h * UP_TO[g, k] * T[k, i]
                flux_at(field, r[0], r[1], r[2], b)
            for i in range(3):
                weight = rod.beyond[e, i] * (1.0 - POINTS[g])
                weight += rod.beyond[e + 1, i] * POINTS[g]
                total -= h * WEIGHTS[g] * (rod.m[e] * b[i] + weight) * T[g, i]
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def within_magnet(field, X):  # type: ignore[no-untyped-def]
    """Tell whether a node is inside a source of the field."""
    for i in range(1, X.shape[0]):
        if blocked(field, X[i, 0], X[i, 1], X[i, 2], 0.0):
            return True
    return False


@njit(**PART)
def _times(q, v, out):  # type: ignore[no-untyped-def]
    """Fill the product of quaternions q (0, v / 2)."""
    out[0] = -0.5 * (q[1] * v[0] + q[2] * v[1] + q[3] * v[2])
    out[1] = 0.5 * (q[0] * v[0] + q[2] * v[2] - q[3] * v[1])
    out[2] = 0.5 * (q[0] * v[1] + q[3] * v[0] - q[1] * v[2])
    out[3] = 0.5 * (q[0] * v[2] + q[1] * v[1] - q[2] * v[0])


@njit(cache=True, nogil=True, error_model="numpy")
def fill_inner(turn):  # type: ignore[no-untyped-def]
    """Fill the inner quaternions."""
    one, two = np.empty(4), np.empty(4)
    for e in range(turn.v.shape[0]):
        for a in range(2):
            _times(turn.q[e], turn.v[e, a], one)
            _times(turn.q[e + 1], turn.v[e, a], two)
            for i in range(4):
                turn.c[e, a, i] = 0.5 * (one[i] + two[i])


@njit(cache=True, nogil=True, error_model="numpy")
def turned(turn, by, out):  # type: ignore[no-untyped-def]
    """Fill `out` with `turn`, turned by the unknowns `by`, shape (9 n + 3,)."""
    step = np.empty(4)
    n = turn.v.shape[0]
    for k in range(n + 1):
        _times(turn.q[k], by[STEP * k : STEP * k + 3], step)
        size = 0.0
        for i in range(4):
            out.q[k, i] = turn.q[k, i] + step[i]
            size += out.q[k, i] ** 2
        for i in range(4):
            out.q[k, i] /= math.sqrt(size)
    for e in range(n):
        for a in range(2):
            for k in range(3):
                out.v[e, a, k] = turn.v[e, a, k] + by[STEP * e + 3 + 3 * a + k]
    fill_inner(out)


@njit(**PART)
def bases(turn, e, B):  # type: ignore[no-untyped-def]
    """Fill what an element's unknowns change in its quaternions, shape (4, 4, 12)."""
    v, one, two = np.zeros(3), np.empty(4), np.empty(4)
    B[:] = 0.0
    for k in range(3):
        v[k] = 1.0
        for end in range(2):
            _times(turn.q[e + end], v, one)
            for a in range(2):
                _times(one, turn.v[e, a], two)
                for i in range(4):
                    B[1 + a, i, 9 * end + k] = 0.5 * two[i]
            for i in range(4):
                B[3 * end, i, 9 * end + k] = one[i]
                for a in range(2):
                    B[1 + a, i, 3 + 3 * a + k] += 0.5 * one[i]
        v[k] = 0.0


@njit(**PART)
def second(turn, e, ga, H):  # type: ignore[no-untyped-def]
    """Add what the unknowns' own curvature has, given the gradient (4, 4)."""
    v, one, two = np.zeros(3), np.empty(4), np.empty(4)
    for end in range(2):
        q = turn.q[e + end]
        # Normalisation: q turns by -q v.v / 8.
        along = 0.0
        for a in range(2):
            _times(q, turn.v[e, a], two)
            for i in range(4):
                along += 0.5 * two[i] * ga[1 + a, i]
        for i in range(4):
            along += q[i] * ga[3 * end, i]
        for k in range(3):
            row = STEP * e + 9 * end + k
            H[row, row] -= 0.25 * along
        # A turn of the node changes what the inner unknowns do.
        for k in range(3):
            v[k] = 1.0
            _times(q, v, one)
            v[k] = 0.0
            for m in range(3):
                v[m] = 1.0
                _times(one, v, two)
                v[m] = 0.0
                for a in range(2):
                    row, column = STEP * e + 9 * end + k, STEP * e + 3 + 3 * a + m
                    total = 0.0
                    for i in range(4):
                        total += 0.5 * two[i] * ga[1 + a, i]
                    H[max(row, column), min(row, column)] += total
