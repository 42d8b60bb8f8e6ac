"""The march of the planar rod from its free tip: Taylor steps and their derivatives.

Everything here is dimensionless: lengths over the rod's length L, moments over
EI_ref / L, forces over EI_ref / L^2, fields in T. With sigma = L - s the rod obeys

    theta' = e q,  q' = Px sin(theta) - Py cos(theta),  x' = -cos,  y' = -sin,  P' = w

where e = EI_ref / EI, q = -M and P is the pole load: m B(r_tip) beyond the last joint,
plus (m_left - m_right) B(r_joint) at each joint on the way to the root, plus the weight
of what lies beyond. This is exact (DESIGN, section 5): because curl B = 0, the
distributed torque m t x B and the gradient force m grad(t . B) together act as these
dead loads.

The march runs in a frame turned by `phi`, the direction of the tip's load, and its
first unknown is gamma = theta_L - phi: in a strong field gamma is exponentially small,
and only as a number of its own, not as a difference of angles, does it keep its digits.

A rod is an array (n, 5), tip first: length h, compliance e, magnetic load m per tesla
and weight per length wx, wy. A field is an array of its own (`magnet.flux`). The state
X, shape (11,), holds theta, q, x, y, Px, Py, what acts within a section: e, wx, wy, and
the flux density at the tip. The columns D, shape (11, 4), hold derivatives of the first
nine (and see `SPARED`).

The kernels are parts (`PART`) of the few that Python calls, each of which holds one
march in one place: every further place would be compiled and optimised again.
"""

from __future__ import annotations

import math

from ...core.jit import njit
from ..magnet.flux import PART, field_at, is_uniform

H, E, M, WX, WY = 0, 1, 2, 3, 4
"""Columns of a rod."""
STATE = 11
"""Length of the state and rows of the column array."""
SPARED, SWING = 9, 10
"""Rows of the column array that hold no derivative: how much of the first column the
others were spared (`spare`), and how the tip's load swings with its place."""
GROWN = 1e16
"""Square of the growth from which on `spare` has something to do."""
MAX_ORDER = 24
MOST_STEPS = 1500
"""Most steps of a section; more is asked for only where an iteration runs away."""
SERIES = 4
"""Series kept of a step: theta, q, sin, cos; and the same of every column."""


@njit(**PART, fastmath={"contract"})
def series(h, order, X, T):  # type: ignore[no-untyped-def]
    """Expand the state X over a step of length `h`.

    Parameters
    ----------
    h : float
        Length of the step.
    order : int
        Order of the series.
    X : ndarray, shape (11,)
        The state where the step begins.
    T : ndarray, shape (4, order + 1 or more)
        Receives the series of theta, q, sin, cos in powers of tau / h.
    """
    he = h * X[6]
    px = h * X[4]
    py = h * X[5]
    wx = h * h * X[7]
    wy = h * h * X[8]
    T[0, 0] = X[0]
    T[1, 0] = X[1]
    T[2, 0] = math.sin(X[0])
    T[3, 0] = math.cos(X[0])
    for k in range(order):
        f = 1.0 / (k + 1)
        push = px * T[2, k] - py * T[3, k]
        if k > 0:
            push += wx * T[2, k - 1] - wy * T[3, k - 1]
        sine = 0.0
        cosine = 0.0
        for j in range(k + 1):
            sine += T[1, j] * T[3, k - j]
            cosine += T[1, j] * T[2, k - j]
        T[0, k + 1] = he * T[1, k] * f
        T[1, k + 1] = push * f
        T[2, k + 1] = he * sine * f
        T[3, k + 1] = -he * cosine * f


@njit(**PART, fastmath={"contract"})
def advance(h, order, X, T):  # type: ignore[no-untyped-def]
    """Move the state X to the end of the step whose `series` is in T."""
    theta = q = x = y = 0.0
    for k in range(order, 0, -1):
        f = 1.0 / k
        theta += T[0, k]
        q += T[1, k]
        x += T[3, k - 1] * f
        y += T[2, k - 1] * f
    X[0] += theta
    X[1] += q
    X[2] -= h * x
    X[3] -= h * y
    X[4] += h * X[7]
    X[5] += h * X[8]


@njit(**PART, fastmath={"contract"})
def column_step(h, order, X, T, D, C):  # type: ignore[no-untyped-def]
    """Move four columns over a step, before the state itself moves.

    Four, written out, stay in registers: a third of the time that a loop takes which
    keeps its sums in memory.

    Parameters
    ----------
    h, order, X, T
        As of `series`, which comes first.
    D : ndarray, shape (11, 4)
        Derivatives of the state.
    C : ndarray, shape (order + 1 or more, 4, 4)
        Receives their series: theta, q, and the products of theta with cos and -sin.
    """
    he = h * X[6]
    px = h * X[4]
    py = h * X[5]
    wx = h * h * X[7]
    wy = h * h * X[8]
    for a in range(4):
        C[0, 0, a] = D[0, a]
        C[0, 1, a] = D[1, a]
    for k in range(order):
        u0 = u1 = u2 = u3 = 0.0
        v0 = v1 = v2 = v3 = 0.0
        for j in range(k + 1):
            c = T[3, k - j]
            s = T[2, k - j]
            u0 += c * C[j, 0, 0]
            u1 += c * C[j, 0, 1]
            u2 += c * C[j, 0, 2]
            u3 += c * C[j, 0, 3]
            v0 -= s * C[j, 0, 0]
            v1 -= s * C[j, 0, 1]
            v2 -= s * C[j, 0, 2]
            v3 -= s * C[j, 0, 3]
        C[k, 2, 0] = u0
        C[k, 2, 1] = u1
        C[k, 2, 2] = u2
        C[k, 2, 3] = u3
        C[k, 3, 0] = v0
        C[k, 3, 1] = v1
        C[k, 3, 2] = v2
        C[k, 3, 3] = v3
        f = 1.0 / (k + 1)
        s0 = h * T[2, k]
        c0 = h * T[3, k]
        hq = h * T[1, k]
        for a in range(4):
            push = px * C[k, 2, a] - py * C[k, 3, a] + D[4, a] * s0 - D[5, a] * c0
            if k > 0:
                push += wx * C[k - 1, 2, a] - wy * C[k - 1, 3, a]
                push += h * h * (D[7, a] * T[2, k - 1] - D[8, a] * T[3, k - 1])
            C[k + 1, 0, a] = (he * C[k, 1, a] + hq * D[6, a]) * f
            C[k + 1, 1, a] = push * f
    for a in range(4):
        theta = q = x = y = 0.0
        for k in range(order, 0, -1):
            f = 1.0 / k
            theta += C[k, 0, a]
            q += C[k, 1, a]
            x += C[k - 1, 3, a] * f
            y += C[k - 1, 2, a] * f
        D[0, a] += theta
        D[1, a] += q
        D[2, a] -= h * x
        D[3, a] -= h * y
        D[4, a] += h * D[7, a]
        D[5, a] += h * D[8, a]


@njit(**PART)
def substeps(h, X, step):  # type: ignore[no-untyped-def]
    """Return how many Taylor steps a section needs.

    The series converges up to about pi / 2 in units of 1 / sqrt(e P), the distance of
    the pendulum's poles from the real axis; `step` is what one step takes, in the same
    units.
    """
    e = X[6]
    p0 = math.hypot(X[4], X[5])
    p1 = math.hypot(X[4] + h * X[7], X[5] + h * X[8])
    z = h * math.sqrt(e * max(p0, p1) + 0.25 * e * e * X[1] * X[1])
    if not z < MOST_STEPS * step:
        return MOST_STEPS
    return max(1, math.ceil(z / step))


@njit(**PART)
def enter_section(rod, i, load, u, columns, X, D):  # type: ignore[no-untyped-def]
    """Set what acts within section `i`: compliance and weight, turned by -phi."""
    cf = math.cos(u[3])
    sf = math.sin(u[3])
    wx = cf * rod[i, WX] + sf * rod[i, WY]
    wy = cf * rod[i, WY] - sf * rod[i, WX]
    X[6] = rod[i, E]
    X[7] = load * wx
    X[8] = load * wy
    if columns > 3:
        D[7, 3] = wx
        D[8, 3] = wy


@njit(**PART)
def begin(u, columns, X, D):  # type: ignore[no-untyped-def]
    """Set state and columns at the free tip."""
    for r in range(STATE):
        X[r] = 0.0
    X[0] = u[0]
    if columns > 0:
        D[:, :] = 0.0
        D[0, 0] = 1.0


@njit(**PART)
def turn_frame(b, scale, u, X, columns, D):  # type: ignore[no-untyped-def]
    """Turn the frame into the tip's load, keeping the tip's direction; set its columns.

    A turn as small as rounding is left out: gamma may be smaller still.
    """
    turn = math.atan2(scale * b[1], scale * b[0]) - u[3]
    turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    if (b[0] != 0.0 or b[1] != 0.0) and scale != 0.0 and abs(turn) > 4e-15:
        u[0] -= turn
        u[3] += turn
        X[0] = u[0]
    if columns > 1:
        cf = math.cos(u[3])
        sf = math.sin(u[3])
        D[2, 1] = cf
        D[3, 1] = -sf
        D[2, 2] = sf
        D[3, 2] = cf
    X[9] = b[0]
    X[10] = b[1]


@njit(**PART)
def _hold_gamma(b, D):  # type: ignore[no-untyped-def]
    """Make the columns of x_L and y_L those at a fixed gamma, as the load swings.

    At a fixed direction of the tip they would be those of gamma, nearly, times what
    the load swings: gamma grows exponentially along a long rod, and drowns the rest.
    """
    size2 = b[0] * b[0] + b[1] * b[1]
    if size2 > 0.0:
        D[0, 1] = D[SWING, 1] = (b[0] * b[3] - b[1] * b[2]) / size2
        D[0, 2] = D[SWING, 2] = (b[0] * b[4] - b[1] * b[3]) / size2


@njit(**PART)
def spare(X, D):  # type: ignore[no-untyped-def]
    """Free the other columns from what has grown in them of the first.

    Determinants stay, and so do the solutions of linear systems, but for their first
    unknown, from which the row `SPARED` times the others is to be taken (Godunov's
    orthogonalisation of growing solutions, 1961).
    """
    e = X[6]
    w = e * e / (1.0 + e * math.hypot(X[4], X[5]))
    size2 = D[0, 0] * D[0, 0] + w * D[1, 0] * D[1, 0]
    if size2 < GROWN:
        return
    for a in range(1, 4):
        c = (D[0, 0] * D[0, a] + w * D[1, 0] * D[1, a]) / size2
        D[SPARED, a] += c
        for k in range(6):
            D[k, a] -= c * D[k, 0]


@njit(**PART)
def add_load(rod, field, i, load, u, columns, X, D):  # type: ignore[no-untyped-def]
    """Add the load m B(r) where section `i` begins, seen from the tip.

    At the tip itself (`i` = 0) the frame is turned into the load first. There, and
    everywhere in a uniform field, the load is along the frame's x exactly. Column 3, if
    in use, is the derivative with respect to the load factor.
    """
    m = rod[i, M] - rod[i - 1, M] if i > 0 else rod[i, M]
    if i > 0 and m == 0.0:
        return
    cf = math.cos(u[3])
    sf = math.sin(u[3])
    x = u[1] + cf * X[2] - sf * X[3]
    y = u[2] + sf * X[2] + cf * X[3]
    b = field_at(field, x, y)
    if i == 0:
        turn_frame(b, load * m, u, X, columns, D)
        if columns > 1 and m != 0.0:
            _hold_gamma(b, D)
        cf = math.cos(u[3])
        sf = math.sin(u[3])
    along = cf * b[0] + sf * b[1]
    across = cf * b[1] - sf * b[0]
    if load * m != 0.0 and (i == 0 or (is_uniform(field) and rod[0, M] != 0.0)):
        across = 0.0
    X[4] += load * m * along
    X[5] += load * m * across
    if columns < 2:
        return
    for a in range(columns):
        dx = cf * D[2, a] - sf * D[3, a]
        dy = sf * D[2, a] + cf * D[3, a]
        fx = load * m * (b[2] * dx + b[3] * dy)
        fy = load * m * (b[3] * dx + b[4] * dy)
        if a == 3:
            fx += m * b[0]
            fy += m * b[1]
        D[4, a] += cf * fx + sf * fy
        D[5, a] += cf * fy - sf * fx


@njit(**PART, fastmath={"contract"})
def sample(s, k, reached, h, last, order, x0, y0, phi, X, T, out):  # type: ignore[no-untyped-def]
    """Fill `out` at the stations within a step; return the next station, or -1.

    At a joint the curvature is the one of the section that begins there. Of T the sin
    and cos are integrated in place.
    """
    if k < 0 or not (last or 1.0 - s[k] <= reached + h + 1e-13):
        return k
    for a in range(order):
        f = h / (a + 1)
        T[2, a] *= f
        T[3, a] *= f
    while k >= 0 and (last or 1.0 - s[k] <= reached + h + 1e-13):
        r = (1.0 - s[k] - reached) / h
        theta = T[0, order]
        q = T[1, order]
        x = y = 0.0
        for a in range(order - 1, -1, -1):
            theta = theta * r + T[0, a]
            q = q * r + T[1, a]
            x = x * r + T[3, a]
            y = y * r + T[2, a]
        out[0, k] = x0 - r * x
        out[1, k] = y0 - r * y
        out[2, k] = theta + phi
        out[3, k] = -q * X[6]
        k -= 1
    return k


@njit(**PART)
def march(rod, field, load, u, order, step, columns, limit, s, count, X, D, T, C, out):  # type: ignore[no-untyped-def]
    """March from the tip to the root.

    Parameters
    ----------
    rod, field : ndarray
        See the module's docstring.
    load : float
        Factor on all loads, from 0 to 1.
    u : ndarray, shape (4,)
        gamma, x_L, y_L and phi; gamma and phi are updated to the tip's load.
    order, step : int, float
        Order of the series, and what one step takes (`substeps`).
    columns : int
        0: none, and D is kept. 1: d/dgamma. 4: also d/dx_L and d/dy_L (at a fixed
        gamma) and d/dload.
    limit : float
        Angle from the load at which the march stops.
    s, count : ndarray, int
        The first `count` stations are filled into `out`.
    X : ndarray, shape (11,)
        On return the state at the root; positions count from the tip, turned by -phi.
    D : ndarray, shape (11, 4)
        On return its columns; those of the position count from the origin.
    T, C : ndarray
        Work space of `series` and `column_step`.
    out : ndarray, shape (4, n)
        x, y (as in X), theta and curvature at the stations.

    Returns
    -------
    int
        Number of sign changes of the Jacobi determinant on (0, L]: the Morse index, if
        this is an equilibrium; -1 if it stopped at `limit`. (The variations of rods
        clamped at s form nested spaces as s falls from L to 0, so each zero adds one
        unstable direction.)
    """
    begin(u, columns, X, D)
    zeros = 0
    positive = True
    k = count - 1
    reached = 0.0
    for i in range(rod.shape[0]):
        add_load(rod, field, i, load, u, columns, X, D)
        enter_section(rod, i, load, u, columns, X, D)
        n = substeps(rod[i, H], X, step)
        h = rod[i, H] / n
        for j in range(n):
            x0 = X[2]
            y0 = X[3]
            series(h, order, X, T)
            if columns > 0:
                column_step(h, order, X, T, D, C)
            advance(h, order, X, T)
            if columns > 1:
                spare(X, D)
            if columns > 0 and (jacobi(D, columns) > 0.0) != positive:
                positive = not positive
                zeros += 1
            if not abs(X[0]) < limit:
                return -1
            last = i + 1 == rod.shape[0] and j + 1 == n
            k = sample(s, k, reached, h, last, order, x0, y0, u[3], X, T, out)
            reached += h
    return zeros


@njit(**PART)
def jacobi(D, columns):  # type: ignore[no-untyped-def]
    """Return the determinant of (theta, x, y) by (gamma, x_L, y_L)."""
    if columns == 1:
        return D[0, 0]
    return (
        D[0, 0] * (D[2, 1] * D[3, 2] - D[2, 2] * D[3, 1])
        - D[0, 1] * (D[2, 0] * D[3, 2] - D[2, 2] * D[3, 0])
        + D[0, 2] * (D[2, 0] * D[3, 1] - D[2, 1] * D[3, 0])
    )
