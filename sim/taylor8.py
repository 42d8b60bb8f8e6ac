"""One Taylor step of order 8 for many rods side by side, written out term by term.

With loops over the orders the compiler sees one rod at a time; written out, it sees one
loop over the rods and runs it on vectors: 25 ns a step instead of 140. That is worth a
long function. The recurrences are those of `planar_march.taylor_step`, for a load along
the frame's own axis (no weight), with the columns of the tip angle and of the load:

    s, c, q: sin, cos, moment;  g, r: theta and q by tip angle;  j, k: by load;
    u, v, w, x: products c g, s g, c j, s j;  digits: the order.
"""

from __future__ import annotations

from ..core.jit import njit

ORDER = 8
ROWS = 13
"""Rows of a state: sin, cos, q, x, y; then theta, q, x, y of the two columns."""


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})
def lane_step(count, h, e, p, z):  # type: ignore[no-untyped-def]
    """Advance `count` rods by steps `h` in sections of compliance `e` and load `p`.

    Parameters
    ----------
    count : int
        How many of the lanes are in use.
    h, e, p : ndarray, shape (lanes,)
        Length of the step, compliance, load; dimensionless.
    z : ndarray, shape (13, lanes)
        States (`ROWS`), updated.
    """
    for i in range(count):
        hi = h[i]
        a1 = hi * e[i]
        b1 = hi * p[i]
        a2 = a1 / 2.0
        b2 = b1 / 2.0
        a3 = a1 / 3.0
        b3 = b1 / 3.0
        a4 = a1 / 4.0
        b4 = b1 / 4.0
        a5 = a1 / 5.0
        b5 = b1 / 5.0
        a6 = a1 / 6.0
        b6 = b1 / 6.0
        a7 = a1 / 7.0
        b7 = b1 / 7.0
        a8 = a1 / 8.0
        b8 = b1 / 8.0
        s0 = z[0, i]
        c0 = z[1, i]
        q0 = z[2, i]
        g0 = z[5, i]
        r0 = z[6, i]
        j0 = z[9, i]
        k0 = z[10, i]
        # order 1
        s1 = a1 * (q0 * c0)
        c1 = -a1 * (q0 * s0)
        u0 = c0 * g0
        v0 = s0 * g0
        w0 = c0 * j0
        x0 = s0 * j0
        q1 = b1 * s0
        r1 = b1 * u0
        k1 = b1 * w0 + hi * s0
        g1 = a1 * r0
        j1 = a1 * k0
        # order 2
        s2 = a2 * (q0 * c1 + q1 * c0)
        c2 = -a2 * (q0 * s1 + q1 * s0)
        u1 = c0 * g1 + c1 * g0
        v1 = s0 * g1 + s1 * g0
        w1 = c0 * j1 + c1 * j0
        x1 = s0 * j1 + s1 * j0
        q2 = b2 * s1
        r2 = b2 * u1
        k2 = b2 * w1 + hi / 2.0 * s1
        g2 = a2 * r1
        j2 = a2 * k1
        # order 3
        s3 = a3 * (q0 * c2 + q1 * c1 + q2 * c0)
        c3 = -a3 * (q0 * s2 + q1 * s1 + q2 * s0)
        u2 = c0 * g2 + c1 * g1 + c2 * g0
        v2 = s0 * g2 + s1 * g1 + s2 * g0
        w2 = c0 * j2 + c1 * j1 + c2 * j0
        x2 = s0 * j2 + s1 * j1 + s2 * j0
        q3 = b3 * s2
        r3 = b3 * u2
        k3 = b3 * w2 + hi / 3.0 * s2
        g3 = a3 * r2
        j3 = a3 * k2
        # order 4
        s4 = a4 * (q0 * c3 + q1 * c2 + q2 * c1 + q3 * c0)
        c4 = -a4 * (q0 * s3 + q1 * s2 + q2 * s1 + q3 * s0)
        u3 = c0 * g3 + c1 * g2 + c2 * g1 + c3 * g0
        v3 = s0 * g3 + s1 * g2 + s2 * g1 + s3 * g0
        w3 = c0 * j3 + c1 * j2 + c2 * j1 + c3 * j0
        x3 = s0 * j3 + s1 * j2 + s2 * j1 + s3 * j0
        q4 = b4 * s3
        r4 = b4 * u3
        k4 = b4 * w3 + hi / 4.0 * s3
        g4 = a4 * r3
        j4 = a4 * k3
        # order 5
        s5 = a5 * (q0 * c4 + q1 * c3 + q2 * c2 + q3 * c1 + q4 * c0)
        c5 = -a5 * (q0 * s4 + q1 * s3 + q2 * s2 + q3 * s1 + q4 * s0)
        u4 = c0 * g4 + c1 * g3 + c2 * g2 + c3 * g1 + c4 * g0
        v4 = s0 * g4 + s1 * g3 + s2 * g2 + s3 * g1 + s4 * g0
        w4 = c0 * j4 + c1 * j3 + c2 * j2 + c3 * j1 + c4 * j0
        x4 = s0 * j4 + s1 * j3 + s2 * j2 + s3 * j1 + s4 * j0
        q5 = b5 * s4
        r5 = b5 * u4
        k5 = b5 * w4 + hi / 5.0 * s4
        g5 = a5 * r4
        j5 = a5 * k4
        # order 6
        s6 = a6 * (q0 * c5 + q1 * c4 + q2 * c3 + q3 * c2 + q4 * c1 + q5 * c0)
        c6 = -a6 * (q0 * s5 + q1 * s4 + q2 * s3 + q3 * s2 + q4 * s1 + q5 * s0)
        u5 = c0 * g5 + c1 * g4 + c2 * g3 + c3 * g2 + c4 * g1 + c5 * g0
        v5 = s0 * g5 + s1 * g4 + s2 * g3 + s3 * g2 + s4 * g1 + s5 * g0
        w5 = c0 * j5 + c1 * j4 + c2 * j3 + c3 * j2 + c4 * j1 + c5 * j0
        x5 = s0 * j5 + s1 * j4 + s2 * j3 + s3 * j2 + s4 * j1 + s5 * j0
        q6 = b6 * s5
        r6 = b6 * u5
        k6 = b6 * w5 + hi / 6.0 * s5
        g6 = a6 * r5
        j6 = a6 * k5
        # order 7
        s7 = a7 * (q0 * c6 + q1 * c5 + q2 * c4 + q3 * c3 + q4 * c2 + q5 * c1 + q6 * c0)
        c7 = -a7 * (q0 * s6 + q1 * s5 + q2 * s4 + q3 * s3 + q4 * s2 + q5 * s1 + q6 * s0)
        u6 = c0 * g6 + c1 * g5 + c2 * g4 + c3 * g3 + c4 * g2 + c5 * g1 + c6 * g0
        v6 = s0 * g6 + s1 * g5 + s2 * g4 + s3 * g3 + s4 * g2 + s5 * g1 + s6 * g0
        w6 = c0 * j6 + c1 * j5 + c2 * j4 + c3 * j3 + c4 * j2 + c5 * j1 + c6 * j0
        x6 = s0 * j6 + s1 * j5 + s2 * j4 + s3 * j3 + s4 * j2 + s5 * j1 + s6 * j0
        q7 = b7 * s6
        r7 = b7 * u6
        k7 = b7 * w6 + hi / 7.0 * s6
        g7 = a7 * r6
        j7 = a7 * k6
        # order 8
        s8 = a8 * (
            q0 * c7
            + q1 * c6
            + q2 * c5
            + q3 * c4
            + q4 * c3
            + q5 * c2
            + q6 * c1
            + q7 * c0
        )
        c8 = -a8 * (
            q0 * s7
            + q1 * s6
            + q2 * s5
            + q3 * s4
            + q4 * s3
            + q5 * s2
            + q6 * s1
            + q7 * s0
        )
        u7 = (
            c0 * g7
            + c1 * g6
            + c2 * g5
            + c3 * g4
            + c4 * g3
            + c5 * g2
            + c6 * g1
            + c7 * g0
        )
        v7 = (
            s0 * g7
            + s1 * g6
            + s2 * g5
            + s3 * g4
            + s4 * g3
            + s5 * g2
            + s6 * g1
            + s7 * g0
        )
        w7 = (
            c0 * j7
            + c1 * j6
            + c2 * j5
            + c3 * j4
            + c4 * j3
            + c5 * j2
            + c6 * j1
            + c7 * j0
        )
        x7 = (
            s0 * j7
            + s1 * j6
            + s2 * j5
            + s3 * j4
            + s4 * j3
            + s5 * j2
            + s6 * j1
            + s7 * j0
        )
        q8 = b8 * s7
        r8 = b8 * u7
        k8 = b8 * w7 + hi / 8.0 * s7
        g8 = a8 * r7
        j8 = a8 * k7
        # sums, and integrals for the positions
        z[0, i] = s0 + s1 + s2 + s3 + s4 + s5 + s6 + s7 + s8
        z[1, i] = c0 + c1 + c2 + c3 + c4 + c5 + c6 + c7 + c8
        z[2, i] = q0 + q1 + q2 + q3 + q4 + q5 + q6 + q7 + q8
        z[5, i] = g0 + g1 + g2 + g3 + g4 + g5 + g6 + g7 + g8
        z[6, i] = r0 + r1 + r2 + r3 + r4 + r5 + r6 + r7 + r8
        z[9, i] = j0 + j1 + j2 + j3 + j4 + j5 + j6 + j7 + j8
        z[10, i] = k0 + k1 + k2 + k3 + k4 + k5 + k6 + k7 + k8
        z[3, i] -= hi * (
            c0
            + c1 / 2.0
            + c2 / 3.0
            + c3 / 4.0
            + c4 / 5.0
            + c5 / 6.0
            + c6 / 7.0
            + c7 / 8.0
        )
        z[4, i] -= hi * (
            s0
            + s1 / 2.0
            + s2 / 3.0
            + s3 / 4.0
            + s4 / 5.0
            + s5 / 6.0
            + s6 / 7.0
            + s7 / 8.0
        )
        z[7, i] += hi * (
            v0
            + v1 / 2.0
            + v2 / 3.0
            + v3 / 4.0
            + v4 / 5.0
            + v5 / 6.0
            + v6 / 7.0
            + v7 / 8.0
        )
        z[8, i] -= hi * (
            u0
            + u1 / 2.0
            + u2 / 3.0
            + u3 / 4.0
            + u4 / 5.0
            + u5 / 6.0
            + u6 / 7.0
            + u7 / 8.0
        )
        z[11, i] += hi * (
            x0
            + x1 / 2.0
            + x2 / 3.0
            + x3 / 4.0
            + x4 / 5.0
            + x5 / 6.0
            + x6 / 7.0
            + x7 / 8.0
        )
        z[12, i] -= hi * (
            w0
            + w1 / 2.0
            + w2 / 3.0
            + w3 / 4.0
            + w4 / 5.0
            + w5 / 6.0
            + w6 / 7.0
            + w7 / 8.0
        )
