"""What a field does at a point: the one place where kernels tell sources apart.

A field is one array of floats (`scaling.field_array`), dimensionless as
`planar.march`: lengths in lengths of the rod, fluxes in T. Its first number is its
kind: `UNIFORM`, then (Bx, By, Bz); or `CUBOID`, then the magnet's block
(`magnet.field.magnet_block`).
"""

from __future__ import annotations

import math

from ...core.jit import njit
from .field import cuboid_flux, inside, plane_flux

PART = {
    "cache": True,
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}
"""Options of a function that only kernels call."""
UNIFORM = 0.0
CUBOID = 1.0
WIDTH = 17
"""Numbers of a field of either kind."""


@njit(**PART)
def is_uniform(field):  # type: ignore[no-untyped-def]
    """Tell whether the field is the same everywhere, and nothing is in the way."""
    return field[0] == UNIFORM


@njit(**PART)
def field_at(field, x, y):  # type: ignore[no-untyped-def]
    """Return (Bx, By, Gxx, Gxy, Gyy) in the plane z = 0, for planar fields."""
    if field[0] == UNIFORM:
        return field[1], field[2], 0.0, 0.0, 0.0
    return plane_flux(field[1:], x, y)


@njit(cache=True)
def flux_at(field, x, y, z, b):  # type: ignore[no-untyped-def]
    """Write B and its gradient (12 numbers, as `cuboid_flux`) into `b`."""
    if field[0] == UNIFORM:
        b[:] = 0.0
        b[0], b[1], b[2] = field[1], field[2], field[3]
    else:
        cuboid_flux(field[1:], x, y, z, b)


@njit(**PART)
def blocked(field, x, y, z, margin):  # type: ignore[no-untyped-def]
    """Tell whether a point is within `margin` of a magnet, or in it."""
    return field[0] != UNIFORM and inside(field[1:], x, y, z, margin)


@njit(**PART)
def in_reach(field, margin):  # type: ignore[no-untyped-def]
    """Tell whether a rod clamped at the origin is long enough to touch a magnet."""
    if field[0] == UNIFORM:
        return False
    corner = math.sqrt(field[1] ** 2 + field[2] ** 2 + field[3] ** 2)
    return math.hypot(field[4], field[5]) <= 1.0 + margin + corner


@njit(**PART)
def distance(field, x, y, z):  # type: ignore[no-untyped-def]
    """Return the distance of a point from the nearest magnet."""
    if field[0] == UNIFORM:
        return math.inf
    total = 0.0
    dx = x - field[4]
    dy = y - field[5]
    dz = z - field[6]
    for k in range(3):
        along = field[7 + 3 * k] * dx + field[8 + 3 * k] * dy + field[9 + 3 * k] * dz
        beyond = max(0.0, abs(along) - field[1 + k])
        total += beyond * beyond
    return math.sqrt(total)
