"""One clamp for a whole run: its direction from all photographs together.

While a run is recorded the clamp may be carried along, by the stage, but it does not
turn. Each photograph reads its direction; the reading hangs on a few millimetres of rod
beside the clamp, is worst where the rod is bent there, and shade and light pull the
readings of one run alike. So the surest photographs count most, and the deviation of
what they say together does not shrink as one over the root of their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ALIKE = 0.5
"""Share of the variance of a direction that the photographs of a run have in common: of
28 runs of `benchmarks/bench_shared_clamp.py` together; in most of them it is more."""
OUTLIER = 2.5
"""Readings farther off, in stated deviations, pull no harder for it."""
DISAGREE = 3.0
"""Scatter over stated deviations beyond which the readings are not of one direction."""
STEP = 4.0
"""Standard deviations of a turn, or of a step aside, that is named."""
PLACE_PX = 0.2
"""Standard deviation of a clamp's place from one photograph to another."""
TRAVEL_PX = 10.0
"""A clamp that goes farther is carried by a stage: along a straight line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """The clamp as one photograph sees it.

    Parameters
    ----------
    x_mm, y_mm : float
        Its place in the board frame.
    angle_deg, sd_deg : float
        Its direction in the board frame, and the standard deviation.
    mm_per_px : float
        The scale of the photograph.
    """

    x_mm: float
    y_mm: float
    angle_deg: float
    sd_deg: float
    mm_per_px: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """The direction of one clamp in the board frame, with its standard deviation."""

    angle_deg: float
    sd_deg: float


def shared_direction(readings: Sequence[Reading]) -> Direction | None:
    """Return the direction that all photographs of one clamp give together.

    Parameters
    ----------
    readings : sequence of Reading
        Two or more, in the order in which they were taken.

    Returns
    -------
    Direction or None
        None if their places or directions disagree: the clamp has moved.

    Notes
    -----
    The best linear unbiased estimate of one value of which reading i has the covariance
    C_ij = s_i s_j (a + (1 - a) [i = j]), a = `ALIKE`, without the negative weights that
    would extrapolate to a rod that is not bent. Its variance w.C w is multiplied by the
    Birge ratio where that is above one.
    """
    stated = np.array([reading.sd_deg for reading in readings])
    surest = readings[int(np.argmin(stated))].angle_deg
    turn = np.array([reading.angle_deg - surest for reading in readings])
    turn = (turn + 180.0) % 360.0 - 180.0
    middle, sd = _without_outliers(turn, stated)
    pulls = np.clip((turn - middle) / stated, -OUTLIER, OUTLIER)
    scatter = _birge(pulls, len(turn) - 1, ALIKE)
    if scatter > DISAGREE or _turned(turn, sd) or _displaced(readings):
        return None
    return Direction(
        angle_deg=(surest + middle + 180.0) % 360.0 - 180.0,
        sd_deg=scatter * float(np.sqrt(_variance(_weights(sd), sd))),
    )


def _without_outliers(turn: Array, stated: Array) -> tuple[float, Array]:
    """Return the estimate, and deviations that are wider for what lies far off it.

    Huber's weights, from the weighted median on.
    """
    order = np.argsort(turn)
    share = np.cumsum(1.0 / stated[order])
    middle = float(turn[order][np.searchsorted(share, 0.5 * share[-1])])
    sd = stated
    for _ in range(20):
        off = np.abs(turn - middle) / (OUTLIER * stated)
        sd = stated * np.sqrt(np.maximum(off, 1.0))
        middle = float(_weights(sd) @ turn)
    return middle, sd


def _weights(sd: Array) -> Array:
    """Return the weights of the best estimate, none of them negative.

    The surest readings are taken as long as the next one still adds to them.
    """
    order = np.argsort(sd, kind="stable")
    inverse = 1.0 / sd[order]
    count = np.arange(1, len(sd) + 1)
    alike = ALIKE * np.cumsum(inverse) / (1.0 - ALIKE + ALIKE * count)
    adds = np.logical_and.accumulate(inverse > alike)
    weights = np.zeros(len(sd))
    weights[order[adds]] = inverse[adds] * (inverse[adds] - alike[adds][-1])
    return np.asarray(weights / weights.sum())


def _variance(weights: Array, sd: Array) -> float:
    parts = weights * sd
    return float(ALIKE * parts.sum() ** 2 + (1.0 - ALIKE) * np.sum(parts**2))


def _turned(turn: Array, sd: Array) -> bool:
    """Whether the directions before some photograph and after it differ.

    Errors in common cancel here where they are equal; no less is relied on, and all
    are taken for independent.
    """
    for first in range(1, len(turn)):
        before, after = _weights(sd[:first]), _weights(sd[first:])
        contrast = np.concatenate([-before, after])
        sides = [before @ turn[:first], after @ turn[first:]]
        means = np.repeat(sides, [first, len(turn) - first])
        scatter = _birge((turn - means) / sd, len(turn) - 2)
        if abs(contrast @ turn) > STEP * scatter * np.hypot.reduce(contrast * sd):
            return True
    return False


def _birge(pulls: Array, freedom: int, alike: float = 0.0) -> float:
    """Return the factor by which pulls scatter more than stated, at least one.

    The root of the reduced chi-square r.C^-1 r, C as for `shared_direction`.
    """
    common = alike * pulls.sum() ** 2 / (1.0 - alike + alike * len(pulls))
    chi2 = (pulls @ pulls - common) / (1.0 - alike)
    return max(1.0, float(np.sqrt(chi2 / max(freedom, 1))))


def _displaced(readings: Sequence[Reading]) -> bool:
    """Whether some place lies off the others, or off the line that a stage follows."""
    xy = np.array([[reading.x_mm, reading.y_mm] for reading in readings])
    pixel = max(reading.mm_per_px for reading in readings)
    off = xy - xy.mean(axis=0)
    _, _, axes = np.linalg.svd(off, full_matrices=False)
    along = off @ axes[0]
    if np.ptp(along) > TRAVEL_PX * pixel:
        off = off - np.outer(along, axes[0])
    return bool(np.hypot(*off.T).max() > STEP * PLACE_PX * pixel)
