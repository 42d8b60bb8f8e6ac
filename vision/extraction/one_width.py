"""Whether a rod is as wide all along, as rods are, or has some shade measured with it.

A shade is the rod once more, shifted by one vector v. Where rod and shade are equally
dark, what is measured is both, and w + |v . n| wide where the rod's normal is n: it
widens as the rod turns away from the vector. A taper widens evenly along the rod.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..curve.curve import arc_lengths
from ..curve.robust import quantile
from ..measurement import Measurement
from .setting import Setting

Array = NDArray[np.float64]

UNEVEN = 0.12
"""How much a width may vary along a rod, over itself: prints and moulds do by less."""

_TAPER = 0.9
"""Part of the variance that a taper explains, at least."""

_CLEAR = 1.0
"""So near to its ends a rod's edges feel the clamp, and the corners of the tip; widths.
"""

_LEAST = 20
"""Fewest points that tell."""


def is_uneven(result: Measurement, setting: Setting) -> bool:
    """Whether a rod's width varies along it as no taper does.

    Seen aslant, as at the border of a near picture, a flat rod and a round one widen
    by different parts as they turn: one of untold section is even if either is.
    """
    points, camera = result.points, setting.calibration
    axis = np.column_stack([points["x_px"], points["y_px"]])
    s, typical = arc_lengths(axis), result.width_px
    use = (points["good"] > 0.5) & np.isfinite(points["width_px"])
    use &= (s > _CLEAR * typical) & (s < s[-1] - _CLEAR * typical)
    if use.sum() < _LEAST:
        return False
    width = points["width_px" if camera is None else "width_mm"]
    s, theta = s[use], points["theta_rad"][use]
    if not _varies(width[use], s, theta):
        return False
    if camera is None or setting.is_round is not None:
        return True
    x, y = np.gradient(axis, axis=0).T
    view = setting.view(camera, axis, np.arctan2(y, x))
    as_round = points["width_px"] / replace(setting, is_round=True).silhouette(view)
    return _varies(as_round[use], s, theta)


def _varies(width: Array, s: Array, theta: Array) -> bool:
    """Whether a width varies by more than it may, and as no taper does."""
    low, middle, high = (quantile(width, part) for part in (0.05, 0.5, 0.95))
    if high - low < UNEVEN * middle:
        return False
    taper = _explained(width, s)
    return taper < max(_TAPER, *(_explained(width, wider) for wider in _both(theta)))


def _both(theta: Array) -> Array:
    """Return by how much rod and shade together are wider, (k, n), for k directions."""
    towards = np.arange(0.0, np.pi, np.pi / 36.0)
    return np.asarray(np.abs(np.sin(theta - towards[:, None])))


def _explained(width: Array, by: Array) -> float:
    """Return the part of a width's variance that a line in something explains."""
    if np.ptp(by) < 1e-9:
        return 0.0
    return float(np.corrcoef(width, by)[0, 1] ** 2)
