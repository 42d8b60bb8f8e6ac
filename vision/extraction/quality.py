"""Gates: every doubt is a named flag, and what cannot be vouched for is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..curve.robust import median, quantile, quantiles
from ..edge.clamp import APART_PX
from ..edge.flank import WHITE
from ..edge.levels import clear_of
from ..edge.state import LostError
from ..edge.white import SOME
from ..find.candidate import Candidate
from ..find.ground import View
from ..find.rod_colour import ALIKE, distance_from
from ..measurement import Measurement
from ..picture.photo import Photo
from .beyond_ends import check_ends, goes_on_after_gap, tip_goes_on
from .crossing import over_paper
from .deviations import scale_sd
from .one_width import is_uneven
from .refine import Refined
from .root import HIDDEN_MM, is_smeared, root_hidden
from .setting import Setting
from .strip import Strip

Array = NDArray[np.float64]

LEAST_WIDTHS = 5.0
"""Length of a rod over its width, at least."""

LENGTH_TOLERANCE = 0.02
SIDE_TOLERANCE = 0.08
"""A print's side is a few percent off; more is a shade measured with it."""

TURN_MM = 0.15
"""What the standard deviation of the direction at the clamp may do to the tip."""

SCALE_MM = 0.05
"""What that of the scale may, for want of the camera's height: all frames share it."""

CLAMP_DOUBTFUL = "clamp_doubtful"
TIP_GOES_ON, OTHER_ROD, OTHER_COLOUR = "tip_goes_on", "other_rod", "colour_mismatch"

AROUND = {OTHER_ROD, CLAMP_DOUBTFUL, TIP_GOES_ON}
"""Doubts for what lies around a rod."""

SAME_SD, LESS_SEEN = 2.0, 0.01
"""Deviations by which length and width may differ, and part of the rod that may be seen
less well, with nothing across it."""

DARKEST, DIMMED = 0.15, 0.8
"""How far from the rod's light to the paper's what goes on behind a root may be; and in
a mix of colours, in which a clamp's shade on the rod takes from its colour and a dark
clamp may look like paper."""

OVER_PAPER, OVER_PAPER_ROUGH = 1.0, 3.0
"""Widths of bare paper under an axis that are more than a speck, or than a gap in a
yarn."""

BLURRED_PX, BLURRED = 1.8, 0.08
"""Blur that is named: the lens is out of focus, or something moved; px and widths."""

SHADE_PX = 0.04
"""Pull of a shade on the midline, before correction, above which it is named."""

OFF_FRONT = 0.15
"""How far from the front that is seen beside it a rod may begin, in widths: two of
three are nearer."""

UNRESOLVED, TIP_SMEARED = 0.21, 0.15
"""Blur, in widths, above which a clamp's front and its shade are seen as one line where
shade pulls: an edge then takes half the rod's width to rise. Or by which a tip is more
blurred than the rod."""


def refusal(
    photo: Photo, view: View, strip: Strip, refined: Refined, candidate: Candidate
) -> None:
    """Refuse a refined rod that contradicts what was found at first.

    Raises
    ------
    LostError
        With flag and reason.
    """
    length = float(refined.fit.curve.s[-1])
    width = refined.typical_width
    if not 0.8 < length / candidate.length_px < 1.5 + 8.0 * width / length:
        raise LostError(
            "inconsistent",
            f"the measured axis is {length:.0f} px long, but the thing it belongs "
            f"to {candidate.length_px:.0f} px",
        )
    if refined.good.mean() < 0.5:
        raise LostError(
            "edges_lost",
            f"only {100 * refined.good.mean():.0f} % of the rod has two clear edges: "
            "lay it on plain paper of another colour, in softer light",
        )
    if refined.fit.noise > 0.25 * width:
        raise LostError("inconsistent", "the edges of the rod lie on no smooth curve")
    bare = OVER_PAPER_ROUGH if refined.rough else OVER_PAPER
    if over_paper(strip, refined, candidate.hidden_px) > bare:
        raise LostError(
            "inconsistent",
            "the axis runs over bare paper for a while: two things may cross there",
        )
    check_ends(photo, view, strip, refined, root=candidate.root)
    if length < LEAST_WIDTHS * width:
        raise LostError(
            "no_rod",
            f"what looks like a rod is {length / width:.1f} widths long; it takes at "
            f"least {LEAST_WIDTHS:.0f} to tell a rod from other things",
        )


def doubts_around(
    photo: Photo, view: View, strip: Strip, refined: Refined, candidate: Candidate,
    setting: Setting,
) -> set[str]:  # fmt: skip
    """Return the doubts for what lies around a rod."""
    found = set()
    after_gap = not refined.rough and goes_on_after_gap(strip, refined)
    if candidate.rivalled or after_gap or len(candidate.hidden_px):
        found.add(OTHER_ROD)
    face_px = setting.face_px(refined.fit.curve)
    darkest = DARKEST if view.plain else DIMMED
    if candidate.root == "clamp" and _goes_on(strip, refined, face_px, darkest):
        found.add(CLAMP_DOUBTFUL)
    if not refined.rough and tip_goes_on(photo, strip, refined):
        found.add(TIP_GOES_ON)
    return found


def is_as_before(result: Measurement, last: Measurement) -> bool:
    """Whether a rod is as long, as wide and as well seen as in another frame.

    What comes across it hides its edges, and what touches its tip moves that: with
    nothing of this, all lies around the rod as it did.
    """
    length = abs(result.length_mm - last.length_mm)
    width = abs(result.width_mm - last.width_mm)
    seen = float(result.points["good"].mean() - last.points["good"].mean())
    return (
        length < SAME_SD * result.length_sd_mm
        and width < SAME_SD * result.width_sd_mm
        and seen > -LESS_SEEN
        and OTHER_ROD not in last.flags
    )


def doubts(
    result: Measurement,
    photo: Photo,
    around: set[str],
    refined: Refined,
    candidate: Candidate,
    setting: Setting,
) -> Measurement:
    """Return the measurement with its flags, beside those of what lies around it."""
    flags, camera = list(result.flags), setting.calibration
    if camera is None:
        flags.append("uncalibrated")
    elif scale_sd(camera, setting.axis_height_mm) * result.length_mm > SCALE_MM:
        flags.append("height_doubtful")
    if _height_is_assumed(setting):
        flags.append("height_assumed")
    if candidate.root == "border":
        flags.append("clamp_at_border")
    if candidate.root == "free":
        flags.append("no_clamp")
    if OTHER_ROD in around:
        flags.append(OTHER_ROD)
    # By a tag the place may be known all the same.
    if root_hidden(refined, setting) and result.clamp_sd_mm > 0.5 * HIDDEN_MM:
        flags.append("root_hidden")
    pull = quantile(refined.shaded[refined.good], 0.9)
    unclear = candidate.root == "clamp" and _front_in_shade(refined, pull)
    if (
        unclear
        or _is_off_front(refined, candidate)
        or (result.inverted and _lines_differ(refined))
        or CLAMP_DOUBTFUL in around
    ):
        flags.append(CLAMP_DOUBTFUL)
    if TIP_GOES_ON in around:
        flags.append(TIP_GOES_ON)
    if direction_is_doubtful(result.clamp_angle_sd_deg, result.length_mm):
        flags.append("direction_doubtful")
    if refined.whole or photo.clipped > 0.01:
        known = refined.whole or refined.saturated <= SOME
        flags.append("clipped" if known else "overexposed")
    elif _is_white_in_mix(photo, result, refined):
        flags.append("overexposed")
    if refined.blur > max(BLURRED_PX, BLURRED * result.width_px):
        flags.append("blurred")
    if pull > SHADE_PX:
        flags.append("shadow")
    unsure = refined.good.mean() < 0.8 or refined.fit.noise > 0.02 * result.width_px
    if refined.rough or unsure:
        flags.append("rough_edges")
    if _is_no_face(refined):
        flags.append("ragged_tip")
    if _length_is_off(result, setting):
        flags.append("length_mismatch")
    if not refined.rough and is_uneven(result, setting):
        flags.append("width_uneven")
    if _side_is_off(result, setting):
        flags.append("width_mismatch")
    if setting.colour and _colour_is_off(photo, refined, setting.colour):
        flags.append(OTHER_COLOUR)
    return replace(result, flags=tuple(dict.fromkeys(flags)))


def _front_in_shade(refined: Refined, pull: float) -> bool:
    """Whether a clamp's front and its shade may be one line, or no step fits it."""
    if refined.clamp is None:
        return False
    front = refined.clamp.front
    if front is not None and front.rise == 0.0:
        return True
    unresolved = refined.blur > UNRESOLVED * refined.typical_width
    smeared = is_smeared(refined, refined.clamp.blur)
    return smeared or (pull > SHADE_PX and unresolved)


def _is_off_front(refined: Refined, candidate: Candidate) -> bool:
    """Whether not both lines at a clamp are seen where all colours show its front."""
    lines = refined.clamp
    if not candidate.from_front or lines is None:
        return False
    if lines.face is None or lines.front is None or _lines_differ(refined):
        return True
    root, _ = refined.fit.curve.at(np.zeros(1))
    away = np.hypot(*(root[0] - candidate.points_px[0]))
    return bool(away > OFF_FRONT * refined.typical_width + APART_PX)


def _is_no_face(refined: Refined) -> bool:
    """Whether a tip is no flat face: frayed, or its shade is blurred into one with it.

    Such an end rises more slowly than the rod's sides do.
    """
    tip = refined.tip
    slower = math.sqrt(max(tip.blur**2 - refined.blur**2, 0.0))
    soft = slower > TIP_SMEARED * refined.typical_width
    return tip.scatter > 0.5 or abs(tip.skew) > 0.2 or soft


def _lines_differ(refined: Refined) -> bool:
    """Whether a clamp's two lines lie apart, as its face does that is no dark one.

    On a dark board it is as light as a light rod, whose root may be ahead of both.
    """
    lines = refined.clamp
    if lines is None or lines.face is None or lines.front is None:
        return False
    return abs(lines.front.s - lines.face.s) > APART_PX


def _is_white_in_mix(photo: Photo, result: Measurement, refined: Refined) -> bool:
    """Whether a light rod is cut off in a colour that it is measured in."""
    if not result.inverted or result.mix is None:
        return False
    light = photo.colour_at(refined.fit.curve.points[refined.good])
    white = np.median(np.asarray(light), axis=0) > WHITE
    return bool(white[np.array(result.mix) > 0.0].any())


def _length_is_off(result: Measurement, setting: Setting) -> bool:
    """Whether a rod has another length than it should have."""
    if setting.length_mm is None:
        return False
    tolerance = LENGTH_TOLERANCE * setting.length_mm
    if setting.length_sd_mm is not None:
        tolerance = 3.0 * math.hypot(setting.length_sd_mm, result.length_sd_mm)
    return abs(result.length_mm - setting.length_mm) > tolerance


def _side_is_off(result: Measurement, setting: Setting) -> bool:
    """Whether a rod is wider or thinner than its specimen by more than a print is."""
    if setting.side_mm is None or not math.isfinite(result.width_mm):
        return False
    tolerance = SIDE_TOLERANCE * setting.side_mm
    if math.isfinite(result.width_sd_mm):  # nobody may know how far the camera is
        tolerance += 3.0 * result.width_sd_mm
    return abs(result.width_mm - setting.side_mm) > tolerance


def _colour_is_off(photo: Photo, refined: Refined, colour: str) -> bool:
    """Whether what was measured has another colour than the specimen."""
    axis = refined.fit.curve.points[refined.good]
    return distance_from(photo, colour)(axis) > ALIKE


def _height_is_assumed(setting: Setting) -> bool:
    """Whether nobody said how high the rod lies above the board, where it matters."""
    camera = setting.calibration
    if camera is None or setting.rod_height_mm is not None:
        return False
    return camera.rod_height_mm is None and math.isfinite(camera.camera_height_sd_mm)


def direction_is_doubtful(sd_deg: float, length_mm: float) -> bool:
    """Whether the direction at the clamp may move the tip by more than `TURN_MM`."""
    return bool(np.radians(sd_deg) * length_mm > TURN_MM)


def _goes_on(strip: Strip, refined: Refined, face_px: float, darkest: float) -> bool:
    """Whether a dark line between two lighter sides goes on behind the clamp's line.

    Then that line may be the border of a shadow (or the clamp has an open groove).
    """
    width, beside = strip.width, 0.5 + 4.0 / strip.width
    near = max(0.3 * width, 2.0 * clear_of(refined.blur) + face_px)
    across = strip.lanes(-beside, -0.2, 0.0, 0.2, beside)
    before = across[:, strip.between(width, 3.0 * width)]
    return any(
        _is_dark_line(before, across[:, strip.between(-last, -first)], darkest)
        for first, last in ((near, near + 0.2 * width), (width, 1.6 * width))
    )


def _is_dark_line(before: Array, behind: Array, darkest: float) -> bool:
    """Whether the dark between two lighter sides is seen behind as it is before.

    Of each, shape (5, n), the first and the last lane lie beside the rod. The middle
    may be lighter by the part `darkest` of the way from rod to paper.
    """
    rod, paper = median(before[1:4].ravel()), median(before[::4].ravel())
    if paper == rod:
        return False
    light = quantiles(behind, 0.5)
    light = (light - rod) / (paper - rod)
    lighter = min(light[0], light[4]) - max(light[1:4].max(), 0.0)
    return bool(light[1:4].max() < darkest and lighter > 0.12)
