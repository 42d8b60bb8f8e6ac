"""Where the axis leaves the clamp: from the lines that are seen there, with its doubt.

The clamp's front plane is seen at the top of the rod (its face) and at the paper (its
front line), if the camera looks at it; else only the clamp's top edge is. Each line is
carried to the height of the axis, and leans as the camera's tilt and height are in
doubt. What both tell together is their least squares; where they disagree by more than
they say, the place is known no better. If they do by far, one of them is of something
else (a shade's border, a chamfer).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..camera.projection import LocalView
from ..edge.clamp import APART_PX, FACE_SEEN, FRONT_SEEN, doubt_px
from ..edge.crossings import EndFace
from .refine import Refined
from .setting import UNKNOWN_CLAMP_MM, Setting

HIDDEN_MM = 0.05
"""What part of the root a clamp of unknown height may hide before that is named."""

BORDER_PX, CARRIED, SMEARED, MIXED = 0.3, 0.002, 0.25, 0.8
"""Standard deviation of a place: px, of where a rod enters the picture; as shares of
how far a line is carried to the height of the axis, and of what blurs a line more than
the rod's sides and its tip: the front of a shade, seen as one step with the clamp's. A
step of which the part q belongs to another line is blurred by sqrt(q (1 - q)) of the
way to that, and moved by q of it: by sqrt(q / (1 - q)) of what it is blurred more. The
likeliest is q = 0.06; much of such blur is noise of the blur that is fitted. Where it
is no noise, the part may be 0.4 (a shade 6 px before a clamp)."""

CLEARLY_SMEARED = 0.075
"""By how much a line is more blurred, in widths, that no noise explains."""

UNCHECKED = 2.5
"""And over that of the rod's end on its own lanes where no front is seen beside it: the
light on a rod changes near its end, alike on all of them."""

ROUND, ROUND_CARRIED = 0.3, 0.7
"""How far the front of a chuck, a disc, bulges toward the tip where it is seen aslant,
over what as much height as the rod is wide is shifted (0.3 for a disc eight times as
wide as the rod, more for a smaller one); and the doubt of how far its rim is carried
to the height of the axis, of which it may be anything up to the radius away. So may a
clamp of which no front is seen beside the rod be a chuck, on whose face the rod ends
where it seems to."""

_STEP_PX = 20.0
"""Length over which lines are taken for straight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RootPlace:
    """Where a rod begins.

    Parameters
    ----------
    s : float
        Arc length on the fitted curve, px.
    sd : float
        Its standard deviation, px.
    hidden : float
        Part of it for what a clamp of unknown height may hide, px.
    apart : float
        How far the two lines at the clamp are apart, px; 0 where one is seen.
    """

    s: float
    sd: float
    hidden: float = 0.0
    apart: float = 0.0

    @property
    def lines_differ(self) -> bool:
        """Whether the two lines at the clamp tell different places."""
        return abs(self.apart) > APART_PX


def root_place(
    refined: Refined, ends: LocalView, setting: Setting, rim_mm: float
) -> RootPlace:
    """Return where the axis leaves the clamp, on the fitted curve.

    Parameters
    ----------
    refined : Refined
        The rod in pixels.
    ends : LocalView
        How the camera sees its ends, the root first.
    setting : Setting
        What is known.
    rim_mm : float
        How high above its axis its upper rim is, in the middle.
    """
    if refined.clamp is None:
        return RootPlace(s=0.0, sd=BORDER_PX)
    rise, along = float(ends.rise_along[0]), float(ends.along[0])
    face, front = refined.clamp.face, refined.clamp.front
    shifted = abs(rise) / along * refined.typical_width
    is_round = front is not None and front.bulge > ROUND * shifted
    if rise > 0.0:
        # A clamp of which no front is seen may be a chuck, and end the rod on its face.
        share = ROUND_CARRIED if is_round or front is None else CARRIED
        return _hidden(refined, front or face, ends, setting, share)
    readings, axis_mm = [], setting.axis_height_mm
    if face is not None:
        at = _below(refined, face, axis_mm + rim_mm, setting)
        sd = _line_sd(refined, face, seen=FACE_SEEN if front else math.inf)
        readings.append(_Reading(at, sd, rim_mm * along))
    # A disc's rim is at no height that is known; the rod's own lanes are.
    if front is not None and not (is_round and face is not None):
        at = _below(refined, front, 0.0, setting)
        carried = (ROUND_CARRIED if is_round else CARRIED) * (at - front.s)
        seen = FRONT_SEEN if face else math.inf
        sd = _line_sd(refined, front, carried, seen=seen)
        readings.append(_Reading(at, sd, -axis_mm * along))
    if not readings:
        return RootPlace(s=0.0, sd=BORDER_PX)
    apart = readings[-1].s - readings[0].s
    if abs(apart) > APART_PX:
        face_px = setting.face_px(refined.fit.curve)
        if not refined.clamp.is_dark_face(apart, face_px):
            return RootPlace(s=readings[0].s, sd=0.5 * abs(apart), apart=apart)
        readings, apart = readings[1:], 0.0
    place, sd = together(readings, _lean_sd(setting, rise / along))
    return RootPlace(s=place, sd=sd, apart=apart)


class _Reading(NamedTuple):
    """Where a line puts the root and how surely, and how high above the axis it is, px.

    So far it is seen moved where what stands upright leans by one radian more.
    """

    s: float
    sd: float
    above: float


def together(readings: Sequence[_Reading], lean_sd: float) -> tuple[float, float]:
    """Return place and deviation by least squares of what lines tell under one lean.

    Parameters
    ----------
    readings : sequence of tuple
        Place and deviation by each, and how high above the axis it lies, px.
    lean_sd : float
        Standard deviation of how what stands upright there is seen to lean, rad.

    Notes
    -----
    Where they differ by more than their deviations, these are too small by as much (the
    Birge ratio; R. T. Birge, Phys. Rev. 40, 207, 1932).
    """
    s, sd, above = np.array(readings).T
    sure = np.linalg.inv(np.diag(sd**2) + lean_sd**2 * np.outer(above, above))
    place = float(sure.sum(axis=0) @ s / sure.sum())
    away = s - place
    return place, math.sqrt(max(1.0, float(away @ sure @ away)) / float(sure.sum()))


def _lean_sd(setting: Setting, lean: float) -> float:
    """Return how well it is known how far what stands upright is seen to lean, rad.

    The camera's tilt is in doubt, and so is its height, over which things away from
    right below it lean.
    """
    camera = setting.calibration
    if camera is None:
        return 0.0
    by_height = lean * camera.camera_height_sd_mm / camera.camera_height_mm
    tilt = math.radians(camera.tilt_sd_deg)
    return math.hypot(tilt, by_height if math.isfinite(by_height) else 0.0)


def _hidden(
    refined: Refined, line: EndFace | None, ends: LocalView, setting: Setting,
    share: float,
) -> RootPlace:  # fmt: skip
    """Return the root that a clamp's top hides, with the doubt of how far, a share."""
    rise, along = float(ends.rise_along[0]), float(ends.along[0])
    hidden = hidden_px(refined, setting, rise) / math.sqrt(3.0)
    place = _hidden_root(refined, ends, setting)
    if line is None:
        return RootPlace(s=place, sd=hidden, hidden=hidden)
    top = setting.clamp_height_mm
    above = 0.0 if top is None else top - setting.axis_height_mm
    leant = _lean_sd(setting, rise / along) * above * along
    sd = _line_sd(refined, line, share * (place - line.s), leant, hidden)
    return RootPlace(s=place, sd=sd, hidden=hidden)


def _line_sd(
    refined: Refined, line: EndFace, *doubts: float, seen: float = math.inf
) -> float:
    """Return the deviation of a place that a line tells, with other doubts, px.

    `seen` is over how many widths it is seen, if another line has to agree with it.
    """
    unchecked = refined.clamp is None or refined.clamp.front is None
    own = (UNCHECKED if unchecked else 1.0) * doubt_px(line, seen)
    share = MIXED if is_smeared(refined, line.blur) else SMEARED
    return math.hypot(own, share * smeared_px(refined, line.blur), *doubts)


def is_smeared(refined: Refined, blur: float) -> bool:
    """Whether a line at the clamp is clearly more blurred than the rod and its tip."""
    return smeared_px(refined, blur) > CLEARLY_SMEARED * refined.typical_width


def smeared_px(refined: Refined, blur: float) -> float:
    """Return what blurs a line at the clamp more than the rod's sides or its tip, px.

    What moved along the rod blurs the tip too.
    """
    usual = max(refined.blur, refined.tip.blur)
    return math.sqrt(max(blur**2 - usual**2, 0.0))


def root_hidden(refined: Refined, setting: Setting) -> bool:
    """Whether the clamp's top may hide more of the root than `HIDDEN_MM`.

    Not where the height of the clamp or the length of the rod is known: then the root
    is put where it belongs.
    """
    if setting.calibration is None:
        return False
    ends = refined.fit.curve.points[:1], refined.fit.curve.theta[:1]
    at = setting.view(setting.calibration, *ends)
    hidden = hidden_px(refined, setting, float(at.rise_along[0]))
    return hidden > HIDDEN_MM * float(at.along[0])


def hidden_px(refined: Refined, setting: Setting, rise: float) -> float:
    """Return how much of the root a clamp of unknown height may hide."""
    known = setting.clamp_height_mm is not None or setting.length_mm is not None
    return 0.0 if known or refined.clamp is None else max(0.0, rise) * UNKNOWN_CLAMP_MM


def _below(
    refined: Refined, line: EndFace, height_mm: float, setting: Setting
) -> float:
    """Return where the axis passes under (or over) a line seen at another height.

    Both are carried to the board frame: near a telephone the line is moved along
    itself too, and is not seen at a right angle to the rod.
    """
    camera = setting.calibration
    if camera is None:
        return line.s
    curve, axis_mm = refined.fit.curve, setting.axis_height_mm
    points, theta = curve.at(np.array([line.s, line.s + _STEP_PX]))
    along = np.array([math.cos(theta[0]), math.sin(theta[0])])
    right = np.array([-along[1], along[0]])
    beside = points[0] + _STEP_PX * (right + line.skew * along)
    first, second = camera.to_mm(np.array([points[0], beside]), height_mm=height_mm)
    start, ahead = camera.to_mm(points, height_mm=axis_mm)
    away, step, across = first - start, ahead - start, first - second
    crossed = float(step[0] * across[1] - step[1] * across[0])
    if abs(crossed) < 1e-9:
        return line.s
    return (
        line.s + _STEP_PX * float(away[0] * across[1] - away[1] * across[0]) / crossed
    )


def _hidden_root(refined: Refined, ends: LocalView, setting: Setting) -> float:
    """Return the root where the clamp's top edge hides it: by height, or by length."""
    rise, along = float(ends.rise_along[0]), float(ends.along[0])
    if setting.clamp_height_mm is not None:
        seen = refined.clamp
        line = None if seen is None else seen.front or seen.face
        if line is None:
            return 0.0
        return _below(refined, line._replace(s=0.0), setting.clamp_height_mm, setting)
    if setting.length_mm is None:
        return 0.0
    missing = setting.length_mm * along - refined.tip.s
    return -float(np.clip(missing, 0.0, 10.0 * rise))
