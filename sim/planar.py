"""Equilibria of the planar rod: Newton on the march, load continuation, dense shapes.

Dimensionless as `planar_march`. Two roads lead to the equilibrium that a rod reaches
when its load grows from zero:

* In a uniform field, without weight and with one sign of magnetisation, gamma (the
  angle from the load) solves (gamma' / e)' = P sin(gamma) with gamma' = 0 at the tip
  and gamma = T at the clamp. With v = pi - gamma this is -(v' / e)' = P sin(v), and
  sin(v) / v falls on (0, pi): by the theorem of Brezis and Oswald (Nonlinear Analysis
  10, 55, 1986) there is exactly one solution inside (0, pi). It is connected to zero
  load, it is stable, and as gamma at the clamp crosses T once, a bracketed Newton on
  the tip angle alone finds it at any load. tan(gamma / 4) at the clamp is nearly
  proportional to its value at the tip, so the iteration runs on these.
* Otherwise Newton on (gamma, x_L, y_L) from the straight rod; where its corrections do
  not shrink to a quarter from step to step, load continuation with tangent predictors.
  The load at which no smaller step helps is a fold: beyond it the rod is pulled in.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .magnet_field import inside
from .planar_march import (
    MAX_ORDER,
    STATE,
    WX,
    WY,
    E,
    H,
    M,
    cross_joint,
    enter_section,
    field_at,
    march,
    start,
    substeps,
    taylor_step,
)

OK_STABLE, OK_UNSTABLE, GONE, FAILED, TOO_STRONG, TOUCHES = 0, 1, 2, 3, 4, 5
"""Outcomes: stable, unstable, no equilibrium, no convergence, load beyond `MAX_REACH`,
undeformed rod touches the magnet."""

MAX_REACH = 200.0
"""Largest sum of h sqrt(e P), the length of the rod in units of its boundary layer."""
MAX_REACH_NEWTON = 40.0
"""The same where weight, a magnet or mixed signs need all three unknowns."""
MAX_TRIALS = 400
"""Most Newton runs along a branch; a branch that needs more is given up."""
ORDER = 16
STEP = 0.3
ROUNDING = 2e-14
"""What rounding alone may leave, in lengths of the rod."""

SHRINK = 0.25
SMALL = 1e-8
MIN_LOAD_STEP = 1e-7


@njit(cache=True)
def solve3(D, rt, rx, ry, out):  # type: ignore[no-untyped-def]
    """Solve the 3x3 Newton system for minus the residual; return False if singular."""
    a = D[2, 1] * D[3, 2] - D[2, 2] * D[3, 1]
    b = D[2, 2] * D[3, 0] - D[2, 0] * D[3, 2]
    c = D[2, 0] * D[3, 1] - D[2, 1] * D[3, 0]
    det = D[0, 0] * a + D[0, 1] * b + D[0, 2] * c
    if det == 0.0 or not math.isfinite(det):
        return False
    f = -1.0 / det
    out[0] = f * (
        a * rt
        + (D[0, 2] * D[3, 1] - D[0, 1] * D[3, 2]) * rx
        + (D[0, 1] * D[2, 2] - D[0, 2] * D[2, 1]) * ry
    )
    out[1] = f * (
        b * rt
        + (D[0, 0] * D[3, 2] - D[0, 2] * D[3, 0]) * rx
        + (D[0, 2] * D[2, 0] - D[0, 0] * D[2, 2]) * ry
    )
    out[2] = f * (
        c * rt
        + (D[0, 1] * D[3, 0] - D[0, 0] * D[3, 1]) * rx
        + (D[0, 0] * D[2, 1] - D[0, 1] * D[2, 0]) * ry
    )
    return True


@njit(cache=True)
def residual(u, clamp, X):  # type: ignore[no-untyped-def]
    """Return how far the root is from the clamp: angle, and position turned by -phi."""
    cf = math.cos(u[3])
    sf = math.sin(u[3])
    return (
        X[0] + u[3] - clamp,
        X[2] + cf * u[1] + sf * u[2],
        X[3] - sf * u[1] + cf * u[2],
    )


@njit(cache=True)
def newton(rod, field, load, clamp, u, order, step, first, X, D, T, C):  # type: ignore[no-untyped-def]
    """Iterate u to an equilibrium; return (Morse index or -1, last contraction).

    Gives up, rather than jump to another branch, when the first correction is above
    `first` or a correction does not shrink to a quarter of the one before.
    """
    d = np.empty(3)
    before = math.inf
    for k in range(16):
        if field[0] != 0.0 and inside(field[1:], u[1], u[2], 0.0, 0.0):
            return -1
        index = march(rod, field, load, u, order, step, 4, X, D, T, C)
        rt, rx, ry = residual(u, clamp, X)
        if not solve3(D, rt, rx, ry, d):
            return -1
        size = max(abs(d[0]), abs(d[1]), abs(d[2]))
        if not size < SMALL and (
            not size < first or (k > 0 and size > SHRINK * before)
        ):
            return -1
        u[0] += d[0]
        u[1] += d[1]
        u[2] += d[2]
        if size < SMALL:
            return index
        before = size
    return -1


@njit(cache=True)
def straight(clamp, u):  # type: ignore[no-untyped-def]
    """Set u to the unloaded rod, keeping its frame."""
    u[0] = clamp - u[3]
    u[1] = math.cos(clamp)
    u[2] = math.sin(clamp)


@njit(cache=True)
def follow_load(rod, field, clamp, u, order, step, X, D, T, C):  # type: ignore[no-untyped-def]
    """Follow the equilibrium from no load to full load; return (index, load).

    The index is -1 where the branch folds back, -2 where it takes too many steps.
    """
    trials = 0
    straight(clamp, u)
    load = 0.0
    jump = 0.25
    here = u.copy()
    tangent = np.zeros(3)
    index = newton(rod, field, 0.0, clamp, u, order, step, 1.0, X, D, T, C)
    while load < 1.0:
        solve3(D, D[0, 3], D[2, 3], D[3, 3], tangent)
        here[:] = u
        while True:
            jump = min(jump, 1.0 - load)
            for i in range(3):
                u[i] = here[i] + jump * tangent[i]
            u[3] = here[3]
            bend = jump * max(abs(tangent[0]), abs(tangent[1]), abs(tangent[2]))
            trial = -1
            if bend < 0.5:
                trial = newton(
                    rod, field, load + jump, clamp, u, order, step, 0.1, X, D, T, C
                )
            if trial >= 0 and abs(trial - index) <= 1:
                break
            jump *= 0.5
            trials += 1
            if trials > MAX_TRIALS:
                return -2, load
            if jump < MIN_LOAD_STEP:
                u[:] = here
                return -1, load
            # The columns at `here` are gone, but only its tangent is needed again.
        index = trial
        load = 1.0 if jump == 1.0 - load else load + jump
        jump *= 2.0
    return index, 1.0


@njit(cache=True)
def one_sided(rod, field):  # type: ignore[no-untyped-def]
    """Tell whether the first road applies: uniform field, one sign, no weight."""
    if field[0] != 0.0 or rod[0, M] == 0.0:
        return False
    for i in range(rod.shape[0]):
        if rod[i, WX] != 0.0 or rod[i, WY] != 0.0 or rod[i, M] * rod[0, M] < 0.0:
            return False
    return True


@njit(cache=True)
def pendulum(rod, flux, gamma, order, step, X, D, T, C):  # type: ignore[no-untyped-def]
    """March gamma alone; return False as soon as it passes pi."""
    X[:] = 0.0
    X[0] = gamma
    D[:, :] = 0.0
    D[0, 0] = 1.0
    for i in range(rod.shape[0]):
        X[4] = abs(rod[i, M]) * flux
        X[6] = rod[i, E]
        n = substeps(rod[i, H], X, step)
        for _ in range(n):
            taylor_step(rod[i, H] / n, order, X, D, 1, T, C)
            if not X[0] < math.pi:
                return False
    return True


@njit(cache=True)
def bracketed(rod, field, clamp, u, order, step, X, D, T, C):  # type: ignore[no-untyped-def]
    """Find the equilibrium of a one-sided rod; return its index, or -1."""
    flux = math.hypot(field[1], field[2])
    sign = 1.0 if rod[0, M] > 0.0 else -1.0
    u[3] = math.atan2(sign * field[2], sign * field[1])
    target = clamp - u[3]
    target -= 2.0 * math.pi * math.floor(target / (2.0 * math.pi) + 0.5)
    u[3] = clamp - target
    side = -1.0 if target < 0.0 else 1.0
    target = abs(target)
    if flux == 0.0 or target == 0.0 or target > math.pi - 1e-12:
        u[0] = side * target
        return march(rod, field, 1.0, u, order, step, 1, X, D, T, C)
    reach = 0.0
    for i in range(rod.shape[0]):
        reach += rod[i, H] * math.sqrt(rod[i, E] * abs(rod[i, M]) * flux)
    goal = math.tan(0.25 * target)
    low = 0.0
    high = goal
    t = goal / math.cosh(reach)
    for _ in range(200):
        gamma = 4.0 * math.atan(t)
        if pendulum(rod, flux, gamma, order, step, X, D, T, C):
            g = math.tan(0.25 * X[0])
            if g > goal:
                high = t
            else:
                low = t
            slope = D[0, 0] * (1.0 + g * g) / (1.0 + t * t)
            new = t - (g - goal) / slope
            if abs(new - t) <= SMALL * t:
                u[0] = side * 4.0 * math.atan(new)
                return 0
        else:
            high = t
            new = -1.0
        if not low < new < high:
            new = math.sqrt(low * high) if low > 0.0 else 0.1 * high
        t = new
    return -1


@njit(cache=True)
def shape(rod, field, u, order, step, s, X, D, T, C, out):  # type: ignore[no-untyped-def]
    """Fill `out` (4, n) with x, y, theta, curvature at the ascending stations `s`.

    At a joint the curvature is the one of the section that begins there.
    """
    start(rod, field, 1.0, u, 0, X, D)
    cf = math.cos(u[3])
    sf = math.sin(u[3])
    k = s.shape[0] - 1
    reached = 0.0
    for i in range(rod.shape[0]):
        enter_section(rod, i, 1.0, cf, sf, 0, X, D)
        n = substeps(rod[i, H], X, step)
        h = rod[i, H] / n
        for j in range(n):
            x0 = X[2]
            y0 = X[3]
            taylor_step(h, order, X, D, 0, T, C)
            last = i + 1 == rod.shape[0] and j + 1 == n
            while k >= 0 and (last or 1.0 - s[k] <= reached + h + 1e-13):
                r = (1.0 - s[k] - reached) / h
                theta = q = x = y = 0.0
                for a in range(order, -1, -1):
                    theta = theta * r + T[0, a]
                    q = q * r + T[1, a]
                for a in range(order - 1, -1, -1):
                    x = x * r + T[3, a] / (a + 1)
                    y = y * r + T[2, a] / (a + 1)
                out[0, k] = x0 - h * r * x
                out[1, k] = y0 - h * r * y
                out[2, k] = theta + u[3]
                out[3, k] = -q * X[6]
                k -= 1
            reached += h
        if i + 1 < rod.shape[0]:
            cross_joint(rod, field, i, 1.0, u, cf, sf, 0, X, D)
    for k in range(s.shape[0]):
        x = out[0, k] - X[2]
        y = out[1, k] - X[3]
        out[0, k] = cf * x - sf * y
        out[1, k] = sf * x + cf * y


@njit(cache=True)
def equilibrium(rod, field, clamp, u, order, step, X, D, T, C):  # type: ignore[no-untyped-def]
    """Find the equilibrium of full load; return (outcome, index, load)."""
    reach = 0.0
    b = field_at(field, u[1], u[2])
    flux = math.hypot(b[0], b[1])
    for i in range(rod.shape[0]):
        p = abs(rod[i, M]) * flux + math.hypot(rod[i, WX], rod[i, WY])
        reach += rod[i, H] * math.sqrt(rod[i, E] * p)
    simple = one_sided(rod, field)
    if not reach < (MAX_REACH if simple else MAX_REACH_NEWTON):
        return TOO_STRONG, -1, 0.0
    load = 1.0
    if simple:
        index = bracketed(rod, field, clamp, u, order, step, X, D, T, C)
    else:
        index = newton(rod, field, 1.0, clamp, u, order, step, 1.0, X, D, T, C)
        if index != 0:
            u[3] = 0.0
            index, load = follow_load(rod, field, clamp, u, order, step, X, D, T, C)
            if index < 0:
                return (GONE if index == -1 else FAILED), -1, load
    if index < 0:
        return FAILED, -1, load
    return (OK_STABLE if index == 0 else OK_UNSTABLE), index, load


@njit(cache=True)
def sharpen(rod, field, clamp, u, order, step, X, D, T, C):  # type: ignore[no-untyped-def]
    """Correct u by what an order four higher finds; return the size of it.

    The correction bounds the truncation error of `order`; what is returned adds what
    rounding leaves.
    """
    d = np.zeros(3)
    if one_sided(rod, field):
        march(rod, field, 1.0, u, order, step, 1, X, D, T, C)
        slope = D[0, 0]
        march(rod, field, 1.0, u, order + 4, step, 0, X, D, T, C)
        r = X[0] + u[3] - clamp
        d[0] = -r / slope
        size = abs(r) + abs(d[0])
        u[0] += d[0]
        return size
    march(rod, field, 1.0, u, order, step, 4, X, D, T, C)
    J = D.copy()
    march(rod, field, 1.0, u, order + 4, step, 0, X, D, T, C)
    rt, rx, ry = residual(u, clamp, X)
    solve3(J, rt, rx, ry, d)
    u[0] += d[0]
    u[1] += d[1]
    u[2] += d[2]
    return abs(rt) + abs(rx) + abs(ry) + abs(d[0]) + abs(d[1]) + abs(d[2])


@njit(cache=True)
def touches(field, x, y, margin):  # type: ignore[no-untyped-def]
    """Tell whether any point of a curve is within `margin` of the magnet."""
    if field[0] == 0.0:
        return False
    found = False
    for k in range(x.shape[0]):
        found = found or inside(field[1:], x[k], y[k], 0.0, margin)
    return found


@njit(cache=True)
def solve_planar(rod, field, clamp, margin, s, order, step):  # type: ignore[no-untyped-def]
    """Solve one rod.

    Parameters
    ----------
    rod, field : ndarray
        See `planar_march`.
    clamp : float
        Tangent angle at the clamp, in rad.
    margin : float
        Half the side of the rod: nearer to the magnet than this, it touches.
    s : ndarray, shape (n,)
        Stations, ascending from 0 to 1.
    order, step : int, float
        Order of the Taylor series and size of its steps.

    Returns
    -------
    tuple
        outcome, Morse index, load reached, error, Bx and By at the tip, root moment,
        the shape (4, n): x, y, theta, curvature, and the unknowns (gamma, x_L, y_L,
        phi) of the march.
    """
    out = np.empty((4, s.shape[0]))
    X = np.empty(STATE)
    D = np.empty((STATE, 4))
    T = np.empty((4, MAX_ORDER + 1))
    C = np.empty((MAX_ORDER + 1, 4, 4))
    u = np.zeros(4)
    straight(clamp, u)
    out[0] = s * math.cos(clamp)
    out[1] = s * math.sin(clamp)
    if touches(field, out[0], out[1], margin):
        return TOUCHES, -1, 0.0, 0.0, 0.0, 0.0, 0.0, out, u
    outcome, index, load = equilibrium(rod, field, clamp, u, order, step, X, D, T, C)
    if outcome > OK_UNSTABLE:
        b = field_at(field, math.cos(clamp), math.sin(clamp))
        return outcome, -1, load, 0.0, b[0], b[1], 0.0, out, u
    error = sharpen(rod, field, clamp, u, order, step, X, D, T, C)
    shape(rod, field, u, order + 4, step, s, X, D, T, C, out)
    if touches(field, out[0], out[1], margin):
        outcome = GONE
    u[1] = out[0, -1]
    u[2] = out[1, -1]
    b = field_at(field, u[1], u[2])
    return outcome, index, load, error + ROUNDING, b[0], b[1], -X[1], out, u
