"""Sub-pixel side edges of a rod: profiles across it, crossed at half level.

Profiles are sampled along the normals by bilinear interpolation of our own (OpenCV's is
quantised to 1/32 px in some versions). On each side the edge is where the light is half
way between the rod just inside and the paper just outside: each side has its own
levels, and the paper's is a straight line carried to the edge, so that a soft shadow
lying along one side does not pull the edge. For an edge blurred by a Gaussian of
standard deviation b on paper with slope g, half level lies g b / sqrt(2 pi) above the
mean of the two levels; that term is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Image = NDArray[np.float32]

STEP_PX = 0.5
"""Distance of samples along a profile."""

_ROOT_2PI = 2.5066282746310002


@dataclass(frozen=True, slots=True, kw_only=True)
class Edges:
    """Side edges along a rod, as offsets from a curve along its normals, in px.

    Parameters
    ----------
    low, high : ndarray, shape (n,)
        Offset of the edge on the negative and the positive side; NaN where not found.
    slope_low, slope_high : ndarray, shape (n,)
        Rise of light per px at the edge, outwards.
    inner, outer_low, outer_high : ndarray, shape (n,)
        Level of the rod and of the paper at either edge.
    shade_low, shade_high : ndarray, shape (n,)
        Slope of the paper's level beside the edge, per px outwards.
    """

    low: Array
    high: Array
    slope_low: Array
    slope_high: Array
    inner: Array
    outer_low: Array
    outer_high: Array
    shade_low: Array
    shade_high: Array

    @property
    def middle(self) -> Array:
        """Offset of the midline."""
        return 0.5 * (self.low + self.high)

    @property
    def width(self) -> Array:
        """Distance of the edges."""
        return self.high - self.low

    @property
    def contrast(self) -> float:
        """Median difference between paper and rod."""
        paper = 0.5 * (self.outer_low + self.outer_high)
        return float(np.nanmedian(paper - self.inner))

    @property
    def blur(self) -> float:
        """Standard deviation of the blur, from the slope at the edges, in px."""
        rise = np.concatenate(
            [
                (self.outer_low - self.inner) / self.slope_low,
                (self.outer_high - self.inner) / self.slope_high,
            ]
        )
        rise = rise[np.isfinite(rise) & (rise > 0.0)]
        return float(np.median(rise)) / _ROOT_2PI if rise.size else float("nan")


def find_edges(
    grey: Image,
    points: Array,
    normals: Array,
    low: Array,
    high: Array,
    *,
    reach: float,
    blur: float,
    sign: float = 1.0,
    smooth: int = 6,
) -> Edges:
    """Find both side edges near where they are expected.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    points, normals : ndarray, shape (n, 2)
        Stations (x, y) and unit normals.
    low, high : ndarray, shape (n,)
        Expected offsets of the edges, in px.
    reach : float
        How far from there to look, in px.
    blur : float
        Standard deviation of the blur, in px: the levels are taken clear of it.
    sign : float
        -1 for a light rod.
    smooth : int
        Stations to either side over which levels are averaged.

    Returns
    -------
    Edges
        NaN where no edge was found.
    """
    near, clear = max(0.6, 1.1 * blur), max(1.5, 2.2 * blur)
    window = max(4.0, 3.0 * blur)
    span = float(np.max(np.maximum(-low, high))) + reach + clear + window + 1.0
    count = int(np.ceil(span / STEP_PX))
    strip = np.empty((len(points), 2 * count + 1), dtype=np.float32)
    _sample(grey, points, normals, STEP_PX, np.float32(sign), strip)
    out = np.full((2, 5, len(points)), np.nan)
    wider = np.zeros((2, len(points)))
    for side, expected in enumerate((-low, high)):
        # Profiles from the axis outwards.
        half = strip[:, count::-1] if side == 0 else strip[:, count:]
        half = np.ascontiguousarray(half)
        levels = np.empty((2, 3, len(points)))
        for rows, gap in zip(levels, (near, clear), strict=True):
            _levels(half, expected, gap, window, blur, rows)
            for row in rows:
                row[:] = _running_mean(row, smooth)
        _cross(half, expected, levels[0], reach, blur, out[side])
        out[side, 2:] = levels[1]
        middle = 0.5 * (levels[:, 0] + levels[:, 1]) + levels[:, 2] * blur / _ROOT_2PI
        wider[side] = (middle[1] - middle[0]) / out[side, 1]
    # Levels close to the edges know the shade and so the middle; those clear of the
    # blur, whose shape is not quite a Gaussian's, know the width.
    growth = 0.5 * (wider[0] + wider[1])
    out[:, 0] += np.where(np.abs(growth) < 0.5, growth, 0.0)
    inner = 0.5 * (out[0, 2] + out[1, 2])
    return Edges(
        low=-out[0, 0], high=out[1, 0], slope_low=out[0, 1], slope_high=out[1, 1],
        inner=inner, outer_low=out[0, 3], outer_high=out[1, 3],
        shade_low=out[0, 4], shade_high=out[1, 4],
    )  # fmt: skip


def rough_edges(
    grey: Image, points: Array, normals: Array, *, reach: float, sign: float = 1.0,
    level: float | None = None,
) -> tuple[Array, Array, float]:  # fmt: skip
    """Return where the dark of a rod ends on either side, to about a pixel.

    The level is a quarter of the way from rod to paper, under that of most shadows, and
    is looked for from outside, so that a streak of glare on the rod does no harm.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    points, normals : ndarray, shape (n, 2)
        Stations inside the rod and unit normals.
    reach : float
        Largest offset, px: the half width with whatever shadow was taken for rod.
    sign : float
        -1 for a light rod.
    level : float, optional
        The level, where it is known already.

    Returns
    -------
    low, high : ndarray, shape (n,)
        Offsets of the edges; NaN where the profile is nowhere dark.
    level : float
        The level taken.
    """
    count = int(np.ceil((reach + 2.0) / STEP_PX))
    strip = np.empty((len(points), 2 * count + 1), dtype=np.float32)
    _sample(grey, points, normals, STEP_PX, np.float32(sign), strip)
    if level is None:
        core = strip[:, 2 * count // 3 : 4 * count // 3]
        dark = float(np.median(core[np.isfinite(core)]))
        seen = np.where(np.isfinite(strip), strip, -np.inf)
        paper = float(np.median(seen.max(axis=1)))
        level = dark + 0.27 * (paper - dark)
    inside = strip < level
    offsets = (np.arange(2 * count + 1) - count) * STEP_PX
    some = inside.any(axis=1)
    low = np.where(some, offsets[np.argmax(inside, axis=1)], np.nan)
    high = np.where(some, offsets[::-1][np.argmax(inside[:, ::-1], axis=1)], np.nan)
    return low - 0.5 * STEP_PX, high + 0.5 * STEP_PX, level


def sample(grey: Image, x: Array, y: Array) -> Array:
    """Return the light at points by bilinear interpolation; NaN outside."""
    out = np.empty(x.size)
    _sample_points(
        grey, np.ascontiguousarray(x.ravel()), np.ascontiguousarray(y.ravel()), out
    )
    return out.reshape(x.shape)


def _running_mean(values: Array, half: int) -> Array:
    """Mean over neighbours, NaN left out."""
    good = np.isfinite(values)
    window = np.ones(2 * half + 1)
    total = np.convolve(np.where(good, values, 0.0), window, mode="full")[half:-half]
    count = np.convolve(good.astype(np.float64), window, mode="full")[half:-half]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(total / count)


@njit(cache=True)
def _bilinear(grey: Image, x: float, y: float) -> float:
    height, width = grey.shape
    if not (x >= 0.0 and y >= 0.0 and x <= width - 1.0 and y <= height - 1.0):
        return np.nan
    j = min(int(x), width - 2)
    i = min(int(y), height - 2)
    u, v = x - j, y - i
    top = grey[i, j] * (1.0 - u) + grey[i, j + 1] * u
    bottom = grey[i + 1, j] * (1.0 - u) + grey[i + 1, j + 1] * u
    return float(top * (1.0 - v) + bottom * v)


@njit(cache=True)
def _sample_points(grey: Image, x: Array, y: Array, out: Array) -> None:
    for k in range(x.size):
        out[k] = _bilinear(grey, x[k], y[k])


@njit(cache=True)
def _sample(
    grey: Image, points: Array, normals: Array, step: float, sign: float, strip: Image
) -> None:
    """Fill the strip: one row a station, columns along the normal, centre on it."""
    count, columns = strip.shape
    middle = columns // 2
    height, width = grey.shape
    reach = middle * step
    for i in range(count):
        x, y = points[i, 0], points[i, 1]
        u, v = normals[i, 0] * step, normals[i, 1] * step
        if reach < x < width - 1.001 - reach and reach < y < height - 1.001 - reach:
            # Well inside: no sample needs to be checked.
            for k in range(columns):
                px, py = x + (k - middle) * u, y + (k - middle) * v
                j, m = int(px), int(py)
                fx, fy = np.float32(px - j), np.float32(py - m)
                a, b = grey[m, j], grey[m, j + 1]
                c, d = grey[m + 1, j], grey[m + 1, j + 1]
                top = a + (b - a) * fx
                strip[i, k] = sign * (top + (c + (d - c) * fx - top) * fy)
            continue
        for k in range(columns):
            t = (k - middle) * step
            strip[i, k] = sign * _bilinear(
                grey, points[i, 0] + t * normals[i, 0], points[i, 1] + t * normals[i, 1]
            )


@njit(cache=True)
def _levels(
    half: Image, expected: Array, near: float, window: float, blur: float, levels: Array
) -> None:
    """Inner level, outer level at the expected edge, and slope of the outer one.

    Least squares of a step onto a slope, both blurred by a Gaussian, on samples at
    either side: so the blurred edge's own tails count neither as rod nor as shade.
    """
    count, columns = half.shape
    step = 0.5
    for i in range(count):
        edge = expected[i]
        first = int(np.ceil(max(edge - near - window, 0.0) / step))
        last = min(int((edge + near + window) / step), columns - 1)
        n_out = 0
        aa, ab, ac, bb, bc, cc = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        ga, gb, gc = 0.0, 0.0, 0.0
        for k in range(first, last + 1):
            t, g = k * step - edge, half[i, k]
            if abs(t) < near:
                continue
            z = t / (1.4142135623730951 * blur)
            b = 0.5 * (1.0 + math.erf(z))
            a = 1.0 - b
            c = t * b + 0.3989422804 * blur * math.exp(-z * z)
            n_out += t > 0.0
            aa += a * a
            ab += a * b
            ac += a * c
            bb += b * b
            bc += b * c
            cc += c * c
            ga += a * g
            gb += b * g
            gc += c * g
        if aa < 0.5:
            # Narrower than the blur: the darkest there is, at the axis.
            dark = half[i, 0]
            aa += 1.0
            ga += dark
        # Elimination of the three normal equations.
        b1, b2, h1 = bb - ab * ab / aa, bc - ab * ac / aa, gb - ab * ga / aa
        c2, h2 = cc - ac * ac / aa, gc - ac * ga / aa
        det = b1 * c2 - b2 * b2
        if n_out < 3 or not det > 1e-9:
            levels[0, i] = ga / aa
            levels[1, i] = np.nan
            levels[2, i] = np.nan
            continue
        outer = (h1 * c2 - h2 * b2) / det
        slope = (h2 * b1 - h1 * b2) / det
        levels[0, i] = (ga - ab * outer - ac * slope) / aa
        levels[1, i] = outer
        levels[2, i] = slope


@njit(cache=True)
def _cross(
    half: Image, expected: Array, levels: Array, reach: float, blur: float, out: Array
) -> None:
    """Find the crossing nearest to the expected place; fit a line through 4 samples."""
    count, columns = half.shape
    step = 0.5
    for i in range(count):
        inner, outer, shade = levels[0, i], levels[1, i], levels[2, i]
        out[2, i], out[3, i], out[4, i] = inner, outer, shade
        if not outer > inner:
            continue
        level = 0.5 * (inner + outer) + 0.3989422804 * shade * blur
        centre = int(expected[i] / step)
        best = -1
        for away in range(int(reach / step) + 1):
            for k in (centre + away, centre - away):
                if k >= 1 and k + 2 < columns and half[i, k] < level <= half[i, k + 1]:
                    best = k
                    break
            if best >= 0:
                break
        if best < 0:
            continue
        a, b = half[i, best - 1], half[i, best]
        c, d = half[i, best + 1], half[i, best + 2]
        slope = (0.3 * (d - a) + 0.1 * (c - b)) / step
        if not slope > 0.0:
            continue
        mean = 0.25 * (a + b + c + d)
        place = (best + 0.5) * step + (level - mean) / slope
        if abs(place - (best + 0.5) * step) > step:
            place = (best + (level - b) / (c - b)) * step
        out[0, i] = place
        out[1, i] = slope
