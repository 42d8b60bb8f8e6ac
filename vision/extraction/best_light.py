"""Measure a rod that was found roughly, in the light that shows it best."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..edge.state import BROKEN, LostError
from ..find.candidate import Candidate
from ..find.ground import View
from ..find.shadeless import in_its_colour, in_lightness
from ..find.track import Start, start_curve
from ..measurement import Measurement
from ..picture.photo import Photo
from .believed import apart_from_colour, doubted, is_elsewhere, lies_out
from .finish import FAR, ROUGHLY, finish
from .setting import Setting
from .streak import is_parted, whole_rod
from .strip import Strip, along_candidate, blur_of
from .two_levels import rod_alone

Image = NDArray[np.float32]

BOTH = 1.25
"""Width over that of a rod alone, above which it is of rod and shade once more."""

SMOOTH = 0.12
"""Blur for a rough rod, in widths: its two edges do not feel each other yet."""

WANDER = 8.0
"""Blur, in jumps of the width, from which it is none of a yarn's."""

AS_COLOURED = 0.1
"""How far a side may be from where a rod's colour has it, in widths, that is no
shade's."""


class TooWideError(LostError):
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
    elsewhere = not seen.plain and is_elsewhere(plain, rod)
    if found is not None and ("rough_edges" in plain.flags or elsewhere):
        return found
    if lost is not None and elsewhere:
        raise lost
    sure = not seen.plain and apart_from_colour(plain, rod) < AS_COLOURED
    return plain if sure else doubted(plain)


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
    start = _start(view.grey, candidate, view.sign)
    soft = start.rough or far is not None
    alone = None if soft else rod_alone(strip, candidate, start.width)
    if alone is None:
        return _from_start(photo, setting, candidate, view, start, far)
    try:
        bare = _start(view.grey, alone, view.sign)
        found = _from_start(photo, setting, alone, view, bare, far)
    except LostError as lost:
        if lost.flag != "edges_lost":
            raise
        # What was told from it has no edges, and was no rod.
        found = _from_start(photo, setting, candidate, view, start, far)
    if found.width_px > BOTH * alone.width_px + ROUGHLY:
        raise TooWideError(found)
    return found


def _from_start(
    photo: Photo, setting: Setting, candidate: Candidate, view: View, start: Start,
    far: tuple[float, float] | None,
) -> Measurement:  # fmt: skip
    """Measure a rod from where its edges are about.

    Raises
    ------
    LostError
        If there is nothing to vouch for.
    """
    grey = view.grey
    if far is not None:
        # Taken for sharp, such edges would be sought between too close levels, and seem
        # the sharper for it.
        start = replace(start, rough=False, blur=far[0], width=far[1])
    elif start.rough:
        # Strands, gaps and hairs blurred away, what is left is how much is rod.
        blur = SMOOTH * start.width
        grey = np.asarray(cv2.GaussianBlur(grey, (0, 0), blur))
        smooth = _start(grey, candidate, view.sign, blur)
        start = replace(smooth, rough=True, width=start.width)
    return finish(photo, replace(view, grey=grey), start, candidate, setting)


def _far(strip: Strip) -> tuple[float, float] | None:
    """Return blur and width, px, of a rod whose edges feel each other in the blur."""
    blur, width, jump = blur_of(strip)
    return (blur, width) if blur > max(FAR * width, WANDER * jump) else None


def _start(grey: Image, candidate: Candidate, sign: float, blur: float = 1.0) -> Start:
    start = start_curve(
        grey, candidate.points_px, candidate.width_px, sign=sign,
        follow=candidate.root == "clamp", blur=blur, whole=candidate.from_front,
    )  # fmt: skip
    if start is None:
        raise LostError("edges_lost", "the rod has no two edges against the paper")
    return start
