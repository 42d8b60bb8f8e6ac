"""The whole length of a clamp's front: the farther it is seen, the surer its direction.

Beside a thin rod two widths of a front are a few px, on which grain, a knot of wood or
a shade turn a line by degrees. But a front goes on straight as far as the clamp is
wide, and a direction is the surer by the power 3/2 of the length.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..curve.curve import Curve
from ..curve.robust import median
from .crossings import Crossed, EndFace, crossings_of, line_through
from .lanes import sample_lanes
from .step_line import STEP_PX

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_WIDTHS, _MOST_PX, _LANES = 8.0, 100.0, 16
"""How far to either side of the rod it is followed, in widths and px at most: over more
a lens may bend it; and on so many lanes."""

_ASTRAY_PX, _GONE = 1.0, 3
"""How far from the line a lane still crosses it, px; and lanes in a row that do not,
where it has ended."""

_SURE = 0.002
"""Deviation of a direction that is sure enough: no front is squarer to its rod."""

_CLEAR_PX = 3.0
"""How far clear of the rod's blur lanes begin."""

_APART = 3.0
"""Deviations by which what goes on may differ from what is seen beside the rod."""


def whole_front(
    grey: Image, curve: Curve, front: EndFace, fit: Callable[[Crossed], EndFace | None],
    *, width: float, near: float, span: float, sign: float,
) -> EndFace:  # fmt: skip
    """Return a front with the direction of all its length.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    curve : Curve
        The axis.
    front : EndFace
        The front as it is seen beside the rod.
    fit : callable
        Fits a step to lanes that cross it.
    width : float
        Width of the rod, px.
    near : float
        How far from a step light is clear of its blur, px.
    span : float
        How far to either side of the front lanes are taken, px.
    sign : float
        -1 for a light rod.
    """
    first, last = 0.5 * width + near + _CLEAR_PX, min(_WIDTHS * width, _MOST_PX)
    if front.skew_sd < _SURE or last < first + 1.5 * width:
        return front
    out = np.linspace(first, last, _LANES)
    across = np.concatenate([-out[::-1], out])
    s = np.arange(-span, span, STEP_PX)
    points, theta = curve.at(np.array([front.s]))
    heading = float(theta[0]) - math.atan(front.skew)  # at a right angle to the front
    ahead = np.array([math.cos(heading), math.sin(heading)])
    square = points + s[:, None] * ahead
    light = sample_lanes(grey, square, np.full(len(s), heading), across, sign)
    crossing = crossings_of(light, s, 0.0, near, 3.0, 4.0, 4.0)
    slopes = (crossing / across)[np.isfinite(crossing)]
    if slopes.size < _LANES // 2:
        return front
    off = np.abs(crossing - median(slopes) * across)
    left, right = np.split(off < _ASTRAY_PX + 2.0 * front.scatter, 2)
    kept = np.concatenate([_as_far(left[::-1])[::-1], _as_far(right)])
    if kept.sum() < _LANES // 2:
        return front
    line = fit(line_through(light[kept], s, across[kept], crossing[kept]))
    if line is None or line.rise <= 0.0 or not line.skew_sd < front.skew_sd:
        return front
    if abs(line.skew) > _APART * math.hypot(front.skew_sd, line.skew_sd):
        return front
    turned = math.atan(front.skew) + math.atan(line.skew)
    return front._replace(skew=math.tan(turned), skew_sd=line.skew_sd)


def _as_far(good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return lanes, from the rod outwards, as far as the line goes on."""
    lost = np.flatnonzero(np.convolve(~good, np.ones(_GONE), "valid") == _GONE)
    last = int(lost[0]) if lost.size else len(good)
    return np.asarray(good & (np.arange(len(good)) < last), np.bool_)
