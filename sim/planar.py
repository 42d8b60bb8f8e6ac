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
* Otherwise Newton on (gamma, x_L, y_L) from the straight rod, where that finds the
  branch from zero load: if the straight rod under full load has no unstable direction
  (then it has none under any smaller load, since its stiffness is linear in the load),
  and if the corrections shrink to a quarter from step to step, as the theorem of
  Kantorovich asks for. Else load continuation with tangent predictors. The load at
  which no smaller step helps is a fold: beyond it the rod is pulled in.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..core.jit import njit
from .magnet_field import inside
from .planar_contact import in_reach, touches
from .planar_march import MAX_ORDER, PART, STATE, WX, WY, E, H, M, march

Array = NDArray[np.float64]

OK_STABLE, OK_UNSTABLE, GONE, FAILED, TOO_STRONG, TOUCHES, FOLLOW = range(7)
"""Outcomes: stable, unstable, no equilibrium, no convergence, load beyond `MAX_REACH`,
undeformed rod touches the magnet; and, inside this module, load to be followed."""
COARSE, FINE, SHAPE = 0, 1, 2
"""What a march of `_solve_row` is for: to come near, to arrive, and to compare with a
higher order while the shape is filled."""

MAX_REACH = 200.0
"""Largest sum of h sqrt(e P), the length of the rod in units of its boundary layer."""
MAX_REACH_NEWTON = 40.0
"""The same where weight, a magnet or mixed signs need all three unknowns."""
MAX_TRIALS = 400
"""Most Newton runs along a branch; a branch that needs more is given up."""
ORDER = 16
STEP = 0.3
ROUNDING = 2e-14
"""What rounding may leave of a residual, in lengths of the rod."""

COARSE_ORDER = 8
COARSE_STEP = 0.6
"""What brings an iteration within about 1e-7 of its end, at a quarter of the cost."""

FIRST = 0.6
SHRINK = 0.25
"""Largest first correction from the straight rod, and how each must shrink."""
SMALL = 1e-7
"""Correction after which the next would be of the size of rounding."""
NEAR = 1e-3
"""Correction after which a coarse iteration has done its part."""
ENOUGH = 1e-13
"""Difference between the orders that is left uncorrected, in lengths of the rod."""
MIN_LOAD_STEP = 1e-7


@njit(**PART)
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


@njit(**PART)
def residual(u, clamp, X):  # type: ignore[no-untyped-def]
    """Return how far the root is from the clamp: angle, and position turned by -phi."""
    cf = math.cos(u[3])
    sf = math.sin(u[3])
    return (
        X[0] + u[3] - clamp,
        X[2] + cf * u[1] + sf * u[2],
        X[3] - sf * u[1] + cf * u[2],
    )


@njit(cache=True, error_model="numpy")
def straight(clamp, u):  # type: ignore[no-untyped-def]
    """Set u to the unloaded rod, keeping its frame."""
    u[0] = clamp - u[3]
    u[1] = math.cos(clamp)
    u[2] = math.sin(clamp)


@njit(cache=True, error_model="numpy")
def newton(rod, field, load, clamp, u, order, step, first, X, D, T, C):  # type: ignore[no-untyped-def]
    """Iterate u to an equilibrium; return its Morse index, or -1.

    Gives up, rather than jump to another branch, when the first correction is above
    `first` or a correction does not shrink to a quarter of the one before.
    """
    d = np.empty(3)
    nowhere = np.empty(0)
    nothing = np.empty((4, 0))
    before = math.inf
    columns = D.shape[1]
    for _ in range(16):
        if field[0] != 0.0 and inside(field[1:], u[1], u[2], 0.0, 0.0):
            return -1
        index = march(
            rod, field, load, u, order, step, columns, math.inf, nowhere, 0,
            X, D, T, C, nothing,
        )  # fmt: skip
        rt, rx, ry = residual(u, clamp, X)
        if not solve3(D, rt, rx, ry, d):
            return -1
        size = max(abs(d[0]), abs(d[1]), abs(d[2]))
        if not size < SMALL and (not size < first or size > SHRINK * before):
            return -1
        for i in range(3):
            u[i] += d[i]
        if size < SMALL:
            return index
        before = size
    return -1


@njit(cache=True, nogil=True, error_model="numpy")
def follow_load(rod, field, clamp, u, order, step):  # type: ignore[no-untyped-def]
    """Follow the equilibrium from no load to full load in u; return (index, load).

    The index is -1 where the branch folds back, -2 where it takes too many steps.
    """
    X = np.empty(STATE)
    D = np.empty((STATE, 4))
    T = np.empty((4, MAX_ORDER + 1))
    C = np.empty((MAX_ORDER + 1, 4, 4))
    tangent = np.zeros(3)
    u[3] = 0.0
    straight(clamp, u)
    here = u.copy()
    trials = 0
    index = 0
    load = 0.0
    jump = 0.0
    while True:
        for i in range(3):
            u[i] = here[i] + jump * tangent[i]
        u[3] = here[3]
        bend = jump * max(abs(tangent[0]), abs(tangent[1]), abs(tangent[2]))
        trial = -1
        if bend < 0.5:
            first = 0.1 if jump > 0.0 else 1.0
            trial = newton(
                rod, field, load + jump, clamp, u, order, step, first, X, D, T, C
            )
        if trial >= 0 and abs(trial - index) <= 1:
            if jump == 1.0 - load:
                return trial, 1.0
            index = trial
            load += jump
            for i in range(4):
                here[i] = u[i]
            solve3(D, D[0, 3], D[2, 3], D[3, 3], tangent)
            jump = 2.0 * jump if jump > 0.0 else 0.25
        else:
            jump *= 0.5
            trials += 1
            if trials > MAX_TRIALS:
                return -2, load
            if jump < MIN_LOAD_STEP:
                return -1, load
        jump = min(jump, 1.0 - load)


@njit(**PART)
def one_sided(rod, field):  # type: ignore[no-untyped-def]
    """Tell whether the first road applies: uniform field, one sign, no weight."""
    if field[0] != 0.0 or rod[0, M] == 0.0:
        return False
    for i in range(rod.shape[0]):
        if rod[i, WX] != 0.0 or rod[i, WY] != 0.0 or rod[i, M] * rod[0, M] < 0.0:
            return False
    return True


@njit(**PART)
def _reach(rod, flux):  # type: ignore[no-untyped-def]
    """Return the sum of h sqrt(e P) in a field of `flux`."""
    reach = 0.0
    for i in range(rod.shape[0]):
        p = abs(rod[i, M]) * flux + math.hypot(rod[i, WX], rod[i, WY])
        reach += rod[i, H] * math.sqrt(rod[i, E] * p)
    return reach


@njit(**PART)
def _growth(rod, flux):  # type: ignore[no-untyped-def]
    """Return by what factor a small angle from the load grows from tip to clamp."""
    g = 1.0
    r = 0.0
    for i in range(rod.shape[0]):
        p = abs(rod[i, M]) * flux
        w = math.sqrt(rod[i, E] * p)
        c = math.cosh(rod[i, H] * w)
        s = rod[i, H] if w == 0.0 else math.sinh(rod[i, H] * w) / w
        g, r = g * c + r * rod[i, E] * s, r * c + g * p * s
    return g


@njit(**PART)
def _first_guess(rod, field, clamp, u, bracket):  # type: ignore[no-untyped-def]
    """Set u and the bracket (low, high, guess, goal, side) of a one-sided rod.

    Return the angle from the load at which a march may stop: pi, but for a rod that
    starts against the field and stays there.
    """
    sign = 1.0 if rod[0, M] > 0.0 else -1.0
    u[3] = math.atan2(sign * field[2], sign * field[1])
    target = clamp - u[3]
    target -= 2.0 * math.pi * math.floor(target / (2.0 * math.pi) + 0.5)
    u[3] = clamp - target
    side = -1.0 if target < 0.0 else 1.0
    goal = math.tan(0.25 * abs(target))
    guess = goal / _growth(rod, math.hypot(field[1], field[2]))
    bracket[0] = 0.0
    bracket[1] = goal
    bracket[2] = guess
    bracket[3] = goal
    bracket[4] = side
    u[0] = side * 4.0 * math.atan(guess)
    if abs(target) > math.pi - 1e-12:
        u[0] = target
        return math.inf
    return math.pi


@njit(**PART)
def _narrow(passed, enough, X, D, u, bracket):  # type: ignore[no-untyped-def]
    """Improve the bracketed guess by what a march found; return whether it is done."""
    low, high, t, goal, side = (
        bracket[0], bracket[1], bracket[2], bracket[3], bracket[4],
    )  # fmt: skip
    new = -1.0
    if passed:
        high = t
    else:
        g = math.tan(0.25 * side * X[0])
        if g > goal:
            high = t
        else:
            low = t
        new = t - (g - goal) * (1.0 + t * t) / (D[0, 0] * (1.0 + g * g))
    done = not passed and abs(new - t) <= enough * t
    if not done and not low < new < high:
        new = math.sqrt(low * high) if low > 0.0 else 0.1 * high
    bracket[0] = low
    bracket[1] = high
    bracket[2] = new
    u[0] = side * 4.0 * math.atan(new)
    return done


@njit(**PART)
def _correct(columns, clamp, u, X, D, d):  # type: ignore[no-untyped-def]
    """Set d to Newton's correction; return the residual (infinite if singular)."""
    rt, rx, ry = residual(u, clamp, X)
    if columns == 1:
        d[0] = -rt / D[0, 0]
        d[1] = d[2] = 0.0
        return abs(rt)
    if not solve3(D, rt, rx, ry, d):
        return math.inf
    return abs(rt) + abs(rx) + abs(ry)


@njit(**PART)
def _rounding(reach, columns, D, d):  # type: ignore[no-untyped-def]
    """Return what rounding may do: more for long rods and near singular matrices."""
    if columns == 1:
        return ROUNDING * (1.0 + reach) * (1.0 + 1.0 / abs(D[0, 0]))
    total = 1.0
    for i in range(3):
        solve3(D, 1.0 * (i == 0), 1.0 * (i == 1), 1.0 * (i == 2), d)
        total += abs(d[0]) + abs(d[1]) + abs(d[2])
    return ROUNDING * (1.0 + reach) * total


@njit(**PART)
def _solve_row(  # type: ignore[no-untyped-def]
    rod, field, clamp, margin, s, order, step, cold, u, found, out, X, D, T, C, d
):
    """Solve one rod into `found` and `out` (see `solve_rows`)."""
    bracket = np.empty(5)
    near = in_reach(field, margin)
    if cold:
        u[3] = 0.0
        straight(clamp, u)
        if near:
            for k in range(s.shape[0]):
                out[0, k] = s[k] * u[1]
                out[1, k] = s[k] * u[2]
                out[2, k] = clamp
            if touches(field, margin, s, out):
                found[0] = TOUCHES
                return
    simple = one_sided(rod, field)
    limit = _first_guess(rod, field, clamp, u, bracket) if simple else math.inf
    columns = 1 if simple else 4
    stage = COARSE if cold and order > COARSE_ORDER else FINE
    first = FIRST if cold else 0.1
    before = math.inf
    error = -1.0
    index = 0
    x = y = 0.0
    for k in range(220):
        free = field[0] == 0.0 or stage == SHAPE
        if not free and inside(field[1:], u[1], u[2], 0.0, 0.0):
            break
        zeros = march(
            rod, field, 1.0, u,
            COARSE_ORDER if stage == COARSE else order if stage == FINE else order + 4,
            COARSE_STEP if stage == COARSE else step,
            0 if stage == SHAPE else columns,
            math.inf if stage == SHAPE else limit,
            s, s.shape[0] if stage == SHAPE else 0, X, D, T, C, out,
        )  # fmt: skip
        if k == 0 and cold:
            found[3] = X[9]
            found[4] = X[10]
            most = MAX_REACH if simple else MAX_REACH_NEWTON
            if not _reach(rod, math.hypot(X[9], X[10])) < most:
                found[0] = TOO_STRONG
                return
            if zeros > 0 and not simple:
                break
        if simple and stage != SHAPE:
            enough = NEAR if stage == COARSE else SMALL
            ahead = -u[0]
            done = limit > 4.0 or _narrow(zeros < 0, enough, X, D, u, bracket)
            ahead += u[0]
            x = X[2] + ahead * D[2, 0]
            y = X[3] + ahead * D[3, 0]
            if done and stage == COARSE:
                bracket[0] = 0.0
                bracket[1] = bracket[3]
        else:
            size = _correct(columns, clamp, u, X, D, d)
            change = max(abs(d[0]), abs(d[1]), abs(d[2]))
            if stage == SHAPE:
                done = error >= 0.0
                if not done:
                    error = size + abs(d[0]) + abs(d[1]) + abs(d[2])
                    if simple:  # whose residual is the angle's alone
                        error += abs(X[2] - x) + abs(X[3] - y)
                    done = error < ENOUGH
                if done:
                    break
            else:
                done = change < NEAR
                if stage == FINE:
                    # In long rods the next residual may be large, small as u is.
                    spread = abs(D[0, 0]) + abs(D[0, 1]) + abs(D[0, 2])
                    done = change < SMALL and change * change * spread < ENOUGH
                if not size < math.inf or not (
                    done or (change < first and change <= SHRINK * before and k < 20)
                ):
                    break
                before = change
            for a in range(3):
                u[a] += d[a]
        if done:
            stage += 1
            index = zeros
            before = math.inf
    if stage != SHAPE or (cold and index != 0 and not simple):
        found[0] = FOLLOW if cold and not simple else FAILED
        return
    found[0] = OK_STABLE if index == 0 else OK_UNSTABLE
    if not _place(u, X, out):
        found[0] = FAILED
    elif near and touches(field, margin, s, out):
        found[0] = GONE
    found[1] = index
    found[2] = error + _rounding(_reach(rod, math.hypot(X[9], X[10])), columns, D, d)
    found[3] = X[9]
    found[4] = X[10]
    found[5] = -X[1]
    found[6] = 1.0


@njit(**PART)
def _place(u, X, out):  # type: ignore[no-untyped-def]
    """Turn the curve, which counts from the tip, so that it counts from the clamp.

    Return whether it is finite.
    """
    cf = math.cos(u[3])
    sf = math.sin(u[3])
    n = out.shape[1]
    total = 0.0
    for k in range(n):
        x = out[0, k] - X[2]
        y = out[1, k] - X[3]
        out[0, k] = cf * x - sf * y
        out[1, k] = sf * x + cf * y
        total += out[0, k] + out[1, k] + out[2, k] + out[3, k]
    u[1] = out[0, n - 1]
    u[2] = out[1, n - 1]
    return math.isfinite(total)


@njit(cache=True, nogil=True, error_model="numpy")
def solve_rows(rods, fields, clamp, margins, s, order, step, cold, u, found, out):  # type: ignore[no-untyped-def]
    """Solve many rods where no load need be followed.

    Parameters
    ----------
    rods, fields : ndarray, shapes (n, k, 5), (n, 17)
        See `planar_march`.
    clamp : float
        Tangent angle at the clamp, in rad.
    margins : ndarray, shape (n,)
        Half the side of the rod: nearer to the magnet than this, it touches.
    s : ndarray, shape (n, m) or (1, m)
        Stations of each rod, or of all.
    order, step : int, float
        Order of the Taylor series and size of its steps.
    cold : bool
        Whether to start from the straight rod rather than from `u`.
    u : ndarray, shape (n, 4)
        Receives the unknowns (gamma, x_L, y_L, phi) of the march.
    found : ndarray, shape (n, 7)
        Receives outcome, Morse index (-1: none), error, Bx and By at the tip, root
        moment, and the load reached (0 where it is still to be followed).
    out : ndarray, shape (n, 4, m)
        Receives x, y, theta, curvature.
    """
    X = np.empty(STATE)
    D = np.empty((STATE, 4))
    T = np.empty((4, MAX_ORDER + 1))
    C = np.empty((MAX_ORDER + 1, 4, 4))
    d = np.empty(3)
    found[:, 1] = -1.0
    found[:, 6] = 0.0
    for i in range(rods.shape[0]):
        _solve_row(
            rods[i], fields[i], clamp, margins[i], s[min(i, s.shape[0] - 1)], order,
            step, cold, u[i], found[i], out[i], X, D, T, C, d,
        )  # fmt: skip


def solve_planar_rows(
    rods: Array,
    fields: Array,
    clamp: float,
    margins: Array,
    s: Array,
    order: int,
    step: float,
) -> tuple[Array, Array, Array]:
    """Solve many rods (arguments as of `solve_rows`).

    Returns
    -------
    found : ndarray, shape (n, 7)
        Outcome, Morse index (-1: none), error, Bx and By at the tip, root moment, load
        reached: 1 but where the outcome is no equilibrium.
    out : ndarray, shape (n, 4, m)
        x, y, theta, curvature.
    u : ndarray, shape (n, 4)
        The unknowns of the march.
    """
    n = len(rods)
    found = np.empty((n, 7))
    out = np.empty((n, 4, s.shape[1]))
    u = np.empty((n, 4))
    solve_rows(rods, fields, clamp, margins, s, order, step, True, u, found, out)
    for i in np.flatnonzero(found[:, 0] == FOLLOW):
        k = slice(i, i + 1)
        here = s if len(s) == 1 else s[k]
        _solve_by_following(
            rods[k], fields[k], clamp, margins[k], here, order, step,
            u[k], found[k], out[k],
        )  # fmt: skip
    return found, out, u


def _solve_by_following(
    rods: Array,
    fields: Array,
    clamp: float,
    margins: Array,
    s: Array,
    order: int,
    step: float,
    u: Array,
    found: Array,
    out: Array,
) -> None:
    """Solve the one rod of these arrays (as of `solve_rows`) by load continuation."""
    index, load = follow_load(rods[0], fields[0], clamp, u[0], order, step)
    if index >= 0:
        solve_rows(rods, fields, clamp, margins, s, order, step, False, u, found, out)
    else:
        found[0, 0] = GONE if index == -1 else FAILED
        found[0, 6] = load


def _load_before_touching(
    end: float,
    rod: Array,
    fields: Array,
    clamp: float,
    margins: Array,
    s: Array,
    order: int,
    step: float,
) -> float:
    """Return up to which load a rod, whose branch ends at `end`, touches no magnet."""
    low, high = 0.0, end
    load = end * (1.0 - 1e-6)
    for _ in range(20):
        part = rod.copy()
        part[:, M:] *= load
        found, _, _ = solve_planar_rows(
            part[None], fields, clamp, margins, s, order, step
        )
        if found[0, 0] > OK_UNSTABLE:
            high = load
        elif high == end:
            return end
        else:
            low = load
        load = 0.5 * (low + high)
    return low


def solve_planar(
    rod: Array,
    field: Array,
    clamp: float,
    margin: float,
    s: Array,
    order: int,
    step: float,
) -> tuple[int, int, float, float, float, float, float, Array, Array]:
    """Solve one rod.

    Returns
    -------
    tuple
        outcome, Morse index, load reached, error, Bx and By at the tip, root moment,
        the shape (4, n): x, y, theta, curvature, and the unknowns (gamma, x_L, y_L,
        phi) of the march.
    """
    # Not by way of `solve_planar_rows`, which costs a few microseconds more.
    case = rod[None], field[None], clamp, np.array([margin]), s[None], order, step
    found = np.empty((1, 7))
    out = np.empty((1, 4, len(s)))
    u = np.empty((1, 4))
    solve_rows(*case, True, u, found, out)
    if found[0, 0] == FOLLOW:
        _solve_by_following(*case, u, found, out)
    if found[0, 0] == GONE:
        found[0, 6] = _load_before_touching(found[0, 6], rod, *case[1:])
    outcome, index, error, bx, by, moment, load = found[0].tolist()
    return int(outcome), int(index), load, error, bx, by, moment, out[0], u[0]
