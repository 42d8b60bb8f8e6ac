"""What one photograph gave: a centreline with its doubts, or a refusal with a reason.

Pixels: `x_px` runs right, `y_px` runs down, and (0, 0) is the centre of the top left
pixel (the convention of OpenCV). Millimetres of a measurement are in the specimen frame
of `magbend.core.centreline`; a `Pose` says where that frame lies in the frame of the
calibration board.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..core.centreline import Centreline

POINT_COLUMNS = (
    "s_mm", "x_mm", "y_mm", "theta_rad", "kappa_per_mm", "width_mm", "sigma_mm",
    "x_px", "y_px", "good",
)  # fmt: skip
"""The columns of every measured centreline, in the order of ``centrelines.csv``."""

DEVIATION_COLUMNS = ("sigma_theta_rad", "sigma_kappa_per_mm", "sigma_width_mm")
"""Their standard deviations, at the end of each row of ``centrelines.csv``."""

EXTRA_COLUMNS = (
    "width_px", "sigma_px", *DEVIATION_COLUMNS,
    "left_x_px", "left_y_px", "right_x_px", "right_y_px",
)  # fmt: skip
"""Columns that a measurement may hold besides; left and right are the side edges."""

NAN2 = (math.nan, math.nan)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Where the specimen frame lies in the frame of the calibration board.

    Parameters
    ----------
    x_mm, y_mm : float
        The point where the rod leaves the clamp, in the board frame.
    angle_deg : float
        Direction of the rod there, counter-clockwise from the board's +x.
    height_mm : float
        Height of the rod's axis above the board's plane.
    """

    x_mm: float
    y_mm: float
    angle_deg: float
    height_mm: float = 0.0

    def to_board(self, xy_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points of the specimen frame, shape (n, 2), in the board frame, mm."""
        c, s = _cos_sin(self.angle_deg)
        x, y = np.asarray(xy_mm, dtype=np.float64).T
        return np.column_stack([self.x_mm + c * x - s * y, self.y_mm + s * x + c * y])

    def from_board(self, xy_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points of the board frame, shape (n, 2), in the specimen frame, mm."""
        c, s = _cos_sin(self.angle_deg)
        x, y = (
            np.asarray(xy_mm, dtype=np.float64) - np.array([self.x_mm, self.y_mm])
        ).T
        return np.column_stack([c * x + s * y, c * y - s * x])


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A rod in a film: where its points are and how fast they go, by a filter.

    Parameters
    ----------
    state : ndarray of complex, shape (3, n)
        The root x + iy, px, and the logarithms of the n - 1 pieces of the axis, clamp
        to tip; their velocity and acceleration, per frame and per frame squared.
    covariance : ndarray, shape (3, 3)
        Of the three, of the point that moves most, in px.
    push_px : float
        Standard deviation of the change of an acceleration from frame to frame.
    seen_px : tuple of ndarray, shape (n, 2)
        The points as measured in the last frames, four at most.
    beats_px2 : tuple of float
        What these told of the frequency at which it swings.
    looked : Measurement
        Of the last frame in which joints were sought, and what lies around the rod.
    """

    state: NDArray[np.complex128]
    covariance: NDArray[np.float64]
    push_px: float
    seen_px: tuple[NDArray[np.float64], ...]
    beats_px2: tuple[float, float]
    looked: Measurement


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """The result of one photograph.

    Parameters
    ----------
    status : {"ok", "failed"}
        A failed measurement has no points.
    flags : tuple of str
        Every doubt by name (``no_rod``, ``shadow``, ``uncalibrated``, ...).
    reason : str
        Why it failed, as a sentence for the user; empty where it did not.
    points : mapping of str to ndarray, shape (n,)
        `POINT_COLUMNS`, ordered clamp to tip, and any of `EXTRA_COLUMNS`. `good` is 1
        where the point was measured and 0 where it was carried over a gap. Columns in
        mm are NaN without a calibration.
    length_mm, tip_mm, tip_angle_deg, width_mm
        Arc length, tip in the specimen frame, tangent angle at the tip and median
        width, in mm and degrees; NaN without a calibration.
    length_sd_mm, tip_sd_mm, width_sd_mm, clamp_sd_mm
        Standard deviations of length, of the tip along x and y, of the median width,
        and of where along the rod it leaves the clamp; NaN without a calibration.
    length_px, width_px : float
        Arc length and median width in the photograph, in pixels.
    blur_px : float
        Standard deviation of the blur across the rod's edges, in pixels.
    clamp_angle_sd_deg : float
        Standard deviation of the direction at the clamp, which turns the whole
        specimen frame and is in no point's `sigma_mm`; NaN without a calibration.
    clamp_px, tip_px : tuple of float
        Where the rod leaves the clamp, and the middle of its end face, in pixels.
    pose : Pose or None
        Where the specimen frame lies in the board frame; None without a calibration.
    inverted : bool
        Whether the rod is lighter than its ground.
    mix : tuple of float or None
        Weights of blue, green and red in whose light it was measured; None is grey.
    seen_px : tuple of ndarray, shape (n, 2)
        Of a failed one: axes of the things that might have been the rod.
    joints_px : ndarray or None
        Arc lengths in px of the joints that were found or told; None where none were
        sought.
    motion : Motion or None
        Of a frame of a film: how the rod moves (`extraction.motion`).
    """

    status: Literal["ok", "failed"]
    flags: tuple[str, ...] = ()
    reason: str = ""
    points: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    length_mm: float = math.nan
    tip_mm: tuple[float, float] = NAN2
    tip_angle_deg: float = math.nan
    width_mm: float = math.nan
    clamp_angle_sd_deg: float = math.nan
    length_sd_mm: float = math.nan
    tip_sd_mm: tuple[float, float] = NAN2
    width_sd_mm: float = math.nan
    clamp_sd_mm: float = math.nan
    length_px: float = math.nan
    width_px: float = math.nan
    blur_px: float = math.nan
    clamp_px: tuple[float, float] = NAN2
    tip_px: tuple[float, float] = NAN2
    pose: Pose | None = None
    inverted: bool = False
    mix: tuple[float, float, float] | None = None
    seen_px: tuple[NDArray[np.float64], ...] = ()
    joints_px: NDArray[np.float64] | None = field(
        default=None, repr=False, compare=False
    )
    motion: Motion | None = field(default=None, repr=False, compare=False)

    @property
    def ok(self) -> bool:
        """Whether the photograph could be measured."""
        return self.status == "ok"

    @property
    def points_px(self) -> NDArray[np.float64]:
        """The centreline in the photograph, shape (n, 2), in pixels."""
        if not self.points:
            return np.empty((0, 2))
        return np.column_stack([self.points["x_px"], self.points["y_px"]])

    def centreline(self) -> Centreline | None:
        """Return the centreline in mm; None if it failed or has no calibration."""
        if not self.ok or self.pose is None:
            return None
        return Centreline(
            s_mm=self.points["s_mm"],
            x_mm=self.points["x_mm"],
            y_mm=self.points["y_mm"],
            theta_rad=self.points["theta_rad"],
            kappa_per_mm=self.points["kappa_per_mm"],
        )


def failure(flag: str, reason: str, *more_flags: str) -> Measurement:
    """Return a refusal: the first flag names it, the reason explains it."""
    return Measurement(status="failed", flags=(flag, *more_flags), reason=reason)


def _cos_sin(angle_deg: float) -> tuple[float, float]:
    angle = math.radians(angle_deg)
    return math.cos(angle), math.sin(angle)
