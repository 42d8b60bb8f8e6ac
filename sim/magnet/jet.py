"""A field around a point to second order: flux, gradient, and the change of that.

A field without curl and divergence is the gradient of a potential, all derivatives of
which are symmetric and free of traces. So a jet is 15 numbers: Bx, By, Bz; of the
gradient xx, xy, xz, yy, yz; of the third derivatives xxx, xxy, xxz, xyy, xyz, yyy, yyz.
"""

from __future__ import annotations

import math

from ...core.jit import njit
from .field import FAR
from .flux import CUBOID, GRADIENT, PART, UNIFORM, flux_at

JET = 15
PROBE = 1e-4
"""Step, in lengths of the rod, of the differences of the gradient."""


@njit(**PART)
def _corners(a, b, c, x, y, z):  # type: ignore[no-untyped-def]
    """Return the third derivatives of a cuboid's potential, over B_r / 4 pi.

    In its own frame, at x, y, z >= 0. They are the derivatives of `field._near_field`'s
    gxx = sum s u / (r (r + v)), gyy = sum s v / (r (r + u)) and gxy = sum s / r.
    """
    xxx = xxy = xxz = xyy = xyz = yyy = yyz = 0.0
    for i in range(2):
        u = x - a if i == 0 else x + a
        for j in range(2):
            v = y - b if j == 0 else y + b
            for k in range(2):
                w = z - c if k == 0 else z + c
                s = 1.0 if (i + j + k) % 2 == 1 else -1.0
                uu = u * u
                vv = v * v
                ww = w * w
                r = math.sqrt(uu + vv + ww)
                rv = r + v if v >= 0.0 else (uu + ww) / (r - v)
                ru = r + u if u >= 0.0 else (vv + ww) / (r - u)
                q = s / (r * r * r)
                f = 1.0 / rv
                g = 1.0 / ru
                fv = q * (r + rv) * f * f
                gu = q * (r + ru) * g * g
                xxx += q * r * r * f - uu * fv
                xxz -= u * w * fv
                yyy += q * r * r * g - vv * gu
                yyz -= v * w * gu
                xxy -= q * u
                xyy -= q * v
                xyz -= q * w
    return xxx, xxy, xxz, xyy, xyz, yyy, yyz


@njit(**PART)
def bend(jet, at, x, y, z):  # type: ignore[no-untyped-def]
    """Return the change of the gradient (xx, xy, xz, yy, yz) along (x, y, z).

    `at` is where the third derivatives begin in `jet`.
    """
    xxx, xxy, xxz = jet[at], jet[at + 1], jet[at + 2]
    xyy, xyz, yyy, yyz = jet[at + 3], jet[at + 4], jet[at + 5], jet[at + 6]
    return (
        xxx * x + xxy * y + xxz * z,
        xxy * x + xyy * y + xyz * z,
        xxz * x + xyz * y - (xxx + xyy) * z,
        xyy * x + yyy * y + yyz * z,
        xyz * x + yyz * y - (xxy + yyy) * z,
    )


@njit(**PART)
def _element(block, own, i, j):  # type: ignore[no-untyped-def]
    """Return element (i, j) of a matrix (xx, xy, xz, yy, yz) of a cuboid's frame."""
    xx, xy, xz, yy, yz = own
    x, y, z = block[6 + i], block[9 + i], block[12 + i]
    return (
        (x * xx + y * xy + z * xz) * block[6 + j]
        + (x * xy + y * yy + z * yz) * block[9 + j]
        + (x * xz + y * yz - z * (xx + yy)) * block[12 + j]
    )


@njit(**PART)
def _cuboid(block, x, y, z, jet, own):  # type: ignore[no-untyped-def]
    """Write a cuboid's third derivatives into `jet`; False where it is too far away."""
    a, b, c = block[0], block[1], block[2]
    dx, dy, dz = x - block[3], y - block[4], z - block[5]
    px = block[6] * dx + block[7] * dy + block[8] * dz
    py = block[9] * dx + block[10] * dy + block[11] * dz
    pz = block[12] * dx + block[13] * dy + block[14] * dz
    far = 2.0 * FAR * max(a, b, c)
    if px * px + py * py + pz * pz > far * far:
        return False
    sx = -1.0 if px < 0.0 else 1.0
    sy = -1.0 if py < 0.0 else 1.0
    sz = -1.0 if pz < 0.0 else 1.0
    third = _corners(a, b, c, abs(px), abs(py), abs(pz))
    f = block[15] / (4.0 * math.pi)
    own[0] = f * sx * sz * third[0]
    own[1] = f * sy * sz * third[1]
    own[2] = f * third[2]
    own[3] = f * sx * sz * third[3]
    own[4] = f * sx * sy * third[4]
    own[5] = f * sy * sz * third[5]
    own[6] = f * third[6]
    by_x = bend(own, 0, block[6], block[9], block[12])
    by_y = bend(own, 0, block[7], block[10], block[13])
    jet[8] = _element(block, by_x, 0, 0)
    jet[9] = _element(block, by_x, 0, 1)
    jet[10] = _element(block, by_x, 0, 2)
    jet[11] = _element(block, by_x, 1, 1)
    jet[12] = _element(block, by_x, 1, 2)
    jet[13] = _element(block, by_y, 1, 1)
    jet[14] = _element(block, by_y, 1, 2)
    return True


@njit(**PART)
def jet_at(field, x, y, z, jet, b, c):  # type: ignore[no-untyped-def]
    """Write the jet at a point into `jet`; `b` and `c` are work space, shape (12,)."""
    flux_at(field, x, y, z, b)
    for i in range(6):
        jet[i] = b[i]
    jet[6], jet[7] = b[7], b[8]
    if field[0] in (UNIFORM, GRADIENT):
        for i in range(8, JET):
            jet[i] = 0.0
        return
    if field[0] == CUBOID and _cuboid(field[1:], x, y, z, jet, b):
        return
    f = 0.5 / PROBE
    flux_at(field, x + PROBE, y, z, b)
    flux_at(field, x - PROBE, y, z, c)
    for i in range(3):
        jet[8 + i] = f * (b[3 + i] - c[3 + i])
    jet[11], jet[12] = f * (b[7] - c[7]), f * (b[8] - c[8])
    flux_at(field, x, y + PROBE, z, b)
    flux_at(field, x, y - PROBE, z, c)
    jet[13], jet[14] = f * (b[7] - c[7]), f * (b[8] - c[8])
