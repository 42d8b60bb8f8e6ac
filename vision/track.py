"""From a rough curve inside the rod to a start for the edge fit.

The mask ends early where the clamp's shadow darkens the paper around the root. Profiles
across the rod still show it there, so the curve is carried on in short steps, each
centred between the edges, until there are no two edges a rod's width apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .centreline_fit import Curve, fit_curve
from .edges import rough_edges

Array = NDArray[np.float64]
Image = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """A curve within a pixel or two of the axis.

    Parameters
    ----------
    curve : Curve
        From near the clamp to near the tip.
    width : float
        Width of the rod, px.
    """

    curve: Curve
    width: float


def start_curve(
    grey: Image, points: Array, width: float, *, sign: float, follow: bool
) -> Start | None:
    """Centre a rough curve between its edges and carry it towards the clamp.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    points : ndarray, shape (n, 2)
        Rough curve inside the rod, root to tip.
    width : float
        Rough width, px, perhaps with a shadow.
    sign : float
        -1 for a light rod.
    follow : bool
        Whether to carry the curve on at the root; at the tip it always is.

    Returns
    -------
    Start or None
        None where no two edges are seen along most of the curve.
    """
    _, along, theta = _resample(points, 0.6 * width)
    normals = np.column_stack([-np.sin(theta), np.cos(theta)])
    low, high, level = rough_edges(
        grey, along, normals, reach=0.5 * width + 6.0, sign=sign
    )
    across = high - low
    found = np.isfinite(across) & (across > 1.0)
    if found.sum() < 0.5 * len(across):
        return None
    real = float(np.median(across[found]))
    good = found & (np.abs(across - real) < 0.3 * real + 1.0)
    if good.sum() < 0.5 * len(across):
        return None
    centre = along + (0.5 * (low + high))[:, None] * normals
    centres = centre[good][:: max(1, int(0.4 * real))]
    if follow:
        centres = _follow(grey, centres[2:], real, sign, level)
    centres = _follow(grey, centres[::-1], real, sign, level)[::-1]
    return Start(curve=smooth_curve(centres, spacing=2.0 * real), width=real)


def smooth_curve(points: Array, *, spacing: float) -> Curve:
    """Fit a curve to a coarse polyline, on an even grid of about 1 px."""
    s, even, theta = _resample(points, 0.25 * spacing)
    fit = fit_curve(
        s, even, np.ones(len(s)), spacing=spacing, iterations=2, theta=theta,
        stiffness=0.1 * spacing**5,
    )  # fmt: skip
    return fit.curve


def _resample(points: Array, window: float) -> tuple[Array, Array, Array]:
    """Return arc length, points and smoothed tangent angles on an even grid."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    points = points[np.concatenate([[True], steps > 1e-6])]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    s = np.linspace(0.0, along[-1], max(int(along[-1]), 16) + 1)
    even = np.column_stack([np.interp(s, along, points[:, k]) for k in (0, 1)])
    index, reach = np.arange(len(s)), max(1, int(window))
    chord = even[np.minimum(index + reach, len(s) - 1)]
    chord = chord - even[np.maximum(index - reach, 0)]
    return s, even, np.unwrap(np.arctan2(chord[:, 1], chord[:, 0]))


def _follow(
    grey: Image, centres: Array, width: float, sign: float, level: float
) -> Array:
    """Carry centres on at the root end, at most seven widths."""
    step = max(2.0, 0.25 * width)
    recent = [np.asarray(c) for c in centres[:12]]
    added: list[Array] = []
    while len(added) * step < 7.0 * width and len(recent) >= 4:
        point, direction = _predict(np.array(recent[:12]), step)
        normal = np.array([-direction[1], direction[0]])
        low, high, _ = rough_edges(
            grey, point[None], normal[None],
            reach=0.5 * width + 4.0, sign=sign, level=level,
        )  # fmt: skip
        across = float(high[0] - low[0])
        aside = 0.5 * float(high[0] + low[0])
        if not abs(across - width) < 0.2 * width + 0.5 or abs(aside) > 0.2 * width:
            break
        point = point + aside * normal
        added.insert(0, point)
        recent.insert(0, point)
    return np.concatenate([np.array(added).reshape(-1, 2), centres])


def _predict(recent: Array, step: float) -> tuple[Array, Array]:
    """Return the next point before the first and the unit direction root to tip."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(recent, axis=0).T))])
    degree = 2 if len(recent) >= 6 else 1
    u = along / along[-1]
    design = u[:, None] ** np.arange(degree + 1)
    c = np.linalg.solve(design.T @ design, design.T @ recent)
    at = -step / along[-1]
    powers = at ** np.arange(degree + 1)
    point = powers @ c
    direction = c[1] if degree == 1 else c[1] + 2.0 * at * c[2]
    return point, direction / np.hypot(*direction)
