"""What magnetisation across the axis does, all along a rod: torque and force.

The field is that of a jet near the point (`magnet.jet`, 15 numbers) and the place where
it was taken: 18 numbers, from which it is developed to second order.
"""

from __future__ import annotations

from ...core.jit import njit
from ..magnet.flux import PART, flux_at
from ..magnet.jet import JET, bend, jet_at

FAST = {**PART, "fastmath": {"contract"}}
POSITIVE = 2047
"""Mask above all offsets of work space: so the compiler knows that none is negative."""
PLACES = 11
"""Where the stages of a pair of steps look: at 0, 1/6, 1/3, 2/3, 5/6, 1 of each."""
PLACE = JET
NEAR = 18
"""Where the place begins, and how many numbers there are."""


@njit(**FAST)
def recall(table, pair, at, near, w):  # type: ignore[no-untyped-def]
    """Copy a jet and its place from a table to `near` on."""
    for i in range(NEAR):
        w[near + i] = table[pair, at, i]


@njit(**FAST)
def look(field, x, y, z, bent, near, w, jet, b, c):  # type: ignore[no-untyped-def]
    """Write the jet at a point, and the point, to `near` on.

    Without the second derivatives unless they are wanted (`bent`).
    """
    if bent:
        jet_at(field, x, y, z, jet, b, c)
        for i in range(JET):
            w[near + i] = jet[i]
    else:
        flux_at(field, x, y, z, b)
        for i in range(6):
            w[near + i] = b[i]
        w[near + 6], w[near + 7] = b[7], b[8]
        for i in range(8, JET):
            w[near + i] = 0.0
    at = near + PLACE
    w[at], w[at + 1], w[at + 2] = x, y, z


@njit(**FAST)
def _developed(near, x, y, z, w):  # type: ignore[no-untyped-def]
    """Return B and its gradient (xx, xy, xz, yy, yz) at a point."""
    x -= w[near + PLACE]
    y -= w[near + PLACE + 1]
    z -= w[near + PLACE + 2]
    xx, xy, xz, yy, yz = bend(w, near + 8, x, y, z)
    gxx = w[near + 3] + 0.5 * xx
    gxy = w[near + 4] + 0.5 * xy
    gxz = w[near + 5] + 0.5 * xz
    gyy = w[near + 6] + 0.5 * yy
    gyz = w[near + 7] + 0.5 * yz
    return (
        w[near + 0] + gxx * x + gxy * y + gxz * z,
        w[near + 1] + gxy * x + gyy * y + gyz * z,
        w[near + 2] + gxz * x + gyz * y - (gxx + gyy) * z,
        w[near + 3] + xx,
        w[near + 4] + xy,
        w[near + 5] + xz,
        w[near + 6] + yy,
        w[near + 7] + yz,
    )


@njit(**FAST)
def add_state(mu1, mu2, near, y, f, w):  # type: ignore[no-untyped-def]
    """Add torque and force at the state from `y` on to its slopes from `f` on."""
    bx, by, bz, xx, xy, xz, yy, yz = _developed(
        near, w[y + 12], w[y + 13], w[y + 14], w
    )
    e00, e01, e02 = w[y], w[y + 1], w[y + 2]
    e10, e11, e12 = w[y + 3], w[y + 4], w[y + 5]
    e20, e21, e22 = w[y + 6], w[y + 7], w[y + 8]
    b2 = bx * e02 + by * e12 + bz * e22
    w[f + 9] += mu2 * b2
    w[f + 10] -= mu1 * b2
    w[f + 11] += mu1 * (bx * e01 + by * e11 + bz * e21)
    w[f + 11] -= mu2 * (bx * e00 + by * e10 + bz * e20)
    mx = mu1 * e00 + mu2 * e01
    my = mu1 * e10 + mu2 * e11
    mz = mu1 * e20 + mu2 * e21
    w[f + 15] += xx * mx + xy * my + xz * mz
    w[f + 16] += xy * mx + yy * my + yz * mz
    w[f + 17] += xz * mx + yz * my - (xx + yy) * mz


@njit(**FAST)
def add_columns(mu1, mu2, near, y, z, f, w):  # type: ignore[no-untyped-def]
    """Add what they change by to the slopes of a block of columns from `z` on."""
    bx, by, bz, xx, xy, xz, yy, yz = _developed(
        near, w[y + 12], w[y + 13], w[y + 14], w
    )
    zz = -(xx + yy)
    e00, e01, e02 = w[y], w[y + 1], w[y + 2]
    e10, e11, e12 = w[y + 3], w[y + 4], w[y + 5]
    e20, e21, e22 = w[y + 6], w[y + 7], w[y + 8]
    b0 = bx * e00 + by * e10 + bz * e20
    b1 = bx * e01 + by * e11 + bz * e21
    b2 = bx * e02 + by * e12 + bz * e22
    # The gradient along the directors.
    g00 = xx * e00 + xy * e10 + xz * e20
    g01 = xy * e00 + yy * e10 + yz * e20
    g02 = xz * e00 + yz * e10 + zz * e20
    g10 = xx * e01 + xy * e11 + xz * e21
    g11 = xy * e01 + yy * e11 + yz * e21
    g12 = xz * e01 + yz * e11 + zz * e21
    g20 = xx * e02 + xy * e12 + xz * e22
    g21 = xy * e02 + yy * e12 + yz * e22
    g22 = xz * e02 + yz * e12 + zz * e22
    # Its own change along the moment.
    kxx, kxy, kxz, kyy, kyz = bend(
        w, near + 8, mu1 * e00 + mu2 * e01, mu1 * e10 + mu2 * e11, mu1 * e20 + mu2 * e21
    )
    kzz = -(kxx + kyy)
    s0 = mu1 * g10 - mu2 * g00
    s1 = mu1 * g11 - mu2 * g01
    s2 = mu1 * g12 - mu2 * g02
    z &= POSITIVE
    f &= POSITIVE
    for a in range(6):
        x0, x1, x2 = w[z + a], w[z + 6 + a], w[z + 12 + a]
        r0, r1, r2 = w[z + 36 + a], w[z + 42 + a], w[z + 48 + a]
        q0 = b1 * x2 - b2 * x1 + g00 * r0 + g01 * r1 + g02 * r2
        q1 = b2 * x0 - b0 * x2 + g10 * r0 + g11 * r1 + g12 * r2
        q2 = b0 * x1 - b1 * x0 + g20 * r0 + g21 * r1 + g22 * r2
        w[f + 18 + a] += mu2 * q2
        w[f + 24 + a] -= mu1 * q2
        w[f + 30 + a] += mu1 * q1 - mu2 * q0
        t = mu2 * x0 - mu1 * x1
        w[f + 54 + a] += t * g20 + x2 * s0 + kxx * r0 + kxy * r1 + kxz * r2
        w[f + 60 + a] += t * g21 + x2 * s1 + kxy * r0 + kyy * r1 + kyz * r2
        w[f + 66 + a] += t * g22 + x2 * s2 + kxz * r0 + kyz * r1 + kzz * r2
