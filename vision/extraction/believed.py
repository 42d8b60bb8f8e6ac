"""Which of two measurements of one photograph is believed, and how much."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..curve.curve import arc_lengths
from ..curve.robust import median
from ..find.candidate import Candidate
from ..find.ground import LUMINANCE, View
from ..measurement import Measurement
from ..picture.photo import Photo
from ..picture.sample import bilinear
from .quality import OTHER_COLOUR, OTHER_ROD, TIP_GOES_ON

PALE = 0.3
"""Light of a rod, over the paper's, above which it may be a shade, or a face of
something: all levels and colours are then looked at."""

AS_LONG, AS_LONG_PX = 0.05, 1.0
"""By how much the lengths of a rod between the same ends may differ in two lights, in
widths and px."""

_NEAR, _FAR, _AS_WIDE = 0.5, 3.0, 1.3
"""Stretches before and behind a place on a rod, in widths, and by what factor their
widths differ where it ends, in a clamp say, between them."""

_ELSEWHERE = 0.5
"""How far from where a rod's colour has it a side is none of that rod, in widths."""

_OUT, _BEYOND = 0.62, 2.0
"""Light at a side, from the rod's to that beyond it, by so many blurs, which is half at
an edge and less in a shade: more is the paper's."""


def is_sure(quick: Measurement, rod: Candidate, view: View) -> bool:
    """Whether one level of lightness may have shown the whole rod, and no shade.

    What was measured by a colour of its own all along is none; what no clamp holds in
    its own light may be a part of a rod.
    """
    doubts = {TIP_GOES_ON, OTHER_COLOUR, "clamp_at_border"} & set(quick.flags)
    coloured = quick.mix not in (None, LUMINANCE, view.mix)
    return not doubts and not rod.from_front and (coloured or rod.ratio < PALE)


def doubted(quick: Measurement) -> Measurement:
    """Return what one level shows and all levels together do not."""
    if {TIP_GOES_ON, "clamp_at_border", OTHER_ROD, OTHER_COLOUR} & set(quick.flags):
        return quick
    return replace(quick, flags=(*quick.flags, OTHER_ROD))


def better(quick: Measurement, whole: Measurement) -> Measurement:
    """Return the one of two measurements that is longer, or held by a clamp.

    Of two with the same ends it is that with fewer flags. What ends where a rod that
    comes in at the border leads through is a part of that; where a clamp is in doubt,
    what is longer is the rod. Of two things, such as both walls of a tube, of which one
    has the other beside it, either may be the rod.
    """
    if "clamp_at_border" in quick.flags:
        held = not {"clamp_at_border", "no_clamp"} & set(whole.flags)
        if "clamp_doubtful" in whole.flags:
            held &= whole.length_px > quick.length_px
        ends = whole.clamp_px, whole.tip_px
        part = held and any(_leads_through(quick, end) for end in ends)
        return whole if held and not part else quick
    if not _same(quick, whole):
        return doubted(whole) if OTHER_ROD in quick.flags else whole
    longer, shorter = sorted((quick, whole), key=lambda one: -one.length_px)
    apart = longer.length_px - shorter.length_px
    same_ends = apart < AS_LONG * longer.width_px + AS_LONG_PX
    fewer = len(shorter.flags) < len(longer.flags)
    return shorter if same_ends and fewer else longer


def _leads_through(found: Measurement, place: tuple[float, float]) -> bool:
    """Whether a rod is as wide before a place on it as behind: it ends not there."""
    points, width = found.points, found.width_px
    away = np.hypot(points["x_px"] - place[0], points["y_px"] - place[1])
    if away.min() > width:
        return False
    s = arc_lengths(found.points_px) / width
    beyond = s - s[away.argmin()]
    before, behind = (
        median(points["width_px"][(side > _NEAR) & (side < _FAR)])
        for side in (-beyond, beyond)
    )
    return bool(1.0 / _AS_WIDE < before / behind < _AS_WIDE)


def is_whole(found: Measurement, part: Measurement | None) -> bool:
    """Whether nothing goes on beyond a tip; and it is more of a part, if there is one.

    The part and the whole leave the clamp at one place.
    """
    if TIP_GOES_ON in found.flags:
        return False
    if part is None:
        return True
    aside = np.hypot(*np.subtract(found.clamp_px, part.clamp_px))
    longer = found.length_px > part.length_px + part.width_px
    return bool(longer and aside < 0.5 * part.width_px and _same(part, found))


def _same(one: Measurement, other: Measurement) -> bool:
    """Whether two measurements are of one rod: the middle of one lies on the other."""
    middle = len(one.points["x_px"]) // 2
    away = np.hypot(
        other.points["x_px"] - one.points["x_px"][middle],
        other.points["y_px"] - one.points["y_px"][middle],
    )
    return bool(away.min() < max(one.width_px, other.width_px))


def apart_from_colour(plain: Measurement, rod: Candidate) -> float:
    """Return how far a side is from where the colour of a rod has it, in its widths.

    Colour tells sides less well, but knows no shade.
    """
    aside, wider = _off_colour(plain, rod)
    return (abs(aside) + abs(wider)) / rod.width_px


def is_elsewhere(plain: Measurement, rod: Candidate) -> bool:
    """Whether a side is none of the rod of a colour: that of a shade, say.

    A shade lies at one side. What reaches out at both is the rod's own dim flanks,
    whose colour is not seen.
    """
    aside, wider = _off_colour(plain, rod)
    apart = abs(aside) + min(abs(aside), wider) if wider > 0.0 else abs(aside) - wider
    return apart > _ELSEWHERE * rod.width_px


def _off_colour(plain: Measurement, rod: Candidate) -> tuple[float, float]:
    """Return how far sides lie to the right of a colour's, and outside of them, px."""
    points, n = plain.points, len(rod.points_px)
    axis = np.column_stack([points["x_px"], points["y_px"]])
    right = np.column_stack([points["right_x_px"], points["right_y_px"]])
    inner = rod.points_px[n // 8 : n - n // 8]
    nearest = np.hypot(*(inner[:, None] - axis).T).argmin(axis=0)
    across = (right - axis)[nearest]
    across /= np.hypot(*across.T)[:, None]
    aside = median(np.sum((axis[nearest] - inner) * across, axis=1))
    return aside, 0.5 * (plain.width_px - rod.width_px)


def lies_out(photo: Photo, found: Measurement) -> bool:
    """Whether the sides that colour tells lie out on the paper, by their lightness.

    JPEG keeps every other pixel's colour, half of it of the paper where edges are.
    """
    points, good = found.points, found.points["good"] > 0.5
    axis = found.points_px[good]
    level = []
    for side in ("left", "right"):
        edge = np.column_stack([points[f"{side}_x_px"], points[f"{side}_y_px"]])[good]
        out = edge - axis
        out *= _BEYOND * found.blur_px / np.hypot(*out.T)[:, None]
        places = np.stack([axis, edge, edge + out], axis=1)
        rod, at, beyond = bilinear(photo.grey, places).T
        level.append(median((at - rod) / np.maximum(beyond - rod, 1e-3)))
    return max(level) > _OUT
