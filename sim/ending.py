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

TILT = 1e-3
"""Turn of the clamp, in rad, that makes a symmetric rod choose its side."""


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
    back.
    """
    rod, field, clamp, margin = case
    tips = []
    for tilt in (TILT, -TILT):
        turned = solve_planar(
            rod, field, clamp + tilt, margin, stations(2), ORDER, STEP
        )
        if turned[0] > OK_UNSTABLE:
            continue
        u, out = turned[-1], np.empty((4, 2))
        index = settle(rod, field, clamp, margin, stations(2), ORDER, STEP, u, out)
        if index == 0 and math.isfinite(out[0, -1]):
            tips.append((float(out[0, -1]) * length_mm, float(out[1, -1]) * length_mm))
    return tuple(tips)
