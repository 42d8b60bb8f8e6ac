"""An equilibrium, stable or not, and the next one along its branch, contacts active.

Unknowns are the rod's and the insertion. Walls act as in `settle`, by forces that are
known better round by round; but what is sought is a root, not a minimum, so that the
matrix may have any index. The step is one of arc length (Keller 1977), which passes
through folds.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .case import Case
from .in_plane import State, copied
from .mesh import thirds, trace, unknowns
from .rod import Rod
from .saddle import exchanged, linearised
from .settle import GAP
from .touch import Before

Array = NDArray[np.float64]

STIFF, RIGID = 1e5, 1e8
"""Stiffness of the walls on the way to a root, and where directions are counted."""
ROUNDS, NEWTON = 24, 10
"""Changes of the contacts' forces, and Newton's steps for each."""
SMALL = 1e-10
"""Newton's step after which a root is found."""
FAR = 0.5
"""Newton's step after which none is."""
NUDGE = 1e-6
"""Step of differences by the insertion, in lengths of the rod."""
RADIAN = 0.05
"""Mean change of the angles that is as long as a whole step of the insertion."""
SHORT, LONG = 0.4, 1.5
"""Length of the first element, in others, beyond which a rod is meshed anew."""
NO_PAST = Before(np.array([0.0, 1.0]), np.zeros(2), np.zeros(2), 0.0, 1.0)


def own(state: State) -> State:
    """Return a state that may be changed."""
    return State(
        insertion_mm=state.insertion_mm,
        rod=state.rod,
        u=state.u.copy(),
        touches=copied(state.touches),
        held=state.held.copy(),
    )


def moved(case: Case, rod: Rod, way: float) -> Rod:
    """Return a rod on the same elements, a small way further in, in its lengths."""
    if not case.feeds:
        x, y, angle = rod.root
        root = [x + way * math.cos(angle), y + way * math.sin(angle), angle]
        return rod._replace(root=np.array(root))
    s, beyond = rod.s.copy(), rod.beyond.copy()
    beyond[0] += (rod.beyond[0] - rod.beyond[1]) / rod.s[1] * way
    s[1:] += way
    return rod._replace(s=s, beyond=beyond)


def advanced(case: Case, state: State, change: Array) -> State:
    """Return a state changed in its unknowns and its insertion."""
    new = own(state)
    new.u += change[:-1]
    new.rod = moved(case, state.rod, change[-1])
    new.insertion_mm += float(change[-1]) * case.length_mm
    return new


def metric(case: Case, state: State, step_mm: float) -> Array:
    """Return the weights of unknowns and insertion in the square of an arc."""
    weights = np.full(len(state.u) + 1, 1.0 / (len(state.u) * RADIAN**2))
    weights[-1] = (case.length_mm / step_mm) ** 2
    return weights


def matrix(case: Case, state: State, stiff: float) -> tuple[Array, Array, float]:
    """Return gradient and Hessian of the augmented energy, and the rod's own energy."""
    rest = own(state)  # contacts float while one looks
    flux = case.flux(state.insertion_mm)
    g, H, energy = linearised(
        rest.rod, flux, case.walls, case.half, rest.u, rest.touches, stiff, rest.held,
        NO_PAST,
    )  # fmt: skip
    return g, H, float(energy)


def gaps(case: Case, state: State) -> Array:
    """Return the gaps of a state's contacts."""
    rest = own(state)
    flux = case.flux(state.insertion_mm)
    linearised(
        rest.rod, flux, case.walls, case.half, rest.u, rest.touches, STIFF, rest.held,
        NO_PAST,
    )  # fmt: skip
    return np.array(rest.touches.gap[: rest.touches.used[0]])


def free_of(state: State) -> slice:
    """Return which unknowns are free: not the clamp's angle, nor that of a held tip."""
    return slice(1, len(state.u) - (1 if state.rod.grip[0] else 0))


def bordered(
    case: Case,
    state: State,
    row: Array,
    along: float,
    stiff: float,
    *,
    still: bool = False,
) -> Array:
    """Return the change that brings a state to rest, by Newton.

    Parameters
    ----------
    row : ndarray, shape (3 n + 2,)
        The change's product with it shall be `along`.
    still : bool
        Whether the state is at rest already: how it changes along its branch.
    """
    free = free_of(state)
    n = free.stop - free.start
    g, H, _ = matrix(case, state, stiff)
    nudge = np.zeros(len(row))
    nudge[-1] = NUDGE
    ahead = matrix(case, advanced(case, state, nudge), stiff)[0]
    behind = matrix(case, advanced(case, state, -nudge), stiff)[0]
    A = np.empty((n + 1, n + 1))
    A[:n, :n] = H[free, free]
    A[:n, n] = (ahead - behind)[free] / (2.0 * NUDGE)
    A[n, :n], A[n, n] = row[:-1][free], row[-1]
    b = np.append(np.zeros(n) if still else -g[free], along)
    found = np.linalg.solve(A, b)
    change = np.zeros(len(row))
    change[:-1][free], change[-1] = found[:n], found[n]
    return change


def tangent(case: Case, state: State, row: Array, weights: Array) -> Array:
    """Return where the branch goes: of length one, its product with `row` positive."""
    change = bordered(case, state, row, 1.0, STIFF, still=True)
    return np.asarray(change / np.sqrt(weights @ change**2))


def further(
    case: Case, start: State, towards: Array, weights: Array, arc: float
) -> State | None:
    """Return the state an arc further on the branch, on the same contacts; or None.

    A contact may let go, and none is added: see `beside`.
    """
    state = advanced(case, start, arc * towards)
    row = weights * towards
    short, stiff, before = 0.0, STIFF, math.inf
    for _ in range(ROUNDS):
        for _ in range(NEWTON):
            change = bordered(case, state, row, short, stiff)
            size = np.abs(change).max()
            if not size < FAR or state.rod.s[1] + change[-1] <= 0.0:
                return None
            state = advanced(case, state, change)
            short -= float(row @ change)
            if size < SMALL:
                break
        else:
            return None
        worst, changed, _ = exchanged(
            state.rod, case.walls, case.half, state.u, state.touches, stiff, state.held,
            False,
        )  # fmt: skip
        if changed == 0 and worst < GAP:
            return state
        if worst > 0.1 * before:
            stiff = min(RIGID, 10.0 * stiff)
        before = worst
    return None


def beside(case: Case, state: State) -> tuple[float, State]:
    """Return how deep the rod is behind a wall, and the state with contacts there."""
    new = own(state)
    _, _, deepest = exchanged(
        new.rod, case.walls, case.half, new.u, new.touches, STIFF, new.held, True
    )
    return float(deepest), new


def index_of(case: Case, state: State) -> int:
    """Return in how many directions the energy falls: 0 if the rod would stay."""
    free = free_of(state)
    H = matrix(case, state, RIGID)[1][free, free]
    return int((np.linalg.eigvalsh(H) < 0.0).sum())


def meshed(case: Case, state: State, towards: Array) -> tuple[State, Array]:
    """Return the state and its way on elements of about equal size."""
    s = state.rod.s
    if not case.feeds or SHORT < s[1] * (len(s) - 2) / (s[-1] - s[1]) < LONG:
        return state, towards
    rod = case.rod(state.insertion_mm)

    def carried(old: State) -> Array:
        on = moved(case, rod, (old.insertion_mm - state.insertion_mm) / case.length_mm)
        at = thirds(on)
        angles = trace(old.rod, old.u, at.ravel())[2].reshape(at.shape)
        return unknowns(on, angles)

    new = own(state)
    new.rod, new.u = rod, carried(state)
    ahead, behind = (
        carried(advanced(case, state, way * towards)) for way in (1e-4, -1e-4)
    )
    return new, np.append((ahead - behind) / 2e-4, towards[-1])
