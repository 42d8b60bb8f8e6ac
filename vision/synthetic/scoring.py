"""How far a measured centreline is from the truth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..measurement import Measurement
from .square_view import Truth

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Errors of one measurement, in pixels.

    Parameters
    ----------
    rms_px, max_px : float
        Distance to the true axis along its normal, over the inner 96 % of the length.
    length_px, width_px : float
        Measured minus true arc length and width.
    tip_along_px, tip_across_px : float
        Measured minus true tip, along the true tip tangent and to the left of it.
    clamp_px : float
        Distance of the measured clamp point from the true one.
    clamp_angle_deg : float
        Measured minus true direction at the clamp; + to the left in the picture.
    coverage : float
        Share of the inner points whose error is within their standard deviation; 0.68
        is honest. NaN where the measurement has none.
    """

    rms_px: float
    max_px: float
    length_px: float
    width_px: float
    tip_along_px: float
    tip_across_px: float
    clamp_px: float
    clamp_angle_deg: float
    coverage: float


def score(measurement: Measurement, truth: Truth) -> Score:
    """Compare a measurement with the truth of its synthetic frame.

    Parameters
    ----------
    measurement : Measurement
        It must be ok.
    truth : Truth
        Of the same frame.

    Raises
    ------
    ValueError
        If the measurement failed: a refusal has no error.
    """
    if not measurement.ok:
        raise ValueError(f"a failed measurement has no score: {measurement.reason}")
    points = measurement.points_px
    arc = arc_length(points)
    distance = signed_distance(points, truth.points_px)
    inner = (arc > 0.02 * arc[-1]) & (arc < 0.98 * arc[-1])
    tangent = _direction(truth.points_px[-2:])
    left = np.array([tangent[1], -tangent[0]])
    tip_error = np.array(measurement.tip_px) - truth.points_px[-1]
    clamp_error = np.array(measurement.clamp_px) - truth.points_px[0]
    return Score(
        rms_px=float(np.sqrt(np.mean(distance[inner] ** 2))),
        max_px=float(np.abs(distance[inner]).max()),
        length_px=measurement.length_px - truth.length_px,
        width_px=measurement.width_px - truth.width_px,
        tip_along_px=float(tip_error @ tangent),
        tip_across_px=float(tip_error @ left),
        clamp_px=float(np.hypot(*clamp_error)),
        clamp_angle_deg=_turn_deg(points[:2], truth.points_px[:2]),
        coverage=_coverage(measurement, distance, inner),
    )


def arc_length(points: Array) -> Array:
    """Return the running length of a polyline, shape (n,)."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def signed_distance(points: Array, line: Array) -> Array:
    """Return how far points lie from a polyline.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Points to test.
    line : ndarray, shape (m, 2)
        Corners of the polyline; its ends are prolonged straight, so that a point beyond
        an end has a distance across, not along.

    Returns
    -------
    ndarray, shape (n,)
        Distance, + on the side of (-dy, dx) of the line's direction (dx, dy).
    """
    nearest = np.array(
        [np.argmin(np.sum((line - point) ** 2, axis=1)) for point in points], dtype=int
    )
    best = np.full(len(points), np.inf)
    for shift in (-1, 0):
        start = np.clip(nearest + shift, 0, len(line) - 2)
        a, step = line[start], line[start + 1] - line[start]
        to_point = points - a
        length2 = np.sum(step**2, axis=1)
        t = np.sum(to_point * step, axis=1) / length2
        low = np.where(start == 0, -np.inf, 0.0)
        high = np.where(start == len(line) - 2, np.inf, 1.0)
        away = to_point - np.clip(t, low, high)[:, None] * step
        side = np.sign(step[:, 0] * to_point[:, 1] - step[:, 1] * to_point[:, 0])
        distance = np.hypot(*away.T)
        closer = distance < np.abs(best)
        best[closer] = (np.where(side == 0.0, 1.0, side) * distance)[closer]
    return best


def _direction(two_points: Array) -> Array:
    step = two_points[1] - two_points[0]
    return np.asarray(step / np.hypot(*step))


def _turn_deg(measured: Array, true: Array) -> float:
    a, b = _direction(measured), _direction(true)
    return math.degrees(math.atan2(a[0] * b[1] - a[1] * b[0], float(a @ b)))


def _coverage(measurement: Measurement, distance: Array, inner: Array) -> float:
    sigma = measurement.points.get("sigma_px")
    if sigma is None:
        return math.nan
    return float(np.mean(np.abs(distance[inner]) <= sigma[inner]))
