"""One photograph to one measurement: find, refine, judge, and turn pixels into mm."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import MagbendError
from ..camera.calibration import Calibration
from ..camera.oriented import oriented
from ..edge.state import LostError
from ..find.candidate import Candidate
from ..find.choose import find_rod, likely_rods, seen_best
from ..find.coloured import shows_another
from ..find.ground import View
from ..find.held import held
from ..find.shadeless import in_its_colour, in_lightness
from ..find.sought import Sought
from ..find.track import Start, start_curve
from ..measurement import Measurement, failure
from ..picture.photo import Photo
from .bare import flattened
from .believed import (
    apart_from_colour,
    better,
    doubted,
    is_sure,
    is_whole,
    lies_out,
)
from .crossing import crossings
from .quality import (
    AROUND,
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
from .told_clamp import seen_tag
from .two_levels import rod_alone

Array = NDArray[np.float64]
Image = NDArray[np.float32]

BROKEN = (
    np.linalg.LinAlgError, ArithmeticError, ValueError, IndexError, cv2.error
)  # fmt: skip
"""What numerics raise on pictures that hold no rod after all."""


BOTH = 1.25
"""Width over that of a rod alone, above which it is of rod and shade once more."""

ASIDE = 1.8
"""How much wider a rod may be than what stood out of it, as on its shaded side only."""

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


class _TooWideError(LostError):
    """What was measured is wider than its rod: with its shade, or that has a streak.

    Parameters
    ----------
    found : Measurement
        What was measured.
    """

    def __init__(self, found: Measurement) -> None:
        super().__init__(
            "edges_lost",
            "the rod cannot be told from the deep shade beside it: light it from more "
            "sides",
        )
        self.found = found


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
        quick = _from_front(photo, setting, rod, view)
        if is_sure(quick, rod, view) and not shows_another(photo, rod):
            return quick
    except LostError as lost:
        doubt = lost
    except BROKEN:
        pass
    try:
        whole = _searched(photo, setting, sought)
    except (LostError, *BROKEN) as lost:
        if quick is None and isinstance(doubt, _TooWideError):
            quick = doubt.found
        if quick is not None:
            return doubted(quick)
        if isinstance(lost, LostError) and lost.seen_px:
            raise
        raise _empty(photo) or doubt from None
    return whole if quick is None else better(quick, whole)


def _searched(photo: Photo, setting: Setting, sought: Sought) -> Measurement:
    """Measure the likeliest of what all levels show that can be measured.

    Of one that goes on beyond its tip, the next that is all of it.

    Raises
    ------
    LostError
        Of the first thing that is like a rod.
    """
    first = LostError("no_rod", "nothing in the picture is long and thin like a rod")
    part = None
    try:
        for rod in likely_rods(photo, sought):
            try:
                found = _seen(photo, setting, *seen_best(photo, sought, rod))
            except LostError as lost:
                lost.seen_px = (rod.points_px,)
                first = first if first.seen_px else lost
                continue
            if is_whole(found, part):
                return found
            part = part or found
    except LostError as several:
        first = first if first.seen_px else several
    if part is None:
        raise first
    return part


def _seen(photo: Photo, setting: Setting, rod: Candidate, view: View) -> Measurement:
    """Measure a rod, with its edges farther aside if there are none nearer."""
    try:
        return _from_front(photo, setting, rod, view)
    except LostError as lost:
        if isinstance(lost, _TooWideError):
            return doubted(lost.found)
        if lost.flag != "edges_lost":
            raise
        wide = replace(rod, width_px=ASIDE * rod.width_px)
        try:
            found = doubted(measure_candidate(photo, setting, wide, view))
        except LostError:
            raise lost from None
        told, seen = in_its_colour(photo, rod, view)
        by_colour = seen is not view and not seen.plain
        if by_colour and apart_from_colour(found, told) > ELSEWHERE:
            raise
        return found


def _from_front(
    photo: Photo, setting: Setting, rod: Candidate, view: View
) -> Measurement:
    """Measure a rod, from the front that all colours show if its own light does not.

    A refusal shows it.
    """
    try:
        return measure_candidate(photo, setting, rod, view)
    except LostError as lost:
        lost.seen_px = (rod.points_px,)
        told = lost.flag != "no_clamp" or rod.from_front
        whole = None if told else held(photo, rod)
        with suppress(LostError):
            if whole is not None:
                return measure_candidate(photo, setting, whole, view)
        raise


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
    if far is None and not view.in_parts:  # no shade is hard otherwise
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
        return found if seen.plain else _sharper(photo, setting, rod, found)
    try:
        plain = _measured_in(
            photo, setting, candidate, view, strip, far, glossy=parted
        )  # fmt: skip
    except LostError:
        if found is None:
            raise
        return found
    apart = AS_COLOURED if seen.plain else apart_from_colour(plain, rod)
    if found is not None and ("rough_edges" in plain.flags or apart > ELSEWHERE):
        return found
    if lost is not None and apart > ELSEWHERE:
        raise lost
    return plain if apart < AS_COLOURED else doubted(plain)


def _sharper(
    photo: Photo, setting: Setting, rod: Candidate, found: Measurement
) -> Measurement:
    """Measure a rod in its lightness, where its colour shows it, if that is coarse."""
    if not lies_out(photo, found):
        return found
    rod = replace(rod, points_px=found.points_px, width_px=found.width_px)
    view = in_lightness(photo, rod, View(grey=photo.grey, sign=1.0))
    strip = along_candidate(view, rod)
    with suppress(LostError, *BROKEN):
        sharp = _measured_in(photo, setting, rod, view, strip, None, glossy=False)
        no_worse = set(sharp.flags) <= set(found.flags)
        if no_worse and apart_from_colour(sharp, rod) < AS_COLOURED:
            return sharp
    return found


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
    if alone is not None and result.width_px > BOTH * alone.width_px + ROUGHLY:
        raise _TooWideError(result)
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
        around = refusal(photo, view, strip, refined, candidate)
        around |= doubts_around(photo, view, strip, refined, candidate, setting)
    if result is None:
        result = _in_mm(photo, view, refined, setting)
    return doubts(result, photo, around, refined, candidate, setting)


def _in_mm(photo: Photo, view: View, refined: Refined, setting: Setting) -> Measurement:
    """Return the measurement of a refined rod, without a word of doubt."""
    tag = seen_tag(photo, setting, refined.fit.curve)
    return replace(
        measurement(refined, view, setting, tag), inverted=view.sign < 0.0,
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
        hidden_px=candidate.hidden_px, photo=photo, from_front=candidate.from_front,
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


def _start(grey: Image, candidate: Candidate, sign: float, blur: float = 1.0) -> Start:
    start = start_curve(
        grey, candidate.points_px, candidate.width_px, sign=sign,
        follow=candidate.root == "clamp", blur=blur, whole=candidate.from_front,
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
