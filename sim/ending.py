"""Why a rod has no equilibrium, or another than the straight one: the certificate."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .magnet.flux import distance_at
from .planar.march import M
from .planar.near import settle
from .planar.outcomes import OK_UNSTABLE
from .planar.solver import ORDER, STEP, solve_planar
from .scaling import stations
from .solution import Ending

Array = NDArray[np.float64]
Case = tuple[Array, Array, float, float]

BEFORE = 1e-6
"""How much below its last load, relatively, a rod is looked at."""
TILT = 1e-3
"""Turn of the clamp, in rad, that makes a symmetric rod choose its side."""


def ending(case: Case, load: float, length_mm: float) -> Ending | None:
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
    shapes = []
    s = stations(241)
    for below in (BEFORE, 1e-3):
        part = rod.copy()
        part[:, M:] *= load * (1.0 - below)
        outcome, *_, table, _ = solve_planar(part, field, clamp, margin, s, ORDER, STEP)
        if outcome > OK_UNSTABLE:
            return None
        shapes.append(table)
    last, earlier = shapes
    apart = np.array([distance_at(field, x, y, 0.0) for x, y in last[:2].T])
    nearest = int(np.argmin(apart))
    touches = bool(apart[nearest] <= margin + 2e-3)
    way = last[:2] - earlier[:2]
    size = float(np.max(np.hypot(*way)))
    turning = way[:, -1] / size if size > 0.0 else way[:, -1]
    at = nearest if touches else -1
    return Ending(
        kind="contact" if touches else "fold",
        load=load,
        s_mm=float(s[at]) * length_mm,
        place_mm=(float(last[0, at]) * length_mm, float(last[1, at]) * length_mm),
        turning=(float(turning[0]), float(turning[1])),
    )


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
