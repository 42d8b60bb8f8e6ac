"""From a rod in pixels to the specimen frame in mm, the rod's own body allowed for.

A square rod seen obliquely shows a side face, and an end face: the silhouette is wider
than the top face and reaches past the axis' end. Its middle is the axis. With g the
shift in the picture of a point per mm of height (from the calibration), n across and t
along the rod, m the pixels per mm: the silhouette of a side a is a (m + |g.n|) wide (of
a round rod, which has no side face, a sqrt(m^2 + (g.n)^2)), it ends |g.t| a / 2 past
the axis' tip, and the clamp's front plane appears shifted by (g.t) z at a height z
above the axis.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..camera.calibration import Calibration
from ..camera.find_tag import TaggedClamp
from ..curve.curve import arc_lengths, normals_of
from ..curve.robust import median
from ..edge.state import LostError
from ..edge.tip import ROUND_END
from ..find.ground import View
from ..measurement import Measurement, Pose
from .clamp_fit import ClampFit, fit_clamp
from .deviations import faces_px, is_dark, with_deviations
from .refine import Refined
from .root import root_place
from .setting import Setting
from .told_clamp import told_clamp

Array = NDArray[np.float64]

SPREAD = 1.1
"""Factor on the fit's own deviations for what its residuals cannot show, and the
systematic parts that the synthetic frames have: of sampling in pixels, and the share of
a shade's pull that is left after the correction."""
SAMPLING_PX = 0.002
SHADE_LEFT = 0.17
THETA_PX = 0.003
"""Systematic part of a tangent angle, times the width: pixel sampling, as above."""
POINTS = 121
"""Points of a measured centreline."""


def measurement(
    refined: Refined, seen_in: View, setting: Setting, tag: TaggedClamp | None = None
) -> Measurement:
    """Return the measurement of a refined rod, without doubts yet.

    `tag` is the clamp's place and direction as a tag on it tells them.
    """
    if setting.calibration is None:
        return _uncalibrated(refined)
    return _calibrated(refined, seen_in, setting, setting.calibration, tag)


def _uncalibrated(refined: Refined) -> Measurement:
    s = np.linspace(0.0, refined.tip.s, POINTS)
    points, theta = refined.fit.curve.at(s)
    table = _pixel_columns(refined, s, points, theta)
    empty = np.full(POINTS, np.nan)
    for name in ("s_mm", "x_mm", "y_mm", "kappa_per_mm", "width_mm", "sigma_mm",
                 "sigma_kappa_per_mm", "sigma_width_mm"):  # fmt: skip
        table[name] = empty
    table["theta_rad"] = -(theta - theta[0])
    return Measurement(
        status="ok",
        points=table,
        length_px=refined.tip.s,
        width_px=refined.typical_width,
        blur_px=refined.blur,
        clamp_px=(float(points[0, 0]), float(points[0, 1])),
        tip_px=(float(points[-1, 0]), float(points[-1, 1])),
    )


def _pixel_columns(
    refined: Refined, s: Array, points: Array, theta: Array
) -> dict[str, Array]:
    fit = refined.fit
    grid = fit.curve.s
    systematic = SAMPLING_PX + SHADE_LEFT * refined.shaded
    width = np.interp(s, grid, refined.width)
    right = normals_of(theta) * 0.5 * width[:, None]
    return {
        "x_px": points[:, 0],
        "y_px": points[:, 1],
        "width_px": width,
        "sigma_px": np.interp(s, grid, np.hypot(SPREAD * fit.sigma, systematic)),
        "sigma_theta_rad": np.hypot(
            SPREAD * np.interp(s, grid, fit.sigma_theta), THETA_PX / width
        ),
        "left_x_px": points[:, 0] - right[:, 0],
        "left_y_px": points[:, 1] - right[:, 1],
        "right_x_px": points[:, 0] + right[:, 0],
        "right_y_px": points[:, 1] + right[:, 1],
        "good": (np.interp(s, grid, refined.good.astype(float)) > 0.5).astype(float),
    }


def _calibrated(
    refined: Refined, seen_in: View, setting: Setting, camera: Calibration,
    tag: TaggedClamp | None,
) -> Measurement:  # fmt: skip
    curve = refined.fit.curve
    ends = setting.view(camera, curve.points[[0, -1]], curve.theta[[0, -1]])
    side_mm = refined.typical_width / float(setting.silhouette(ends).mean())
    rim_mm = 0.5 * setting.height_share * side_mm
    if setting.is_round:
        rim_mm *= ROUND_END
    last = refined.tip.s - rim_mm * abs(float(ends.rise_along[1]))
    seen = root_place(refined, ends, setting, rim_mm)
    told = told_clamp(seen, tag, refined, setting, camera)
    clamp = fit_clamp(told, refined, seen_in, setting, camera)
    s = np.linspace(clamp.s, last, 4 * POINTS)
    points, _ = curve.at(s)
    s_mm = arc_lengths(camera.to_mm(points, height_mm=setting.axis_height_mm))
    if not np.isfinite(s_mm[-1]):
        raise LostError(
            "calibration_mismatch",
            "the calibration sees no plane where the rod is; calibrate again",
        )
    even = np.linspace(0.0, s_mm[-1], POINTS)
    at = np.interp(even, s_mm, s)
    return _in_frame(refined, clamp, seen_in, setting, even, at, camera)


def _in_frame(
    refined: Refined, clamp: ClampFit, seen_in: View, setting: Setting, s_mm: Array,
    s: Array, camera: Calibration,
) -> Measurement:  # fmt: skip
    """Return the measurement at these arc lengths, in mm and px."""
    fit = refined.fit
    grid = fit.curve
    points, theta = grid.at(s)
    view = setting.view(camera, points, theta)
    heading, angle_deg = view.heading, clamp.angle_deg
    across = setting.silhouette(view)
    wall = setting.wall_px(view, np.interp(s, grid.s, refined.width))
    pose = Pose(
        x_mm=float(view.x_mm[0]), y_mm=float(view.y_mm[0]),
        angle_deg=angle_deg, height_mm=setting.axis_height_mm,
    )  # fmt: skip
    own = pose.from_board(np.column_stack([view.x_mm, view.y_mm]))
    # y runs down in the picture: there the heading turns the other way.
    kappa = np.gradient(heading + theta, s_mm[1])
    kappa -= np.interp(s, grid.s, grid.kappa) * view.along
    table = _pixel_columns(refined, s, points, theta)
    faces = faces_px(refined, wall, seen_in, told=setting.is_round is not None)
    table["sigma_px"] = np.hypot(table["sigma_px"], faces)
    table |= {
        "s_mm": s_mm,
        "x_mm": own[:, 0],
        "y_mm": own[:, 1],
        "theta_rad": heading - math.radians(angle_deg),
        "kappa_per_mm": kappa,
        "width_mm": table["width_px"] / across,
        "sigma_mm": table["sigma_px"] / view.along,
        "sigma_kappa_per_mm": np.interp(s, grid.s, fit.sigma_kappa) * view.along,
        "sigma_width_mm": np.interp(s, grid.s, refined.sigma_width) / across,
    }
    result = Measurement(
        status="ok",
        points=table,
        length_mm=float(s_mm[-1]),
        tip_mm=(float(own[-1, 0]), float(own[-1, 1])),
        tip_angle_deg=float(np.degrees(heading[-1])) - angle_deg,
        width_mm=median(table["width_mm"][table["good"] > 0.5]),
        clamp_angle_sd_deg=clamp.angle_sd_deg,
        length_px=float(s[-1] - s[0]),
        width_px=refined.typical_width,
        blur_px=refined.blur,
        clamp_px=(float(points[0, 0]), float(points[0, 1])),
        tip_px=(float(points[-1, 0]), float(points[-1, 1])),
        pose=pose,
        flags=clamp.flags,
    )
    return with_deviations(
        result, refined, clamp.covariance, view, camera, setting, faces,
        dark=is_dark(seen_in),
    )  # fmt: skip
