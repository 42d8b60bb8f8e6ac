"""One photograph to one measurement: find, refine, judge, and turn pixels into mm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import MagbendError
from ..camera.calibration import Calibration
from ..curve.curve import Curve
from ..edge.state import LostError
from ..find.binarise import binarise
from ..find.choose import Clamp, find_rod
from ..find.rod import Candidate
from ..find.track import Start, start_curve
from ..measurement import Measurement, failure
from ..picture.photo import Photo
from .quality import doubts, refusal
from .refine import refine
from .specimen_frame import Setting, measurement

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_BROKEN = (
    np.linalg.LinAlgError, ArithmeticError, ValueError, IndexError, cv2.error
)  # fmt: skip
"""What numerics raise on pictures that hold no rod after all."""


SMOOTH = 0.12
"""Blur for a rough rod, in widths: its two edges do not feel each other yet."""


def extract(
    photo: Photo,
    calibration: Calibration | None,
    *,
    rod_height_mm: float | None = None,
    invert: bool | None = None,
    joints_mm: Sequence[float] = (),
    length_mm: float | None = None,
    clamp: Clamp = "auto",
    clamp_height_mm: float | None = None,
) -> Measurement:
    """Measure the rod in a photograph, from clamp to tip.

    Parameters
    ----------
    photo : Photo
        The photograph, in linear light.
    calibration : Calibration or None
        The camera; without it only pixels are given, flagged ``uncalibrated``.
    rod_height_mm : float, optional
        Height of the rod's axis above the board's plane; else the calibration's.
    invert : bool, optional
        True for a light rod on a dark background; detected when not given.
    joints_mm : sequence of float
        Arc lengths of stiffness joints, where the curvature may jump.
    length_mm : float, optional
        Nominal free length; a measured length 2 % off is flagged ``length_mismatch``.
    clamp : {"auto", "none"}
        ``none`` also measures a rod that floats freely, from one end to the other.
    clamp_height_mm : float, optional
        Height of the clamp's top above the board's plane. Needed only where the camera
        looks over the clamp so that it hides the root (flag ``root_hidden``).

    Returns
    -------
    Measurement
        Failed, with flag and reason, where there is nothing to vouch for; never raises
        for what a picture shows.
    """
    setting = Setting(
        calibration=calibration,
        rod_height_mm=_height(calibration, rod_height_mm),
        joints_mm=tuple(joints_mm),
        length_mm=length_mm,
        clamp_height_mm=clamp_height_mm,
    )
    try:
        if calibration is not None:
            calibration.check_size(*photo.size_px)
        return _extract(photo, setting, invert, clamp)
    except LostError as lost:
        return failure(lost.flag, lost.reason)
    except MagbendError as error:
        return failure("calibration_mismatch", str(error))
    except _BROKEN as error:
        return failure("not_measurable", f"the picture cannot be measured ({error})")


def _height(calibration: Calibration | None, given: float | None) -> float:
    if given is not None:
        return given
    return 0.0 if calibration is None else calibration.rod_height_mm


def _extract(
    photo: Photo, setting: Setting, invert: bool | None, clamp: Clamp
) -> Measurement:
    binary = binarise(photo.grey, invert=invert)
    if binary is None:
        return _empty(photo)
    binary, candidate = find_rod(photo, binary, invert, clamp)
    sign = -1.0 if binary.inverted else 1.0
    grey, start = photo.grey, _start(photo.grey, candidate, sign)
    if start.rough:
        # Strands, gaps and hairs blurred away, what is left is how much is rod.
        blur = SMOOTH * start.width
        grey = np.asarray(cv2.GaussianBlur(grey, (0, 0), blur))
        soft = _start(grey, candidate, sign, blur)
        start = replace(soft, rough=True, width=start.width)
    calibrated = setting.calibration is not None

    def joints(curve: Curve) -> Sequence[float]:
        return setting.joints_px(curve)

    refined = refine(
        grey, start, root=candidate.root, sign=sign, joints=joints,
        walls=setting.walls_px if calibrated and not binary.inverted else None,
        face_px=setting.face_px(start.curve),
    )  # fmt: skip
    refusal(photo, refined, candidate)
    result = measurement(refined, candidate, setting)
    return doubts(result, photo, refined, candidate, setting)


def _start(grey: Image, candidate: Candidate, sign: float, blur: float = 1.0) -> Start:
    start = start_curve(
        grey, candidate.points_px, candidate.width_px, sign=sign,
        follow=candidate.root == "clamp", blur=blur,
    )  # fmt: skip
    if start is None:
        raise LostError("edges_lost", "the rod has no two edges against the paper")
    return start


def _empty(photo: Photo) -> Measurement:
    if photo.clipped > 0.5:
        return failure("overexposed", "the picture is white all over; expose it less")
    if float(photo.grey.max()) < 0.02:
        return failure("underexposed", "the picture is black all over; expose it more")
    return failure("no_rod", "nothing stands out from the background")
