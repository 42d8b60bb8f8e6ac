"""A straight step across lanes along a rod: what a free end and a clamp both are.

Lanes along a curve are crossed at half level and a straight line goes through the
crossings; a blurred step along such a line, fitted to all samples near it, is the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.curve import Curve
from ..curve.robust import median
from .edges import _bilinear
from .flank import WHITE, fit_flanks, is_held, median_profiles

Array = NDArray[np.float64]
Image = NDArray[np.float32]

STEP_PX = 0.5

SPAN = 5.5
"""So many blurs of paper are fitted: fewer leave its slope in doubt, and shade is
straight no farther."""
_SHARPER, _SOFTER = 0.7, 2.5
"""By how much an end may be sharper, or softer, than was expected."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EndFace:
    """Where lanes along a rod cross an end.

    Parameters
    ----------
    s : float
        Arc length at which the axis meets the line through the crossings, px.
    sigma : float
        Its standard deviation, px.
    skew, skew_sd : float
        Slope of the line against the normal, px per px, and its standard deviation.
    scatter : float
        RMS distance of the crossings from the line, px.
    found : float
        Part of the lanes that crossed.
    rise, blur : float
        Light behind the line minus light before it, and standard deviation of the blur
        along the rod, px, of the step that was fitted; 0 where none was.
    """

    s: float
    sigma: float
    skew: float
    scatter: float
    found: float
    rise: float = 0.0
    blur: float = 0.0
    skew_sd: float = 0.0


def lanes(
    grey: Image, curve: Curve, s: Array, across: Array, sign: float = 1.0
) -> Array:
    """Sample lanes along a curve, carried past its ends.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    curve : Curve
        The axis.
    s : ndarray, shape (m,)
        Arc lengths.
    across : ndarray, shape (k,)
        Offsets along the normal (to the right in the picture).
    sign : float
        -1 for a light rod.

    Returns
    -------
    ndarray, shape (k, m)
        Light; NaN outside the picture.
    """
    return sample_lanes(grey, *curve.at(s), across, sign)


def sample_lanes(
    grey: Image, points: Array, theta: Array, across: Array, sign: float
) -> Array:
    """Sample lanes beside points, as `lanes` does, where the axis has given angles."""
    light = np.empty((len(across), len(points)))
    _sample_lanes(grey, points, theta, across, sign, light)
    return light


@njit(cache=True)
def _sample_lanes(
    grey: Image, points: Array, theta: Array, across: Array, sign: float, light: Array
) -> None:
    height, width = grey.shape
    low, high = across.min(), across.max()
    for k in range(len(points)):
        x, y = points[k]
        u, v = -np.sin(theta[k]), np.cos(theta[k])
        left, right = x + low * u, x + high * u
        upper, lower = y + low * v, y + high * v
        if (
            0.0 <= left < width - 1.0 and 0.0 <= right < width - 1.0
            and 0.0 <= upper < height - 1.0 and 0.0 <= lower < height - 1.0
        ):  # fmt: skip
            # Well inside: no sample needs to be checked.
            for i in range(across.size):
                px, py = x + across[i] * u, y + across[i] * v
                j, m = int(px), int(py)
                fx, fy = px - j, py - m
                a, b = grey[m, j], grey[m, j + 1]
                c, d = grey[m + 1, j], grey[m + 1, j + 1]
                above, below = a + (b - a) * fx, c + (d - c) * fx
                light[i, k] = sign * (above + (below - above) * fy)
            continue
        for i in range(across.size):
            light[i, k] = sign * _bilinear(grey, x + across[i] * u, y + across[i] * v)


def fit_step(
    light: Array, s: Array, across: Array, line: EndFace, crossing: Array, *,
    blur: float, inner: float, outer: float,
) -> EndFace:  # fmt: skip
    """Return a line moved to where a blurred step fits the lanes best.

    Least squares of the step between two levels, the outer one with a slope, blurred by
    a Gaussian, whose width is sought too (what moved along the rod is blurred more than
    its sides): all samples near the line count, each by what it knows of the place, and
    the levels come as near to the line as the blur allows. A half level between levels
    taken clear of the blur knows less (they are carried farther) and is biased by the
    blur's tails.

    Parameters
    ----------
    light : ndarray, shape (k, m)
        Lanes, as from `lanes`.
    s : ndarray, shape (m,)
        Even grid of arc length, rising from rod to paper.
    across : ndarray, shape (k,)
        Offsets of the lanes.
    line : EndFace
        Through the crossings at half level.
    crossing : ndarray, shape (k,)
        These; lanes that cross far from the line are left out.
    blur : float
        Standard deviation of the blur, px, about; how far the crossings scatter about
        the line comes on top.
    inner, outer : float
        How far before and behind the line to fit, px.
    """
    wide = math.hypot(blur, line.scatter)
    away = np.abs(crossing - line.s - line.skew * across)
    near = away < 3.5 * (line.scatter + 0.02)
    place, skew, rise, fitted = _fit_step(
        light[near], s, across[near], line.s, line.skew, wide, inner, outer
    )
    if not (abs(place - line.s) < 2.0 * wide and rise > 0.0):
        return line
    line = replace(line, s=place, skew=skew, rise=rise, blur=fitted)
    return _to_whole_step(light[near], s, across[near], line, wide, inner, outer)


def _to_whole_step(
    light: Array, s: Array, across: Array, line: EndFace, blur: float, inner: float,
    outer: float,
) -> EndFace:  # fmt: skip
    """Return a line beside what is white moved to where it is with all its light.

    Lanes of a light rod are negative: white lies before the line then.
    """
    sign = 1.0 if is_held(light) else -1.0
    if not is_held(sign * light):
        return line
    x = np.arange(-inner, outer, STEP_PX)
    at = line.s + line.skew * across
    profiles = [
        np.interp(place + x, s, lane) for place, lane in zip(at, light, strict=True)
    ]
    (profile,) = median_profiles(np.array(profiles), np.array([0, len(profiles)]))
    if sign < 0.0:
        x, profile = -x[::-1], -profile[::-1]
    if not median(profile[x > 0.6 * x[-1]]) > WHITE:
        return line
    step = fit_flanks(x, profile[None], blur=blur, known=True)
    return replace(line, s=line.s + sign * float(step.moves()[0, 0]))


@njit(cache=True)
def _fit_step(
    light: Array, s: Array, across: Array, place: float, skew: float, blur: float,
    inner: float, outer: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Gauss-Newton: two levels, the outer one's slope, the line's two numbers, blur.

    Returns place and skew of the line, and height and blur of the step.
    """
    change, height = np.empty(6), 0.0
    least, most = _SHARPER * blur, _SOFTER * blur
    for _ in range(3):
        normal, right = np.zeros((6, 6)), np.zeros(6)
        for i in range(across.size):
            at = place + skew * across[i]
            first = max(int(np.ceil((at - inner - s[0]) / (s[1] - s[0]))), 0)
            last = min(int((at + outer - s[0]) / (s[1] - s[0])), s.size - 1)
            for k in range(first, last + 1):
                t = (s[k] - at) / blur
                outside = 0.5 * (1.0 + math.erf(t / math.sqrt(2.0)))
                bell = math.exp(-0.5 * t * t) / math.sqrt(2.0 * math.pi)
                change[0] = 1.0 - outside
                change[1] = outside
                change[2] = t * outside + bell
                change[3] = -bell
                change[4] = -bell * across[i]
                change[5] = -bell * t
                if not np.isfinite(light[i, k]):
                    continue
                for a in range(6):
                    right[a] += change[a] * light[i, k]
                    for b in range(a + 1):
                        normal[a, b] += change[a] * change[b]
        for a in range(6):
            for b in range(a):
                normal[b, a] = normal[a, b]
        if not np.linalg.det(normal) > 0.0:
            return place, skew, 0.0, blur
        found = np.linalg.solve(normal, right)
        height = found[1] - found[0]
        step = blur / height
        place += step * found[3]
        skew += step * found[4]
        blur = min(max(blur + step * found[5], least), most)
    return place, skew, height, blur


def line_through(across: Array, crossing: Array) -> EndFace | None:
    """Fit a line to lane crossings, the worst ones dropped."""
    found = int(np.count_nonzero(np.isfinite(crossing)))
    if found < 0.5 * len(crossing):
        return None
    place, slope, scatter, used, spread = _fit_line(across, crossing)
    sigma = scatter / math.sqrt(used) + 0.005
    return EndFace(
        s=place,
        sigma=sigma,
        skew=slope,
        skew_sd=sigma / spread,
        scatter=scatter,
        found=found / len(crossing),
    )


@njit(cache=True)
def _fit_line(across: Array, crossing: Array) -> tuple[float, float, float, int, float]:
    """Return place, slope, scatter and number of crossings of the line's last fit.

    And the standard deviation of where the lanes are.
    """
    good = np.isfinite(crossing)
    residual = np.empty(len(across))
    place, slope, used = 0.0, 0.0, 0
    for _ in range(3):
        x, y = across[good], crossing[good]
        used = len(x)
        centre, mean = x.mean(), y.mean()
        slope = np.sum((x - centre) * y) / np.sum((x - centre) * x)
        place = mean - slope * centre
        residual = crossing - place - slope * across
        distance = np.abs(residual)
        spread = 1.4826 * np.sort(distance[good])[used // 2] + 0.02
        kept = distance < 3.5 * spread  # false where a lane does not cross
        if np.sum(kept) < 4 or np.all(kept == good):
            break
        good = kept
    left = residual[good]
    spread = float(np.std(across))
    return place, slope, np.sqrt(np.mean(left**2)), len(left), spread


def crossings_of(
    light: Array, s: Array, place: float, near: float, inner: float, outer: float,
    *, reach: float,
) -> Array:  # fmt: skip
    """Return where lanes cross half level near `place`, going outwards (s rising).

    Parameters
    ----------
    light : ndarray, shape (k, m)
        Lanes, as from `lanes`.
    s : ndarray, shape (m,)
        Even grid of arc length.
    place, reach : float
        Where to look, and how far to either side.
    near, inner, outer : float
        The level before is a mean over `inner`, the level behind a line through
        `outer` carried to `place`, both `near` px clear of it.

    Returns
    -------
    ndarray, shape (k,)
        NaN where a lane does not cross.
    """
    step = float(s[1] - s[0])
    out = np.empty(len(light))
    _cross_lanes(light, (place - s[0]) / step, near / step, inner / step, outer / step,
                 reach / step, out)  # fmt: skip
    return np.asarray(s[0] + step * out)


@njit(cache=True)
def _cross_lanes(
    light: Array, place: float, near: float, inner: float, outer: float, reach: float,
    out: Array,
) -> None:  # fmt: skip
    """Everything in samples."""
    count, columns = light.shape
    out[:] = np.nan
    for i in range(count):
        low = _mean(light, i, place - near - inner, place - near)
        high = _line(light, i, place + near, place + near + outer, place)
        if not high > low:
            continue
        level = 0.5 * (low + high)
        best = -1
        for k in range(columns - 1):
            away = abs(k + 0.5 - place)
            rises = light[i, k] < level <= light[i, k + 1] and away <= reach
            if rises and (best < 0 or away < abs(best + 0.5 - place)):
                best = k
        if best < 1 or best + 2 >= columns:
            continue
        a, b = light[i, best - 1], light[i, best]
        c, d = light[i, best + 1], light[i, best + 2]
        slope = 0.3 * (d - a) + 0.1 * (c - b)
        at = best + (level - b) / (c - b)
        if slope > 0.0:
            line = best + 0.5 + (level - 0.25 * (a + b + c + d)) / slope
            if abs(line - best - 0.5) <= 1.0:
                at = line
        out[i] = at


@njit(cache=True)
def _line(light: Array, i: int, first: float, last: float, at: float) -> float:
    """Value at a place of the straight line through samples beside it."""
    n, st, sg, stt, stg = 0, 0.0, 0.0, 0.0, 0.0
    for k in range(max(int(np.ceil(first)), 0), min(int(last), light.shape[1] - 1) + 1):
        if np.isfinite(light[i, k]):
            t, g = k - at, light[i, k]
            n += 1
            st += t
            sg += g
            stt += t * t
            stg += t * g
    if n < 4:
        return np.nan
    return (stt * sg - st * stg) / (n * stt - st * st)


@njit(cache=True)
def _mean(light: Array, i: int, first: float, last: float) -> float:
    total, number = 0.0, 0
    for k in range(max(int(np.ceil(first)), 0), min(int(last), light.shape[1] - 1) + 1):
        if np.isfinite(light[i, k]):
            total += light[i, k]
            number += 1
    return total / number if number >= 3 else np.nan
