"""From a rough curve inside the rod to a start for the edge fit.

The mask ends early where the clamp's shadow darkens the paper around the root. Profiles
across the rod still show it there, so the curve is carried on in short steps, each
centred between the edges, until there are no two edges a rod's width apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.curve import Curve, normals_of
from ..curve.fit import fit_curve
from ..curve.problem import SHARED
from ..curve.robust import median
from ..edge.profiles import STEP_PX, _bilinear
from ..edge.rough_edges import SHADED_LEVEL, rough_edges

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_RECENT = 12
"""Centres from which the next one is predicted."""

_GRID_PX = 3.0
"""Distance of points along a rough curve."""

_UNSEEN = 8
"""Quarters of a width that a curve is carried on before two edges are seen again."""

_LEAST_LIGHT = 0.2
"""Least light of paper beside a rod, from the rod's to the level of its edges: what is
darker is a clamp as dark as the rod, whose printed layers may lie as far apart as its
edges do (0.09)."""

_AS_LIGHT = 0.7
"""Light of paper beyond what hid an edge, over that before it; a clamp is darker."""

_LIGHT_ASIDE = 0.9
"""How far aside the edges of a light rod may be, in its rough width, which may be that
of the side a lamp lights."""

FLARED = 0.6
"""How much a rough rod may widen or thin, as where its end opens, in widths."""
ROUGH_PX, ROUGH_WIDTHS = 0.7, 0.03
"""A rod is rough if its width jumps by more, on the average over steps of 3 px: by 0.9
to 2.2 px and over 0.033 widths on yarns, by 0.6 px on smooth rods in noise of 6 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """A curve within a pixel or two of the axis.

    Parameters
    ----------
    curve : Curve
        From near the clamp to near the tip.
    width : float
        Width of the rod, px.
    rough : bool
        Whether its edges wander as no noise makes them: those of a yarn or a rope.
    blur : float
        As was given.
    """

    curve: Curve
    width: float
    rough: bool
    blur: float


def start_curve(
    grey: Image, points: Array, width: float, *, sign: float, follow: bool,
    blur: float = 1.0, whole: bool = False,
) -> Start | None:  # fmt: skip
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
    blur : float
        Standard deviation of the picture's blur, px: where paper is looked for.
    whole : bool
        Whether the rough curve begins at the root, as surely as that can be told.

    Returns
    -------
    Start or None
        None where no two edges are seen along most of the curve.
    """
    s, along, theta = resample(points, 0.6 * width)
    normals = normals_of(theta)
    aside = 0.5 if sign > 0.0 else _LIGHT_ASIDE
    low, high, dark, level = rough_edges(
        grey, along, normals, reach=aside * width + 4.0 + 2.0 * blur, sign=sign
    )
    across = high - low
    found = np.isfinite(across) & (across > 1.0)
    if found.sum() < 0.5 * len(across):
        return None
    real = median(across[found])
    rough = blur > 1.0
    alike = FLARED * real if rough else 0.3 * real + 1.0
    good = found & (np.abs(across - real) < alike)
    good |= found & _is_tapering(s, across, good, 0.5 * alike, 0.2 * real + 1.0)
    if good.sum() < 0.5 * len(across):
        return None
    centre = along + (0.5 * (low + high))[:, None] * normals
    centres = centre[good]
    if rough:  # a polyline that wanders is too long
        centres = _means(centres, max(1, round(real / s[1])))
    else:
        centres = centres[:: max(1, round(0.4 * real / s[1]))]
    if whole:
        shaded = along[: int(np.argmax(good))]
        centres = np.vstack([shaded[:: max(1, round(0.4 * real / s[1]))], centres])
    elif follow:
        centres = _follow(grey, centres[2:], real, sign, dark, level, blur)
    centres = _follow(grey, centres[::-1], real, sign, dark, level, blur)[::-1]
    return Start(
        curve=smooth_curve(centres, spacing=2.0 * real),
        width=real,
        rough=_is_rough(across[found], real),
        blur=blur,
    )


def _is_tapering(
    s: Array, across: Array, alike: NDArray[np.bool_], least: float, near: float
) -> NDArray[np.bool_]:
    """Whether a rod is as wide there as the taper of what is of about one width has it.

    It must make at least so much there, and the width be so near to it, px.
    """
    if alike.sum() < 0.3 * len(across):
        return alike
    centre, usual = s[alike].mean(), across[alike].mean()
    along = s[alike] - centre
    slope = along @ (across[alike] - usual) / (along @ along)
    taper = slope * (s - centre)
    near_it = np.abs(across - usual - taper) < near
    return np.asarray((np.abs(taper) > least) & near_it)


def _means(points: Array, count: int) -> Array:
    """Return the means of so many points each; the last ones of those that are left."""
    first = np.arange(0, len(points), count)
    size = np.diff(np.append(first, len(points)))
    return np.asarray(np.add.reduceat(points, first) / size[:, None])


def _is_rough(across: Array, width: float) -> bool:
    """Whether the width jumps from station to station, but for lost edges."""
    jump = float(np.minimum(np.abs(np.diff(across)), 0.3 * width).mean())
    return jump > max(ROUGH_PX, ROUGH_WIDTHS * width)


def smooth_curve(points: Array, *, spacing: float) -> Curve:
    """Fit a curve to a coarse polyline."""
    s, even, theta = resample(points, 0.25 * spacing)
    fit = fit_curve(
        s, even, np.ones(len(s)), spacing=spacing, iterations=2, theta=theta,
        stiffness=0.1 * spacing**5, shared=SHARED / s[1],
    )  # fmt: skip
    return fit.curve


@njit(cache=True)
def resample(points: Array, window: float) -> tuple[Array, Array, Array]:
    """Return arc length, points and smoothed tangent angles on an even grid."""
    kept, along = points.copy(), np.zeros(len(points))
    last = 0
    for i in range(1, len(points)):
        step = np.hypot(points[i, 0] - kept[last, 0], points[i, 1] - kept[last, 1])
        if step > 1e-6:
            last += 1
            kept[last], along[last] = points[i], along[last - 1] + step
    along = along[: last + 1]
    s = np.linspace(0.0, along[last], max(int(along[last] / _GRID_PX), 100) + 1)
    even = np.empty((s.size, 2))
    for k in range(2):
        even[:, k] = np.interp(s, along, kept[: last + 1, k])
    reach = max(1, round(window / s[1]))
    theta = np.empty(s.size)
    for i in range(s.size):
        chord = even[min(i + reach, s.size - 1)] - even[max(i - reach, 0)]
        theta[i] = np.arctan2(chord[1], chord[0])
        if i > 0:
            turns = round((theta[i] - theta[i - 1]) / (2.0 * np.pi))
            theta[i] -= 2.0 * np.pi * turns
    return s, even, theta


def _follow(
    grey: Image,
    centres: Array,
    width: float,
    sign: float,
    dark: float,
    level: float,
    blur: float,
) -> Array:
    """Carry centres on at the root end, at most seven widths."""
    step = max(2.0, 0.25 * width)
    room = int(7.0 * width / step) + 1
    path = np.zeros((room + min(len(centres), _RECENT), 2))
    path[room:] = centres[:_RECENT]
    head = _carry_on(grey, path, room, width, step, sign, dark, level, blur)
    return np.concatenate([path[head:room], centres])


@njit(cache=True)
def _carry_on(
    grey: Image, path: Array, head: int, width: float, step: float, sign: float,
    dark: float, level: float, blur: float,
) -> int:  # fmt: skip
    """Fill the path before `head` while there are two edges; return its new head.

    A hair or a speck beside the rod hides an edge: the path goes on unseen for a while,
    and counts if two edges are seen again twice, with paper as light beside them.
    """
    seen, unseen, again, light = head, 0, 0, level - dark
    while head > 0 and len(path) - head >= 4 and unseen <= _UNSEEN:
        x, y, u, v = predict(path[head : head + _RECENT], step)
        beside = 0.5 * width + 2.0 + 2.0 * blur
        shade = min(
            sign * _streak(grey, x - beside * v, y + beside * u, u, v),
            sign * _streak(grey, x + beside * v, y - beside * u, u, v),
        )
        here = level
        if sign > 0.0:
            here = min(level, dark + SHADED_LEVEL * (shade - dark))
        low, high = _dark_span(grey, x, y, -v, u, beside + 2.0, sign, here)
        aside = 0.5 * (low + high)
        alike = abs(high - low - width) < 0.2 * width + 0.5
        alike = alike and shade - dark > _LEAST_LIGHT * (level - dark)
        if alike and abs(aside) <= 0.2 * width:
            again += 1
        elif alike and abs(aside) <= 0.5 * width:
            again = 0
        elif sign * _streak(grey, x, y, u, v) < level:
            aside, again = 0.0, 0
        else:
            break
        head -= 1
        path[head, 0], path[head, 1] = x - aside * v, y + aside * u
        if again > 0 and unseen == 0:
            seen, light = head, shade - dark
        elif again >= 2 and shade - dark > _AS_LIGHT * light:
            seen, unseen, light = head, 0, shade - dark
        else:
            unseen += 1
    return seen


@njit(cache=True)
def _dark_span(
    grey: Image, x: float, y: float, u: float, v: float, reach: float, sign: float,
    level: float,
) -> tuple[float, float]:  # fmt: skip
    """Return where the dark begins and ends on a profile; see `edge.rough_edges`."""
    count = int(np.ceil(reach / STEP_PX))
    low, high = np.nan, np.nan
    for k in range(-count, count + 1):
        t = k * STEP_PX
        if sign * _streak(grey, x + t * u, y + t * v, -v, u) < level:
            if np.isnan(low):
                low = t - 0.5 * STEP_PX
            high = t + 0.5 * STEP_PX
    return low, high


@njit(cache=True)
def _streak(grey: Image, x: float, y: float, u: float, v: float) -> float:
    """Return the mean of five samples 1.5 px apart along a direction."""
    total, count = 0.0, 0
    for k in range(-2, 3):
        light = _bilinear(grey, x + 1.5 * k * u, y + 1.5 * k * v)
        if not np.isnan(light):
            total += light
            count += 1
    return total / count if count else np.nan


@njit(cache=True)
def predict(recent: Array, step: float) -> tuple[float, float, float, float]:
    """Return the next point before the first and the unit direction root to tip."""
    count = len(recent)
    along = np.zeros(count)
    for i in range(1, count):
        away = recent[i] - recent[i - 1]
        along[i] = along[i - 1] + np.hypot(away[0], away[1])
    m = np.zeros((3, 3))
    right = np.zeros((3, 2))
    for i in range(count):
        power = np.array([1.0, along[i], along[i] ** 2])
        for j in range(3):
            for k in range(2):
                right[j, k] += power[j] * recent[i, k]
            for k in range(3):
                m[j, k] += power[j] * power[k]
    if count < 6:  # a straight line
        m[2, :2], m[:2, 2], right[2] = 0.0, 0.0, 0.0
    for j in range(3):  # elimination; the matrix is positive definite
        for i in range(j + 1, 3):
            share = m[i, j] / m[j, j]
            m[i] -= share * m[j]
            right[i] -= share * right[j]
    c = np.zeros((3, 2))
    for j in range(2, -1, -1):
        rest = right[j].copy()
        for k in range(j + 1, 3):
            rest -= m[j, k] * c[k]
        c[j] = rest / m[j, j]
    point = c[0] - step * c[1] + step * step * c[2]
    turn = c[1] - 2.0 * step * c[2]
    size = np.hypot(turn[0], turn[1])
    return point[0], point[1], turn[0] / size, turn[1] / size
