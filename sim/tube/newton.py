"""Newton's steps of a rod in a tube, for one set of contacts.

Newton's matrix is exact, so that its Cholesky factor exists if and only if the state is
a minimum; where it does not exist bending is added until it does, and at a saddle the
way down is found by inverse iteration. A trace of bending is always there: a rod that
may turn about the axis of a straight tube at no cost is at rest.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .linear import FIRST, factor, solve
from .look import Look, Round, Scene, slopes_of
from .rod import Turn, turned
from .touch import survey

Array = NDArray[np.float64]

STEPS = 60
"""For one set of contacts."""
RESTED, STUCK, BLIND = range(3)
"""Ends of Newton's steps: at rest; no way down, as where a contact that floats comes to
a joint, on whose sides the rod bends differently; behind a wall without a contact."""
LONGEST = 0.4
"""Most that a rotation may change in one step, in rad."""
SMALL, CALM = 1e-11, 1e-7
"""Newton's steps after which it is at rest, and below which the energy tells nothing.
"""
WILD = 1e-3
"""Steps beyond this are looked at: they must not pass a wall."""
BOLD, ARCS = 1e-4, 2
"""Steps beyond this are worth a second one back to the wall; and so many tries."""
TRACE, EASE = 1e-9, 1e-3
"""Part of bending that is always added; and most that is added while moments are out of
balance, so that what costs nothing, as a turn about the axis of a straight tube, does
not outrun the rest."""


def _softest(L: Array, size: int) -> Array:
    """Return the softest way out of a saddle, of size 1e-3 rad."""
    d: Array = np.sin(1.7 * np.arange(size)) + 0.3
    for _ in range(8):
        solve(L, d)
        d *= 1e-3 / np.max(np.abs(d))
    return d


def newton(scene: Scene, turn: Turn, now: Round) -> tuple[int, bool, Look]:
    """Minimise the augmented energy; return how it ended, whether stable, the rod."""
    look = Look(scene, turn, now)
    kicked = False
    shift = 0.0
    for _ in range(STEPS):
        at = slopes_of(scene, look, now)
        uneven = float(np.max(np.abs(at.g[FIRST:])))
        trace = TRACE + min(EASE, 0.05 * uneven)
        shift = factor(at.H, at.K, trace, L := np.empty_like(at.H))
        solve(L, d := -at.g)
        size = float(np.max(np.abs(d)))
        if not math.isfinite(size):
            return STUCK, False, look
        if size < SMALL and (shift == 0.0 or kicked):
            return RESTED, shift == 0.0, look
        if size < CALM and shift > 0.0 and not kicked:
            d, kicked = _softest(L, len(d)), True
            look = Look(scene, _by(look.turn, d), now)
            continue
        found = _down(scene, look, now, d, at.g, L)
        if found is None:
            return RESTED if size < CALM else STUCK, shift == 0.0, look
        look = found
        if shift == 0.0 and size < CALM:
            return RESTED, True, look
        if size > WILD and _behind(scene, look) > 0.1 * scene.narrow:
            return BLIND, False, look
    return STUCK, False, look


def _strays(scene: Scene, old: Look, new: Look) -> bool:
    """Tell whether a step is so long that it could pass a wall unseen."""
    return float(np.max(np.abs(new.X - old.X))) > scene.narrow


def _behind(scene: Scene, look: Look) -> float:
    """Return how deep the rod is behind the wall, contacts or not."""
    seen = survey(scene.rod, look.turn, look.X, scene.tube, scene.half, scene.start)
    return -float(np.min(seen[1]))


def _by(turn: Turn, d: Array) -> Turn:
    out = Turn(*(np.empty_like(part) for part in turn))
    turned(turn, d, out)
    return out


def _down(
    scene: Scene, look: Look, now: Round, d: Array, g: Array, L: Array
) -> Look | None:
    """Return the rod a step further down, or None where there is none.

    A straight step along a round wall goes into it: if that costs more than the step
    gains, a second one with the same factor brings the rod back to the wall.
    """
    size = float(np.max(np.abs(d)))
    share = min(1.0, LONGEST / size)
    slope = float(g @ d)
    touches = now.touches
    before = touches.s.copy(), touches.p.copy()
    noise = 1e-13 * (1.0 + abs(look.total))
    for tries in range(30):
        enough = look.total + 1e-4 * share * slope + noise
        new = Look(scene, _by(look.turn, share * d), now)
        if size < CALM:
            return new
        wild = share * size > WILD and _strays(scene, look, new)
        if new.total <= enough and not wild:
            return new
        if tries < ARCS and share * size > BOLD and not wild:
            solve(L, back := (1.0 - share) * g - slopes_of(scene, new, now).g)
            new = Look(scene, _by(new.turn, back), now)
            if new.total <= enough and not _strays(scene, look, new):
                return new
        touches.s, touches.p = (old.copy() for old in before)
        share *= 0.5
    return None
