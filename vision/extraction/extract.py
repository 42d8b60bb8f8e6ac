"""One photograph to one measurement: find, refine, judge, and turn pixels into mm."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

from ...core.errors import MagbendError
from ..camera.calibration import Calibration
from ..camera.oriented import oriented
from ..edge.state import BROKEN, LostError
from ..find.candidate import Candidate
from ..find.choose import find_rod, likely_rods, seen_best
from ..find.coloured import shows_another
from ..find.ground import View
from ..find.held import held
from ..find.rod import NO_ROD
from ..find.shadeless import in_its_colour
from ..find.sought import Sought
from ..measurement import Measurement, failure
from ..picture.photo import Photo
from .bare import flattened
from .believed import better, doubted, is_elsewhere, is_sure, is_whole
from .best_light import TooWideError, measure_candidate
from .setting import Setting

ASIDE = 1.8
"""How much wider a rod may be than what stood out of it, as on its shaded side only."""


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
        if quick is None and isinstance(doubt, TooWideError):
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
    first = LostError("no_rod", NO_ROD)
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
        if isinstance(lost, TooWideError):
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
        if by_colour and is_elsewhere(found, told):
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
            if whole is not None and whole.is_held_as(rod):
                return measure_candidate(photo, setting, whole, view)
        raise


def _empty(photo: Photo) -> LostError | None:
    """Return what keeps anything from being seen; None where that is not the light."""
    if photo.clipped > 0.5:
        return LostError("overexposed", "the picture is white all over; expose it less")
    if float(photo.grey.max()) < 0.02:
        return LostError(
            "underexposed", "the picture is black all over; expose it more"
        )
    return None
