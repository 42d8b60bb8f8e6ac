"""Why a rod has no equilibrium, or another than the straight one: the certificate."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .planar.ends import end_of
from .planar.march import M
from .planar.near import settle
from .planar.outcomes import OK_UNSTABLE
from .planar.solver import ORDER, STEP, solve_planar
from .scaling import stations
from .solution import Ending

Array = NDArray[np.float64]
Case = tuple[Array, Array, float, float]

TILTS = (*(1e-3 / 4.0**k for k in range(11)), 0.0)
"""Turns of the clamp, in rad, that make a symmetric rod choose its side, and back."""
STRAIGHT = 1e-9
"""Curvature, times the length, of a rod that counts as straight."""


def ending(case: Case, load: float, length_mm: float) -> Ending:
    """Return how the branch that grows from no load ends.

    Parameters
    ----------
    case : tuple
        Rod, field, clamp and margin as `solve_planar` takes them.
    load : float
        The last load it has.
    length_mm : float
        Of the rod.
    """
    rod, field, clamp, margin = case

    def shape_at(part: float) -> Array | None:
        less = rod.copy()
        less[:, M:] *= part
        outcome, *_, table, _ = solve_planar(
            less, field, clamp, margin, stations(241), ORDER, STEP
        )
        return table[:2] if outcome <= OK_UNSTABLE else None

    return end_of(shape_at, load, field, margin, length_mm)


def buckled_tips(case: Case, length_mm: float) -> tuple[tuple[float, float], ...]:
    """Return the tips of the stable shapes to which a straight unstable rod buckles.

    The clamp turned a little to either side leads to them, and they stay as it turns
    back: little by little, since near a bifurcation they change as its cube root. A
    turn too large for Newton brings the next one nearer all the same.
    """
    rod, field, clamp, margin = case
    rest = margin, stations(2), ORDER, STEP
    tips = []
    for side in (1.0, -1.0):
        turned = solve_planar(rod, field, clamp + side * TILTS[0], *rest)
        if turned[0] > OK_UNSTABLE:
            continue
        u, out = turned[-1], np.empty((4, 2))
        for tilt in TILTS[1:]:
            index = settle(rod, field, clamp + side * tilt, *rest, u, out)
        if index == 0 and math.isfinite(out[0, -1]):
            tips.append((float(out[0, -1]) * length_mm, float(out[1, -1]) * length_mm))
    return tuple(tips)
