"""First and second derivatives of a rod's energy and places by its unknowns.

By the quaternion d and its derivative v the strain is w_a = 2 d . J_a v / (h d . d),
the tangent's part along p is d . T d / d . d with T symmetric: quotients of quadratic
forms, whose derivatives are written out here and carried to the unknowns by the bases
of `rod.bases`.
"""

from __future__ import annotations

import numpy as np

from ...core.jit import njit
from ..magnet.flux import PART
from .rod import (
    GAUSS,
    POINTS,
    STEP,
    WEIGHTS,
    bases,
    blend,
    second,
    shapes,
    strain,
    tangent,
)  # fmt: skip


@njit(**PART)
def _times_form(p, d, out):  # type: ignore[no-untyped-def]
    """Fill T d, where p . t = d . T d / d . d."""
    out[0] = p[0] * d[2] - p[1] * d[1] + p[2] * d[0]
    out[1] = p[0] * d[3] - p[1] * d[0] - p[2] * d[1]
    out[2] = p[0] * d[0] + p[1] * d[3] - p[2] * d[2]
    out[3] = p[0] * d[1] + p[1] * d[2] + p[2] * d[3]


@njit(**PART)
def pull_slopes(p, d, n, T, grad, hess):  # type: ignore[no-untyped-def]
    """Fill gradient (4,) and Hessian (4, 4) of p . t by d; T is work space (4, 4)."""
    T[:] = 0.0
    T[0, 0], T[1, 1], T[2, 2], T[3, 3] = p[2], -p[2], -p[2], p[2]
    T[0, 1] = T[1, 0] = -p[1]
    T[0, 2] = T[2, 0] = p[0]
    T[1, 3] = T[3, 1] = p[0]
    T[2, 3] = T[3, 2] = p[1]
    _times_form(p, d, grad)
    along = (d[0] * grad[0] + d[1] * grad[1] + d[2] * grad[2] + d[3] * grad[3]) / n
    for i in range(4):
        grad[i] = 2.0 * (grad[i] - along * d[i]) / n
    for i in range(4):
        for j in range(4):
            hess[i, j] = 2.0 * (T[i, j] - grad[i] * d[j] - d[i] * grad[j]) / n
        hess[i, i] -= 2.0 * along / n


@njit(**PART)
def _bending(rod, e, d, v, n, w, J, gd, gv, dd, dv, vv, soft):  # type: ignore[no-untyped-def]
    """Fill what bending has: gradients, Hessians, and its part that is never negative.

    `soft`, shape (2, 4, 4), receives the squares of the strain's gradients alone: by d
    and by v.
    """
    gd[:] = 0.0
    gv[:] = 0.0
    dd[:] = 0.0
    dv[:] = 0.0
    vv[:] = 0.0
    soft[:] = 0.0
    h = rod.s[e + 1] - rod.s[e]
    f = 2.0 / (n * h)
    wd, wv, turn = np.empty(4), np.empty(4), np.empty((4, 4))
    turn[:] = 0.0
    total = 0.0
    load = np.zeros(4)
    back = np.zeros(4)
    for a in range(3):
        stiff = rod.stiff[e, a]
        moment = stiff * w[a]
        b = 0.0
        for i in range(4):
            b += d[i] * J[a, i]
        # J_a^T d, by the antisymmetry of J_a, is minus J_a d.
        if a == 0:
            wv[0], wv[1], wv[2], wv[3] = -d[1], d[0], d[3], -d[2]
        elif a == 1:
            wv[0], wv[1], wv[2], wv[3] = -d[2], -d[3], d[0], d[1]
        else:
            wv[0], wv[1], wv[2], wv[3] = -d[3], d[2], -d[1], d[0]
        total += moment * b
        for i in range(4):
            load[i] += moment * J[a, i]
            back[i] += moment * wv[i]
            wd[i] = f * (J[a, i] - 2.0 * b * d[i] / n)
            gd[i] += moment * wd[i]
            gv[i] += moment * f * wv[i]
        for i in range(4):
            for j in range(4):
                soft[0, i, j] += stiff * wd[i] * wd[j]
                soft[1, i, j] += stiff * f * f * wv[i] * wv[j]
                dv[i, j] += stiff * f * wd[i] * wv[j]
        # J_a itself, row by row.
        s = moment * f
        if a == 0:
            turn[0, 1] += s
            turn[1, 0] -= s
            turn[2, 3] -= s
            turn[3, 2] += s
        elif a == 1:
            turn[0, 2] += s
            turn[2, 0] -= s
            turn[3, 1] -= s
            turn[1, 3] += s
        else:
            turn[0, 3] += s
            turn[3, 0] -= s
            turn[1, 2] -= s
            turn[2, 1] += s
    for i in range(4):
        for j in range(4):
            vv[i, j] = soft[1, i, j]
            dd[i, j] = soft[0, i, j] - 2.0 * f / n * (
                load[i] * d[j] + d[i] * load[j] - 4.0 * total / n * d[i] * d[j]
            )
            dv[i, j] += turn[i, j] - 2.0 * f / n * d[i] * back[j]
        dd[i, i] -= 2.0 * f * total / n


@njit(**PART)
def _carry(turn, e, B, ga, hb, W, g, H):  # type: ignore[no-untyped-def]
    """Add gradient (4, 4) and Hessian (4, 4, 4, 4) by an element's quaternions.

    Of the Hessian the blocks a >= b are given. `W`, shape (4, 4, 12), is work space.
    """
    for a in range(4):
        for i in range(4):
            for u in range(12):
                W[a, i, u] = 0.0
            for b in range(4):
                for j in range(4):
                    f = hb[a, b, i, j] if a >= b else hb[b, a, j, i]
                    for u in range(12):
                        W[a, i, u] += f * B[b, j, u]
    at = STEP * e
    for a in range(4):
        for i in range(4):
            for u in range(12):
                f = B[a, i, u]
                g[at + u] += f * ga[a, i]
                if f != 0.0:
                    for w in range(u + 1):
                        H[at + u, at + w] += f * W[a, i, w]
    second(turn, e, ga, H)


@njit(cache=True, nogil=True, error_model="numpy")
def assemble(rod, turn, loads, g, H, K):  # type: ignore[no-untyped-def]
    """Fill gradient, lower triangle of the Hessian, and the diagonal of bending's part.

    Parameters
    ----------
    rod, turn : Rod, Turn
        What bends.
    loads : ndarray, shape (n, 3)
        Of poles and contacts beyond each element; the weight comes to it here.
    g, H, K : ndarray, shapes (9 n + 3,), (9 n + 3, 9 n + 3), (9 n + 3,)
        Filled.
    """
    g[:] = 0.0
    H[:, :] = 0.0
    K[:] = 0.0
    d, v, w, t = np.empty(4), np.empty(4), np.empty(3), np.empty(3)
    J, B, W = np.empty((3, 4)), np.empty((4, 4, 12)), np.empty((4, 4, 12))
    p, dv_u = np.empty(3), np.empty(4)
    gd, gv, gp = np.empty(4), np.empty(4), np.empty(4)
    dd, dv, vv = np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 4))
    T, hp, soft = np.empty((4, 4)), np.empty((4, 4)), np.empty((2, 4, 4))
    ga, hb = np.empty((4, 4)), np.empty((4, 4, 4, 4))
    for e in range(rod.m.shape[0]):
        h = rod.s[e + 1] - rod.s[e]
        bases(turn, e, B)
        ga[:] = 0.0
        hb[:] = 0.0
        for q in range(GAUSS):
            xi = POINTS[q]
            f = shapes(xi)
            fv = (-1.0, 2.0 * xi - 1.0, 6.0 * xi * (xi - 1.0) + 1.0, 1.0)
            blend(turn, e, xi, d, v)
            n = strain(rod, e, d, v, J, w)
            _bending(rod, e, d, v, n, w, J, gd, gv, dd, dv, vv, soft)
            for i in range(3):
                p[i] = loads[e, i] + rod.beyond[e, i] * (1.0 - xi)
                p[i] += rod.beyond[e + 1, i] * xi
            tangent(d, t)
            pull_slopes(p, d, n, T, gp, hp)
            weight = h * WEIGHTS[q]
            for i in range(4):
                gd[i] -= gp[i]
                for j in range(4):
                    dd[i, j] -= hp[i, j]
            for a in range(4):
                for i in range(4):
                    ga[a, i] += weight * (f[a] * gd[i] + fv[a] * gv[i])
                for b in range(a + 1):
                    for i in range(4):
                        for j in range(4):
                            hb[a, b, i, j] += weight * (
                                f[a] * f[b] * dd[i, j]
                                + f[a] * fv[b] * dv[i, j]
                                + fv[a] * f[b] * dv[j, i]
                                + fv[a] * fv[b] * vv[i, j]
                            )
            for u in range(12):
                total = 0.0
                for i in range(4):
                    dv_u[i] = 0.0
                    for a in range(4):
                        dv_u[i] += fv[a] * B[a, i, u]
                for i in range(4):
                    for j in range(4):
                        total += dv_u[i] * soft[1, i, j] * dv_u[j]
                K[STEP * e + u] += weight * total
        _carry(turn, e, B, ga, hb, W, g, H)


@njit(**PART)
def _spread(turn, e, xi, h, B, A, d, v, t):  # type: ignore[no-untyped-def]
    """Add to A, shape (3, 12), the derivatives of the place at xi of an element."""
    T, grad, hess = np.empty((4, 4)), np.empty(4), np.empty((4, 4))
    p = np.zeros(3)
    for q in range(GAUSS):
        z = xi * POINTS[q]
        blend(turn, e, z, d, v)
        n = tangent(d, t)
        f = shapes(z)
        for i in range(3):
            p[i] = 1.0
            pull_slopes(p, d, n, T, grad, hess)
            p[i] = 0.0
            for a in range(4):
                for j in range(4):
                    weight = h * xi * WEIGHTS[q] * f[a] * grad[j]
                    for u in range(12):
                        A[i, u] += weight * B[a, j, u]


@njit(cache=True, nogil=True, error_model="numpy")
def places(rod, turn, element, xi, A, T):  # type: ignore[no-untyped-def]
    """Fill the derivatives of places and tangents of points of the rod.

    Parameters
    ----------
    rod, turn : Rod, Turn
        What bends.
    element, xi : ndarray, shape (k,)
        Where the points are.
    A, T : ndarray, shape (k, 3, 9 n + 3)
        Filled: of the places, and of the tangents.
    """
    A[:] = 0.0
    T[:] = 0.0
    d, v, t = np.empty(4), np.empty(4), np.empty(3)
    B, part = np.empty((4, 4, 12)), np.empty((3, 12))
    form, grad, hess = np.empty((4, 4)), np.empty(4), np.empty((4, 4))
    p = np.zeros(3)
    last = -1
    for k in range(element.shape[0]):
        last = max(last, element[k])
    for e in range(last + 1):
        h = rod.s[e + 1] - rod.s[e]
        bases(turn, e, B)
        part[:] = 0.0
        _spread(turn, e, 1.0, h, B, part, d, v, t)
        at = STEP * e
        for k in range(element.shape[0]):
            if element[k] > e:
                A[k, :, at : at + 12] += part
            elif element[k] == e:
                _spread(turn, e, xi[k], h, B, A[k, :, at : at + 12], d, v, t)
                blend(turn, e, xi[k], d, v)
                n = tangent(d, t)
                f = shapes(xi[k])
                for i in range(3):
                    p[i] = 1.0
                    pull_slopes(p, d, n, form, grad, hess)
                    p[i] = 0.0
                    for a in range(4):
                        for j in range(4):
                            for u in range(12):
                                T[k, i, at + u] += f[a] * grad[j] * B[a, j, u]


@njit(cache=True, nogil=True, error_model="numpy")
def press(rod, turn, element, xi, force, g, H):  # type: ignore[no-untyped-def]
    """Add what forces on points do within their own elements.

    Parameters
    ----------
    rod, turn, element, xi
        As of `places`.
    force : ndarray, shape (k, 3)
        On each point.
    g, H : ndarray
        As of `assemble`; loads beyond an element are in its `loads`.
    """
    d, v, t = np.empty(4), np.empty(4), np.empty(3)
    B, W = np.empty((4, 4, 12)), np.empty((4, 4, 12))
    T, grad, hess = np.empty((4, 4)), np.empty(4), np.empty((4, 4))
    ga, hb = np.empty((4, 4)), np.empty((4, 4, 4, 4))
    for k in range(element.shape[0]):
        e = element[k]
        h = rod.s[e + 1] - rod.s[e]
        bases(turn, e, B)
        ga[:] = 0.0
        hb[:] = 0.0
        for q in range(GAUSS):
            z = xi[k] * POINTS[q]
            blend(turn, e, z, d, v)
            n = tangent(d, t)
            pull_slopes(force[k], d, n, T, grad, hess)
            f = shapes(z)
            weight = h * xi[k] * WEIGHTS[q]
            for a in range(4):
                for i in range(4):
                    ga[a, i] -= weight * f[a] * grad[i]
                    for b in range(a + 1):
                        for j in range(4):
                            hb[a, b, i, j] -= weight * f[a] * f[b] * hess[i, j]
        _carry(turn, e, B, ga, hb, W, g, H)
