"""The clamp's place and direction, by what is seen there or by a tag, as is surer.

Both are readings with deviations. Where they disagree by more than `APART` of these,
one of them is of something else (a shade's border, a rod that bends right at its clamp,
a tag that came loose), which is named.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..camera.calibration import Calibration
from ..camera.find_tag import TaggedClamp, tagged_clamp
from ..curve.curve import Curve
from ..measurement import Pose
from ..picture.photo import Photo
from .refine import Refined
from .root import RootPlace
from .setting import Setting

APART = 3.0

CAMERA_MOVED, CLAMP_TURNED = "camera_moved", "clamp_turned"
TAG_DIFFERS, TAG_NOT_SEEN = "tag_differs", "tag_not_seen"


@dataclass(frozen=True, slots=True, kw_only=True)
class ToldClamp:
    """Where the rod leaves the clamp and in which direction, with doubts.

    Parameters
    ----------
    root : RootPlace
        On the fitted curve.
    angle_deg, angle_sd_deg : float
        In the board frame; NaN where the rod itself tells it.
    flags : tuple of str
        Doubts by name.
    """

    root: RootPlace
    angle_deg: float = math.nan
    angle_sd_deg: float = math.inf
    flags: tuple[str, ...] = ()


def seen_tag(photo: Photo, setting: Setting, curve: Curve) -> TaggedClamp | None:
    """Return what a tag on the clamp tells, where there is one.

    Parameters
    ----------
    photo : Photo
        The photograph.
    setting : Setting
        What is known: a camera that knows the tag, or else there is none.
    curve : Curve
        The rod's axis, px, from the clamp on.
    """
    camera = setting.calibration
    if camera is None or camera.clamp_tag is None:
        return None
    root, ahead = camera.to_mm(curve.points[:2], height_mm=setting.axis_height_mm)
    x, y = ahead - root
    heading = math.degrees(math.atan2(y, x))
    rod = Pose(x_mm=float(root[0]), y_mm=float(root[1]), angle_deg=heading)
    return tagged_clamp(photo.grey, camera, rod)


def told_clamp(
    seen: RootPlace, tag: TaggedClamp | None, refined: Refined, setting: Setting,
    camera: Calibration,
) -> ToldClamp:  # fmt: skip
    """Return the surer of the place that is seen and the one that a tag tells.

    Parameters
    ----------
    seen : RootPlace
        By the lines at the clamp.
    tag : TaggedClamp or None
        By the tag; None where it is not seen.
    refined, setting, camera
        The rod in pixels, what is known, and the camera.
    """
    if camera.clamp_tag is None:
        return ToldClamp(root=seen)
    if tag is None:
        return ToldClamp(root=seen, flags=(TAG_NOT_SEEN,))
    if tag.camera_moved:
        return ToldClamp(root=seen, flags=(CAMERA_MOVED,))
    place, scale = _on_curve(tag, seen.s, refined, setting, camera)
    sd = tag.place_sd_mm * scale
    flags: tuple[str, ...] = (CLAMP_TURNED,) if tag.clamp_turned else ()
    root = seen
    if refined.clamp is not None and seen.hidden == 0.0:
        flags += _differs(place - seen.s, seen.sd, sd)
    if sd < seen.sd:
        doubt = 0.5 * abs(place - seen.s) if TAG_DIFFERS in flags else 0.0
        root = RootPlace(s=place, sd=max(sd, doubt))
    return ToldClamp(
        root=root, angle_deg=tag.pose.angle_deg, angle_sd_deg=tag.angle_sd_deg,
        flags=flags,
    )  # fmt: skip


def surer_direction(
    told: ToldClamp, own_deg: float, own_sd_deg: float
) -> tuple[float, float, tuple[str, ...]]:
    """Return direction at the clamp, its deviation and doubts, in degrees.

    `own_deg` is what the rod itself tells.
    """
    if not math.isfinite(told.angle_deg):
        return own_deg, own_sd_deg, told.flags
    turn = (told.angle_deg - own_deg + 180.0) % 360.0 - 180.0
    apart = _differs(turn, own_sd_deg, told.angle_sd_deg)
    flags = tuple(dict.fromkeys((*told.flags, *apart)))
    if told.angle_sd_deg >= own_sd_deg:
        return own_deg, own_sd_deg, flags
    sd_deg = max(told.angle_sd_deg, 0.5 * abs(turn) if apart else 0.0)
    return own_deg + turn, sd_deg, flags


def _differs(apart: float, first_sd: float, second_sd: float) -> tuple[str, ...]:
    """Return the flag for two readings that are too far apart, else nothing."""
    return (
        (TAG_DIFFERS,) if abs(apart) > APART * math.hypot(first_sd, second_sd) else ()
    )


def _on_curve(
    tag: TaggedClamp, near: float, refined: Refined, setting: Setting,
    camera: Calibration,
) -> tuple[float, float]:  # fmt: skip
    """Return the arc length nearest to the tag's root, and pixels per mm there."""
    s, scale = near, 1.0
    for _ in range(3):
        points, theta = refined.fit.curve.at(np.array([s]))
        view = setting.view(camera, points, theta)
        along, scale = float(view.heading[0]), float(view.along[0])
        ahead = (tag.pose.x_mm - float(view.x_mm[0])) * math.cos(along)
        ahead += (tag.pose.y_mm - float(view.y_mm[0])) * math.sin(along)
        s += ahead * scale
    return s, scale
