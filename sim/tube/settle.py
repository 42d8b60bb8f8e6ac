"""The rod comes to rest in its tube: Newton on an augmented Lagrangian.

The method is that of the plane (`navigate.settle`): Newton's matrix is exact, so that
its Cholesky factor exists if and only if the state is a minimum; where it does not
exist bending is added until it does, and at a saddle the way down is found by inverse
iteration. A trace of bending is always there: a rod that may turn about the axis of a
straight tube at no cost is at rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..magnet.flux import UNIFORM, flux_at
from .linear import FIRST, add_dyads, add_points, factor, solve
from .rod import STEP, Rod, Turn, own_energy, turned, within_magnet
from .slopes import assemble, places, press
from .touch import (
    FLAT,
    FLOATS,
    Seen,
    Touches,
    exchange,
    seen_of,
    sort_kinds,
    survey,
)
from .wall import Bore

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

SETTLED, RESTLESS, JAMMED, PULLED = range(4)
"""Outcomes: at rest; no convergence; no room left; pulled onto a magnet."""
RESTED, STUCK, BLIND = range(3)
"""Ends of Newton's steps: at rest; no way down, as where a contact that floats comes to
a joint, on whose sides the rod bends differently; behind a wall without a contact."""
SOFT, HARD = 1e6, 1e8
"""Stiffness of the walls at first and at last: it decides how fast the gaps close, not
how far."""
GAP, LOOSE = 3e-10, 1e-8
"""Gaps closed to this count as closed, in lengths of the rod; and those of contacts so
close that they share their force only slowly."""
TOO_DEEP = 3e-4
"""A state with a point deeper than this behind the wall is none."""
STEPS, ROUNDS = 60, 40
"""Newton's steps for one set of contacts; changes of the set."""
PATIENCE, FROZEN = 6, 20
"""Rounds after which contacts stay and none is dropped; and after which none is added:
the set cannot cycle."""
LONGEST = 0.4
"""Most that a rotation may change in one step, in rad."""
SMALL, CALM = 1e-11, 1e-7
"""Newton's steps after which it is at rest, and below which the energy tells nothing.
"""
PAIR = 0.03
"""Where Newton is stuck two contacts, so far on either side, stay for one that floats,
in elements."""
WILD = 1e-3
"""Steps beyond this are looked at: they must not pass a wall."""
BOLD = 1e-4
"""Steps beyond this are worth a second one back to the wall."""
TRACE, EASE = 1e-9, 1e-3
"""Part of bending that is always added; and most that is added while moments are out of
balance, so that what costs nothing, as a turn about the axis of a straight tube, does
not outrun the rest."""


@dataclass(slots=True)
class Scene:
    """A rod in a tube and a field; where the feet on the centre curve begin."""

    rod: Rod
    field: Array
    tube: Bore
    half: float
    start: float

    @property
    def room(self) -> float:
        """How far a rod on the centre curve is from the wall, where it is narrowest."""
        return max(float(np.min(self.tube.spans[:, 3, 0])) - self.half, 1e-4)


@dataclass(slots=True)
class Rest:
    """How a rod came to rest.

    Parameters
    ----------
    outcome : int
        `SETTLED` and so on.
    stable : bool
        Whether it is a minimum.
    turn, touches, seen : Turn, Touches, Seen
        The state.
    energy : float
        Without walls.
    overlap : float
        How deep any place is behind the wall.
    residual : float
        Largest moment that is not balanced.
    load : ndarray, shape (3,)
        All loads beyond the clamp, but the root's pole.
    """

    outcome: int
    stable: bool
    turn: Turn
    touches: Touches
    seen: Seen
    energy: float
    overlap: float
    residual: float
    load: Array


class _Look:
    """The rod at one rotation: places, contacts, augmented energy."""

    def __init__(self, scene: Scene, turn: Turn, touches: Touches, stiff: float):
        self.X = np.empty((len(scene.rod.s), 3))
        self.turn = turn
        self.energy = own_energy(scene.rod, scene.field, turn, self.X)
        self.seen = seen_of(scene.rod, turn, self.X, scene.tube, scene.half, touches)
        self.force = np.maximum(0.0, touches.force - stiff * self.seen.gap)
        walls = self.force @ self.force - touches.force @ touches.force
        self.total = self.energy + 0.5 * walls / stiff


def settle(scene: Scene, turn: Turn, touches: Touches, soft: float) -> Rest:
    """Bring the rod to rest from a rotation and contacts (which it changes).

    Parameters
    ----------
    soft : float
        Stiffness of the walls to begin with.
    """
    stiff, stuck, before, deepest = soft, 0, 1e9, 0.0
    outcome = RESTLESS
    h = scene.rod.s[-1] / len(scene.rod.m)
    look = _Look(scene, turn, touches, stiff)
    exchange(scene.rod, turn, look.X, scene.tube, scene.half, touches, scene.start)
    for k in range(ROUNDS):
        seen = seen_of(scene.rod, turn, look.X, scene.tube, scene.half, touches)
        sort_kinds(scene.rod, seen, touches, free=k < PATIENCE, float_too=not stuck)
        end, stable, look = _newton(scene, turn, touches, stiff)
        turn = look.turn
        if not is_uniform_field(scene.field) and within_magnet(scene.field, look.X):
            outcome = PULLED
            break
        worst = float(np.max(abs(look.force - touches.force), initial=0.0)) / stiff
        touches.force = look.force
        changed = 0
        if worst < 1e-3 or end != RESTED:
            changed = _strayed(touches, look.seen)
            if k < PATIENCE:
                kept = (touches.force > 0.0) | (look.seen.gap < GAP)
                touches = touches.kept(kept)
            added, deepest = exchange(
                scene.rod, turn, look.X, scene.tube, scene.half, touches, scene.start
            )
            changed = changed + added if k < FROZEN else 0
        if end == RESTED and not changed and worst < (GAP if k < FROZEN else LOOSE):
            outcome = SETTLED if deepest < TOO_DEEP else JAMMED
            break
        if end == STUCK:
            stuck += 1
            touches = touches.paired(PAIR * h)
        if k > 8 and worst > 1e-4:
            outcome = JAMMED
        if soft >= SOFT and (stuck > 6 or (outcome == JAMMED and k > 14)):
            break
        if worst > 0.1 * before:
            stiff = min(HARD, 10.0 * stiff)
        before = worst
    look = _Look(scene, turn, touches, HARD)
    look.force = touches.force
    gradient, load = _slopes(scene, look, touches, 0.0)[::3]
    return Rest(
        outcome, stable, turn, touches, look.seen, look.energy, deepest,
        float(np.max(np.abs(gradient[FIRST:]))), load,
    )  # fmt: skip


def is_uniform_field(field: Array) -> bool:
    """Tell whether a field is the same everywhere."""
    return bool(field[0] == UNIFORM)


def _strayed(touches: Touches, seen: Seen) -> int:
    """Return how many floating contacts are as far from home as they may be."""
    floats = (touches.kind == FLOATS) & (touches.force > 0.0)
    return int(np.sum(floats & _held(touches)))


def _held(touches: Touches) -> NDArray[np.bool_]:
    """Tell which contacts are as far from home as they may be."""
    return np.asarray(abs(touches.s - touches.home) > 0.999 * touches.room)


def _points(scene: Scene, look: _Look) -> tuple[Ints, Array, Array]:
    """Return node, pull and its derivative of each pole."""
    rod = scene.rod
    at = np.flatnonzero(rod.pole)
    flux = np.zeros((len(at), 12))
    for b, x in zip(flux, look.X[at], strict=True):
        flux_at(scene.field, *x, b)
    pole = rod.pole[at]
    return (
        at,
        pole[:, None] * flux[:, :3],
        pole[:, None, None] * flux[:, 3:].reshape(-1, 3, 3),
    )


def _slopes(
    scene: Scene, look: _Look, touches: Touches, stiff: float
) -> tuple[Array, Array, Array, Array]:
    """Return gradient, Hessian (lower triangle), bending's diagonal, all loads."""
    rod, seen = scene.rod, look.seen
    n = len(rod.m)
    size = STEP * n + 3
    at, pull, steep = _points(scene, look)
    in_use = np.flatnonzero(look.force > 0.0)
    force, grad, hess = look.force[in_use], seen.grad[in_use], seen.hess[in_use]
    push = force[:, None] * grad
    beyond = np.zeros((n + 1, 3))
    np.add.at(beyond, at, pull)
    np.add.at(beyond, seen.element[in_use], push)
    loads = np.cumsum(beyond[::-1], axis=0)[::-1][1:].copy()
    g, H, K = np.empty(size), np.empty((size, size)), np.empty(size)
    assemble(rod, look.turn, loads, g, H, K)
    press(rod, look.turn, seen.element[in_use], seen.xi[in_use], push, g, H)
    element = np.concatenate([seen.element[in_use], at - 1])
    xi = np.concatenate([seen.xi[in_use], np.ones(len(at))])
    if not len(in_use) and not np.any(steep):
        return g, H, K, loads[0] + beyond[0] + rod.beyond[0]
    A, B = np.empty((2, len(element), 3, size))
    places(rod, look.turn, element, xi, A, B)
    m = len(in_use)
    weight = np.empty((len(element), 3, 3))
    weight[:m] = stiff * grad[:, :, None] * grad[:, None, :] - (
        force[:, None, None] * hess
    )
    weight[m:] = -steep
    width = STEP * (element + 1) + 3
    add_points(H, A, weight, width)
    slides = np.flatnonzero((touches.kind == FLOATS)[in_use] & ~_held(touches)[in_use])
    if len(slides):
        turns = np.einsum("ki,kij->kj", seen.t[in_use][slides], hess[slides])
        rows = (turns[:, :, None] * A[slides]).sum(axis=1)
        rows += (grad[slides, :, None] * B[slides]).sum(axis=1)
        second = np.maximum(seen.second[in_use][slides], FLAT)
        add_dyads(H, rows, force[slides] / second, width[slides])
    return g, H, K, loads[0] + beyond[0] + rod.beyond[0]


def _softest(L: Array, size: int) -> Array:
    """Return the softest way out of a saddle, of size 1e-3 rad."""
    d: Array = np.sin(1.7 * np.arange(size)) + 0.3
    for _ in range(8):
        solve(L, d)
        d *= 1e-3 / np.max(np.abs(d))
    return d


def _newton(
    scene: Scene, turn: Turn, touches: Touches, stiff: float
) -> tuple[int, bool, _Look]:
    """Minimise the augmented energy; return how it ended, whether stable, the rod."""
    look = _Look(scene, turn, touches, stiff)
    kicked = False
    shift = 0.0
    for _ in range(STEPS):
        g, H, K, _ = _slopes(scene, look, touches, stiff)
        uneven = float(np.max(np.abs(g[FIRST:])))
        trace = TRACE + min(EASE, 0.05 * uneven)
        shift = factor(H, K, trace, L := np.empty_like(H))
        solve(L, d := -g)
        size = float(np.max(np.abs(d)))
        if not math.isfinite(size):
            return STUCK, False, look
        if size < SMALL and (shift == 0.0 or kicked):
            return RESTED, shift == 0.0, look
        if size < CALM and shift > 0.0 and not kicked:
            d, kicked = _softest(L, len(g)), True
            look = _Look(scene, _by(look.turn, d), touches, stiff)
            continue
        found = _down(scene, look, touches, stiff, d, g, L)
        if found is None:
            return RESTED if size < CALM else STUCK, shift == 0.0, look
        look = found
        if shift == 0.0 and size < CALM:
            return RESTED, True, look
        if size > WILD and _behind(scene, look) > 0.1 * scene.room:
            return BLIND, False, look
    return STUCK, False, look


def _strays(scene: Scene, old: _Look, new: _Look) -> bool:
    """Tell whether a step is so long that it could pass a wall unseen."""
    return float(np.max(np.abs(new.X - old.X))) > scene.room


def _behind(scene: Scene, look: _Look) -> float:
    """Return how deep the rod is behind the wall, contacts or not."""
    seen = survey(
        scene.rod, look.turn, look.X, scene.tube, scene.half, scene.start
    )  # fmt: skip
    return -float(np.min(seen[1]))


def _by(turn: Turn, d: Array) -> Turn:
    out = Turn(*(np.empty_like(part) for part in turn))
    turned(turn, d, out)
    return out


def _down(
    scene: Scene, look: _Look, touches: Touches, stiff: float, d: Array, g: Array,
    L: Array,
) -> _Look | None:  # fmt: skip
    """Return the rod a step further down, or None where there is none.

    A straight step along a round wall goes into it: if that costs more than the step
    gains, a second one with the same factor brings the rod back to the wall.
    """
    size = float(np.max(np.abs(d)))
    share = min(1.0, LONGEST / size)
    slope = float(g @ d)
    before = touches.s.copy(), touches.p.copy()
    noise = 1e-13 * (1.0 + abs(look.total))
    for _ in range(30):
        enough = look.total + 1e-4 * share * slope + noise
        new = _Look(scene, _by(look.turn, share * d), touches, stiff)
        if size < CALM:
            return new
        wild = share * size > WILD and _strays(scene, look, new)
        if new.total <= enough and not wild:
            return new
        if share * size > BOLD and not wild:
            solve(L, back := (1.0 - share) * g - _slopes(scene, new, touches, stiff)[0])
            new = _Look(scene, _by(new.turn, back), touches, stiff)
            if new.total <= enough and not _strays(scene, look, new):
                return new
        touches.s, touches.p = (old.copy() for old in before)
        share *= 0.5
    return None
