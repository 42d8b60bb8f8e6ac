"""The rod in finite elements of high order: its angle is a cubic on each element.

Dimensionless as `planar.march`: lengths over the rod's length L, moments over
EI_ref / L, forces over EI_ref / L^2, fields in T; but s runs from the clamp. On an
element, with xi from 0 to 1,

    theta = (1 - xi) u0 + (xi^2 - xi) u1 + (2 xi^3 - 3 xi^2 + xi) u2 + xi u3

whose derivatives are Legendre's polynomials, so that bending couples the nodes alone.
Positions are integrals of (cos theta, sin theta). Quadrature of Gauss in 5 points takes
them; at nodes they are of sixth order in the elements' size, as are end angles.

The energy is int EI (theta' - kn)^2 / 2 - m t . B(r) - W . t ds, with W the weight
beyond s. Because curl B = 0, the derivative of the magnetic part is that of poles at
joints and tip (DESIGN, section 5), whose flux is evaluated there and nowhere else.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..magnet.flux import PART, field_at, is_uniform

Array = NDArray[np.float64]

_X, _W = np.polynomial.legendre.leggauss(5)
POINTS: Array = 0.5 * (_X + 1.0)
WEIGHTS: Array = 0.5 * _W
GAUSS = 5
SHAPES: Array = np.array(
    [
        1.0 - POINTS,
        POINTS**2 - POINTS,
        2.0 * POINTS**3 - 3.0 * POINTS**2 + POINTS,
        POINTS,
    ]
).T.copy()
"""The four shapes at the points, shape (5, 4)."""


class Rod(NamedTuple):
    """What is in the lumen of a rod, and its mesh.

    Parameters
    ----------
    s : ndarray, shape (n + 1,)
        Arc length of the nodes from the clamp.
    stiff, kn, m : ndarray, shape (n,)
        Stiffness, natural curvature and magnetic load per tesla of the elements.
    pole : ndarray, shape (n + 1,)
        Pole at each node: the fall of m there, and at the last node m itself.
    beyond : ndarray, shape (n + 1, 2)
        Weight of what lies beyond each node.
    root : ndarray, shape (3,)
        x, y and angle of the clamp.
    grip : ndarray, shape (4,)
        1 if the tip is held, else 0; and its x, y and angle.
    """

    s: Array
    stiff: Array
    kn: Array
    m: Array
    pole: Array
    beyond: Array
    root: Array
    grip: Array


class Bent(NamedTuple):
    """A bent rod at its quadrature points and nodes.

    Parameters
    ----------
    cos, sin : ndarray, shape (n, 5)
        Of its angle at the quadrature points.
    x, y : ndarray, shape (n + 1,)
        Of the nodes.
    dx, dy : ndarray, shape (n, 4)
        Derivatives of what an element adds to x and y, by its four unknowns.
    """

    cos: Array
    sin: Array
    x: Array
    y: Array
    dx: Array
    dy: Array


class Station(NamedTuple):
    """A point of the rod: position, angle, curvature; and its element and xi."""

    x: float
    y: float
    theta: float
    kappa: float
    element: int
    xi: float


@njit(**PART)
def angle_at(u, e, xi):  # type: ignore[no-untyped-def]
    """Return the angle within an element."""
    b = xi * xi - xi
    return (
        (1.0 - xi) * u[3 * e]
        + b * u[3 * e + 1]
        + (2.0 * xi - 1.0) * b * u[3 * e + 2]
        + xi * u[3 * e + 3]
    )


@njit(**PART)
def bend(rod, u, out):  # type: ignore[no-untyped-def]
    """Fill `out` (`Bent`) for the unknowns `u`, shape (3 n + 1,)."""
    x = rod.root[0]
    y = rod.root[1]
    out.x[0] = x
    out.y[0] = y
    for e in range(rod.stiff.shape[0]):
        h = rod.s[e + 1] - rod.s[e]
        for a in range(4):
            out.dx[e, a] = 0.0
            out.dy[e, a] = 0.0
        for g in range(GAUSS):
            theta = 0.0
            for a in range(4):
                theta += SHAPES[g, a] * u[3 * e + a]
            c = np.cos(theta)
            s = np.sin(theta)
            w = h * WEIGHTS[g]
            out.cos[e, g] = c
            out.sin[e, g] = s
            x += w * c
            y += w * s
            for a in range(4):
                out.dx[e, a] -= w * s * SHAPES[g, a]
                out.dy[e, a] += w * c * SHAPES[g, a]
        out.x[e + 1] = x
        out.y[e + 1] = y


@njit(**PART)
def station(rod, u, bent, s):  # type: ignore[no-untyped-def]
    """Return the rod's `Station` at arc length `s`."""
    n = rod.stiff.shape[0]
    low = 0
    high = n
    while high - low > 1:
        middle = (low + high) // 2
        if rod.s[middle] <= s:
            low = middle
        else:
            high = middle
    e = low
    h = rod.s[e + 1] - rod.s[e]
    xi = (s - rod.s[e]) / h
    x = bent.x[e]
    y = bent.y[e]
    for g in range(GAUSS):
        theta = angle_at(u, e, xi * POINTS[g])
        x += h * xi * WEIGHTS[g] * np.cos(theta)
        y += h * xi * WEIGHTS[g] * np.sin(theta)
    slope = (
        u[3 * e + 3]
        - u[3 * e]
        + (2.0 * xi - 1.0) * u[3 * e + 1]
        + (6.0 * xi * (xi - 1.0) + 1.0) * u[3 * e + 2]
    )
    return Station(x, y, angle_at(u, e, xi), slope / h, e, xi)


@njit(**PART)
def own_energy(rod, field, u, bent):  # type: ignore[no-untyped-def]
    """Return the energy of bending, magnet and weight."""
    total = 0.0
    for e in range(rod.stiff.shape[0]):
        h = rod.s[e + 1] - rod.s[e]
        rise = u[3 * e + 3] - u[3 * e] - rod.kn[e] * h
        b1 = u[3 * e + 1]
        b2 = u[3 * e + 2]
        total += 0.5 * rod.stiff[e] / h * (rise * rise + b1 * b1 / 3.0 + b2 * b2 / 5.0)
        x = bent.x[e]
        y = bent.y[e]
        for g in range(GAUSS):
            share = 1.0 - POINTS[g]
            wx = rod.beyond[e + 1, 0] * (1.0 - share) + rod.beyond[e, 0] * share
            wy = rod.beyond[e + 1, 1] * (1.0 - share) + rod.beyond[e, 1] * share
            c = bent.cos[e, g]
            s = bent.sin[e, g]
            bx = by = 0.0
            if rod.m[e] != 0.0:
                if is_uniform(field):
                    bx = field[1]
                    by = field[2]
                else:
                    at = station_within(rod, u, x, y, e, POINTS[g])
                    b = field_at(field, at[0], at[1])
                    bx = b[0]
                    by = b[1]
            w = h * WEIGHTS[g]
            total -= w * ((rod.m[e] * bx + wx) * c + (rod.m[e] * by + wy) * s)
    total -= rod.beyond[0, 0] * rod.root[0] + rod.beyond[0, 1] * rod.root[1]
    return total


@njit(**PART)
def station_within(rod, u, x, y, e, xi):  # type: ignore[no-untyped-def]
    """Return the position at xi of element `e`, which begins at (x, y)."""
    h = rod.s[e + 1] - rod.s[e]
    for g in range(GAUSS):
        theta = angle_at(u, e, xi * POINTS[g])
        x += h * xi * WEIGHTS[g] * np.cos(theta)
        y += h * xi * WEIGHTS[g] * np.sin(theta)
    return x, y


@njit(**PART)
def rows_at(rod, u, bent, e, xi, ax, ay):  # type: ignore[no-untyped-def]
    """Fill the derivatives of the position at xi of element `e` by all unknowns."""
    ax[:] = 0.0
    ay[:] = 0.0
    for k in range(e):
        for a in range(4):
            ax[3 * k + a] += bent.dx[k, a]
            ay[3 * k + a] += bent.dy[k, a]
    if xi == 0.0:
        return
    if xi == 1.0:
        for a in range(4):
            ax[3 * e + a] += bent.dx[e, a]
            ay[3 * e + a] += bent.dy[e, a]
        return
    h = rod.s[e + 1] - rod.s[e]
    for g in range(GAUSS):
        z = xi * POINTS[g]
        theta = angle_at(u, e, z)
        w = h * xi * WEIGHTS[g]
        c = w * np.cos(theta)
        s = w * np.sin(theta)
        b = z * z - z
        for a in range(4):
            f = 1.0 - z if a == 0 else b if a == 1 else (2.0 * z - 1.0) * b
            if a == 3:
                f = z
            ax[3 * e + a] -= s * f
            ay[3 * e + a] += c * f


@njit(**PART)
def own_gradient(rod, field, u, bent, px, py, ax, ay, g, H):  # type: ignore[no-untyped-def]
    """Fill gradient and Hessian of the rod's own energy.

    Parameters
    ----------
    px, py : ndarray, shape (n,)
        On return the poles' load on each element, which contacts are added to.
    ax, ay : ndarray, shape (3 n + 1,)
        Work space.
    g, H : ndarray, shapes (3 n + 1,), (3 n + 1, 3 n + 1)
        Filled; of H the part that follows from `own_stiffness` is still to be added.
    """
    n = rod.stiff.shape[0]
    g[:] = 0.0
    H[:, :] = 0.0
    px[:] = 0.0
    py[:] = 0.0
    for i in range(1, n + 1):
        m = rod.pole[i]
        if m == 0.0:
            continue
        b = field_at(field, bent.x[i], bent.y[i])
        for e in range(i):
            px[e] += m * b[0]
            py[e] += m * b[1]
        if b[2] != 0.0 or b[3] != 0.0 or b[4] != 0.0:
            rows_at(rod, u, bent, i - 1, 1.0, ax, ay)
            for a in range(3 * i + 1):
                fx = m * (b[2] * ax[a] + b[3] * ay[a])
                fy = m * (b[3] * ax[a] + b[4] * ay[a])
                for c in range(a + 1):
                    H[a, c] -= fx * ax[c] + fy * ay[c]
    for e in range(n):
        h = rod.s[e + 1] - rod.s[e]
        k = rod.stiff[e] / h
        moment = k * (u[3 * e + 3] - u[3 * e] - rod.kn[e] * h)
        g[3 * e] -= moment
        g[3 * e + 3] += moment
        g[3 * e + 1] += k * u[3 * e + 1] / 3.0
        g[3 * e + 2] += k * u[3 * e + 2] / 5.0
        for a in range(4):
            g[3 * e + a] -= px[e] * bent.dx[e, a] + py[e] * bent.dy[e, a]
        weigh(rod, bent, e, g)


@njit(**PART)
def weigh(rod, bent, e, g):  # type: ignore[no-untyped-def]
    """Add the gradient of the weight on an element."""
    if rod.beyond[0, 0] == 0.0 and rod.beyond[0, 1] == 0.0:
        return
    h = rod.s[e + 1] - rod.s[e]
    for q in range(GAUSS):
        z = POINTS[q]
        wx = rod.beyond[e, 0] * (1.0 - z) + rod.beyond[e + 1, 0] * z
        wy = rod.beyond[e, 1] * (1.0 - z) + rod.beyond[e + 1, 1] * z
        across = h * WEIGHTS[q] * (wy * bent.cos[e, q] - wx * bent.sin[e, q])
        for a in range(4):
            g[3 * e + a] -= across * SHAPES[q, a]


@njit(**PART)
def own_stiffness(rod, bent, px, py, H, K):  # type: ignore[no-untyped-def]
    """Add to H what bending, and the load on each element as it turns, contribute.

    `K`, shape (3 n + 1,), receives the diagonal of bending's part.
    """
    K[:] = 0.0
    for e in range(rod.stiff.shape[0]):
        h = rod.s[e + 1] - rod.s[e]
        k = rod.stiff[e] / h
        i = 3 * e
        H[i, i] += k
        H[i + 3, i + 3] += k
        H[i + 3, i] -= k
        H[i + 1, i + 1] += k / 3.0
        H[i + 2, i + 2] += k / 5.0
        K[i] += k
        K[i + 3] += k
        K[i + 1] += k / 3.0
        K[i + 2] += k / 5.0
        for q in range(GAUSS):
            z = POINTS[q]
            wx = rod.beyond[e, 0] * (1.0 - z) + rod.beyond[e + 1, 0] * z
            wy = rod.beyond[e, 1] * (1.0 - z) + rod.beyond[e + 1, 1] * z
            pull = (px[e] + wx) * bent.cos[e, q] + (py[e] + wy) * bent.sin[e, q]
            f = h * WEIGHTS[q] * pull
            for a in range(4):
                for c in range(a + 1):
                    H[i + a, i + c] += f * SHAPES[q, a] * SHAPES[q, c]
