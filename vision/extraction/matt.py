"""A picture of a glossy rod as if it were matt: the light of a streak is taken off it.

The streak is as light at any place along the rod as it is lighter there than the rod
right beside it, so that it ends where the rod does, and where the lamp's line does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..curve.curve import Curve, beside
from ..curve.robust import median
from ..edge.highlight import Bars
from ..edge.lanes import sample_lanes
from ..edge.levels import clear_of
from ..find.ground import View

Array = NDArray[np.float64]

_FAINT = 0.1
"""Light, of what the streak has in the middle, that ends it."""

_ROOM, _INSIDE_PX = 3.0, 3
"""How far beyond its curve a rod may go on, in widths; and how far within its ends a
streak's are sought from, px."""

_TAIL_PX = 6.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Streak:
    """A streak of gloss and its rod.

    Parameters
    ----------
    curve : Curve
        Along both.
    at : ndarray, shape (n,)
        Arc lengths of the profiles.
    bars : Bars
        What they show; its places are offsets from the curve.
    """

    curve: Curve
    at: Array
    bars: Bars

    @property
    def width(self) -> float:
        """Median width of the rod, px."""
        return median(self.bars.high - self.bars.low)

    @property
    def rims(self) -> tuple[float, float]:
        """Median widths of the dark on either side of the streak, px."""
        bars = self.bars
        return median(bars.first - bars.low), median(bars.high - bars.last)

    def axis(self) -> Array:
        """Return points on the midline of the rod, shape (m, 2), from end to end."""
        s = self.curve.s
        middle = np.interp(s, self.at, 0.5 * (self.bars.low + self.bars.high))
        return np.asarray(self.curve.points + middle[:, None] * self.curve.normals)


def matt(view: View, streak: Streak) -> View:
    """Return a picture without a streak.

    Parameters
    ----------
    view : View
        The picture.
    streak : Streak
        What to take off it.
    """
    room = int(_ROOM * streak.width)
    s = np.arange(-room, streak.curve.s[-1] + room)
    bars = streak.bars.at(streak.at, s)
    light = _along(view, streak, s, bars, room)
    points, theta = streak.curve.at(s)
    far = float(np.abs(0.5 * (bars.low + bars.high)).max()) + 0.5 * streak.width
    x, y, nearest = _pixels(points, far + _TAIL_PX, view.grey.shape)
    away = np.column_stack([x, y]) - points[nearest]
    u, v = np.cos(theta[nearest]), np.sin(theta[nearest])
    here = np.interp(s[nearest] + away[:, 0] * u + away[:, 1] * v, s, light)
    added = bars.rows(nearest).highlight(away[:, 1] * u - away[:, 0] * v)
    grey = view.grey.copy()
    grey[y, x] -= (view.sign * here * added).astype(np.float32)
    return replace(view, grey=grey)


def _along(view: View, streak: Streak, s: Array, bars: Bars, room: int) -> Array:
    """Return the light of a streak along its rod, over that of its bars."""
    below, above = streak.rims
    aside = min(0.5 * max(below, above), clear_of(median(np.exp(bars.blur))) + 1.0)
    middle = 0.5 * (bars.first + bars.last)
    beside = bars.first - aside if below > above else bars.last + aside
    lighter, dark = (_lane(view, streak.curve, s, at) for at in (middle, beside))
    own = bars.highlight(middle) - bars.highlight(beside)
    light = (lighter - dark) / np.maximum(own, 1e-3)
    light = np.convolve(light, np.full(3, 1.0 / 3.0), "same")
    off = np.flatnonzero(~(light > _FAINT * median(light[room:-room])))
    first, last = room + _INSIDE_PX, len(s) - room - _INSIDE_PX
    light[off] = 0.0
    light[: off[off < first].max(initial=0)] = 0.0
    light[off[off >= last].min(initial=len(s)) :] = 0.0
    return light


def _lane(view: View, curve: Curve, s: Array, offset: Array) -> Array:
    """Return the light along a lane of changing offset, a mean over a pixel or so."""
    points, theta = curve.at(s)
    points = beside(points, theta, offset)
    across = np.array([-0.5, 0.0, 0.5])
    light = sample_lanes(view.grey, points, theta, across, view.sign)
    return np.asarray(light.mean(axis=0))


def _pixels(
    points: Array, far: float, shape: tuple[int, ...]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return x and y of the pixels near points 1 px apart, and the nearest point."""
    size = np.array([shape[1], shape[0]])
    first = np.maximum(points.min(axis=0) - far, 0.0).astype(np.intp)
    after = np.minimum(points.max(axis=0) + far + 2.0, size).astype(np.intp)
    spots = np.rint(points).astype(np.intp)
    inside = np.flatnonzero(np.all((spots >= first) & (spots < after), axis=1))
    column, row = (spots[inside] - first).T
    empty = np.ones((after - first)[::-1], np.uint8)
    empty[row, column] = 0
    away, label = cv2.distanceTransformWithLabels(
        empty, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    named = np.zeros(int(label.max()) + 1, np.intp)
    named[label[row, column]] = inside
    y, x = np.nonzero(away < far)
    return x + first[0], y + first[1], named[label[y, x]]
