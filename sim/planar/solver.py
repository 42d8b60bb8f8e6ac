"""Equilibria of the planar rod and their shapes, one rod or many.

Dimensionless as `planar.march`. Two roads lead to the equilibrium that a rod reaches
when its load grows from zero:

* In a uniform field, without weight and with one sign of magnetisation, a bracketed
  Newton on the tip angle alone (`planar.one_sided`).
* Otherwise Newton on (gamma, x_L, y_L) from the straight rod, where that finds the
  branch from zero load: if the straight rod under full load has no unstable direction
  (then it has none under any smaller load, since its stiffness is linear in the load),
  and if the corrections shrink to a quarter from step to step, as the theorem of
  Kantorovich asks for. Else load continuation (`planar.follow`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError, SolverError
from ...core.jit import njit
from ...core.specimen import Specimen
from ..fields import Field, gap_of
from ..magnet.flux import PART, blocked, field_at, in_reach, is_uniform
from .contact import load_before_touching, touches_in_plane
from .follow import (
    SHRINK,
    SMALL,
    correction,
    follow_load,
    move,
    residual,
    solve3,
    straight,
)
from .march import MAX_ORDER, STATE, WX, WY, E, H, M, march
from .one_sided import first_guess, narrow, one_sided
from .outcomes import (
    FAILED,
    FOLLOW,
    GONE,
    OK_STABLE,
    OK_UNSTABLE,
    ROUNDING,
    TOO_STRONG,
    TOUCHES,
)
from .pieces import fill, follow_pieces

Array = NDArray[np.float64]

COARSE, FINE, SHAPE = 0, 1, 2
"""What a march of `_solve_row` is for: to come near, to arrive, and to compare with a
higher order while the shape is filled."""

MAX_REACH = 200.0
"""Largest sum of h sqrt(e P), the length of the rod in units of its boundary layer."""
SURE_REACH = 40.0
"""Up to which rods that weight or unlike sections bend between their ends are solved,
too: beyond, the tip no longer fixes the root, and some are refused."""
ORDER = 16
STEP = 0.3

COARSE_ORDER = 8
COARSE_STEP = 0.6
"""What brings an iteration within about 1e-7 of its end, at a quarter of the cost."""

FIRST = 0.6
"""Largest first correction from the straight rod."""
NEAR = 1e-3
"""Correction after which a coarse iteration has done its part."""
TINY = 1e-12
"""Correction that is taken for the last, whatever the next residual may be."""
ENOUGH = 1e-13
"""Difference between the orders that is left uncorrected, in lengths of the rod."""


@njit(**PART)
def _reach(rod, flux):  # type: ignore[no-untyped-def]
    """Return the sum of h sqrt(e P) in a field of `flux`."""
    reach = 0.0
    for i in range(rod.shape[0]):
        p = abs(rod[i, M]) * flux + math.hypot(rod[i, WX], rod[i, WY])
        reach += rod[i, H] * math.sqrt(rod[i, E] * p)
    return reach


@njit(cache=True, error_model="numpy")
def reach_there(rod, field, u):  # type: ignore[no-untyped-def]
    """Return the rod's length in boundary layers in the field at the tip in `u`."""
    b = field_at(field, u[1], u[2])
    return _reach(rod, math.hypot(b[0], b[1]))


@njit(**PART)
def _correct(columns, clamp, u, X, D, d):  # type: ignore[no-untyped-def]
    """Set d to Newton's correction; return the residual (infinite if singular)."""
    if columns == 1:
        rt = residual(u, clamp, X)[0]
        d[0] = d[3] = -rt / D[0, 0]
        d[1] = d[2] = 0.0
        return abs(rt)
    return correction(clamp, u, X, D, d)


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


@njit(**PART, inline="always")
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
            if touches_in_plane(field, margin, s, out):
                found[0] = TOUCHES
                return
    simple = one_sided(rod, field)
    limit = first_guess(rod, field, clamp, u, bracket) if simple else math.inf
    columns = 1 if simple else 4
    stage = COARSE if cold and order > COARSE_ORDER else FINE
    first = FIRST if cold else 0.1
    before = math.inf
    error = -1.0
    index = 0
    x = y = 0.0
    for k in range(220):
        free = is_uniform(field) or stage == SHAPE
        if not free and blocked(field, u[1], u[2], 0.0, 0.0):
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
            if not _reach(rod, math.hypot(X[9], X[10])) < MAX_REACH:
                found[0] = TOO_STRONG
                return
            if zeros > 0 and not simple:
                break
        if simple and stage != SHAPE:
            enough = NEAR if stage == COARSE else SMALL
            ahead = -u[0]
            done = limit > 4.0 or narrow(zeros < 0, enough, X, D, u, bracket)
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
                    error = size + abs(d[3]) + abs(d[1]) + abs(d[2])
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
                    quick = change * change * spread < ENOUGH
                    done = change < SMALL and (quick or change < TINY)
                if not size < math.inf or not (
                    done or (change < first and change <= SHRINK * before and k < 20)
                ):
                    break
                before = change
            if simple:
                u[0] += d[0]
            else:
                move(rod, field, 1.0, d, u)
        if done:
            stage += 1
            index = zeros
            before = math.inf
    if stage != SHAPE or (cold and index != 0 and not simple):
        found[0] = FOLLOW if cold and not simple else FAILED
        return
    found[0] = OK_STABLE if index == 0 else OK_UNSTABLE
    if not place(u, X, out):
        found[0] = FAILED
    elif near and touches_in_plane(field, margin, s, out):
        found[0] = GONE
    found[1] = index
    found[2] = error + _rounding(_reach(rod, math.hypot(X[9], X[10])), columns, D, d)
    found[3] = X[9]
    found[4] = X[10]
    found[5] = -X[1]
    found[6] = 1.0


@njit(**PART)
def place(u, X, out):  # type: ignore[no-untyped-def]
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
        See `planar.march`.
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
    d = np.empty(4)
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
        The unknowns of the march; NaN where the tip does not fix the root.
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
    rod, field = rods[0], fields[0]
    pieces = None
    index, load = follow_load(rod, field, clamp, u[0], order, step)
    if index < 0 and (index == -2 or _is_unlike(rod)):
        order, step = max(order, ORDER), min(step, STEP)
        index, load, pieces = follow_pieces(rod, field, clamp, u[0], order, step)
    if index < 0:
        found[0, 0] = GONE if index == -1 else FAILED
        found[0, 6] = load
    else:
        solve_rows(rods, fields, clamp, margins, s, order, step, False, u, found, out)
        if found[0, 0] == FAILED and pieces is not None:
            u[0] = math.nan
            fill(
                rod, field, clamp, margins[0], pieces, s[0], order, step, found[0],
                out[0],
            )  # fmt: skip
    failed = found[0, 0] == FAILED
    if failed and reach_there(rod, field, u[0]) > SURE_REACH:
        found[0, 0] = TOO_STRONG


def _is_unlike(rod: Array) -> bool:
    """Tell whether more than the load at the tip bends a rod."""
    return bool(np.any(rod[:, M] != rod[0, M]) or np.any(rod[:, WX : WY + 1]))


def _load_before_touching(end: float, rod: Array, *rest: Any) -> float:
    """Return up to which load a rod (arguments of `solve_planar_rows`) is clear."""

    def clear(load: float) -> bool:
        part = rod.copy()
        part[:, M:] *= load
        found, _, _ = solve_planar_rows(part[None], *rest)
        return bool(found[0, 0] <= OK_UNSTABLE)

    return load_before_touching(end, clear)


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
        phi) of the march, NaN where the tip does not fix the root (`planar.pieces`).
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


def failure(
    outcome: int, specimen: Specimen, field: Field, load: float
) -> InputError | SolverError:
    """Return the error that says why the kernel gave no answer."""
    if outcome == TOUCHES:
        return InputError(
            f"gap_mm (or centre_mm) must leave the undeformed rod {specimen.name!r} "
            "clear of the magnet, with half its side to spare; instead received "
            f"{gap_of(field)}"
        )
    if outcome == TOO_STRONG:
        return InputError(
            "the load on the rod (flux_mT, remanence_mT, weight) must be less than "
            "40000 times its stiffness EI / L^2, or 1600 times where sections differ "
            "in remanence or weight acts; instead received one beyond it: check E_MPa, "
            "side_mm and flux_mT"
        )
    return SolverError(
        f"no equilibrium of {specimen.name!r} could be followed beyond "
        f"{load:.3g} of its load; try a smaller flux_mT or a larger gap_mm"
    )
