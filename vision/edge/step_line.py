"""A straight step across lanes along a rod: what a free end and a clamp both are.

Near the line through half-level crossings a blurred step is fitted to all samples.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.robust import median
from .crossings import Crossed, EndFace
from .flank import HELD, WHITE, fit_flanks, median_profiles

Array = NDArray[np.float64]

STEP_PX = 0.5

SPAN = 5.5
"""So many blurs of paper are fitted: fewer leave its slope in doubt, and shade is
straight no farther."""
_FARTHER = 1.5
"""With so much more of the paper before it a line is placed once more."""
_SHARPER, _SOFTER = 0.7, 2.5
"""By how much an end may be sharper, or softer, than was expected."""
_ROUNDS, _ROUNDS_OWN = 3, 4
"""Steps of Gauss-Newton, where all lanes have the same levels, or each its own."""
_OUTLYING, _LEAST_OFF, _ALIKE = 4.0, 0.02, 4.0
"""Median pulls beyond which a lane counts less, with so many px more; and lanes that
tell as much as one."""
_SURE = 3.0
"""Standard deviations by which a line must bulge not to be straight."""
_LEAST_PIVOT = 1e-6


def fit_step(
    seen: Crossed, *, blur: float, inner: float, outer: float, own: bool = False,
    fine: bool = True, told: tuple[float, float] = (0.0, math.inf),
) -> EndFace | None:  # fmt: skip
    """Return a line moved to where a blurred step fits the lanes best.

    Least squares of the step between two levels, the outer one with a slope, blurred by
    a Gaussian, whose width is sought too (what moved along the rod is blurred more than
    its sides): all samples near the line count, each by what it knows of the place, and
    the levels come as near to the line as the blur allows. A half level between levels
    taken clear of the blur knows less (they are carried farther) and is biased by the
    blur's tails.

    Parameters
    ----------
    seen : Crossed
        Lanes, and the line through their crossings; those that cross far from the line
        are left out.
    blur : float
        Standard deviation of the blur, px, about; how far the crossings scatter about
        the line comes on top.
    inner, outer : float
        How far before and behind the line to fit, px.
    own : bool
        Whether each lane has levels of its own, as where some lie in a shade: common
        ones would turn the line towards it. A lane then counts by the square of its
        step's height, and less the farther it is off.
    fine : bool
        Whether to fit; else the line through the crossings will do.
    told : tuple of float
        What others tell of the blur, px, and its standard deviation: a line that
        hardly knows its blur does not know its place either, where its levels are not
        alike for long.

    Returns
    -------
    EndFace or None
        None where there is no line.
    """
    line = seen.line
    if math.isnan(line.s):
        return None
    if not fine:
        return line
    found, white = _fitted(seen, blur, inner, outer, own, told)
    return _to_whole_step(seen, found, blur, inner, outer, white) if white else found


@njit(cache=True)
def _fitted(
    seen: Crossed, blur: float, inner: float, outer: float, own: bool,
    told: tuple[float, float],
) -> tuple[EndFace, float]:  # fmt: skip
    """Return the line fitted, and 1 or -1 where it lies beside what is white, else 0.

    Lanes of a light rod are negative: white lies before the line then.
    """
    line, s = seen.line, seen.s
    wide = np.hypot(blur, line.scatter)
    light, across = _near(seen)
    samples = len(across) * (inner + outer) / (s[1] - s[0])
    optics = (told[0], np.sqrt(samples) * told[1])
    place, skew, fitted, rise, known, off, uneven = _fit_step(
        light, s, across, line.s, line.skew, wide, inner, outer, own, optics
    )
    least = 2 if own else 1  # a lane alone tells of no line
    if not (abs(place - line.s) < 2.0 * wide and np.sum(known != 0.0) >= least):
        # No step fits here: what was crossed may be anything as blurred as this.
        skew_sd = line.skew_sd * wide / line.sigma
        unsure = EndFace(
            line.s, wide, line.skew, line.scatter, line.found, 0.0, 0.0, skew_sd, 0.0,
            0.0,
        )  # fmt: skip
        return unsure, 0.0
    share = known / np.sum(known)
    scatter, sigma, skew_sd, bulge = line.scatter, line.sigma, line.skew_sd, 0.0
    if own:
        scatter = np.sqrt(np.sum(share * off**2))
        middle = np.sum(share * across)
        spread = np.sqrt(np.sum(share * (across - middle) ** 2))
        alone = scatter * np.sqrt(_ALIKE * np.sum(share**2)) + 0.005
        sigma, skew_sd = alone * np.hypot(1.0, middle / spread), alone / spread
        bulge = _bulge(across, off, share)
    height = np.sum(share * rise)
    found = EndFace(
        place, sigma, skew, scatter, line.found, height, fitted, skew_sd, uneven, bulge
    )
    white = 0.0
    for sign in (1.0, -1.0):
        if WHITE < np.nanmax(sign * light) <= HELD:
            white = sign
    return found, white


@njit(cache=True)
def _bulge(across: Array, off: Array, share: Array) -> float:
    """Return how far the middle of lanes stands out over their ends; 0 if unsure."""
    if not np.min(across) < 0.0 < np.max(across):
        return 0.0
    x = across / np.max(np.abs(across))
    middle = np.sum(share * x)
    spread = np.sum(share * (x - middle) ** 2)
    square = x**2 - np.sum(share * x**2)
    square -= (x - middle) * np.sum(share * square * (x - middle)) / spread
    power = np.sum(share * square**2)
    bulge = -np.sum(share * square * off) / power
    left = np.sum(share * (off + bulge * square) ** 2)
    sd = np.sqrt(_ALIKE * left * np.sum((share * square) ** 2)) / power
    return bulge if np.abs(bulge) > _SURE * sd else 0.0


@njit(cache=True)
def _near(seen: Crossed) -> tuple[Array, Array]:
    """Return the light on lanes that cross near the line, and their offsets."""
    line, across = seen.line, seen.across
    away = np.abs(seen.crossing - line.s - line.skew * across)
    near = away < 3.5 * (line.scatter + 0.02)
    return seen.light[near], across[near]


def _to_whole_step(
    seen: Crossed, line: EndFace, blur: float, inner: float, outer: float, sign: float
) -> EndFace:
    """Return a line beside what is white moved to where it is with all its light."""
    light, across = _near(seen)
    blur = math.hypot(blur, seen.line.scatter)
    x = np.arange(-inner, outer, STEP_PX)
    at = line.s + line.skew * across
    profiles = [
        np.interp(place + x, seen.s, lane)
        for place, lane in zip(at, light, strict=True)
    ]
    (profile,) = median_profiles(np.array(profiles), np.array([0, len(profiles)]))
    if sign < 0.0:
        x, profile = -x[::-1], -profile[::-1]
    if not median(profile[x > 0.6 * x[-1]]) > WHITE:
        return line
    step = fit_flanks(x, profile[None], blur=blur, known=True)
    # What is cut off looks sharper than it is.
    return line._replace(s=line.s + sign * float(step.moves()[0, 0]), blur=blur)


@njit(cache=True, error_model="numpy")
def _fit_step(
    light: Array, s: Array, across: Array, place: float, skew: float, blur: float,
    inner: float, outer: float, own: bool, optics: tuple[float, float],
) -> tuple[float, float, float, Array, Array, Array, float]:  # fmt: skip
    """Gauss-Newton for place and skew of a line and the blur, each group's levels out.

    A group is a lane with levels of its `own`, else all lanes. Returns the three, and
    of each group the step's height, how surely it tells the place, and by how much it
    tells another one; last, how far the line moves with more of the outer level.
    """
    groups = len(light) if own else 1
    least, most = _SHARPER * blur, _SOFTER * blur
    weight, known, off = np.ones(groups), np.zeros(groups), np.zeros(groups)
    equations, heights = np.zeros((groups, 4, 4)), np.zeros((groups, 4))
    step, uneven = np.zeros(3), 0.0
    for _ in range(_ROUNDS_OWN if own else _ROUNDS):
        _fill(light, s, across, place, skew, blur, inner, outer, equations, heights)
        rise: Array = heights[:, 3].copy()
        for _again in range(2):  # the step changes the levels
            if not _solve(equations, weight, rise, blur, optics, step):
                return place, skew, blur, rise, np.zeros(groups), off, uneven
            rise = heights[:, 3] - rise * (heights[:, :3].copy() @ step)
        place, skew = place + step[0], skew + step[1]
        blur = min(max(blur + step[2], least), most)
        known = weight * equations[:, 0, 0] * rise * np.maximum(rise, 0.0)
        if own:
            told = equations[:, 0, 3] / rise - equations[:, 0, 2] * step[2]
            off = told / equations[:, 0, 0] - step[0] - step[1] * across
            pull = np.where(known > 0.0, np.abs(off) * np.sqrt(known / weight), 0.0)
            usual = np.median(pull) + _LEAST_OFF * np.sqrt(np.max(known))
            weight = 1.0 / (1.0 + (pull / (_OUTLYING * usual)) ** 2)
            off, weight = np.where(known > 0.0, off, 0.0), weight * (known > 0.0)
    if own:
        farther = _FARTHER * outer
        _fill(light, s, across, place, skew, blur, inner, farther, equations, heights)
        if _solve(equations, weight, rise, blur, optics, step):
            uneven = abs(step[0])
    return place, skew, blur, rise, known, off, uneven


@njit(cache=True, error_model="numpy")
def _solve(
    equations: Array, weight: Array, rise: Array, blur: float,
    optics: tuple[float, float], step: Array,
) -> bool:  # fmt: skip
    """Fill in the step that all groups together ask for; False where none does."""
    total, left = np.zeros((3, 4)), 0.0
    for g in range(weight.size):
        scale = weight[g] * rise[g]
        for a in range(3):
            for b in range(3):
                total[a, b] += scale * rise[g] * equations[g, a, b]
            total[a, 3] += scale * equations[g, a, 3]
        left += weight[g] * equations[g, 3, 3]
    if not np.isfinite(np.sum(total)):
        return False
    right = total[:, 3].copy()
    for p in range(3):
        if not total[p, p] > 0.0:
            return False
        for a in range(p + 1, 3):
            part = total[a, p] / total[p, p]
            for b in range(p, 4):
                total[a, b] -= part * total[p, b]
    _substitute(total, step)
    left -= float(np.sum(step * right))
    sure = _ALIKE * max(left, 0.0) / optics[1] ** 2
    total[2, 2] += sure
    total[2, 3] += sure * (optics[0] - blur)
    _substitute(total, step)
    return True


@njit(cache=True, error_model="numpy")
def _substitute(total: Array, step: Array) -> None:
    """Fill in the step that solves equations, (3, 4), of which a triangle is left."""
    for p in range(2, -1, -1):
        rest = total[p, 3]
        for a in range(p + 1, 3):
            rest -= total[p, a] * step[a]
        step[p] = rest / total[p, p]


@njit(cache=True, error_model="numpy")
def _fill(
    light: Array, s: Array, across: Array, place: float, skew: float, blur: float,
    inner: float, outer: float, equations: Array, heights: Array,
) -> None:  # fmt: skip
    """Fill in normal equations of each group, (groups, 4, 4), and heights, (groups, 4).

    Of place, skew and blur, times the step's height, and of the light, whose square is
    what is left; the levels, and the outer one's slope, are eliminated. The height is
    the last number less the other three times these.
    """
    changes, full = np.empty((7, s.size)), np.zeros((7, 7))
    for i in range(across.size):
        at = place + skew * across[i]
        first = max(int(np.ceil((at - inner - s[0]) / (s[1] - s[0]))), 0)
        last = min(int((at + outer - s[0]) / (s[1] - s[0])), s.size - 1)
        count = 0
        for k in range(first, last + 1):
            if not np.isfinite(light[i, k]):
                continue
            t = (s[k] - at) / blur
            outside = 0.5 * (1.0 + math.erf(t / math.sqrt(2.0)))
            bell = math.exp(-0.5 * t * t) / math.sqrt(2.0 * math.pi)
            changes[0, count] = 1.0 - outside
            changes[1, count] = outside
            changes[2, count] = t * outside + bell
            changes[3, count] = -bell / blur
            changes[4, count] = -bell / blur * across[i]
            changes[5, count] = -bell / blur * t
            changes[6, count] = light[i, k]
            count += 1
        for a in range(7):
            for b in range(a, 7):
                one, other, total = changes[a], changes[b], full[a, b]
                for k in range(count):
                    total += one[k] * other[k]
                full[a, b] = total
        if len(equations) > 1 or i == across.size - 1:
            g = min(i, len(equations) - 1)
            _eliminate(full, heights[g])
            for a in range(4):
                for b in range(4):
                    equations[g, a, b] = full[3 + min(a, b), 3 + max(a, b)]
            full[:] = 0.0


@njit(cache=True)
def _eliminate(full: Array, heights: Array) -> None:
    """Take two levels and a slope out of the upper half of normal equations, (7, 7).

    Fill in what the other four add to the difference of the levels.
    """
    for p in range(3):
        if full[p, p] < _LEAST_PIVOT:
            full[:], heights[:] = 0.0, 0.0
            return
        for a in range(p + 1, 7):
            part = full[p, a] / full[p, p]
            for b in range(a, 7):
                full[a, b] -= part * full[p, b]
    for j in range(3, 7):
        slope = full[2, j] / full[2, 2]
        outer = (full[1, j] - full[1, 2] * slope) / full[1, 1]
        inner = (full[0, j] - full[0, 1] * outer - full[0, 2] * slope) / full[0, 0]
        heights[j - 3] = outer - inner
