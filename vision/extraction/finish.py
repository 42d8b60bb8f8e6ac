"""From a curve near the axis to a measurement: refine, judge, turn pixels into mm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..edge.state import LostError
from ..find.candidate import Candidate
from ..find.ground import View
from ..find.track import Start
from ..measurement import Measurement
from ..picture.photo import Photo
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
from .strip import along_rod
from .told_clamp import seen_tag

Array = NDArray[np.float64]

FAR = 0.15
"""Blur, in widths, from which edges are sought as blurred from the start."""

TOO_FAR, COLLAPSED, ROUGHLY = 0.5, 0.9, 1.0
"""Blur, in widths, in which a width cannot be told from the blur; and width over that
of the start, below which edges were lost, with how well that is known, px."""


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
        face_px=setting.face_px(start.curve), foot_px=setting.foot_px(start.curve),
        sd_px=sd_px, known_joints=joints, plain=None if view.plain else photo.grey,
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
