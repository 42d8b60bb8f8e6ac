"""Many planar rods side by side: Newton on vectors of rods.

Dimensionless as `planar.march`, for rods of one sign of magnetisation (before sources:
of one load per tesla) and no weight, by Taylor steps of order 8. The unknowns are the
angle gamma of the tip from its load, as sine and cosine, and the tip's position. A last
march with steps half as long corrects the result, with the Newton matrix of the march
before. Its own error is 2^-8 of what it changes (up to 2^-6 where the leading term
passes through zero), and what it leaves is that change times the one before; the bound
given takes 2^-5 and sixteen times the product. What the patches of a field
(`batch.patches`) may be off counts by the inverse of the Newton matrix.

A rod leaves this fast lane (its outcome is `HARD`) when it is long in units of its
boundary layer, near antiparallel to the field, near a source, when Newton's
corrections do not shrink as they should, or when the Jacobi determinant is not clearly
positive: `planar.solve_planar_rows` decides those.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import INLINE, PART
from ..planar.march import E, H, M
from .survey import NO_FLUX, PLAIN, near, sorted_rows, survey, tip_flux
from .taylor8 import COLUMN, LANES, SERIES, STATE, column_step, state_step

HARD = 9
"""Outcome of a rod that the lanes leave to the scalar solver."""
CLOSE = 1e-3
"""Correction after which the next is about 1e-7, and the last march leaves its 1e-9."""
ROUNDING = 1e-12

# Offsets, in one array of work space, of what the lanes hold. With constant distances
# the compiler knows that nothing overlaps, and runs the loops over lanes on vectors.
_SIN, _COS, _X, _Y = (LANES * k for k in range(4))
"""Of gamma, and the tip's position."""
_FLUX, _CF, _SF, _BX, _BY, _TX, _TY = (LANES * k for k in range(4, 11))
"""Flux, direction of the load, and by x and y the gradients of both."""
_H, _E, _P, _M = (LANES * k for k in range(11, 15))
"""Of the step: length, compliance, load; and the moment of the tip's section."""
_TURN, _MOVE, _SWING, _BEFORE, _LOW = (LANES * k for k in range(15, 20))
"""Newton's corrections of gamma, position and direction, what they must not exceed, and
the least d(gamma)/d(gamma_L) met in a march."""
_OFF, _GAIN, _LENGTH, _SIGN = (LANES * k for k in range(20, 24))
"""How much the load may be off, and how far it then moves the tip; length in mm, and
sign of the magnetisation."""
_Z = LANES * 24
_C1 = _Z + LANES * STATE
_C2 = _C1 + LANES * COLUMN
_T = _C2 + LANES * COLUMN
_PACK = _T + LANES * SERIES
"""State, columns by tip angle and by load, series; then h, e, m of every section."""


@njit(**INLINE)
def _guess(soft, c, s):  # type: ignore[no-untyped-def]
    """Guess sine and cosine of gamma and the tip from compliance and load direction.

    With T = -phi at the clamp, gamma = T - atan2(soft sin T, 1 + 0.81 soft cos T) is
    right for soft rods and at the Euler load, and within a few hundredths between.
    """
    a = 1.0 + 0.81 * soft * c
    b = -soft * s
    f = 1.0 / math.sqrt(a * a + b * b)
    theta = math.atan2(b, a)
    return (
        -(s * a + c * b) * f,
        (c * a - s * b) * f,
        1.0 - 0.25 * theta * theta,
        -0.65 * theta,
    )


@njit(**PART)
def _begin(rows, rods, length, start, w, outcome):  # type: ignore[no-untyped-def]
    """Guess the tips from the load on the straight rods and its gradient there."""
    for i in range(rows.shape[0]):
        row = rows[i]
        outcome[row] = 0
        soft, c, s = start[row, 0], start[row, 2], start[row, 3]
        sine, cosine, x, y = _guess(soft, c, s)
        if start.shape[1] > PLAIN:
            # Before sources: the load at the tip so guessed. Fluxes fall as
            # 1 / (1 + change), and do not turn round.
            gxy = start[row, PLAIN + 1]
            bx = start[row, PLAIN] * (x - 1.0) + gxy * y
            by = gxy * (x - 1.0) + start[row, PLAIN + 2] * y
            f = 1.0 / (1.0 + math.sqrt(bx * bx + by * by))
            bx = c + f * bx
            by = s + f * by
            size = math.sqrt(bx * bx + by * by)
            sine, cosine, x, y = _guess(soft * size, bx / size, by / size)
        w[_SIN + i] = sine
        w[_COS + i] = cosine
        w[_X + i] = x
        w[_Y + i] = y
        w[_FLUX + i] = start[row, 1]
        w[_CF + i] = c
        w[_SF + i] = s
        w[_BX + i] = w[_BY + i] = w[_TX + i] = w[_TY + i] = 0.0
        w[_OFF + i] = 0.0
        w[_LENGTH + i] = length[row]
        w[_SIGN + i] = -1.0 if rods[row, 0, M] < 0.0 else 1.0
        w[_M + i] = abs(rods[row, 0, M])
        w[_BEFORE + i] = 0.6
        for k in range(rods.shape[1]):
            at = _PACK + 3 * k * LANES + i
            w[at] = rods[row, k, H]
            w[at + LANES] = rods[row, k, E]
            w[at + 2 * LANES] = abs(rods[row, k, M])


@njit(**PART)
def _part(w, first, rows):  # type: ignore[no-untyped-def]
    return w[first : first + rows * LANES]


@njit(**PART)
def _march(count, sections, steps, columns, w):  # type: ignore[no-untyped-def]
    """March all rods, with no column, the tip angle's or also the load's."""
    z = _part(w, _Z, STATE)
    c1 = _part(w, _C1, COLUMN)
    c2 = _part(w, _C2, COLUMN)
    t = _part(w, _T, SERIES)
    h = _part(w, _H, 1)
    e = _part(w, _E, 1)
    p = _part(w, _P, 1)
    z[:] = 0.0
    for i in range(count):
        w[_Z + i] = w[_SIN + i]
        w[_Z + LANES + i] = w[_COS + i]
    if columns > 0:
        c1[:] = 0.0
        c2[:] = 0.0
        for i in range(count):
            w[_C1 + i] = 1.0
            w[_LOW + i] = 1.0
    for k in range(sections):
        at = _PACK + 3 * k * LANES
        for i in range(count):
            h[i] = w[at + i] / steps
            e[i] = w[at + LANES + i]
            p[i] = w[at + 2 * LANES + i] * w[_FLUX + i]
        for _ in range(steps):
            state_step(count, h, e, p, z, t)
            if columns > 0:
                column_step(count, h, e, p, t, 0.0, c1)
                for i in range(count):
                    w[_LOW + i] = min(w[_LOW + i], w[_C1 + i])
            if columns > 1:
                column_step(count, h, e, p, t, 1.0, c2)


@njit(**PART)
def _correct(count, w):  # type: ignore[no-untyped-def]
    """Make one Newton step on (gamma, x_L, y_L) of all rods.

    Sets the sizes of the corrections of angle and position, NaN or infinite where a rod
    is not stable, how far the tip swings, and how far a load that is off by one, in
    size and direction, would move it.
    """
    for i in range(count):
        cf = w[_CF + i]
        sf = w[_SF + i]
        sine = w[_SIN + i]
        cosine = w[_COS + i]
        x = w[_Z + 3 * LANES + i]
        y = w[_Z + 4 * LANES + i]
        rt = w[_Z + i] * cf + w[_Z + LANES + i] * sf
        rx = x + cf * w[_X + i] + sf * w[_Y + i]
        ry = y - sf * w[_X + i] + cf * w[_Y + i]
        px = w[_M + i] * w[_BX + i]
        py = w[_M + i] * w[_BY + i]
        fx = w[_TX + i]
        fy = w[_TY + i]
        tt = w[_C1 + i]
        xt = w[_C1 + 2 * LANES + i]
        yt = w[_C1 + 3 * LANES + i]
        tx = w[_C2 + i] * px + fx
        ty = w[_C2 + i] * py + fy
        xx = cf + w[_C2 + 2 * LANES + i] * px - fx * y
        xy = sf + w[_C2 + 2 * LANES + i] * py - fy * y
        yx = -sf + w[_C2 + 3 * LANES + i] * px + fx * x
        yy = cf + w[_C2 + 3 * LANES + i] * py + fy * x
        a = xx * yy - xy * yx
        b = xy * yt - xt * yy
        c = xt * yx - xx * yt
        det = tt * a + tx * b + ty * c
        g = -1.0 / det if det > 1e-3 else math.inf
        b1 = tt * yy - ty * yt
        b2 = ty * xt - tt * xy
        c1 = tx * yt - tt * yx
        c2 = tt * xx - tx * xt
        d0 = g * (a * rt + (ty * yx - tx * yy) * rx + (tx * xy - ty * xx) * ry)
        d1 = g * (b * rt + b1 * rx + b2 * ry)
        d2 = g * (c * rt + c1 * rx + c2 * ry)
        push = abs(w[_C2 + i]) + abs(w[_C2 + 2 * LANES + i])
        push = 1.0 + w[_M + i] * w[_FLUX + i] * (push + abs(w[_C2 + 3 * LANES + i]))
        gain = abs(b) + abs(b1) + abs(b2) + abs(c) + abs(c1) + abs(c2)
        w[_GAIN + i] = abs(g) * push * gain
        # The direction of the tip turns by d0, to second order.
        h = 0.5 * d0
        f = 1.0 / (1.0 + h * h)
        w[_SIN + i] = f * (sine * (1.0 - h * h) + cosine * d0)
        w[_COS + i] = f * (cosine * (1.0 - h * h) - sine * d0)
        w[_X + i] += d1
        w[_Y + i] += d2
        w[_TURN + i] = abs(d0)
        w[_MOVE + i] = abs(d1) + abs(d2)
        w[_SWING + i] = d0 + fx * d1 + fy * d2


@njit(**PART)
def _load_all(  # type: ignore[no-untyped-def]
    rows, length, margin, gap, before, field, w, outcome
):
    """Set the loads at all tips; where there is none, the rod is `HARD`."""
    for i in range(rows.shape[0]):
        row = rows[i]
        if outcome[row] != 0:
            continue
        bx, by, gxx, gxy, gyy, off = tip_flux(
            w[_X + i], w[_Y + i], length[row], gap[row], margin[row],
            before, field,
        )  # fmt: skip
        w[_CF + i] = bx
        w[_SF + i] = by
        w[_BX + i] = gxx
        w[_BY + i] = gxy
        w[_TY + i] = gyy
        w[_OFF + i] = off
        if not bx * bx + by * by > NO_FLUX * NO_FLUX:
            outcome[row] = HARD
    _turn_loads(rows.shape[0], w)


@njit(**PART)
def _turn_loads(count, w):  # type: ignore[no-untyped-def]
    """Turn fluxes and gradients into flux and direction of the loads."""
    for i in range(count):
        bx, by = w[_CF + i], w[_SF + i]
        gxx, gxy, gyy = w[_BX + i], w[_BY + i], w[_TY + i]
        size = math.sqrt(bx * bx + by * by)
        f = 1.0 / size
        c = bx * f
        s = by * f
        length = w[_LENGTH + i]
        g = length * f
        w[_FLUX + i] = size
        w[_CF + i] = w[_SIGN + i] * c
        w[_SF + i] = w[_SIGN + i] * s
        w[_BX + i] = length * (c * gxx + s * gxy)
        w[_BY + i] = length * (c * gxy + s * gyy)
        w[_TX + i] = g * (c * gxy - s * gxx)
        w[_TY + i] = g * (c * gyy - s * gxy)
        w[_OFF + i] *= f


@njit(**PART)
def _judge(rows, weight, w, outcome):  # type: ignore[no-untyped-def]
    """Return the largest correction; rods that do not converge well are `HARD`.

    The first, from the guess, must be within 0.6, and each a quarter of the one before
    or less (see `planar`). `weight` is that of the positions.
    """
    largest = 0.0
    for i in range(rows.shape[0]):
        d = max(w[_TURN + i], weight * w[_MOVE + i])
        if not d < w[_BEFORE + i]:
            outcome[rows[i]] = HARD
        if outcome[rows[i]] == 0:
            largest = max(largest, d)
        w[_BEFORE + i] = max(0.25 * d, 1e-7)
    return largest


@njit(**PART, inline="always")
def _solve_block(  # type: ignore[no-untyped-def]
    rows, rods, length, margin, gap, before, field,
    start, steps, w, out, outcome,
):  # fmt: skip
    """Solve up to LANES rods."""
    uniform = before.shape[0] == 0
    count = rows.shape[0]
    sections = rods.shape[1]
    _begin(rows, rods, length, start, w, outcome)
    for _ in range(8):
        if not uniform:
            _load_all(
                rows, length, margin, gap, before, field, w, outcome
            )  # fmt: skip
        _march(count, sections, steps, 1 if uniform else 2, w)
        _correct(count, w)
        if _judge(rows, 0.0 if uniform else 1.0, w, outcome) < CLOSE:
            break
    if not uniform:
        _load_all(
            rows, length, margin, gap, before, field, w, outcome
        )  # fmt: skip
    _march(count, sections, 2 * steps, 0, w)
    for i in range(count):
        cf, sf, s, c = w[_CF + i], w[_SF + i], w[_SIN + i], w[_COS + i]
        out[rows[i], 2] = math.atan2(s * cf + c * sf, c * cf - s * sf)
    _correct(count, w)
    for i in range(count):
        row = rows[i]
        cf, sf, x, y = w[_CF + i], w[_SF + i], w[_X + i], w[_Y + i]
        change = w[_TURN + i] + w[_MOVE + i]
        last = 4.0 * w[_BEFORE + i]
        out[row, 0] = x
        out[row, 1] = y
        out[row, 2] += w[_SWING + i]
        out[row, 3] = change / 32.0 + 16.0 * change * (change + last) + ROUNDING
        out[row, 3] += w[_GAIN + i] * w[_OFF + i]
        root = w[_Z + LANES + i] * cf - w[_Z + i] * sf
        # The solution that grows from zero load has gamma between 0 and T = -phi.
        good = root > 0.9 and w[_LOW + i] > 0.05 and w[_SIN + i] * sf < 1e-12
        # It bends to the side to which the straight rod is pushed.
        turned = start[row, 3] * y < -1e-9
        if turned or not (good and change < 1e-3 and last <= CLOSE):
            outcome[row] = HARD
            continue
        if not uniform and near(
            x, y, length[row], gap[row], margin[row], before, field
        ):
            outcome[row] = HARD


@njit(cache=True, nogil=True, error_model="numpy")
def solve_lanes(  # type: ignore[no-untyped-def]
    rods, length, margin, flux, cosine, sine, gap, before, out,
    outcome,
):  # fmt: skip
    """Solve rods clamped along +x, in uniform fields or before sources.

    Parameters
    ----------
    rods : ndarray, shape (n, sections, 5)
        Tip first (see `planar.march`).
    length, margin : ndarray, shape (n,)
        Length in mm, and half the side over it: tips nearer to a source are `HARD`.
    flux, cosine, sine : ndarray, shape (n,) or, before sources, (0,)
        Of the uniform field, in T, and of its direction.
    gap : ndarray, shape (n,) or, in uniform fields, (0,)
        In mm.
    before : ndarray
        What they stand before (`batch.patches.Before`); in uniform fields it is empty.
    out : ndarray, shape (n, 4)
        Receives x and y of the tip over L, its angle, and the error bound over L.
    outcome : ndarray, shape (n,)
        Receives 0 or `HARD`.
    """
    n, sections, _ = rods.shape
    start = np.empty((n, PLAIN if before.shape[0] == 0 else PLAIN + 3))
    steps = np.empty(n, dtype=np.int64)
    w = np.zeros(_PACK + 3 * sections * LANES)
    field = np.empty(int(before[0]) if before.shape[0] > 0 else 0)
    survey(
        rods, length, margin, flux, cosine, sine, gap, before, field,
        start, steps,
    )  # fmt: skip
    outcome[:] = HARD
    order = sorted_rows(steps)
    for first in range(0, order.shape[0], LANES):
        rows = order[first : first + LANES]
        most = steps[rows[-1]]
        _solve_block(
            rows, rods, length, margin, gap, before, field, start,
            most, w, out, outcome,
        )  # fmt: skip
