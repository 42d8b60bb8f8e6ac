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
from .root import RootPlace

Array = NDArray[np.float64]

TIP_PX, WIDTH_PX, WIDTH_SHADE = 0.05, 0.03, 0.3
"""Systematic parts: of an end face whose edge is not straight, and of a width whose
blur is no Gaussian's; and the share of a shade's pull that is left in a width."""
END_FACE, SIDE_FACE, PALE_FACE = 0.1, 0.07, 0.5
"""Doubt of where an end or a side ends whose face is seen, in widths of that face: it
has another grey value than the top, and one that is not known on a rod that is not
dark."""


def side_face(seen_in: View) -> float:
    """Return the doubt of a side face in the light in which a rod is seen."""
    return SIDE_FACE if seen_in.sign > 0.0 and seen_in.mix is None else PALE_FACE


def scale_sd(camera: Calibration, rod_height_mm: float) -> float:
    """Return how well the scale is known at the rod's height, relative."""
    if rod_height_mm == 0.0:
        return 0.0
    height = camera.camera_height_mm
    return abs(rod_height_mm) * camera.camera_height_sd_mm / height**2


def with_deviations(
    result: Measurement, refined: Refined, root: RootPlace, view: LocalView,
    camera: Calibration, height_mm: float, faces: float,
) -> Measurement:  # fmt: skip
    """Return a measurement with its standard deviations.

    Parameters
    ----------
    result : Measurement
        In mm.
    refined, root
        The rod in pixels, and where it begins.
    view : LocalView
        How the camera sees its points.
    camera : Calibration
        The camera.
    height_mm : float
        Of the axis above the board's plane.
    faces : float
        Doubt of a side face, in its width.
    """
    own = camera.scale_relative_sd
    scale = math.hypot(own if math.isfinite(own) else 0.0, scale_sd(camera, height_mm))
    clamp = root.sd / float(view.along[0])
    face = END_FACE * abs(float(view.rise_along[-1])) * result.width_mm
    tip = math.hypot(refined.tip.sigma, TIP_PX, face) / float(view.along[-1])
    wall = faces * median(np.abs(view.rise_across)) * result.width_mm
    noise = median(refined.sigma_width) / math.sqrt(max(1.0, _widths(refined)))
    shade = WIDTH_SHADE * median(refined.shaded)
    width = math.hypot(noise, WIDTH_PX, shade, wall) / median(view.across)
    return replace(
        result,
        length_sd_mm=math.hypot(clamp, tip, scale * result.length_mm),
        width_sd_mm=math.hypot(width, scale * result.width_mm),
        clamp_sd_mm=clamp,
        tip_sd_mm=_tip_sd_mm(result, clamp, tip, scale),
    )


def _widths(refined: Refined) -> float:
    return float(refined.fit.curve.s[-1]) / refined.typical_width


def _tip_sd_mm(
    result: Measurement, clamp: float, tip: float, scale: float
) -> tuple[float, float]:
    """Return the tip's deviations along x and y of the specimen frame."""
    across = result.points["sigma_mm"]
    end = math.radians(result.tip_angle_deg)
    turn = math.radians(result.clamp_angle_sd_deg)
    x, y = result.tip_mm
    parts = np.array(
        [
            [tip * math.cos(end), tip * math.sin(end)],
            [across[-1] * math.sin(end), across[-1] * math.cos(end)],
            [clamp, across[0]],
            [turn * y, turn * x],
            [scale * x, scale * y],
        ]
    )
    sd_x, sd_y = np.hypot.reduce(parts, axis=0)
    return float(sd_x), float(sd_y)
