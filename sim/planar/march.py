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
from .taylor import advance, column_step, sample, series, substeps

H, E, M, WX, WY = 0, 1, 2, 3, 4
"""Columns of a rod."""
STATE = 11
"""Length of the state and rows of the column array."""
SPARED, SWING = 9, 10
"""Rows of the column array that hold no derivative: how much of the first column the
others were spared (`spare`), and how the tip's load swings with its place."""
GROWN = 1e16
"""Square of the growth from which on `spare` has something to do."""
TURN = 1e-11
"""Turns of the frame up to which come from rounding of the tip's place."""
MAX_ORDER = 24
SERIES = 4
"""Series kept of a step: theta, q, sin, cos; and the same of every column."""


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
    if columns > 1:
        for a in range(1, 3):
            D[7, a] = load * wy * D[SWING, a]
            D[8, a] = -load * wx * D[SWING, a]
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
def turn_frame(b, scale, u, X):  # type: ignore[no-untyped-def]
    """Turn the frame into the tip's load, keeping the tip's direction.

    After a turn that comes from rounding it is gamma that is kept, which may be smaller
    still.
    """
    turn = math.atan2(scale * b[1], scale * b[0]) - u[3]
    turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    if (b[0] != 0.0 or b[1] != 0.0) and scale != 0.0:
        u[3] += turn
        if abs(turn) > TURN:
            u[0] -= turn
            X[0] = u[0]
    X[9] = b[0]
    X[10] = b[1]


@njit(**PART)
def _swing(b, D):  # type: ignore[no-untyped-def]
    """Set by how much the load at the tip, and the frame with it, swings."""
    size2 = b[0] * b[0] + b[1] * b[1]
    if size2 > 0.0:
        D[SWING, 1] = (b[0] * b[3] - b[1] * b[2]) / size2
        D[SWING, 2] = (b[0] * b[4] - b[1] * b[3]) / size2


@njit(**PART)
def _moved(a, cf, sf, X, D):  # type: ignore[no-untyped-def]
    """Return what column `a` does to the position, in the frame as it stands.

    The columns of x_L and y_L are in a frame that swings and shifts with the tip: at a
    fixed gamma nothing grows in them but by the size of the load. In the fixed frame
    rounding would, as exponentially along a long rod as gamma does.
    """
    dx = D[2, a] - D[SWING, a] * X[3]
    dy = D[3, a] + D[SWING, a] * X[2]
    if a == 1:
        dx += cf
        dy -= sf
    elif a == 2:
        dx += sf
        dy += cf
    return dx, dy


@njit(**PART)
def _close(cf, sf, X, D):  # type: ignore[no-untyped-def]
    """Turn the columns of x_L and y_L into those of the fixed frame."""
    for a in range(1, 3):
        D[2, a], D[3, a] = _moved(a, cf, sf, X, D)
        D[0, a] += D[SWING, a]


@njit(**PART)
def _determinant(cf, sf, X, D, columns):  # type: ignore[no-untyped-def]
    """Return the Jacobi determinant (`jacobi`) within the march."""
    if columns == 1:
        return D[0, 0]
    x1, y1 = _moved(1, cf, sf, X, D)
    x2, y2 = _moved(2, cf, sf, X, D)
    return (
        D[0, 0] * (x1 * y2 - x2 * y1)
        - (D[0, 1] + D[SWING, 1]) * (D[2, 0] * y2 - x2 * D[3, 0])
        + (D[0, 2] + D[SWING, 2]) * (D[2, 0] * y1 - x1 * D[3, 0])
    )


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
        turn_frame(b, load * m, u, X)
        if columns > 1 and m != 0.0:
            _swing(b, D)
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
        px, py = _moved(a, cf, sf, X, D)
        dx = cf * px - sf * py
        dy = sf * px + cf * py
        fx = load * m * (b[2] * dx + b[3] * dy)
        fy = load * m * (b[3] * dx + b[4] * dy)
        if a == 3:
            fx += m * b[0]
            fy += m * b[1]
        D[4, a] += cf * fx + sf * fy + load * m * across * D[SWING, a]
        if i > 0 or load * m == 0.0:  # the frame swings with the load at the tip
            D[5, a] += cf * fy - sf * fx - load * m * along * D[SWING, a]


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
    cf = sf = 0.0
    k = count - 1
    reached = 0.0
    for i in range(rod.shape[0]):
        add_load(rod, field, i, load, u, columns, X, D)
        if i == 0:
            cf, sf = math.cos(u[3]), math.sin(u[3])
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
            stable = columns == 0 or _determinant(cf, sf, X, D, columns) > 0.0
            if columns > 0 and stable != positive:
                positive = not positive
                zeros += 1
            if not abs(X[0]) < limit:
                return -1
            last = i + 1 == rod.shape[0] and j + 1 == n
            k = sample(s, k, reached, h, last, order, x0, y0, u[3], X, T, out)
            reached += h
    if columns > 1:
        _close(cf, sf, X, D)
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
