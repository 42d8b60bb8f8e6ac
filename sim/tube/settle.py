"""The rod comes to rest in its tube: Newton on an augmented Lagrangian.

The method is that of the plane (`navigate.settle`): rounds of Newton's steps. After
each the walls' forces are taken over, and the set of contacts is looked over.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .linear import FIRST
from .look import Look, Round, Scene, held, slopes_of
from .newton import BLIND, RESTED, STUCK, newton
from .rod import Turn, within_magnet
from .rub import Rubs, no_rubs, rubs_of
from .touch import FLOATS, Seen, Touches, exchange, seen_of, sort_kinds

Array = NDArray[np.float64]

SETTLED, RESTLESS, JAMMED, PULLED = range(4)
"""Outcomes: at rest; no convergence; no room left; pulled onto a magnet."""
SOFT, HARD = 1e6, 1e8
"""Stiffness of the walls at first and at last: it decides how fast the gaps close, not
how far."""
GAP, LOOSE = 3e-10, 1e-8
"""Gaps closed to this count as closed, in lengths of the rod; and those of contacts so
close that they share their force only slowly."""
TOO_DEEP = 3e-4
"""A state with a point deeper than this behind the wall is none."""
ROUNDS = 40
"""Newton's steps for one set of contacts; changes of the set."""
PATIENCE, FROZEN = 6, 20
"""Rounds after which contacts stay and none is dropped; and after which none is added:
the set cannot cycle."""
PAIR = 0.03
"""Where Newton is stuck two contacts, so far on either side, stay for one that floats,
in elements."""


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
    rubbed : float
        Work of friction since the step before.
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
    rubbed: float


def settle(scene: Scene, turn: Turn, touches: Touches, soft: float) -> Rest:
    """Bring the rod to rest from a rotation and contacts (which it changes).

    Parameters
    ----------
    soft : float
        Stiffness of the walls to begin with.
    """
    stiff, stuck, before, deepest = soft, 0, 1e9, 0.0
    outcome = RESTLESS
    now = Round(touches, stiff, no_rubs())
    look = Look(scene, turn, now)
    _exchange(scene, look, touches)
    k = 0
    for _ in range(3 * ROUNDS):
        if k == ROUNDS:
            break
        seen = _seen(scene, look, touches)
        sort_kinds(scene.rod, seen, touches, free=k < PATIENCE, float_too=not stuck)
        now = Round(touches, stiff, _rubs(scene, touches, seen))
        end, stable, look = newton(scene, look.turn, now)
        if not scene.is_uniform and within_magnet(scene.field, look.X):
            outcome = PULLED
            break
        if end == BLIND:
            deepest = _exchange(scene, look, touches)[1]
            continue
        worst = float(np.max(abs(look.force - touches.force), initial=0.0)) / stiff
        touches.force = look.force
        changed = 0
        if worst < 1e-3 or end != RESTED:
            touches, changed, deepest = _looked_over(scene, look, touches, k)
        if end == RESTED and not changed and worst < (GAP if k < FROZEN else LOOSE):
            outcome = SETTLED if deepest < TOO_DEEP else JAMMED
            break
        if end == STUCK:
            stuck += 1
            touches = touches.paired(PAIR * scene.rod.s[-1] / len(scene.rod.m))
        if k > 8 and worst > 1e-4:
            outcome = JAMMED
        if soft >= SOFT and (stuck > 6 or (outcome == JAMMED and k > 14)):
            break
        if worst > 0.1 * before:
            stiff = min(HARD, 10.0 * stiff)
        before = worst
        k += 1
    rest = _rest(scene, look, touches, now, deepest)
    rest.outcome, rest.stable = outcome, stable
    return rest


def _looked_over(
    scene: Scene, look: Look, touches: Touches, k: int
) -> tuple[Touches, int, float]:
    """Return the contacts after a round, how many are to change, the overlap."""
    changed = _strayed(touches)
    if k < PATIENCE:
        touches = touches.kept((touches.force > 0.0) | (look.seen.gap < GAP))
    added, deepest = _exchange(scene, look, touches)
    return touches, changed + added if k < FROZEN else 0, deepest


def _rest(
    scene: Scene, look: Look, touches: Touches, now: Round, deepest: float
) -> Rest:
    """Return the state with the forces that were found, and how well they balance."""
    seen = _seen(scene, look, touches)
    last = Look(scene, look.turn, replace(now, touches=touches, stiff=HARD))
    last.force = touches.force
    at = slopes_of(scene, last, replace(now, touches=touches, stiff=0.0))
    return Rest(
        outcome=RESTLESS,
        stable=False,
        turn=look.turn,
        touches=touches,
        seen=seen,
        energy=look.energy,
        overlap=deepest,
        residual=float(np.max(np.abs(at.g[FIRST:]))),
        load=at.load,
        rubbed=now.rubs.work(last.slip),
    )


def _rubs(scene: Scene, touches: Touches, seen: Seen) -> Rubs:
    """Return where the rod rubs, if it does."""
    if scene.past is None or not scene.friction:
        return no_rubs()
    return rubs_of(scene.past, scene.friction, scene.rod, touches, seen)


def _seen(scene: Scene, look: Look, touches: Touches) -> Seen:
    """Return the contacts as they are now."""
    return seen_of(scene.rod, look.turn, look.X, scene.tube, scene.half, touches)


def _exchange(scene: Scene, look: Look, touches: Touches) -> tuple[int, float]:
    """Add contacts where the rod is behind the wall; see `touch.exchange`."""
    return exchange(
        scene.rod, look.turn, look.X, scene.tube, scene.half, touches, scene.start
    )


def _strayed(touches: Touches) -> int:
    """Return how many floating contacts are as far from home as they may be."""
    return int(np.sum((touches.kind == FLOATS) & (touches.force > 0.0) & held(touches)))
