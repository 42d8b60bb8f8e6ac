"""Where the rod leaves the clamp, sub-pixel, for a clamp of any colour at any side.

Two lines can be seen. (A) On the rod's own lanes the clamp's face begins where the dark
of the rod ends: there if clamp and rod differ in grey value. (B) Beside the rod the
front of the clamp meets the paper: there for a black clamp too. Neither lies at the
height of the axis, so where the camera sees the clamp at an angle, each is shifted
along the rod; `extract` corrects for that, knowing the camera.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..curve.curve import Curve
from ..curve.robust import median
from .crossings import Crossed, EndFace, crossings_of, line_through
from .front_line import whole_front
from .lanes import lanes_along
from .levels import clear_of
from .step_line import SPAN, STEP_PX, fit_step

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_LANES = np.linspace(-0.5, 0.5, 9)
_BESIDE = np.linspace(0.5, 2.0, 13)
APART_PX = 2.0
"""The two lines at a clamp tell different things if they are farther apart."""

FACE_SEEN, FRONT_SEEN = 0.6, 3.0
"""Widths of the rod over which the two lines are seen."""
_SHADED = 0.03
"""Light times px by which shade and grain move a line seen over one width of a rod,
alike on all its lanes: the likeliest on scenes of two kinds."""
_CLAMP_SPAN = 3.0
"""So many blurs of the clamp are fitted: its foot and the corner over the rod are dark,
and only what lies right beside the line makes the step."""

_ALIKE = 2.7
"""Standard deviation of the face's place over what its lanes scatter, were they
independent: they lie close together on the rod, and share light, grain and levels."""

_LENS = 0.05
"""Deviation of a blur in one picture from what others tell of it, in itself."""

_PARALLEL, _ASKEW = 0.3, 0.45
"""Slopes by which the two lines, both in one plane, may differ, and a line may be off a
right angle, a camera aslant and a root hidden behind a bend allowed for: else it is no
end that is seen on the rod, as where a lamp from one side lights but half of it."""

_SQUEEZED = 0.7
"""Part of its length that a lane inside a bend has lost where it tells nothing more."""

_FRONT_PX = 4.0
"""How far off its place the rest of a front is sought."""

_LEAST_PX = 0.8
"""Blur for which a lane's own levels are sought at least: fewer samples do not tell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampLines:
    """The two lines at a clamp, as far as they are seen.

    Parameters
    ----------
    face : EndFace or None
        (A) Where the rod's dark ends on its own lanes.
    front : EndFace or None
        (B) The clamp's front against the paper beside the rod.
    end : float or None
        Arc length, px, up to which the rod is fully seen (`sides_end`), to a fraction
        of its width; None where no place tells.
    """

    face: EndFace | None
    front: EndFace | None
    end: float | None = None

    @property
    def blur(self) -> float:
        """Blur along the rod as the clearer line shows it, px; 0 if none was fitted."""
        seen = [line for line in (self.face, self.front) if line is not None]
        return max(seen, key=lambda line: line.rise).blur if seen else 0.0

    def shifted(self, first: float) -> ClampLines:
        """Return the lines with arc length counted from `first`."""
        face, front = (
            None if line is None else line._replace(s=line.s - first)
            for line in (self.face, self.front)
        )
        end = None if self.end is None else self.end - first
        return ClampLines(face=face, front=front, end=end)

    def is_dark_face(self, apart: float, face_px: float) -> bool:
        """Whether what lies between the two lines is the clamp's face, dark as the rod.

        Seen obliquely, it makes the rod seem to end at the face's top edge. It is none
        where the rod's sides end nearer to that than to the front.

        Parameters
        ----------
        apart : float
            How far the front lies ahead of the line on the rod, px.
        face_px : float
            How much of such a face may be seen, px.
        """
        if self.face is None or self.front is None:
            return False
        is_seen = APART_PX < apart < APART_PX + face_px
        middle = 0.5 * (self.face.s + self.front.s)
        return is_seen and (self.end is None or self.end > middle)


def between(first: float, second: float, lines: ClampLines) -> float:
    """Return the place by the least squares of those that each of two lines tells."""
    a, b = _sureness(lines.face, FACE_SEEN), _sureness(lines.front, FRONT_SEEN)
    return (a * first + b * second) / (a + b) if a + b > 0.0 else 0.5 * (first + second)


def _sureness(line: EndFace | None, seen: float) -> float:
    """Return the inverse of the variance of a line that is seen over so many widths."""
    if line is None or line.rise <= 0.0:
        return 0.0
    return 1.0 / doubt_px(line, seen) ** 2


def doubt_px(line: EndFace | None, seen: float = FACE_SEEN) -> float:
    """Return the deviation of a line that is seen over so many widths, px.

    What shade and grain do alike to neighbouring lanes does not show in their scatter;
    it goes with the inverse of the step's height. Infinite where there is no line.
    """
    if line is None:
        return math.inf
    alike = _SHADED / line.rise / math.sqrt(seen) if line.rise > 0.0 else 0.0
    return math.hypot(line.place_sd, alike)


def find_clamp(
    grey: Image,
    curve: Curve,
    *,
    expected: float,
    width: float,
    blur: float,
    contrast: float,
    reach: float,
    on_rod: float = math.inf,
    ahead: float = 0.0,
    optics: Sequence[float] = (),
    sign: float = 1.0,
    fine: bool = True,
) -> ClampLines:
    """Find the clamp's lines near an expected arc length (s falls into the clamp).

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Linear light.
    curve : Curve
        The axis, from about the clamp to the tip.
    expected, reach : float
        Where to look along s, and how far to either side, px.
    on_rod, ahead : float
        How far at most for the end on the rod, and how much farther ahead for the
        front, px.
    width, blur : float
        Width of the rod and standard deviation of the blur, px.
    contrast : float
        Light of paper minus light of rod.
    optics : sequence of float
        What the rod's sides and its tip tell of the blur, px: one lens blurs all alike.
    sign : float
        -1 for a light rod.
    fine : bool
        Whether to fit a step after taking the half level.

    Returns
    -------
    ClampLines
        Each None where it is not seen.
    """
    front = find_front(
        grey, curve, expected=expected, width=width, blur=blur, contrast=contrast,
        reach=reach, ahead=ahead, sign=sign, fine=fine,
    )  # fmt: skip
    face = find_face(
        grey, curve, expected=expected, width=width, blur=blur, contrast=contrast,
        reach=min(reach, on_rod), front=front, optics=optics, sign=sign, fine=fine,
    )  # fmt: skip
    return squared(face, front, fine=fine)


def find_front(
    grey: Image, curve: Curve, *, expected: float, width: float, blur: float,
    contrast: float, reach: float, ahead: float = 0.0, sign: float = 1.0,
    fine: bool = True,
) -> EndFace | None:  # fmt: skip
    """Find the clamp's front beside the rod; see `find_clamp`."""
    near, wide = clear_of(blur), max(blur, _LEAST_PX)
    fit = partial(
        fit_step, blur=blur, inner=_CLAMP_SPAN * wide, outer=SPAN * wide, own=True,
        fine=fine,
    )  # fmt: skip
    seen = _front(
        grey, curve, expected + 0.5 * ahead, _span(reach, blur) + 0.5 * ahead,
        (_BESIDE if fine else _BESIDE[::2]) * width, near, contrast,
        reach + 0.5 * ahead, sign,
    )  # fmt: skip
    front = fit(seen)
    if front is None or not fine or front.rise <= 0.0 or front.bulge:
        return front
    return whole_front(
        grey, curve, front, fit, width=width, near=near, span=_span(_FRONT_PX, blur),
        sign=sign,
    )  # fmt: skip


def find_face(
    grey: Image, curve: Curve, *, expected: float, width: float, blur: float,
    contrast: float, reach: float, front: EndFace | None = None,
    optics: Sequence[float] = (), sign: float = 1.0, fine: bool = True,
) -> EndFace | None:  # fmt: skip
    """Find where the rod ends on its own lanes, its `front` known; see `find_clamp`."""
    face = fit_step(
        _face(
            grey, curve, expected, _span(reach, blur), width, clear_of(blur), contrast,
            reach, sign,
        ),
        blur=blur, inner=SPAN * blur, outer=_CLAMP_SPAN * blur, fine=fine,
        told=_told_blur(front, optics) if fine else (0.0, math.inf),
    )  # fmt: skip
    if face is None:
        return None
    return face._replace(s=-face.s, skew=-face.skew, sigma=_ALIKE * face.sigma)


def _span(reach: float, blur: float) -> float:
    """Return how far to either side lanes are taken to find a line within reach, px."""
    span: float = reach + clear_of(blur) + max(8.0, SPAN * blur)
    return span


def squared(face: EndFace | None, front: EndFace | None, *, fine: bool) -> ClampLines:
    """Return the lines without those that no clamp has which a rod leaves squarely.

    Nor has one a line that no step fits, where the other shows what its step is. Those
    that are not `fine` are not known so well.
    """
    if not fine:
        return ClampLines(face=face, front=front)
    if (
        face is not None
        and front is not None
        and (face.rise > 0.0) != (front.rise > 0.0)
    ):
        face, front = (face, None) if face.rise > 0.0 else (None, front)
    if front is not None and abs(front.skew) > _ASKEW:
        front = None
    along, most = (0.0, _ASKEW) if front is None else (front.skew, _PARALLEL)
    if face is not None and abs(face.skew - along) > most:
        face = None
    return ClampLines(face=face, front=front)


def _told_blur(front: EndFace | None, optics: Sequence[float]) -> tuple[float, float]:
    """Return the blur that is told for the face of a clamp, and its deviation, px.

    The face, as short as the rod is wide, hardly knows its blur itself. Where motion or
    a lens out of focus blurs sides, tip and front unlike, it is told less.
    """
    told = [*optics, front.blur] if front is not None and front.blur else [*optics]
    if not told:
        return 0.0, math.inf
    middle, mean = median(np.array(told)), sum(told) / len(told)
    apart = math.hypot(*(blur - mean for blur in told)) / math.sqrt(len(told))
    return middle, math.hypot(_LENS * middle, apart)


@njit(cache=True)
def _face(
    grey: Image, curve: Curve, expected: float, span: float, width: float, near: float,
    contrast: float, reach: float, sign: float,
) -> Crossed:  # fmt: skip
    """Return lanes on the rod, out of the clamp's end: their s falls into the clamp."""
    s = -np.arange(expected - span, expected + span, STEP_PX)[::-1]
    across = FACE_SEEN * _LANES * width
    light = lanes_along(grey, curve, -s, across, sign)
    place = _steepest(light, s, -expected, reach, 0.12 * contrast)
    if not np.isnan(place):
        place = _end_of_dark(light, s, place, -expected - reach, 0.12 * contrast)
    crossing = crossings_of(light, s, place, near, 3.0, 4.0, 4.0)
    crossed: Crossed = line_through(light, s, across, crossing)
    return crossed


@njit(cache=True)
def _front(
    grey: Image, curve: Curve, expected: float, span: float, beside: Array, near: float,
    contrast: float, reach: float, sign: float,
) -> Crossed:  # fmt: skip
    """Return lanes on the sides of a rod where the clamp's front is seen."""
    s = np.arange(expected - span, expected + span, STEP_PX)
    beside = beside + near + 3.0
    across = np.concatenate((-beside[::-1], beside))
    # The normals of a bent rod meet: near there no lane runs beside another.
    bend = np.interp(expected, curve.s, curve.kappa)
    across = across[bend * across < _SQUEEZED]
    light = lanes_along(grey, curve, s, across, sign)
    count = np.sum(across < 0.0)
    sides = light[:count], light[count:]
    left, right = [_steepest(x, s, expected, reach, 0.15 * contrast) for x in sides]
    crossing = np.concatenate((
        crossings_of(sides[0], s, left, near, 3.0, 4.0, 4.0),
        crossings_of(sides[1], s, right, near, 3.0, 4.0, 4.0),
    ))  # fmt: skip
    # A side on which nothing rises does not count as one whose lanes do not cross.
    first = count if np.isnan(left) else 0
    last = count if np.isnan(right) else across.size
    # Along a bent rod, a straight line askew rises so far.
    crossed: Crossed = line_through(
        light[first:last], s, (across / (1.0 - bend * across))[first:last],
        crossing[first:last],
    )  # fmt: skip
    return crossed


@njit(cache=True)
def _steepest(
    light: Array, s: Array, expected: float, reach: float, least: float
) -> float:
    """Return where the mean of lanes rises most over 3 px, if by `least`; else NaN."""
    lag = int(3.0 / STEP_PX)
    best, place = least, np.nan
    for k in range(s.size - lag):
        centre = 0.5 * (s[k] + s[k + lag])
        if abs(centre - expected) <= reach:
            rise = 0.0
            for i in range(len(light)):
                rise += (light[i, k + lag] - light[i, k]) / len(light)
            if rise > best:
                best, place = rise, centre
    return place


@njit(cache=True)
def _end_of_dark(
    light: Array, s: Array, place: float, first: float, least: float
) -> float:
    """Return where lanes leave the dark of the rod, from `first` to the steepest rise.

    Between rod and clamp may lie the clamp's face, lighter than the one and darker than
    the other, so that its top edge is the steeper rise.
    """
    lag = int(3.0 / STEP_PX)
    mean = np.zeros(s.size)
    for i in range(len(light)):
        mean += light[i] / len(light)
    steepest = int((place - s[0]) / STEP_PX)
    dark = np.nanmin(mean[: steepest + 1])
    k = steepest
    while k > 0 and s[k] > first and mean[k] > dark + 0.5 * least:
        k -= 1
    if k + 2 * lag >= steepest:
        return place
    best, end = 0.5 * least, place  # less is no end, but light that changes on it
    for j in range(max(k - lag, 0), k + lag):
        rise = mean[j + lag] - mean[j]
        if s[j] >= first and rise > best:
            best, end = rise, 0.5 * (s[j] + s[j + lag])
    return end
