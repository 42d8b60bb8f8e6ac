"""How well length, tip, width and the clamp's place are known, in mm.

What is measured in pixels has the deviations of its fit; the frame hangs on the clamp's
place and direction; everything scales with the millimetres of a pixel.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..camera.calibration import Calibration
from ..camera.projection import LocalView
from ..curve.robust import median
from ..find.ground import View
from ..measurement import Measurement
from .refine import Refined
from .setting import Setting

Array = NDArray[np.float64]

EDGE_MM = 0.001
"""Doubt of where a clamp or a rod ends, or its sides: no edge is sharper."""
TIP_BLUR = 0.01
"""Doubt of an end, in its blurs."""
WIDTH_BLUR, WIDTH_SHADE, WIDTH_GROWTH = 0.02, 0.6, 3.0
"""Doubt of a width: in blurs, which are no Gaussian's; the share of a shade's pull that
is left in it; and over what edges differ with closer levels, as beside a limb that is
rounded, or where a camera sharpened its picture."""
WIDTH_FELT = 6.0
"""And in widths times the fourth power of the blur in widths: by so little do width and
blur change a profile differently, and so much is a lens out of focus no Gaussian."""
FACE_SEEN, FACE_HIDDEN = 0.18, 0.02
"""Doubt of where an end is, in widths of its face where the camera sees it (it has
another grey value than the top), or where its lower edge is hidden."""
SIDE_FACE, PALE_FACE, WIDTH_FACE = 0.025, 0.5, 0.01
"""Doubt of where a side ends whose face is seen, in widths of that face: on a dark rod,
one that is not dark, and what of it is left in a dark rod's width."""
PALE_PX = 0.2
"""Doubt of a width that is not dark, whatever is seen of its sides."""
WHOLE, CUT_OFF = 0.05, 0.45
"""Doubt of an edge beside paper that is white, in px and again in blurs where all its
light was fitted; else in blurs. With 1.5 times what makes it white, half level of what
is left lies 0.43 blurs off."""


def is_dark(seen_in: View) -> bool:
    """Whether a rod is seen dark in plain light, so that its faces' light is known."""
    return seen_in.sign > 0.0 and seen_in.plain


def faces_px(refined: Refined, wall: Array, seen_in: View, *, told: bool) -> Array:
    """Return the doubt of the midline by side faces, px, positive on the right.

    Parameters
    ----------
    refined : Refined
        The rod in pixels.
    wall : ndarray, shape (n,)
        How wide its side wall is seen, px, positive on the left.
    seen_in : View
        The light it is seen in.
    told : bool
        Whether its section is: else it may be round and have no such wall.
    """
    share = SIDE_FACE if is_dark(seen_in) else PALE_FACE
    moved = 0.0 if told else refined.walled
    return np.asarray(-np.sign(wall) * np.hypot(share * wall, moved))


def scale_sd(camera: Calibration, rod_height_mm: float) -> float:
    """Return how well the scale is known at the rod's height, relative."""
    if rod_height_mm == 0.0:
        return 0.0
    height = camera.camera_height_mm
    return abs(rod_height_mm) * camera.camera_height_sd_mm / height**2


def with_deviations(
    result: Measurement, refined: Refined, clamped: Array, view: LocalView,
    camera: Calibration, setting: Setting, faces: Array, *, dark: bool,
) -> Measurement:  # fmt: skip
    """Return a measurement with its standard deviations.

    Parameters
    ----------
    result : Measurement
        In mm.
    refined : Refined
        The rod in pixels.
    clamped : ndarray, shape (2, 2)
        Covariance of where it leaves the clamp and of its direction there, px and rad.
    view : LocalView
        How the camera sees its points.
    camera, setting : Calibration, Setting
        The camera, and what else is known.
    faces : ndarray, shape (n,)
        Doubt of the midline by side faces, px.
    dark : bool
        Whether the rod is seen dark in plain light.
    """
    own = camera.scale_relative_sd if math.isfinite(camera.scale_relative_sd) else 0.0
    scale = math.hypot(own, scale_sd(camera, setting.axis_height_mm))
    to_mm = np.array([1.0 / float(view.along[0]), 1.0])
    clamped = clamped * np.outer(to_mm, to_mm)
    clamp = math.sqrt(clamped[0, 0])
    rise = float(view.rise_along[-1])
    seen = rise < 0.0 or not dark
    face = rise * (FACE_SEEN if seen else FACE_HIDDEN)
    along = float(view.along[-1])
    tip = math.hypot(
        refined.tip.sigma,
        TIP_BLUR * refined.blur,
        face * result.width_mm,
        white_px(refined),
        EDGE_MM * along,
    ) / along  # fmt: skip
    wall = WIDTH_FACE if dark else PALE_FACE
    width = math.hypot(
        median(refined.sigma_width) / math.sqrt(max(1.0, _widths(refined))),
        WIDTH_BLUR * refined.blur if dark else PALE_PX,
        WIDTH_SHADE * median(refined.shaded),
        WIDTH_GROWTH * refined.growth,
        wall * median(np.abs(view.rise_across)) * result.width_mm,
        2.0 * white_px(refined),
        WIDTH_FELT * refined.blur**4 / refined.typical_width**3,
    ) / median(view.across)
    untold = math.hypot(EDGE_MM, _section_mm(result, view, setting))
    return replace(
        result,
        length_sd_mm=math.hypot(clamp, tip, scale * result.length_mm),
        width_sd_mm=math.hypot(width, untold, scale * result.width_mm),
        clamp_sd_mm=clamp,
        tip_sd_mm=_tip_sd_mm(result, faces / view.along, clamped, tip, scale),
    )


def _section_mm(result: Measurement, view: LocalView, setting: Setting) -> float:
    """Return by how much a rod of untold section is wider if it is flat or round."""
    if setting.is_round is not None:
        return 0.0
    seen = median(np.abs(view.rise_across) / view.across)
    return setting.height_share * result.width_mm * seen


def white_px(refined: Refined) -> float:
    """Return the doubt of an edge because of white beside it, px."""
    unsure = WHOLE * (1.0 + refined.blur) if refined.whole else CUT_OFF * refined.blur
    return unsure * refined.saturated


def _widths(refined: Refined) -> float:
    return float(refined.fit.curve.s[-1]) / refined.typical_width


def _tip_sd_mm(
    result: Measurement, faces: Array, clamped: Array, tip: float, scale: float
) -> tuple[float, float]:
    """Return the tip's deviations along x and y of the specimen frame.

    What side faces shift alike at the root and at the tip moves the frame with the tip.
    A clamp that is taken too far out by d, and turned too far by f, moves the tip by
    y f - d along x, and by -x f along y.
    """
    own = result.points["sigma_mm"]
    across = np.sqrt(np.maximum(own**2 - faces**2, 0.0))
    beside = math.hypot(across[-1], faces[-1] - faces[0])
    end = math.radians(result.tip_angle_deg)
    x, y = result.tip_mm
    moves = np.array([[-1.0, y], [0.0, -x]])
    frame = np.diag(moves @ clamped @ moves.T)
    parts = np.array(
        [
            [tip * math.cos(end), tip * math.sin(end)],
            [beside * math.sin(end), beside * math.cos(end)],
            [0.0, across[0]],
            [scale * x, scale * y],
        ]
    )
    sd_x, sd_y = np.sqrt(np.sum(parts**2, axis=0) + frame)
    return float(sd_x), float(sd_y)
