"""One photograph to one measurement: find, refine, judge, and turn pixels into mm."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import MagbendError
from ..camera.calibration import Calibration
from ..camera.find_tag import TaggedClamp, tagged_clamp
from ..camera.oriented import oriented
from ..curve.curve import Curve
from ..curve.robust import median
from ..edge.state import LostError
from ..find.candidate import Candidate
from ..find.choose import find_rod, search_rod
from ..find.coloured import shows_another
from ..find.ground import LUMINANCE, View
from ..find.shadeless import in_its_colour, in_lightness
from ..find.track import Start, start_curve
from ..measurement import Measurement, Pose, failure
from ..picture.photo import Photo
from .bare import flattened
from .crossing import crossings
from .quality import (
    AROUND,
    OTHER_COLOUR,
    OTHER_ROD,
    TIP_GOES_ON,
    doubts,
    doubts_around,
    is_as_before,
    refusal,
)
from .refine import Refined, refine
from .setting import Setting
from .specimen_frame import measurement
from .streak import is_parted, whole_rod
from .strip import Strip, along_candidate, along_rod, blur_of
from .two_levels import rod_alone

Array = NDArray[np.float64]
Image = NDArray[np.float32]

BROKEN = (
    np.linalg.LinAlgError, ArithmeticError, ValueError, IndexError, cv2.error
)  # fmt: skip
"""What numerics raise on pictures that hold no rod after all."""


PALE = 0.3
"""Light of a rod, over the paper's, above which it may be a shade, or a face of
something: all levels and colours are then looked at."""

BOTH = 1.25
"""Width over that of a rod alone, above which it is of rod and shade once more."""

SMOOTH = 0.12
"""Blur for a rough rod, in widths: its two edges do not feel each other yet."""

FAR, WANDER = 0.15, 8.0
"""Blur, in widths, from which edges are sought as blurred from the start, and in jumps
of the width, which are more on a yarn."""

TOO_FAR, COLLAPSED, ROUGHLY = 0.5, 0.9, 1.0
"""Blur, in widths, in which a width cannot be told from the blur; and width over that
of the start, below which edges were lost, with how well that is known, px."""


AS_COLOURED, ELSEWHERE = 0.1, 0.5
"""How far a side may be from where a rod's colour has it, in widths: so little that it
is no shade's, and so much that it is no side of that rod."""


def extract(photo: Photo, calibration: Calibration | None, **known: Any) -> Measurement:
    """Measure the rod in a photograph, from clamp to tip.

    Parameters
    ----------
    photo : Photo
        The photograph, in linear light.
    calibration : Calibration or None
        The camera; without it only pixels are given, flagged ``uncalibrated``.
    **known
        What else is known: the fields of `Setting`, such as ``rod_height_mm``.

    Returns
    -------
    Measurement
        Failed, with flag and reason, where there is nothing to vouch for; never raises
        for what a picture shows.
    """
    return measure(photo, Setting(calibration=calibration, **known))


def measure(photo: Photo, setting: Setting) -> Measurement:
    """Measure one photograph; a refusal is a value, never an exception.

    Parameters
    ----------
    photo : Photo
        The photograph.
    setting : Setting
        Calibration, and what else is known.
    """
    try:
        if setting.calibration is not None:
            photo = oriented(photo, setting.calibration)
            setting.calibration.check_size(*photo.size_px)
        if setting.bare is not None:
            photo = flattened(photo, setting.bare, setting.guide_px)
        return _measure(photo, setting)
    except LostError as lost:
        refused = failure(lost.flag, lost.reason)
        return replace(refused, seen_px=lost.seen_px)
    except MagbendError as error:
        return failure("calibration_mismatch", str(error))
    except BROKEN as error:
        return failure("not_measurable", f"the picture cannot be measured ({error})")


def _measure(photo: Photo, setting: Setting) -> Measurement:
    """Measure what one level of lightness shows, else what all levels show."""
    sought = setting.sought(photo.size_px)
    quick, doubt = None, LostError("no_rod", "nothing stands out from the background")
    try:
        rod, view = find_rod(photo, sought)
        quick = _measured(photo, setting, rod, view)
        if _is_sure(quick, rod, view) and not shows_another(photo, rod):
            return quick
    except LostError as lost:
        doubt = lost
    except BROKEN:
        pass
    try:
        whole = _measured(photo, setting, *search_rod(photo, sought))
    except (LostError, *BROKEN) as lost:
        if quick is not None:
            return _doubted(quick)
        if isinstance(lost, LostError) and lost.seen_px:
            raise
        raise _empty(photo) or doubt from None
    return whole if quick is None else _better(quick, whole)


def _measured(
    photo: Photo, setting: Setting, rod: Candidate, view: View
) -> Measurement:
    """Measure what was found; a refusal shows it."""
    try:
        return measure_candidate(photo, setting, rod, view)
    except LostError as lost:
        raise LostError(lost.flag, lost.reason, [rod.points_px]) from None


def _is_sure(quick: Measurement, rod: Candidate, view: View) -> bool:
    """Whether one level of lightness may have shown the whole rod, and no shade.

    What was measured by a colour of its own all along is none.
    """
    doubts = {TIP_GOES_ON, OTHER_COLOUR, "clamp_at_border"} & set(quick.flags)
    coloured = quick.mix not in (None, LUMINANCE, view.mix)
    return not doubts and (coloured or rod.ratio < PALE)


def _doubted(quick: Measurement) -> Measurement:
    """Return what one level shows and all levels together do not."""
    if {TIP_GOES_ON, "clamp_at_border", OTHER_ROD, OTHER_COLOUR} & set(quick.flags):
        return quick
    return replace(quick, flags=(*quick.flags, OTHER_ROD))


def _better(quick: Measurement, whole: Measurement) -> Measurement:
    """Return the one of two measurements that is longer, or held by a clamp."""
    if "clamp_at_border" in quick.flags:
        held = not {"clamp_at_border", "no_clamp", "rough_edges"} & set(whole.flags)
        return whole if held else quick
    return (
        quick if _same(quick, whole) and quick.length_px >= whole.length_px else whole
    )


def _same(one: Measurement, other: Measurement) -> bool:
    """Whether two measurements are of one rod: the middle of one lies on the other."""
    middle = len(one.points["x_px"]) // 2
    away = np.hypot(
        other.points["x_px"] - one.points["x_px"][middle],
        other.points["y_px"] - one.points["y_px"][middle],
    )
    return bool(away.min() < max(one.width_px, other.width_px))


def measure_candidate(
    photo: Photo, setting: Setting, candidate: Candidate, view: View
) -> Measurement:
    """Measure a rod that was found roughly.

    Raises
    ------
    LostError
        If there is nothing to vouch for.
    """
    strip = along_candidate(view, candidate)
    far, parted = _far(strip), is_parted(strip)
    rod, seen = candidate, view
    if far is None:  # no shade is hard otherwise
        rod, seen = in_its_colour(photo, candidate, view)
    if seen.plain and (parted or far is not None):
        # A streak may have left but a rim: its picture is needed farther from that.
        rod, seen = candidate, in_lightness(photo, None if parted else candidate, view)
    if seen is view:
        return _measured_in(photo, setting, rod, view, strip, far, glossy=parted)
    found = lost = None
    try:
        new = along_candidate(seen, rod)
        found = _measured_in(
            photo, setting, rod, seen, new, far, glossy=is_parted(new)
        )  # fmt: skip
    except LostError as error:
        lost = error
    # What makes a rod rough in a mix of colours may be the mix's noise.
    if found is not None and (seen.plain or "rough_edges" not in found.flags):
        return found
    try:
        plain = _measured_in(
            photo, setting, candidate, view, strip, far, glossy=parted
        )  # fmt: skip
    except LostError:
        if found is None:
            raise
        return found
    apart = AS_COLOURED if seen.plain else _apart(plain, rod)
    if found is not None and ("rough_edges" in plain.flags or apart > ELSEWHERE):
        return found
    if lost is not None and apart > ELSEWHERE:
        raise lost
    return plain if apart < AS_COLOURED else _doubted(plain)


def _apart(plain: Measurement, rod: Candidate) -> float:
    """Return how far a side is from where the colour of a rod has it, in its widths.

    Colour tells sides less well, but knows no shade.
    """
    points, n = plain.points, len(rod.points_px)
    axis = np.column_stack([points["x_px"], points["y_px"]])
    right = np.column_stack([points["right_x_px"], points["right_y_px"]])
    inner = rod.points_px[n // 8 : n - n // 8]
    nearest = np.hypot(*(inner[:, None] - axis).T).argmin(axis=0)
    across = (right - axis)[nearest]
    across /= np.hypot(*across.T)[:, None]
    aside = median(np.sum((inner - axis[nearest]) * across, axis=1))
    wider = 0.5 * (plain.width_px - rod.width_px)
    return (abs(aside) + abs(wider)) / rod.width_px


def _measured_in(
    photo: Photo, setting: Setting, candidate: Candidate, view: View, strip: Strip,
    far: tuple[float, float] | None, *, glossy: bool,
) -> Measurement:  # fmt: skip
    """Measure a rod in one light, in which it is seen along a strip.

    Raises
    ------
    LostError
        If there is nothing to vouch for.
    """
    if glossy:
        view, candidate = whole_rod(view, candidate)
        strip = along_candidate(view, candidate)
        far = _far(strip)
    elif candidate.halved:
        candidate = replace(candidate, rivalled=True)
    grey, sign = view.grey, view.sign
    start = _start(grey, candidate, sign)
    soft = start.rough or far is not None
    alone = None if soft else rod_alone(strip, candidate, start.width)
    if alone is not None:
        candidate, start = alone, _start(grey, alone, sign)
    if far is not None:
        # Taken for sharp, such edges would be sought between too close levels, and seem
        # the sharper for it.
        start = replace(start, rough=False, blur=far[0], width=far[1])
    elif start.rough:
        # Strands, gaps and hairs blurred away, what is left is how much is rod.
        blur = SMOOTH * start.width
        grey = np.asarray(cv2.GaussianBlur(grey, (0, 0), blur))
        smooth = _start(grey, candidate, sign, blur)
        start = replace(smooth, rough=True, width=start.width)
    result = finish(photo, replace(view, grey=grey), start, candidate, setting)
    if alone is not None and result.width_px > BOTH * alone.width_px:
        raise LostError(
            "edges_lost",
            "the rod cannot be told from the deep shade beside it: light it from more "
            "sides",
        )
    return result


def _far(strip: Strip) -> tuple[float, float] | None:
    """Return blur and width, px, of a rod whose edges feel each other in the blur."""
    blur, width, jump = blur_of(strip)
    return (blur, width) if blur > max(FAR * width, WANDER * jump) else None


def finish(
    photo: Photo, view: View, start: Start, candidate: Candidate, setting: Setting, *,
    sd_px: float = np.inf, last: Measurement | None = None,
) -> Measurement:  # fmt: skip
    """Refine, judge and turn into mm what starts from a curve near the axis.

    Parameters
    ----------
    photo, view
        The photograph, and its light as it is to be refined.
    start, candidate
        The curve, and what was found before it.
    setting : Setting
        What is known.
    sd_px : float
        How surely the start tells the rod and its ends; see `refine`.
    last : Measurement, optional
        The same rod, about as bent, in another frame of a film: its joints are where
        they were, and so is what lies around it unless the rod is seen differently.

    Raises
    ------
    LostError
        If there is nothing to vouch for.
    """
    joints = None if last is None else last.joints_px
    refined = _refined(photo, view, start, candidate, setting, sd_px, joints)
    if np.isfinite(sd_px) and not refined.settled:
        raise LostError("edges_lost", "the rod moved too far since the last frame")
    result = None if last is None else _in_mm(photo, view, refined, setting)
    if result is not None and last is not None and is_as_before(result, last):
        around = AROUND & set(last.flags)
    else:
        strip = along_rod(view, refined)
        across = crossings(strip, refined, candidate.hidden_px)
        if len(across) and not refined.rough:
            hidden = np.vstack([candidate.hidden_px, across])
            candidate = replace(candidate, hidden_px=hidden)
            refined = _refined(photo, view, start, candidate, setting, sd_px, joints)
            strip, result = along_rod(view, refined), None
        refusal(photo, view, strip, refined, candidate)
        around = doubts_around(photo, view, strip, refined, candidate, setting)
    if result is None:
        result = _in_mm(photo, view, refined, setting)
    return doubts(result, photo, around, refined, candidate, setting)


def _in_mm(photo: Photo, view: View, refined: Refined, setting: Setting) -> Measurement:
    """Return the measurement of a refined rod, without a word of doubt."""
    told = _told(photo, setting, refined.fit.curve)
    return replace(
        measurement(refined, view, setting, told), inverted=view.sign < 0.0,
        mix=view.mix, joints_px=refined.joints,
    )  # fmt: skip


def _refined(
    photo: Photo, view: View, start: Start, candidate: Candidate, setting: Setting,
    sd_px: float, joints: Array | None,
) -> Refined:  # fmt: skip
    """Return axis, edges and ends, where these are as far apart as at the start."""
    walls = setting.calibration is not None and view.sign > 0.0 and not setting.is_round
    refined = refine(
        view.grey, start, root=candidate.root, sign=view.sign,
        joints=setting.joints_px, walls=setting.walls_px if walls else None,
        face_px=setting.face_px(start.curve), sd_px=sd_px,
        known_joints=joints, plain=None if view.plain else photo.grey,
        hidden_px=candidate.hidden_px, photo=photo,
    )  # fmt: skip
    if start.blur > FAR * start.width:
        lost = refined.blur > TOO_FAR * refined.typical_width
    else:
        least = COLLAPSED * (start.width - ROUGHLY)
        lost = not start.rough and refined.typical_width < least
    if lost:
        raise LostError(
            "edges_lost",
            "the rod's two edges are seen closer together than it is wide: focus the "
            "lens, or soften the light on a glossy rod",
        )
    return refined


def _told(photo: Photo, setting: Setting, curve: Curve) -> TaggedClamp | None:
    """Return what a tag on the clamp tells, where there is one."""
    camera = setting.calibration
    if camera is None or camera.clamp_tag is None:
        return None
    root, ahead = camera.to_mm(curve.points[:2], height_mm=setting.axis_height_mm)
    x, y = ahead - root
    heading = math.degrees(math.atan2(y, x))
    rod = Pose(x_mm=float(root[0]), y_mm=float(root[1]), angle_deg=heading)
    return tagged_clamp(photo.grey, camera, rod)


def _start(grey: Image, candidate: Candidate, sign: float, blur: float = 1.0) -> Start:
    start = start_curve(
        grey, candidate.points_px, candidate.width_px, sign=sign,
        follow=candidate.root == "clamp", blur=blur,
    )  # fmt: skip
    if start is None:
        raise LostError("edges_lost", "the rod has no two edges against the paper")
    return start


def _empty(photo: Photo) -> LostError | None:
    """Return what keeps anything from being seen; None where that is not the light."""
    if photo.clipped > 0.5:
        return LostError("overexposed", "the picture is white all over; expose it less")
    if float(photo.grey.max()) < 0.02:
        return LostError(
            "underexposed", "the picture is black all over; expose it more"
        )
    return None
