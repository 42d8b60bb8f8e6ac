"""From a rod in pixels to the specimen frame in mm, the rod's own body allowed for.

A square rod seen obliquely shows a side face, and an end face: the silhouette is wider
than the top face and reaches past the axis' end. Its middle is the axis. With g the
shift in the picture of a point per mm of height (from the calibration), n across and t
along the rod, m the pixels per mm: the silhouette of a side a is a (m + |g.n|) wide, it
ends |g.t| a / 2 past the axis' tip, and the clamp's front plane appears shifted by
(g.t) z at a height z above the axis.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..camera.calibration import Calibration
from ..camera.projection import LocalView
from ..curve.robust import median
from ..edge.clamp import between
from ..edge.ends import APART_PX, is_face
from ..edge.state import LostError
from ..find.rod import Candidate
from ..measurement import Measurement, Pose
from .refine import Refined
from .setting import UNKNOWN_CLAMP_MM, Setting, arc_mm, silhouette

Array = NDArray[np.float64]

SPREAD = 1.1
"""Factor on the fit's own deviations for what its residuals cannot show, and the
systematic parts that the synthetic frames have: of sampling in pixels, and the share of
a shade's pull that is left after the correction. A side face that is seen has another
grey value than the top: `SIDE_FACE` of its width is in doubt."""
SAMPLING_PX = 0.002
SHADE_LEFT = 0.17
SIDE_FACE = 0.07
THETA_PX = 0.003
"""Systematic part of a tangent angle, times the width: pixel sampling, as above."""
DRIFT_SHADE = 0.5
DRIFT_WALL = 0.02
DRIFT_REACH = 1.5
"""Errors that neighbours share: the midline drifts by this share of the shade's pull,
and of the side wall that is seen, alike over so many widths. They turn the direction at
the clamp, from which the whole frame hangs."""
CLAMP_PLACE_PX = 0.2
"""A clamp whose place is so far off has the direction of another point of the rod."""
HIDDEN_MM = 0.05
"""What part of the root a clamp of unknown height may hide before that is named."""

POINTS = 121
"""Points of a measured centreline."""


def measurement(
    refined: Refined, candidate: Candidate, setting: Setting
) -> Measurement:
    """Return the measurement of a refined rod, without doubts yet."""
    if setting.calibration is None:
        return _uncalibrated(refined)
    return _calibrated(refined, setting, setting.calibration)


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
    right = np.column_stack([-np.sin(theta), np.cos(theta)]) * 0.5 * width[:, None]
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


def _calibrated(refined: Refined, setting: Setting, camera: Calibration) -> Measurement:
    curve = refined.fit.curve
    ends = setting.view(camera, curve.points[[0, -1]], curve.theta[[0, -1]])
    side_mm = refined.typical_width / float(silhouette(ends).mean())
    last = refined.tip.s - 0.5 * side_mm * abs(float(ends.rise_along[1]))
    first = _root(refined, ends, setting, side_mm)
    s = np.linspace(first, last, 4 * POINTS)
    points, _ = curve.at(s)
    s_mm = arc_mm(camera.to_mm(points, height_mm=setting.axis_height_mm))
    if not np.isfinite(s_mm[-1]):
        raise LostError(
            "calibration_mismatch",
            "the calibration sees no plane where the rod is; calibrate again",
        )
    even = np.linspace(0.0, s_mm[-1], POINTS)
    return _in_frame(refined, setting, even, np.interp(even, s_mm, s), camera)


def _in_frame(
    refined: Refined, setting: Setting, s_mm: Array, s: Array, camera: Calibration
) -> Measurement:
    """Return the measurement at these arc lengths, in mm and px."""
    fit = refined.fit
    grid = fit.curve
    points, theta = grid.at(s)
    view = setting.view(camera, points, theta)
    heading = view.heading
    pose = Pose(
        x_mm=float(view.x_mm[0]), y_mm=float(view.y_mm[0]),
        angle_deg=float(np.degrees(heading[0])), height_mm=setting.axis_height_mm,
    )  # fmt: skip
    own = pose.from_board(np.column_stack([view.x_mm, view.y_mm]))
    # y runs down in the picture: there the heading turns the other way.
    kappa = np.gradient(heading + theta, s_mm[1])
    kappa -= np.interp(s, grid.s, grid.kappa) * view.along
    table = _pixel_columns(refined, s, points, theta)
    across = silhouette(view)
    wall = np.abs(view.rise_across) * table["width_px"] / across
    table["sigma_px"] = np.hypot(table["sigma_px"], SIDE_FACE * wall)
    table |= {
        "s_mm": s_mm,
        "x_mm": own[:, 0],
        "y_mm": own[:, 1],
        "theta_rad": heading - heading[0],
        "kappa_per_mm": kappa,
        "width_mm": table["width_px"] / across,
        "sigma_mm": table["sigma_px"] / view.along,
        "sigma_kappa_per_mm": np.interp(s, grid.s, fit.sigma_kappa) * view.along,
        "sigma_width_mm": np.interp(s, grid.s, refined.sigma_width) / across,
    }
    hidden = _hidden_px(refined, setting, float(view.rise_along[0]))
    return Measurement(
        status="ok",
        points=table,
        length_mm=float(s_mm[-1]),
        tip_mm=(float(own[-1, 0]), float(own[-1, 1])),
        tip_angle_deg=float(np.degrees(heading[-1] - heading[0])),
        width_mm=median(table["width_mm"][table["good"] > 0.5]),
        clamp_angle_sd_deg=_clamp_sd_deg(refined, np.interp(grid.s, s, wall), hidden),
        length_px=float(s[-1] - s[0]),
        width_px=refined.typical_width,
        clamp_px=(float(points[0, 0]), float(points[0, 1])),
        tip_px=(float(points[-1, 0]), float(points[-1, 1])),
        pose=pose,
    )


def _clamp_sd_deg(refined: Refined, wall: Array, hidden: float) -> float:
    """Return the standard deviation of the direction at the clamp.

    `wall` is how wide the side wall is seen, and `hidden` how much of the root may not
    be seen, px; where in it the rod begins is even odds.
    """
    fit, width = refined.fit, float(refined.width[0])
    drift = np.hypot(DRIFT_SHADE * refined.shaded, DRIFT_WALL * wall)
    place = math.hypot(CLAMP_PLACE_PX, hidden / math.sqrt(3.0))
    parts = (
        fit.sigma_theta[0], fit.turned(drift, DRIFT_REACH * width),
        place * fit.curve.kappa[0],
    )  # fmt: skip
    return math.degrees(math.hypot(*parts))


def _root(refined: Refined, ends: LocalView, setting: Setting, side_mm: float) -> float:
    """Return the arc length in px at which the axis leaves the clamp.

    The clamp's front plane is seen at the top of the rod (its face) and at the paper
    (its front line), if the camera looks at it; else only the clamp's top edge is.
    """
    if refined.clamp is None:
        return 0.0
    rise = float(ends.rise_along[0])
    face, front = refined.clamp.face, refined.clamp.front
    if rise > 0.0:
        return _hidden_root(refined, ends, setting)
    seen_at = []
    if face is not None:
        seen_at.append(face.s - 0.5 * rise * side_mm)
    if front is not None:
        seen_at.append(front.s + rise * setting.axis_height_mm)
    if len(seen_at) == 2 and abs(seen_at[1] - seen_at[0]) > APART_PX:
        apart = seen_at[1] - seen_at[0]
        return seen_at[is_face(apart, setting.face_px(refined.fit.curve))]
    if len(seen_at) == 2:
        return between(seen_at[0], seen_at[1], refined.clamp)
    return seen_at[0] if seen_at else 0.0


def _hidden_root(refined: Refined, ends: LocalView, setting: Setting) -> float:
    """Return the root where the clamp's top edge hides it: by height, or by length."""
    rise, along = float(ends.rise_along[0]), float(ends.along[0])
    if setting.clamp_height_mm is not None:
        return -rise * (setting.clamp_height_mm - setting.axis_height_mm)
    if setting.length_mm is None:
        return 0.0
    missing = setting.length_mm * along - refined.tip.s
    return -float(np.clip(missing, 0.0, 10.0 * rise))


def root_hidden(refined: Refined, setting: Setting) -> bool:
    """Whether the clamp's top may hide more of the root than `HIDDEN_MM`.

    Not where the height of the clamp or the length of the rod is known: then the root
    is put where it belongs.
    """
    if setting.calibration is None:
        return False
    ends = refined.fit.curve.points[:1], refined.fit.curve.theta[:1]
    at = setting.view(setting.calibration, *ends)
    hidden = _hidden_px(refined, setting, float(at.rise_along[0]))
    return hidden > HIDDEN_MM * float(at.along[0])


def _hidden_px(refined: Refined, setting: Setting, rise: float) -> float:
    """Return how much of the root a clamp of unknown height may hide."""
    known = setting.clamp_height_mm is not None or setting.length_mm is not None
    return 0.0 if known or refined.clamp is None else max(0.0, rise) * UNKNOWN_CLAMP_MM
