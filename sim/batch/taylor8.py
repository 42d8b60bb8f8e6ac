"""One Taylor step of order 8 for many rods side by side, written out term by term.

With loops over the orders the compiler sees one rod at a time; written out, it sees one
loop over the rods and runs it on vectors. That is worth two long functions. The
recurrences are those of `planar.march.series` and `column_step`, for a load along the
frame's own axis (no weight): s, c, q are sin, cos and moment, g and r a column of theta
and q, and u and v its products with cos and sin; digits are orders. Fractions are
multiplied by: a division costs more than all the rest of a term.
"""

from __future__ import annotations

from ...core.jit import njit

ORDER = 8
LANES = 64
"""Rods side by side; row k of an array is its elements from k LANES on. With a constant
distance between rows, and few arrays, the compiler need not fear that they overlap."""
STATE = 5
"""Rows of a state: sin, cos, q, x, y."""
COLUMN = 4
"""Rows of a column: derivatives of theta, q, x, y."""
SERIES = 16
"""Rows that hold the series of a step: sin and cos, orders 0 to 7."""
_3, _5, _6, _7 = 1.0 / 3.0, 1.0 / 5.0, 1.0 / 6.0, 1.0 / 7.0
_OPTIONS = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc"},
}


@njit(**_OPTIONS)
def state_step(count, h, e, p, z, t):  # type: ignore[no-untyped-def]
    """Advance `count` rods by steps `h` in sections of compliance `e` and load `p`.

    Parameters
    ----------
    count : int
        How many of the lanes are in use.
    h, e, p : ndarray, shape (LANES,)
        Length of the step, compliance, load; dimensionless.
    z : ndarray, shape (5 LANES,)
        States (`STATE`), updated.
    t : ndarray, shape (16 LANES,)
        Receives the series of sin and cos (`SERIES`), for `column_step`.
    """
    for i in range(count):
        hi = h[i]
        a = hi * e[i]
        b = hi * p[i]
        s0 = z[i]
        c0 = z[LANES + i]
        q0 = z[2 * LANES + i]
        s1 = a * (q0 * c0)
        c1 = -a * (q0 * s0)
        q1 = b * s0
        s2 = a * 0.5 * (q0 * c1 + q1 * c0)
        c2 = -a * 0.5 * (q0 * s1 + q1 * s0)
        q2 = b * 0.5 * s1
        s3 = a * _3 * (q0 * c2 + q1 * c1 + q2 * c0)
        c3 = -a * _3 * (q0 * s2 + q1 * s1 + q2 * s0)
        q3 = b * _3 * s2
        s4 = a * 0.25 * (q0 * c3 + q1 * c2 + q2 * c1 + q3 * c0)
        c4 = -a * 0.25 * (q0 * s3 + q1 * s2 + q2 * s1 + q3 * s0)
        q4 = b * 0.25 * s3
        s5 = a * _5 * (q0 * c4 + q1 * c3 + q2 * c2 + q3 * c1 + q4 * c0)
        c5 = -a * _5 * (q0 * s4 + q1 * s3 + q2 * s2 + q3 * s1 + q4 * s0)
        q5 = b * _5 * s4
        s6 = q0 * c5 + q1 * c4 + q2 * c3 + q3 * c2 + q4 * c1 + q5 * c0
        c6 = q0 * s5 + q1 * s4 + q2 * s3 + q3 * s2 + q4 * s1 + q5 * s0
        s6 *= a * _6
        c6 *= -a * _6
        q6 = b * _6 * s5
        s7 = q0 * c6 + q1 * c5 + q2 * c4 + q3 * c3 + q4 * c2 + q5 * c1 + q6 * c0
        c7 = q0 * s6 + q1 * s5 + q2 * s4 + q3 * s3 + q4 * s2 + q5 * s1 + q6 * s0
        s7 *= a * _7
        c7 *= -a * _7
        q7 = b * _7 * s6
        s8 = q0 * c7 + q1 * c6 + q2 * c5 + q3 * c4
        s8 += q4 * c3 + q5 * c2 + q6 * c1 + q7 * c0
        c8 = q0 * s7 + q1 * s6 + q2 * s5 + q3 * s4
        c8 += q4 * s3 + q5 * s2 + q6 * s1 + q7 * s0
        s8 *= a * 0.125
        c8 *= -a * 0.125
        q8 = b * 0.125 * s7
        t[i] = s0
        t[LANES + i] = s1
        t[2 * LANES + i] = s2
        t[3 * LANES + i] = s3
        t[4 * LANES + i] = s4
        t[5 * LANES + i] = s5
        t[6 * LANES + i] = s6
        t[7 * LANES + i] = s7
        t[8 * LANES + i] = c0
        t[9 * LANES + i] = c1
        t[10 * LANES + i] = c2
        t[11 * LANES + i] = c3
        t[12 * LANES + i] = c4
        t[13 * LANES + i] = c5
        t[14 * LANES + i] = c6
        t[15 * LANES + i] = c7
        z[i] = s0 + s1 + s2 + s3 + s4 + s5 + s6 + s7 + s8
        z[LANES + i] = c0 + c1 + c2 + c3 + c4 + c5 + c6 + c7 + c8
        z[2 * LANES + i] = q0 + q1 + q2 + q3 + q4 + q5 + q6 + q7 + q8
        x = c0 + c1 * 0.5 + c2 * _3 + c3 * 0.25
        x += c4 * _5 + c5 * _6 + c6 * _7 + c7 * 0.125
        y = s0 + s1 * 0.5 + s2 * _3 + s3 * 0.25
        y += s4 * _5 + s5 * _6 + s6 * _7 + s7 * 0.125
        z[3 * LANES + i] -= hi * x
        z[4 * LANES + i] -= hi * y


@njit(**_OPTIONS)
def column_step(count, h, e, p, t, push, z):  # type: ignore[no-untyped-def]
    """Advance a column of `count` rods over a step whose series are in `t`.

    Parameters
    ----------
    count, h, e, p, t
        As of `state_step`, which comes first.
    push : float
        Derivative of the load: 0 for the column of the tip angle, 1 for the load's.
    z : ndarray, shape (4 LANES,)
        The column (`COLUMN`), updated.
    """
    for i in range(count):
        hi = h[i]
        a = hi * e[i]
        b = hi * p[i]
        f = hi * push
        s0 = t[i]
        s1 = t[LANES + i]
        s2 = t[2 * LANES + i]
        s3 = t[3 * LANES + i]
        s4 = t[4 * LANES + i]
        s5 = t[5 * LANES + i]
        s6 = t[6 * LANES + i]
        s7 = t[7 * LANES + i]
        c0 = t[8 * LANES + i]
        c1 = t[9 * LANES + i]
        c2 = t[10 * LANES + i]
        c3 = t[11 * LANES + i]
        c4 = t[12 * LANES + i]
        c5 = t[13 * LANES + i]
        c6 = t[14 * LANES + i]
        c7 = t[15 * LANES + i]
        g0 = z[i]
        r0 = z[LANES + i]
        u0 = c0 * g0
        v0 = s0 * g0
        r1 = b * u0 + f * s0
        g1 = a * r0
        u1 = c0 * g1 + c1 * g0
        v1 = s0 * g1 + s1 * g0
        r2 = 0.5 * (b * u1 + f * s1)
        g2 = a * 0.5 * r1
        u2 = c0 * g2 + c1 * g1 + c2 * g0
        v2 = s0 * g2 + s1 * g1 + s2 * g0
        r3 = _3 * (b * u2 + f * s2)
        g3 = a * _3 * r2
        u3 = c0 * g3 + c1 * g2 + c2 * g1 + c3 * g0
        v3 = s0 * g3 + s1 * g2 + s2 * g1 + s3 * g0
        r4 = 0.25 * (b * u3 + f * s3)
        g4 = a * 0.25 * r3
        u4 = c0 * g4 + c1 * g3 + c2 * g2 + c3 * g1 + c4 * g0
        v4 = s0 * g4 + s1 * g3 + s2 * g2 + s3 * g1 + s4 * g0
        r5 = _5 * (b * u4 + f * s4)
        g5 = a * _5 * r4
        u5 = c0 * g5 + c1 * g4 + c2 * g3 + c3 * g2 + c4 * g1 + c5 * g0
        v5 = s0 * g5 + s1 * g4 + s2 * g3 + s3 * g2 + s4 * g1 + s5 * g0
        r6 = _6 * (b * u5 + f * s5)
        g6 = a * _6 * r5
        u6 = c0 * g6 + c1 * g5 + c2 * g4 + c3 * g3 + c4 * g2 + c5 * g1 + c6 * g0
        v6 = s0 * g6 + s1 * g5 + s2 * g4 + s3 * g3 + s4 * g2 + s5 * g1 + s6 * g0
        r7 = _7 * (b * u6 + f * s6)
        g7 = a * _7 * r6
        u7 = c0 * g7 + c1 * g6 + c2 * g5 + c3 * g4
        u7 += c4 * g3 + c5 * g2 + c6 * g1 + c7 * g0
        v7 = s0 * g7 + s1 * g6 + s2 * g5 + s3 * g4
        v7 += s4 * g3 + s5 * g2 + s6 * g1 + s7 * g0
        r8 = 0.125 * (b * u7 + f * s7)
        g8 = a * 0.125 * r7
        z[i] = g0 + g1 + g2 + g3 + g4 + g5 + g6 + g7 + g8
        z[LANES + i] = r0 + r1 + r2 + r3 + r4 + r5 + r6 + r7 + r8
        x = v0 + v1 * 0.5 + v2 * _3 + v3 * 0.25
        x += v4 * _5 + v5 * _6 + v6 * _7 + v7 * 0.125
        y = u0 + u1 * 0.5 + u2 * _3 + u3 * 0.25
        y += u4 * _5 + u5 * _6 + u6 * _7 + u7 * 0.125
        z[2 * LANES + i] += hi * x
        z[3 * LANES + i] -= hi * y
