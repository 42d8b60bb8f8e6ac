"""Many planar rods side by side: Newton on vectors of rods.

Dimensionless as `planar_march`, for rods of one sign of magnetisation (in a magnet's
field: of one load per tesla) and no weight, by Taylor steps of order 8. A last march
with steps half as long corrects the result. Its own error is 2^-8 of what it changes,
plus the square of that; the bound given takes 2^-6 and four times the square.

A rod leaves this fast lane (its outcome is `HARD`) when it is long in units of its
boundary layer, near antiparallel to the field, near the magnet, when Newton's
corrections do not shrink as they should, or when the Jacobi determinant is not clearly
positive: `planar.equilibrium` decides those.
"""

from __future__ import annotations

import math

import numpy as np

from ..core.jit import njit
from .magnet_field import inside, plane_flux
from .planar_march import E, H, M
from .taylor8 import ROWS, lane_step

LANES = 64
HARD = 9
"""Outcome of a rod that the lanes leave to the scalar solver."""
STEP_UNIFORM = 0.6
"""Largest h sqrt(e P) of one step: errors stay below 1e-5 mm for rods of 30 mm."""
STEP_MAGNET = 0.4
"""The same, for errors below 1e-6 mm."""
MOST_STEPS = 4
"""Most steps in a section."""
LONGEST_ROD = 3.0
"""Largest sum of them: up to 3 pi / 2 there is one solution with gamma rising to T."""
CLOSE = 3e-5
"""Correction after which one more is below 1e-9."""
ROUNDING = 1e-12


@njit(cache=True, nogil=True)
def _turn(u, i, d):  # type: ignore[no-untyped-def]
    """Turn the direction (u[1], u[0]) of a tip by `d`, to second order."""
    t = 0.5 * d
    f = 1.0 / (1.0 + t * t)
    c = (1.0 - t * t) * f
    s = 2.0 * t * f
    s0 = u[0, i]
    u[0, i] = s0 * c + u[1, i] * s
    u[1, i] = u[1, i] * c - s0 * s


@njit(cache=True, nogil=True)
def _begin(count, u, z):  # type: ignore[no-untyped-def]
    """Set the states at the tips, whose sin and cos are the rows of `u`."""
    for r in range(2, ROWS):
        for i in range(count):
            z[r, i] = 0.0
    for i in range(count):
        z[0, i] = u[0, i]
        z[1, i] = u[1, i]
        z[5, i] = 1.0


@njit(cache=True, nogil=True)
def _march(count, rods, size, steps, u, z, h, e, p, low):  # type: ignore[no-untyped-def]
    """March all rods; `low` is the least d(gamma)/d(gamma_L) met on the way."""
    _begin(count, u, z)
    for i in range(count):
        low[i] = 1.0
    for k in range(rods.shape[1]):
        for i in range(count):
            h[i] = rods[i, k, H] / steps
            e[i] = rods[i, k, E]
            p[i] = abs(rods[i, k, M]) * size[i]
        for _ in range(steps):
            lane_step(count, h, e, p, z)
            for i in range(count):
                low[i] = min(low[i], z[5, i])


@njit(cache=True, nogil=True)
def _ready(rods, size, i, step):  # type: ignore[no-untyped-def]
    """Return the rod's compliance to its load (-1: too long) and how many steps."""
    sigma = 0.0
    total = 0.0
    soft = 0.0
    longest = 0.0
    for k in range(rods.shape[1]):
        hk = rods[i, k, H]
        ep = rods[i, k, E] * abs(rods[i, k, M]) * size
        z = hk * math.sqrt(ep)
        longest = max(longest, z)
        total += z
        soft += ep * hk * (sigma + 0.5 * hk)
        sigma += hk
    steps = math.ceil(longest / step)
    if not total < LONGEST_ROD or steps > MOST_STEPS:
        return -1.0, 1
    return soft, max(steps, 1)


@njit(cache=True, nogil=True)
def _guess(soft, st, ct, u, i):  # type: ignore[no-untyped-def]
    """Guess sin and cos of gamma at the tip from those of T at the clamp.

    theta_L = atan2(soft sin T, 1 + 0.81 soft cos T) is right for soft rods and at the
    Euler load, and within a few hundredths between.
    """
    a = 1.0 + 0.81 * soft * ct
    b = soft * st
    f = 1.0 / math.sqrt(a * a + b * b)
    u[0, i] = (st * a - ct * b) * f
    u[1, i] = (ct * a + st * b) * f
    return math.atan2(b, a)


@njit(cache=True, nogil=True)
def solve_uniform(rods, flux, angle, tips, outcome, error):  # type: ignore[no-untyped-def]
    """Solve rods in uniform fields; angles from the clamp's direction, clamp at 0.

    Parameters
    ----------
    rods : ndarray, shape (n, sections, 5)
        Tip first.
    flux, angle : ndarray, shape (n,)
        In T and rad.
    tips : ndarray, shape (n, 3)
        On return x, y, theta of the tips, lengths over L.
    outcome, error : ndarray, shape (n,)
        0 or `HARD`; error bound over L.
    """
    z = np.empty((ROWS, LANES))
    u = np.empty((2, LANES))
    goal = np.empty((4, LANES))
    work = np.empty((5, LANES))
    for first in range(0, rods.shape[0], LANES):
        count = min(LANES, rods.shape[0] - first)
        block = rods[first : first + count]
        _uniform_block(
            count, block, flux[first:], angle[first:], z, u, goal, work,
            tips[first:], outcome[first:], error[first:],
        )  # fmt: skip


@njit(cache=True, nogil=True)
def _uniform_block(count, rods, flux, angle, z, u, goal, work, tips, outcome, error):  # type: ignore[no-untyped-def]
    """Solve up to LANES rods. `goal`: sin and cos of T, and of phi; `work`: scratch."""
    h, e, p, low, size = work[0], work[1], work[2], work[3], work[4]
    steps = 1
    for i in range(count):
        sign = -1.0 if rods[i, 0, M] * flux[i] < 0.0 else 1.0
        sf = sign * math.sin(angle[i])
        cf = sign * math.cos(angle[i])
        goal[3, i] = cf
        goal[2, i] = sf
        # The rod is mirrored so that gamma at the clamp, T = |phi|, is positive.
        goal[0, i] = abs(sf)
        goal[1, i] = cf
        size[i] = abs(flux[i])
        soft, wanted = _ready(rods, size[i], i, STEP_UNIFORM)
        steps = max(steps, wanted)
        outcome[i] = 0
        if soft < 0.0 or cf < -0.996:
            outcome[i] = HARD
            size[i] = 0.0
            soft = 0.0
        for k in range(1, rods.shape[1]):
            if rods[i, k, M] * rods[i, 0, M] < 0.0:
                outcome[i] = HARD
        _guess(soft, goal[0, i], goal[1, i], u, i)
    for _ in range(5):
        _march(count, rods, size, steps, u, z, h, e, p, low)
        largest = 0.0
        for i in range(count):
            miss = z[0, i] * goal[1, i] - z[1, i] * goal[0, i]
            d = -miss / z[5, i]
            if outcome[i] == 0:
                largest = max(largest, abs(d))
            _turn(u, i, d)
            tips[i, 0] = -(z[3, i] + d * z[7, i])
            tips[i, 1] = -(z[4, i] + d * z[8, i])
        if largest < CLOSE:
            break
    _march(count, rods, size, 2 * steps, u, z, h, e, p, low)
    for i in range(count):
        _close_uniform(i, u, z, goal, low[i], tips, outcome, error)


@njit(cache=True, nogil=True)
def _bound(change):  # type: ignore[no-untyped-def]
    """Bound what a last correction of this size leaves (module docstring)."""
    return change / 64.0 + 4.0 * change * change + ROUNDING


@njit(cache=True, nogil=True)
def _close_uniform(i, u, z, goal, low, tips, outcome, error):  # type: ignore[no-untyped-def]
    """Correct a rod by what the half steps found, and accept it or not."""
    sine = z[0, i] * goal[1, i] - z[1, i] * goal[0, i]
    cosine = z[1, i] * goal[1, i] + z[0, i] * goal[0, i]
    d = -sine / z[5, i]
    x = -(z[3, i] + d * z[7, i])
    y = -(z[4, i] + d * z[8, i])
    moved = abs(x - tips[i, 0]) + abs(y - tips[i, 1])
    error[i] = _bound(2.0 * abs(d) + abs(sine) + moved)
    # theta at the tip is gamma - T, then turned back by phi, then mirrored back.
    st = u[0, i] * goal[1, i] - u[1, i] * goal[0, i]
    ct = u[1, i] * goal[1, i] + u[0, i] * goal[0, i]
    side = -1.0 if goal[2, i] < 0.0 else 1.0
    tips[i, 0] = goal[1, i] * x + goal[0, i] * y
    tips[i, 1] = side * (goal[0, i] * x - goal[1, i] * y)
    tips[i, 2] = -side * (math.atan2(st, ct) + d)
    good = cosine > 0.9 and low > 0.05 and u[0, i] >= 0.0 and abs(d) < 1e-3
    if not good:
        outcome[i] = HARD


@njit(cache=True, nogil=True)
def solve_magnet(rods, fields, margin, tips, outcome, error):  # type: ignore[no-untyped-def]
    """Solve rods before magnets (blocks in lengths of L), clamp at 0.

    As `solve_uniform`; `fields`, shape (n, 17), are the fields of `planar_march` and
    `margin`, shape (n,), is half a side over L: tips nearer to the magnet are `HARD`.
    """
    z = np.empty((ROWS, LANES))
    u = np.empty((4, LANES))
    f = np.empty((7, LANES))
    work = np.empty((7, LANES))
    for first in range(0, rods.shape[0], LANES):
        count = min(LANES, rods.shape[0] - first)
        block = rods[first : first + count]
        _magnet_block(
            count, block, fields[first:], margin[first:], z, u, f, work,
            tips[first:], outcome[first:], error[first:],
        )  # fmt: skip


@njit(cache=True, nogil=True)
def _magnet_block(count, rods, fields, margin, z, u, f, work, tips, outcome, error):  # type: ignore[no-untyped-def]
    """Solve up to LANES rods. `u`: sin, cos of gamma, x and y of the tip; `f`: load."""
    h, e, p, low, before = work[0], work[1], work[2], work[3], work[4]
    size = work[5]
    steps = 1
    for i in range(count):
        outcome[i] = 0
        before[i] = 0.6
        for k in range(1, rods.shape[1]):
            if rods[i, k, M] != rods[i, 0, M]:
                outcome[i] = HARD
        u[2, i] = 1.0
        u[3, i] = 0.0
        u[0, i] = 0.0
        u[1, i] = 1.0
        _tip_load(rods, fields, i, 0.0, u, f, size, outcome)
        soft, wanted = _ready(rods, size[i], i, STEP_MAGNET)
        steps = max(steps, wanted)
        if soft < 0.0 or f[1, i] < -0.996:
            outcome[i] = HARD
            soft = 0.0
        # gamma = theta - phi: the clamp stands at T = -phi, the tip turns towards 0.
        theta = _guess(soft, -f[2, i], f[1, i], u, i)
        u[3, i] = -0.65 * theta
        u[2, i] = 1.0 - 0.25 * theta * theta
    for _ in range(7):
        largest = 0.0
        for i in range(count):
            _tip_load(rods, fields, i, margin[i], u, f, size, outcome)
        _march(count, rods, size, steps, u, z, h, e, p, low)
        for i in range(count):
            d = _correct(i, u, z, f, abs(rods[i, 0, M]), work[6])
            if outcome[i] == 0:
                # From a guess instead of the straight rod: first within 0.6, then
                # shrinking to a quarter or better, as in `planar.newton`.
                if not d < before[i]:
                    outcome[i] = HARD
                largest = max(largest, d)
                before[i] = max(0.25 * d, 1e-7)
        if largest < CLOSE:
            break
    for i in range(count):
        _tip_load(rods, fields, i, margin[i], u, f, size, outcome)
    _march(count, rods, size, 2 * steps, u, z, h, e, p, low)
    for i in range(count):
        phi_s = u[0, i] * f[1, i] + u[1, i] * f[2, i]
        phi_c = u[1, i] * f[1, i] - u[0, i] * f[2, i]
        d = _correct(i, u, z, f, abs(rods[i, 0, M]), work[6])
        error[i] = _bound(3.0 * d)
        tips[i, 0] = u[2, i]
        tips[i, 1] = u[3, i]
        tips[i, 2] = math.atan2(phi_s, phi_c) + work[6, i]
        if not (d < 1e-3 and low[i] > 0.05) or _near(fields, margin, u, i):
            outcome[i] = HARD


@njit(cache=True, nogil=True)
def _tip_load(rods, fields, i, margin, u, f, size, outcome):  # type: ignore[no-untyped-def]
    """Evaluate the load at a tip: f holds its size, direction, and their gradients.

    Rows: flux, cos phi, sin phi, d(flux)/dx and /dy, dphi/dx and /dy.
    """
    if outcome[i] != 0 or inside(fields[i, 1:], u[2, i], u[3, i], 0.0, margin):
        outcome[i] = HARD
        size[i] = 0.0
        return
    b = plane_flux(fields[i, 1:], u[2, i], u[3, i])
    flux = math.sqrt(b[0] * b[0] + b[1] * b[1])
    if flux < 1e-12:
        outcome[i] = HARD
        size[i] = 0.0
        return
    sign = -1.0 if rods[i, 0, M] < 0.0 else 1.0
    f[0, i] = flux
    f[1, i] = sign * b[0] / flux
    f[2, i] = sign * b[1] / flux
    f[3, i] = (b[0] * b[2] + b[1] * b[3]) / flux
    f[4, i] = (b[0] * b[3] + b[1] * b[4]) / flux
    f[5, i] = (b[0] * b[3] - b[1] * b[2]) / (flux * flux)
    f[6, i] = (b[0] * b[4] - b[1] * b[3]) / (flux * flux)
    size[i] = flux


@njit(cache=True, nogil=True)
def _correct(i, u, z, f, m, turn):  # type: ignore[no-untyped-def]
    """Make one Newton step on (gamma, x_L, y_L); return its size, inf if unstable.

    `turn[i]` becomes the change of theta at the tip.
    """
    cf = f[1, i]
    sf = f[2, i]
    x = z[3, i]
    y = z[4, i]
    rt = z[0, i] * cf + z[1, i] * sf
    rx = x + cf * u[2, i] + sf * u[3, i]
    ry = y - sf * u[2, i] + cf * u[3, i]
    px = m * f[3, i]
    py = m * f[4, i]
    tt = z[5, i]
    xt = z[7, i]
    yt = z[8, i]
    tx = z[9, i] * px + f[5, i]
    ty = z[9, i] * py + f[6, i]
    xx = cf + z[11, i] * px - f[5, i] * y
    xy = sf + z[11, i] * py - f[6, i] * y
    yx = -sf + z[12, i] * px + f[5, i] * x
    yy = cf + z[12, i] * py + f[6, i] * x
    a = xx * yy - xy * yx
    det = tt * a - tx * (xt * yy - xy * yt) + ty * (xt * yx - xx * yt)
    if not det > 1e-3:
        return math.inf
    g = -1.0 / det
    d0 = g * (a * rt + (ty * yx - tx * yy) * rx + (tx * xy - ty * xx) * ry)
    d1 = g * (
        (xy * yt - xt * yy) * rt + (tt * yy - ty * yt) * rx + (ty * xt - tt * xy) * ry
    )
    d2 = g * (
        (xt * yx - xx * yt) * rt + (tx * yt - tt * yx) * rx + (tt * xx - tx * xt) * ry
    )
    _turn(u, i, d0)
    u[2, i] += d1
    u[3, i] += d2
    turn[i] = d0 + f[5, i] * d1 + f[6, i] * d2
    return max(abs(d0), abs(d1), abs(d2))


@njit(cache=True, nogil=True)
def _near(fields, margin, u, i):  # type: ignore[no-untyped-def]
    """Tell whether a rod might touch its magnet.

    A curve of length 1 between two points at a distance d stays within
    sqrt(1 - d^2) / 2 of the straight line between them (an ellipse); eight pieces of
    that line are checked.
    """
    d2 = u[2, i] * u[2, i] + u[3, i] * u[3, i]
    reach = 0.5 * math.sqrt(max(0.0, 1.0 - d2)) + margin[i] + math.sqrt(d2) / 16.0
    found = False
    for k in range(9):
        r = k / 8.0
        found = found or inside(fields[i, 1:], r * u[2, i], r * u[3, i], 0.0, reach)
    return found
