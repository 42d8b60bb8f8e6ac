"""Measure a rod that a person pointed at: clamp, tip, points between, a ruler.

The path of least light from point to point is the start curve, so that the points need
not lie on the axis; from there on the rod is measured as any other. It is flagged
``hinted``: a person chose what is the rod, the edges alone where it lies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError, MagbendError
from ..camera.calibrate import calibrate_known_length
from ..camera.oriented import oriented
from ..edge.state import BROKEN, LostError, Root
from ..find.candidate import Candidate
from ..find.ground import best_view
from ..measurement import Measurement, failure
from ..picture.photo import Photo
from ..picture.sample import nearest_pixels
from ..picture.turn import turned_points
from .best_light import measure_candidate
from .setting import Setting

Array = NDArray[np.float64]
Point = tuple[float, float]

HINTED = "hinted"
_GRID_PX = 320
"""Longest side of the grid on which the path is sought."""

_WIDTHS = (0.02, 0.035, 0.05, 0.012, 0.08, 0.007)
"""Widths that are tried, as shares of the way from clamp to tip, likeliest first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hints:
    """What a person pointed at, in pixels of the upright photograph.

    Parameters
    ----------
    clamp_px, tip_px : tuple of float
        Where the rod leaves the clamp, and its end.
    via_px : tuple of tuple of float
        Points between, from clamp to tip.
    ruler : tuple (point, point, float) or None
        Two ticks of a ruler and the millimetres between: the scale, where there is no
        calibration.
    """

    clamp_px: Point
    tip_px: Point
    via_px: tuple[Point, ...] = ()
    ruler: tuple[Point, Point, float] | None = None

    @property
    def words(self) -> str:
        """The hints as ``frames.csv`` records them."""
        points = [("clamp", self.clamp_px), *(("via", p) for p in self.via_px)]
        parts = [f"{n} {p[0]:g},{p[1]:g}" for n, p in [*points, ("tip", self.tip_px)]]
        if self.ruler is not None:
            (a, b), (c, d), length_mm = self.ruler
            parts.append(f"ruler {a:g},{b:g} {c:g},{d:g} {length_mm:g} mm")
        return "; ".join(parts)


def measure_hinted(photo: Photo, setting: Setting, hints: Hints) -> Measurement:
    """Measure the rod between two points that a person gave.

    Parameters
    ----------
    photo : Photo
        The photograph, upright.
    setting : Setting
        What is known; without a calibration the ruler of the hints gives the scale.
    hints : Hints
        The points.

    Returns
    -------
    Measurement
        Flagged ``hinted``; failed, with a reason, where there is no rod between the
        points.

    Raises
    ------
    InputError
        If a point lies outside the photograph, or two coincide.
    """
    _check(hints, photo.size_px)
    setting = with_ruler(photo, setting, hints)
    points = np.array([hints.clamp_px, *hints.via_px, hints.tip_px])
    try:
        if setting.calibration is not None:
            seen = oriented(photo, setting.calibration)
            points = turned_points(points, photo, seen.orientation)
            photo = seen
            setting.calibration.check_size(*photo.size_px)
        found = _between(photo, setting, points)
    except LostError as lost:
        return failure(lost.flag, lost.reason)
    except MagbendError as error:
        return failure("calibration_mismatch", str(error))
    return replace(found, flags=(*found.flags, HINTED))


def with_ruler(photo: Photo, setting: Setting, hints: Hints) -> Setting:
    """Return a setting that has the ruler's scale, where it has no calibration."""
    if setting.calibration is not None or hints.ruler is None:
        return setting
    start, end, length_mm = hints.ruler
    scale = calibrate_known_length(
        photo.size_px, from_px=start, to_px=end, length_mm=length_mm,
        rod_height_mm=setting.rod_height_mm,
    )  # fmt: skip
    return replace(setting, calibration=scale)


def _check(hints: Hints, size_px: tuple[int, int]) -> None:
    width, height = size_px
    for name, (x, y) in [
        ("clamp", hints.clamp_px), *(("via", p) for p in hints.via_px),
        ("tip", hints.tip_px),
    ]:  # fmt: skip
        if not (0.0 <= x <= width - 1 and 0.0 <= y <= height - 1):
            raise InputError(
                f"{name} must lie in the photograph of {width} x {height} px; instead "
                f"received {x:g},{y:g}"
            )
    if np.hypot(*np.subtract(hints.tip_px, hints.clamp_px)) < 16.0:
        raise InputError("clamp and tip must be at least 16 px apart")


def _between(photo: Photo, setting: Setting, points: Array) -> Measurement:
    """Try widths until a rod is found along the path between the points."""
    path = _path(photo.grey, points)
    steps = np.hypot(*np.diff(path, axis=0).T)
    length = float(steps.sum())
    lost = LostError("no_rod", "there is no rod between the points")
    best: Measurement | None = None
    for root, share in product(_roots(photo, points[0]), _WIDTHS):
        width = max(3.0, share * length)
        rod = Candidate(
            points_px=path, width_px=width, length_px=length, root=root,
            contacts=1, ratio=0.0,
        )  # fmt: skip
        view = best_view(photo, path, width)
        try:
            found = measure_candidate(photo, setting, rod, view)
        except LostError as error:
            lost = lost if lost.flag == "edges_lost" else error
            continue
        except BROKEN:
            continue
        if not _same(found, points, width):
            continue
        # A width that is far off makes smooth edges look rough.
        if best is None or len(found.flags) < len(best.flags):
            best = found
        if "rough_edges" not in found.flags:
            break
    if best is None:
        raise lost
    return best


def _roots(photo: Photo, clamp: Array) -> tuple[Root, ...]:
    """Return what the rod may grow from at the point given, likeliest first."""
    width, height = photo.size_px
    near = 0.02 * max(width, height)
    x, y = clamp
    if min(x, y, width - 1 - x, height - 1 - y) < near:
        return ("border", "clamp")
    return ("clamp", "free")


def _same(found: Measurement, points: Array, width_px: float) -> bool:
    """Whether the measured rod ends where the person pointed."""
    reach = 3.0 * width_px + 0.02 * float(np.hypot(*(points[-1] - points[0])))
    ends = np.array([found.clamp_px, found.tip_px])
    away = np.hypot(*(ends - points[[0, -1]]).T)
    return bool(np.all(away < reach))


def _path(grey: NDArray[np.float32], points: Array) -> Array:
    """Return the darkest (or lightest) way through the points, smoothed, in px."""
    factor = max(1.0, max(grey.shape) / _GRID_PX)
    size = (round(grey.shape[1] / factor), round(grey.shape[0] / factor))
    small = np.asarray(
        cv2.resize(grey, size, interpolation=cv2.INTER_AREA), dtype=np.float32
    )
    # Of the way along the points against that beside them: dark rod or light.
    straight = nearest_pixels(small, points / factor).astype(np.float64)
    is_light = float(np.median(straight)) > float(np.median(small)) * 1.2
    cost = _cost(small, lighter=is_light)
    ways = [
        _cheapest(cost, start, end)
        for start, end in zip(points[:-1] / factor, points[1:] / factor, strict=True)
    ]
    way = np.concatenate([ways[0], *(part[1:] for part in ways[1:])]) * factor
    way[0], way[-1] = points[0], points[-1]
    return _smoothed(way)


def _cost(small: NDArray[np.float32], *, lighter: bool) -> Array:
    """Return what a step through each pixel costs: little on the rod, much beside."""
    span = float(np.quantile(small, 0.95) - np.quantile(small, 0.02)) or 1.0
    light = (small - float(np.quantile(small, 0.02))) / span
    away = np.clip(1.0 - light if lighter else light, 0.0, 1.0)
    return np.asarray(0.02 + away**2, dtype=np.float64)


def _cheapest(cost: Array, start: Array, end: Array) -> Array:
    """Return the cheapest way over the grid, by Dijkstra's algorithm."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    height, width = cost.shape
    number = np.arange(height * width).reshape(height, width)
    rows, columns, weights = [], [], []
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = number[: height - dy, max(0, -dx) : width - max(0, dx)]
        b = number[dy:, max(0, dx) : width + min(0, dx)]
        price = 0.5 * (cost.ravel()[a] + cost.ravel()[b]) * np.hypot(dy, dx)
        rows.append(a.ravel())
        columns.append(b.ravel())
        weights.append(price.ravel())
    graph: Any = coo_array(
        (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))),
        shape=(height * width,) * 2,
    ).tocsr()
    first, last = (
        int(number[round(min(p[1], height - 1)), round(min(p[0], width - 1))])
        for p in (start, end)
    )
    found: Any = dijkstra(  # type: ignore[call-overload]
        graph, directed=False, indices=first, return_predecessors=True
    )
    before = found[1]
    way = [last]
    while way[-1] != first:
        way.append(int(before[way[-1]]))
    flat = np.array(way[::-1])
    return np.column_stack([flat % width, flat // width]).astype(np.float64)


def _smoothed(way: Array) -> Array:
    """Return the way without the stairs of the grid, both ends kept."""
    from scipy.ndimage import gaussian_filter1d

    smooth = gaussian_filter1d(way, 2.0, axis=0, mode="nearest")
    smooth[[0, -1]] = way[[0, -1]]
    steps = np.hypot(*np.diff(smooth, axis=0).T)
    keep = np.concatenate([[True], steps > 1e-6])
    return np.asarray(smooth[keep])
