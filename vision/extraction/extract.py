"""One photograph to one measurement: find, refine, judge, and turn pixels into mm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import MagbendError
from ..camera.calibration import Calibration
from ..curve.curve import Curve
from ..edge.state import LostError
from ..find.binarise import Binary, binarise, rebinarise
from ..find.rod import LEAST_SHARE, Candidate, find_candidates
from ..find.track import Start, start_curve
from ..measurement import Measurement, failure
from ..picture.photo import Photo
from .quality import doubts, refusal
from .refine import refine
from .specimen_frame import Setting, measurement

Array = NDArray[np.float64]
Image = NDArray[np.float32]
Clamp = Literal["auto", "none"]

_BROKEN = (
    np.linalg.LinAlgError, ArithmeticError, ValueError, IndexError, cv2.error
)  # fmt: skip
"""What numerics raise on pictures that hold no rod after all."""

_PALER = 0.25
"""How much lighter than the rod, of the paper's light, a thing is that is no rod."""

LEAST_LENGTH = 0.08
"""Shortest rod, in diagonals of the picture: below that it is dust, hair or print."""


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
    binary, candidate = _find(photo, binary, invert, clamp)
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


def _find(
    photo: Photo, binary: Binary, invert: bool | None, clamp: Clamp
) -> tuple[Binary, Candidate]:
    """Return the rod and its mask; glints make grey paper look like a dark board."""
    try:
        return binary, _choose(binary, clamp)
    except LostError as lost:
        if lost.flag != "no_rod" or invert is not None or not binary.inverted:
            raise
        dark = binarise(photo.grey, invert=False)
        if dark is None:
            raise
        return dark, _choose(dark, clamp)


def _choose(binary: Binary, clamp: Clamp) -> Candidate:
    """Return the rod; a paler clamp shows only at higher levels."""
    best: Candidate | None = None
    least = LEAST_LENGTH * binary.factor * float(np.hypot(*binary.mask.shape))
    for level in _levels(binary):
        at_level = binary if level == binary.threshold else rebinarise(binary, level)
        rods = [item for item in find_candidates(at_level) if item.length_px > least]
        if not rods:
            continue
        rod = _likeliest(rods)
        _refuse_second(rod, rods)
        # What shows only where less is dark may be the clamp's shade: seek its root.
        alike = best is None or _is_part(best, rod)
        if rod.root != "free" and alike:
            return _accept(rod)
        best = best or rod
    if best is None:
        raise LostError("no_rod", "nothing in the picture is long and thin like a rod")
    if clamp == "none":
        return best
    raise LostError(
        "no_clamp",
        "the rod grows from no clamp and from no border of the picture; "
        "for a rod that floats freely say so with clamp none",
    )


def _levels(binary: Binary) -> list[float]:
    """Return the levels to try: a pale rod on a board is best told from the board."""
    first = binary.threshold
    higher = [level for level in (0.6, 0.75) if level > first + 0.05]
    return [*higher, first] if binary.inverted else [first, *higher]


def _is_part(one: Candidate, other: Candidate) -> bool:
    """Whether a candidate's middle lies on another."""
    middle = one.points_px[len(one.points_px) // 2]
    return other.away(middle) < max(one.width_px, other.width_px)


def _likeliest(rods: list[Candidate]) -> Candidate:
    """Return the longest that is no hair, but rather one in a clamp than another."""
    thick = [
        rod
        for rod in rods
        if not any(
            rod.width_px < 0.5 * other.width_px
            and rod.root != "clamp"
            and other.length_px > LEAST_SHARE * rod.length_px
            and other.ratio < rod.ratio + 0.1
            for other in rods
        )
    ]
    clamped = [
        rod
        for rod in thick
        if rod.root == "clamp" and rod.length_px > LEAST_SHARE * thick[0].length_px
    ]
    return clamped[0] if clamped else thick[0]


def _refuse_second(first: Candidate, rods: list[Candidate]) -> None:
    alike = [
        other
        for other in rods
        if other is not first
        and 0.5 < other.width_px / first.width_px < 2.0
        and other.length_px > 0.4 * first.length_px
        and other.ratio < first.ratio + _PALER
    ]
    if len(alike) == 1:
        raise LostError(
            "two_rods",
            "there are two things like a rod in the picture; cover one of them",
        )
    if alike:
        raise LostError(
            "no_rod",
            f"there are {len(alike) + 1} long and thin things in the picture and none "
            "that stands out as the rod",
        )


def _accept(rod: Candidate) -> Candidate:
    if rod.contacts > 1:
        flag = "touches_border" if rod.root == "border" else "touches_object"
        what = "the border of the picture" if rod.root == "border" else "another object"
        raise LostError(flag, f"the rod touches {what} besides its root")
    return rod
