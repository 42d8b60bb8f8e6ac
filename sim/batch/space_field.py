"""The gradient of a cuboid's field, and its change along p, for lanes of rods in space.

The formulas are those of `magnet.field` and `magnet.jet`, in the cuboid's own frame,
for points outside the sphere through its corners: there nothing cancels that is
mirrored into x, y, z >= 0, and no corner is in the way. The flux density itself, the
part with logarithms and arc tangents, is marched along the rod.
"""

from __future__ import annotations

import math

from ...core.jit import njit
from ..spatial.march import MU1, MU2
from .space_room import BENT, HALF, LANES, LOOK, OPTIONS, G


@njit(**OPTIONS)
def _corner(s, u, v, w):  # type: ignore[no-untyped-def]
    """Return what a corner of sign s adds to xx, xy, xz, yy and yz of the gradient."""
    r = math.sqrt(u * u + v * v + w * w)
    rv = r + v
    ru = r + u
    d = s / (r * rv * ru)
    f = d * ru
    g = d * rv
    return u * f, g * ru, w * f, v * g, w * g


@njit(**OPTIONS)
def gradients(w):  # type: ignore[no-untyped-def]
    """Set the gradients where the lanes look."""
    for i in range(LANES):
        x, y = w[LOOK + 12 * LANES + i], w[LOOK + 13 * LANES + i]
        z = w[LOOK + 14 * LANES + i]
        sx = math.copysign(1.0, x)
        sy = math.copysign(1.0, y)
        sz = math.copysign(1.0, z)
        x, y, z = abs(x), abs(y), abs(z)
        a, b, c = w[HALF + i], w[HALF + LANES + i], w[HALF + 2 * LANES + i]
        k0 = _corner(-1.0, x - a, y - b, z - c)
        k1 = _corner(1.0, x - a, y - b, z + c)
        k2 = _corner(1.0, x - a, y + b, z - c)
        k3 = _corner(-1.0, x - a, y + b, z + c)
        k4 = _corner(1.0, x + a, y - b, z - c)
        k5 = _corner(-1.0, x + a, y - b, z + c)
        k6 = _corner(-1.0, x + a, y + b, z - c)
        k7 = _corner(1.0, x + a, y + b, z + c)
        f = w[HALF + 3 * LANES + i]
        xx = k0[0] + k1[0] + k2[0] + k3[0] + k4[0] + k5[0] + k6[0] + k7[0]
        xy = k0[1] + k1[1] + k2[1] + k3[1] + k4[1] + k5[1] + k6[1] + k7[1]
        xz = k0[2] + k1[2] + k2[2] + k3[2] + k4[2] + k5[2] + k6[2] + k7[2]
        yy = k0[3] + k1[3] + k2[3] + k3[3] + k4[3] + k5[3] + k6[3] + k7[3]
        yz = k0[4] + k1[4] + k2[4] + k3[4] + k4[4] + k5[4] + k6[4] + k7[4]
        w[G + i] = f * sz * xx
        w[G + LANES + i] = f * sx * sy * sz * xy
        w[G + 2 * LANES + i] = f * sx * xz
        w[G + 3 * LANES + i] = f * sz * yy
        w[G + 4 * LANES + i] = f * sy * yz


@njit(**OPTIONS)
def _bent_corner(s, u, v, w):  # type: ignore[no-untyped-def]
    """Return what a corner adds to xxx, xxy, xxz, xyy, xyz, yyy, yyz."""
    uu = u * u
    vv = v * v
    r = math.sqrt(uu + vv + w * w)
    rv = r + v
    ru = r + u
    d = 1.0 / (r * rv * ru)
    f = d * r * ru
    g = d * r * rv
    p = d * rv * ru
    q = s * p * p * p
    fv = q * (r + rv) * f * f
    gu = q * (r + ru) * g * g
    rr = q * r * r
    return (
        rr * f - uu * fv, -q * u, -u * w * fv, -q * v, -q * w, rr * g - vv * gu,
        -v * w * gu,
    )  # fmt: skip


@njit(**OPTIONS)
def bends(w):  # type: ignore[no-untyped-def]
    """Set the changes of the gradients along p = mu1 d1 + mu2 d2."""
    for i in range(LANES):
        x, y = w[LOOK + 12 * LANES + i], w[LOOK + 13 * LANES + i]
        z = w[LOOK + 14 * LANES + i]
        sx = math.copysign(1.0, x)
        sy = math.copysign(1.0, y)
        sz = math.copysign(1.0, z)
        x, y, z = abs(x), abs(y), abs(z)
        a, b, c = w[HALF + i], w[HALF + LANES + i], w[HALF + 2 * LANES + i]
        k0 = _bent_corner(-1.0, x - a, y - b, z - c)
        k1 = _bent_corner(1.0, x - a, y - b, z + c)
        k2 = _bent_corner(1.0, x - a, y + b, z - c)
        k3 = _bent_corner(-1.0, x - a, y + b, z + c)
        k4 = _bent_corner(1.0, x + a, y - b, z - c)
        k5 = _bent_corner(-1.0, x + a, y - b, z + c)
        k6 = _bent_corner(-1.0, x + a, y + b, z - c)
        k7 = _bent_corner(1.0, x + a, y + b, z + c)
        f = w[HALF + 3 * LANES + i]
        xxx = k0[0] + k1[0] + k2[0] + k3[0] + k4[0] + k5[0] + k6[0] + k7[0]
        xxy = k0[1] + k1[1] + k2[1] + k3[1] + k4[1] + k5[1] + k6[1] + k7[1]
        xxz = k0[2] + k1[2] + k2[2] + k3[2] + k4[2] + k5[2] + k6[2] + k7[2]
        xyy = k0[3] + k1[3] + k2[3] + k3[3] + k4[3] + k5[3] + k6[3] + k7[3]
        xyz = k0[4] + k1[4] + k2[4] + k3[4] + k4[4] + k5[4] + k6[4] + k7[4]
        yyy = k0[5] + k1[5] + k2[5] + k3[5] + k4[5] + k5[5] + k6[5] + k7[5]
        yyz = k0[6] + k1[6] + k2[6] + k3[6] + k4[6] + k5[6] + k6[6] + k7[6]
        xxx *= f * sx * sz
        xxy *= f * sy * sz
        xxz *= f
        xyy *= f * sx * sz
        xyz *= f * sx * sy
        yyy *= f * sy * sz
        yyz *= f
        mu1, mu2 = w[MU1 * LANES + i], w[MU2 * LANES + i]
        d, e = LOOK + i, LOOK + 3 * LANES + i
        px = mu1 * w[d] + mu2 * w[e]
        py = mu1 * w[d + LANES] + mu2 * w[e + LANES]
        pz = mu1 * w[d + 2 * LANES] + mu2 * w[e + 2 * LANES]
        w[BENT + i] = xxx * px + xxy * py + xxz * pz
        w[BENT + LANES + i] = xxy * px + xyy * py + xyz * pz
        w[BENT + 2 * LANES + i] = xxz * px + xyz * py - (xxx + xyy) * pz
        w[BENT + 3 * LANES + i] = xyy * px + yyy * py + yyz * pz
        w[BENT + 4 * LANES + i] = xyz * px + yyz * py - (xxy + yyy) * pz
