"""What a field does at a point: the one place where kernels tell sources apart.

A field is one array of floats (`scaling.field_array`), dimensionless as
`planar.march`: lengths in lengths of the rod, fluxes in T. Its first number is its
kind. `UNIFORM`: then (Bx, By, Bz). `CUBOID`: then the magnet's block
(`magnet.field.magnet_block`). `SUM`: then how many sources, and of each its kind and
16 numbers: three of its own, its centre, its axes as rows, its strength:

    cuboid, cylinder   half sides (a cylinder: radius, radius, half length); B_r
    coil               radius, half the winding's thickness, half length; B_r of the
                       cylinder that it is like, or mu0 I / 4 pi of a ring
    dipole             radius, 0, 0; mu0 m / 4 pi
    uniform            Bx, By, Bz
    gradient           0, 0, 0, the centre, and dB/dx in place of the axes
    charges            place of the first in the array, and how many; each has a
                       position and a charge: B = sum of q r / r^3

A further kind is one more branch in `_source`, `_apart` and, if it can be quick in the
plane, `plane_source`. Whatever it is must have neither curl nor divergence where rods
go: the pole reduction needs no more.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from .field import cuboid_flux, dipole_flux, inside, plane_flux
from .round import ring, sheet

PART = {
    "cache": True,
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}
"""Options of a function that only kernels call."""
INLINE = {**PART, "forceinline": True}
"""The same for one that is little more than a choice: each array that a call hands on
costs seven pushes."""
UNIFORM, CUBOID, SUM, CYLINDER, DIPOLE, COIL, GRADIENT, CHARGES = (
    float(k) for k in range(8)
)
WIDTH = 17
"""Numbers of a source with its kind, and of a field of one cuboid or a uniform one."""
FIRST = 2
"""Where the sources of a sum begin."""


@njit(**PART)
def is_uniform(field):  # type: ignore[no-untyped-def]
    """Tell whether the field is the same everywhere, and nothing is in the way."""
    return field[0] == UNIFORM


@njit(**PART)
def sources_in(field):  # type: ignore[no-untyped-def]
    """Return how many sources a field has."""
    return int(field[1]) if field[0] == SUM else 1


@njit(**PART)
def source_at(field, i):  # type: ignore[no-untyped-def]
    """Return the 17 numbers of source `i`."""
    at = FIRST + WIDTH * i if field[0] == SUM else 0
    return field[at : at + WIDTH]


@njit(**PART)
def _own(source, x, y, z):  # type: ignore[no-untyped-def]
    """Return a point in the frame of a source."""
    dx = x - source[4]
    dy = y - source[5]
    dz = z - source[6]
    return (
        source[7] * dx + source[8] * dy + source[9] * dz,
        source[10] * dx + source[11] * dy + source[12] * dz,
        source[13] * dx + source[14] * dy + source[15] * dz,
    )


@njit(**PART)
def _turn_out(source, own, b):  # type: ignore[no-untyped-def]
    """Turn B and gradient of a source's own frame, in `own`, into `b`."""
    for i in range(3):
        b[i] = 0.0
        for k in range(3):
            b[i] += source[7 + 3 * k + i] * own[k]
        for j in range(3):
            total = 0.0
            for k in range(3):
                for m in range(3):
                    total += (
                        source[7 + 3 * k + i]
                        * own[3 + 3 * k + m]
                        * source[7 + 3 * m + j]
                    )
            b[3 + 3 * i + j] = total


@njit(**PART)
def _round(source, x, y, z, own, b):  # type: ignore[no-untyped-def]
    """Write B and gradient of a cylinder or coil into `b`."""
    px, py, pz = _own(source, x, y, z)
    rho = math.sqrt(px * px + py * py)
    if source[0] == COIL and source[3] == 0.0:
        f = source[16]
        r, w, over, rz, wz = ring(source[1], rho, pz)
    else:
        f = source[16] / (4.0 * math.pi)
        r, w, over, rz, wz = sheet(source[1], source[3], rho, pz)
    ex = px / rho if rho > 0.0 else 1.0
    ey = py / rho if rho > 0.0 else 0.0
    rr = -wz - over
    own[0] = f * ex * r
    own[1] = f * ey * r
    own[2] = f * w
    own[3] = f * (ex * ex * rr + ey * ey * over)
    own[4] = own[6] = f * ex * ey * (rr - over)
    own[7] = f * (ey * ey * rr + ex * ex * over)
    own[5] = own[9] = f * ex * rz
    own[8] = own[10] = f * ey * rz
    own[11] = f * wz
    _turn_out(source, own, b)


@njit(**PART)
def _charges(field, source, x, y, z, b):  # type: ignore[no-untyped-def]
    """Write B and gradient of point charges into `b`."""
    b[:] = 0.0
    first = int(source[1])
    for n in range(int(source[2])):
        at = first + 4 * n
        dx = x - field[at]
        dy = y - field[at + 1]
        dz = z - field[at + 2]
        r2 = dx * dx + dy * dy + dz * dz
        f = field[at + 3] / (r2 * math.sqrt(r2))
        g = -3.0 * f / r2
        b[0] += f * dx
        b[1] += f * dy
        b[2] += f * dz
        b[3] += f + g * dx * dx
        b[4] += g * dx * dy
        b[5] += g * dx * dz
        b[7] += f + g * dy * dy
        b[8] += g * dy * dz
        b[11] += f + g * dz * dz
    b[6] = b[4]
    b[9] = b[5]
    b[10] = b[8]


@njit(**PART)
def _source(field, source, x, y, z, own, b):  # type: ignore[no-untyped-def]
    """Write B and gradient of one source into `b`; `own` is work space, shape (12,)."""
    kind = source[0]
    if kind == CUBOID:
        cuboid_flux(source[1:], x, y, z, b)
    elif kind in (CYLINDER, COIL):
        _round(source, x, y, z, own, b)
    elif kind == DIPOLE:
        for k in range(3):
            own[k] = source[16] * source[13 + k]
        dipole_flux(own, x - source[4], y - source[5], z - source[6], b)
    elif kind == GRADIENT:
        for i in range(3):
            for j in range(3):
                b[3 + 3 * i + j] = source[7 + 3 * i + j]
            b[i] = (
                source[7 + 3 * i] * (x - source[4])
                + source[8 + 3 * i] * (y - source[5])
                + source[9 + 3 * i] * (z - source[6])
            )
    elif kind == CHARGES:
        _charges(field, source, x, y, z, b)
    else:
        b[:] = 0.0
        for i in range(3):
            b[i] = source[1 + i]


@njit(cache=True, error_model="numpy")
def flux_at(field, x, y, z, b):  # type: ignore[no-untyped-def]
    """Write B and its gradient (12 numbers, as `cuboid_flux`) into `b`."""
    if field[0] == UNIFORM:
        b[:] = 0.0
        b[0], b[1], b[2] = field[1], field[2], field[3]
    elif field[0] == CUBOID:
        cuboid_flux(field[1:], x, y, z, b)
    else:
        own, one = np.empty(12), np.empty(12)
        b[:] = 0.0
        for i in range(sources_in(field)):
            _source(field, source_at(field, i), x, y, z, own, one)
            for k in range(12):
                b[k] += one[k]


@njit(**PART)
def plane_source(field, i, x, y, own, one):  # type: ignore[no-untyped-def]
    """Return (Bx, By, Gxx, Gxy, Gyy) of source `i` in the plane z = 0.

    `own` and `one` are work space, shape (12,).
    """
    source = source_at(field, i)
    if source[0] == CUBOID:
        return plane_flux(source[1:], x, y)
    _source(field, source, x, y, 0.0, own, one)
    return one[0], one[1], one[3], one[4], one[7]


@njit(**PART)
def _plane_sum(field, x, y):  # type: ignore[no-untyped-def]
    own, one = np.empty(12), np.empty(12)
    bx = by = gxx = gxy = gyy = 0.0
    for i in range(sources_in(field)):
        part = plane_source(field, i, x, y, own, one)
        bx += part[0]
        by += part[1]
        gxx += part[2]
        gxy += part[3]
        gyy += part[4]
    return bx, by, gxx, gxy, gyy


@njit(**INLINE)
def field_at(field, x, y):  # type: ignore[no-untyped-def]
    """Return (Bx, By, Gxx, Gxy, Gyy) in the plane z = 0, for planar fields."""
    if field[0] == UNIFORM:
        return field[1], field[2], 0.0, 0.0, 0.0
    if field[0] == CUBOID:
        return plane_flux(field[1:], x, y)
    return _plane_sum(field, x, y)


@njit(**PART)
def _apart(source, x, y, z):  # type: ignore[no-untyped-def]
    """Return the distance of a point from a source: infinite if it is no body."""
    kind = source[0]
    if kind in (UNIFORM, GRADIENT, CHARGES):
        return math.inf
    px, py, pz = _own(source, x, y, z)
    if kind == CUBOID:
        ex = max(0.0, abs(px) - source[1])
        ey = max(0.0, abs(py) - source[2])
        ez = max(0.0, abs(pz) - source[3])
        return math.sqrt(ex * ex + ey * ey + ez * ez)
    if kind == DIPOLE:
        return max(0.0, math.sqrt(px * px + py * py + pz * pz) - source[1])
    rho = math.sqrt(px * px + py * py)
    beyond = max(0.0, abs(pz) - source[3])
    if kind == COIL:
        return max(0.0, math.hypot(rho - source[1], beyond) - source[2])
    return math.hypot(max(0.0, rho - source[1]), beyond)


@njit(**PART)
def distance(field, x, y, z):  # type: ignore[no-untyped-def]
    """Return the distance of a point from the nearest body among the sources."""
    nearest = math.inf
    for i in range(sources_in(field)):
        nearest = min(nearest, _apart(source_at(field, i), x, y, z))
    return nearest


@njit(**PART)
def clearance(field, x, y):  # type: ignore[no-untyped-def]
    """Return how far from a point in the plane z = 0 the field is analytic, at least.

    That is to the nearest body or charge.
    """
    nearest = distance(field, x, y, 0.0)
    for i in range(sources_in(field)):
        source = source_at(field, i)
        if source[0] == CHARGES:
            first = int(source[1])
            for n in range(int(source[2])):
                at = first + 4 * n
                dx, dy, dz = x - field[at], y - field[at + 1], field[at + 2]
                nearest = min(nearest, math.sqrt(dx * dx + dy * dy + dz * dz))
    return nearest


@njit(cache=True)
def distance_at(field, x, y, z):  # type: ignore[no-untyped-def]
    """Return `distance`, for Python."""
    return distance(field, x, y, z)


@njit(**INLINE)
def blocked(field, x, y, z, margin):  # type: ignore[no-untyped-def]
    """Tell whether a point is within `margin` of a body, or in it."""
    if field[0] == UNIFORM:
        return False
    if field[0] == CUBOID:
        return inside(field[1:], x, y, z, margin)
    return distance(field, x, y, z) <= margin


@njit(**PART)
def in_reach(field, margin):  # type: ignore[no-untyped-def]
    """Tell whether a rod clamped at the origin is long enough to touch a body."""
    for i in range(sources_in(field)):
        source = source_at(field, i)
        if source[0] in (UNIFORM, GRADIENT, CHARGES):
            continue
        corner = math.sqrt(source[1] ** 2 + source[2] ** 2 + source[3] ** 2)
        if math.hypot(source[4], source[5]) <= 1.0 + margin + corner:
            return True
    return False
