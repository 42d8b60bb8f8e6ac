"""Where the rod touches the walls: points on it, with the force in each.

A contact is a point s of the rod and a piece of a wall. An isolated one *floats*: s is
where the rod comes nearest, so that by the theorem of the envelope the gap's derivative
is the one at fixed s, and its Hessian gains -g_us g_us / g_ss (semi-infinite programs:
Hettich and Kortanek 1993). Contacts that follow each other on one piece stay where they
are: they sample a line of contact. The tip's end is a contact of its own.

The gap g = distance - half the side enters the energy as an augmented Lagrangian,
(pi^2 - lambda^2) / 2k with pi = max(0, lambda - k g) (Rockafellar 1973).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..magnet.flux import PART
from .rod import GAUSS, POINTS, WEIGHTS, angle_at, rows_at, station
from .walls import clearance

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST = 160
"""Contacts of one rod."""
FLAT = 1e-2
"""Curvature of the gap, in 1/L, below which the rod is about to lie on the wall."""
FIXED, FLOATS, TIP = 0, 1, 2
"""Kinds of contact."""


class Touches(NamedTuple):
    """Contacts; the first `used[0]` of each array are in use.

    Parameters
    ----------
    used : ndarray, shape (1,)
        How many there are.
    piece, kind, s : ndarray, shape (160,)
        Piece of wall, `FIXED` and so on, arc length.
    force, grip : ndarray, shape (160,)
        lambda, and the friction that it allows.
    gap, nx, ny, bend : ndarray, shape (160,)
        Of the wall as seen from there: gap, normal, curvature of its level line.
    x, y, theta, kappa, xi, element : ndarray, shape (160,)
        Of the rod.
    home, room : ndarray, shape (160,)
        Where it was when Newton began, and how far it may float from there.
    tx, ty, x0, y0 : ndarray, shape (160,)
        For friction at home: the wall's tangent, and where the rod's point came from.
    way : ndarray, shape (160,)
        How far that point slipped along the tangent.
    """

    used: Ints
    piece: Ints
    kind: Ints
    element: Ints
    s: Array
    force: Array
    grip: Array
    gap: Array
    nx: Array
    ny: Array
    bend: Array
    x: Array
    y: Array
    theta: Array
    kappa: Array
    xi: Array
    home: Array
    room: Array
    tx: Array
    ty: Array
    x0: Array
    y0: Array
    way: Array


class Before(NamedTuple):
    """Where the rod was at the step before: what slip is measured from.

    Parameters
    ----------
    s, x, y : ndarray, shape (m,)
        Points of it, equally spaced; s negative within the guide.
    shift : float
        How much further out of the guide the rod is now.
    ease : float
        Slip at which friction is fully mobilised.
    """

    s: Array
    x: Array
    y: Array
    shift: float
    ease: float


def no_touches() -> Touches:
    """Return room for contacts, and none."""
    sizes: list[Any] = [np.zeros(1, np.int64)]
    ints: list[Any] = [np.zeros(MOST, np.int64) for _ in range(3)]
    reals: list[Any] = [np.zeros(MOST) for _ in range(19)]
    return Touches(*sizes, *ints, *reals)


@njit(**PART)
def slope(near, at):  # type: ignore[no-untyped-def]
    """Return the first and second derivative of the gap along the rod."""
    c = math.cos(at.theta)
    s = math.sin(at.theta)
    along = near.ny * c - near.nx * s
    return near.nx * c + near.ny * s, along * at.kappa + near.bend * along * along


@njit(**PART)
def nearest(rod, u, bent, walls, piece, s, home, reach):  # type: ignore[no-untyped-def]
    """Return the arc length within `reach` of `home` where the rod is nearest."""
    low = max(0.0, home - reach)
    high = min(rod.s[-1], home + reach)
    for _ in range(12):
        at = station(rod, u, bent, s)
        near = clearance(walls, piece, at.x, at.y)
        d1, d2 = slope(near, at)
        if d1 > 0.0:
            high = min(high, s)
        else:
            low = max(low, s)
        step = -d1 / d2 if d2 > 0.0 else -math.copysign(0.3 * reach, d1)
        new = s + step
        if not low <= new <= high:
            new = 0.5 * (low + high) if high - low < reach else max(low, min(new, high))
        if abs(new - s) < 1e-13:
            return new
        s = new
    return s


@njit(**PART)
def locate(rod, u, bent, walls, half, t):  # type: ignore[no-untyped-def]
    """Bring the contacts up to date with the bent rod; floating ones move."""
    for k in range(t.used[0]):
        if t.kind[k] == FLOATS:
            t.s[k] = nearest(
                rod, u, bent, walls, t.piece[k], t.s[k], t.home[k], t.room[k]
            )
        elif t.kind[k] == TIP:
            t.s[k] = rod.s[-1]
        at = station(rod, u, bent, t.s[k])
        near = clearance(walls, t.piece[k], at.x, at.y)
        t.element[k] = at.element
        t.xi[k] = at.xi
        t.x[k] = at.x
        t.y[k] = at.y
        t.theta[k] = at.theta
        t.kappa[k] = at.kappa
        t.gap[k] = near.distance - half
        t.nx[k] = near.nx
        t.ny[k] = near.ny
        t.bend[k] = near.bend
        if t.grip[k] > 0.0:
            at = station(rod, u, bent, t.home[k])
            t.way[k] = t.tx[k] * (at.x - t.x0[k]) + t.ty[k] * (at.y - t.y0[k])


@njit(**PART)
def anchor(t, before):  # type: ignore[no-untyped-def]
    """Let friction act where the contacts are now."""
    for k in range(t.used[0]):
        t.home[k] = t.s[k]
        t.tx[k] = t.ny[k]
        t.ty[k] = -t.nx[k]
        m = before.s.shape[0] - 1
        at = (t.s[k] - before.shift - before.s[0]) / (before.s[m] - before.s[0]) * m
        i = max(0, min(int(at), m - 1))
        f = at - i
        t.x0[k] = (1.0 - f) * before.x[i] + f * before.x[i + 1]
        t.y0[k] = (1.0 - f) * before.y[i] + f * before.y[i + 1]


@njit(**PART)
def touch_energy(t, stiff, before):  # type: ignore[no-untyped-def]
    """Return what walls and friction add to the energy."""
    total = 0.0
    for k in range(t.used[0]):
        force = max(0.0, t.force[k] - stiff * t.gap[k])
        total += 0.5 * (force * force - t.force[k] * t.force[k]) / stiff
        if t.grip[k] > 0.0:
            way = abs(t.way[k])
            ease = before.ease
            lost = way if way > ease else 0.5 * (way * way / ease + ease)
            total += t.grip[k] * lost
    return total


@njit(**PART)
def drag(t, k, before):  # type: ignore[no-untyped-def]
    """Return friction along the wall's tangent, and how it grows with the slip."""
    if t.grip[k] == 0.0:
        return 0.0, 0.0
    way = t.way[k]
    if abs(way) > before.ease:
        return math.copysign(t.grip[k], way), 0.0
    return t.grip[k] * way / before.ease, t.grip[k] / before.ease


@njit(**PART)
def add_dyad(v, f, n, H):  # type: ignore[no-untyped-def]
    """Add f v v^T to the lower triangle of H, of whose rows v fills the first n."""
    if f == 0.0:
        return
    for a in range(n):
        fa = f * v[a]
        if fa != 0.0:
            for c in range(a + 1):
                H[a, c] += fa * v[c]


@njit(**PART)
def touch_gradient(rod, u, bent, t, stiff, before, px, py, ax, ay, work, g, H):  # type: ignore[no-untyped-def]
    """Add the contacts to gradient and Hessian, and their loads to px, py."""
    for k in range(t.used[0]):
        force = max(0.0, t.force[k] - stiff * t.gap[k])
        if force > 0.0:
            e = t.element[k]
            n = 3 * e + 4
            load(rod, u, bent, e, t.xi[k], force * t.nx[k], force * t.ny[k],
                 px, py, ax, ay, g, H)  # fmt: skip
            for a in range(n):
                work[a] = t.nx[k] * ax[a] + t.ny[k] * ay[a]
            add_dyad(work, stiff, n, H)
            for a in range(n):
                work[a] = t.ny[k] * ax[a] - t.nx[k] * ay[a]
            add_dyad(work, -force * t.bend[k], n, H)
            if t.kind[k] == FLOATS:
                slide(rod, t, k, force, n, work, H)
        if t.grip[k] > 0.0:
            rub, growth = drag(t, k, before)
            at = station(rod, u, bent, t.home[k])
            load(rod, u, bent, at.element, at.xi, -rub * t.tx[k], -rub * t.ty[k],
                 px, py, ax, ay, g, H)  # fmt: skip
            n = 3 * at.element + 4
            for a in range(n):
                work[a] = t.tx[k] * ax[a] + t.ty[k] * ay[a]
            add_dyad(work, growth, n, H)


@njit(**PART)
def load(rod, u, bent, e, xi, fx, fy, px, py, ax, ay, g, H):  # type: ignore[no-untyped-def]
    """Add a load at xi of element `e`; fill the rows of its place."""
    rows_at(rod, u, bent, e, xi, ax, ay)
    for a in range(3 * e + 4):
        g[a] -= fx * ax[a] + fy * ay[a]
    for i in range(e):
        px[i] += fx
        py[i] += fy
    part_stiffness(rod, u, e, xi, fx, fy, H)


@njit(**PART)
def curvature(t, k):  # type: ignore[no-untyped-def]
    """Return the second derivative of a contact's gap along the rod."""
    along = t.ny[k] * math.cos(t.theta[k]) - t.nx[k] * math.sin(t.theta[k])
    return along * t.kappa[k] + t.bend[k] * along * along


@njit(**PART)
def slide(rod, t, k, force, n, work, H):  # type: ignore[no-untyped-def]
    """Add to H what a floating contact gains by moving along the rod.

    `work` holds the derivative of its position along the wall's tangent. Where the rod
    is about to lie flat on the wall it cannot turn there: the curvature has a floor.
    """
    if t.s[k] <= 0.0 or t.s[k] >= rod.s[-1]:
        return
    c = math.cos(t.theta[k])
    s = math.sin(t.theta[k])
    along = t.ny[k] * c - t.nx[k] * s
    second = max(curvature(t, k), FLAT)
    e = t.element[k]
    z = t.xi[k]
    b = z * z - z
    for a in range(n):
        work[a] *= t.bend[k] * along
    work[3 * e] += along * (1.0 - z)
    work[3 * e + 1] += along * b
    work[3 * e + 2] += along * (2.0 * z - 1.0) * b
    work[3 * e + 3] += along * z
    add_dyad(work, force / second, n, H)


@njit(**PART)
def part_stiffness(rod, u, e, xi, fx, fy, H):  # type: ignore[no-untyped-def]
    """Add to H what a load at xi of element `e` contributes within that element."""
    h = rod.s[e + 1] - rod.s[e]
    shape = np.empty(4)
    for q in range(GAUSS):
        z = xi * POINTS[q]
        theta = angle_at(u, e, z)
        f = h * xi * WEIGHTS[q] * (fx * np.cos(theta) + fy * np.sin(theta))
        b = z * z - z
        shape[0] = 1.0 - z
        shape[1] = b
        shape[2] = (2.0 * z - 1.0) * b
        shape[3] = z
        for a in range(4):
            for c in range(a + 1):
                H[3 * e + a, 3 * e + c] += f * shape[a] * shape[c]
