"""Where the rod's root lies in the frame of the clamp's tag, from photographs.

The tag is seen far better than the rod's direction at the clamp, which hangs on a few
millimetres of rod. So its place is what photographs of the rod say of it together: best
those of a rod that is straight, in even light.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...core.errors import MagbendError, VisionError
from ...core.progress import Progress, silent
from ..camera.clamp_tag import ClampTag
from ..camera.find_tag import SeenTag, find_tag
from ..camera.oriented import oriented
from ..extraction.extract import measure
from ..extraction.setting import Setting
from ..picture.photo import Photo
from .inputs import list_sources, read_source
from .run_frame import NOT_HELD
from .shared_clamp import ALIKE, Direction, Reading, shared_direction

SIDE_OFF = 0.015
"""A tag whose side is off by more was printed, measured or placed in height wrongly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TagPlace:
    """A tag with the root in its frame, and what came of each photograph.

    Parameters
    ----------
    tag : ClampTag
        To be kept in a calibration.
    used : tuple of str
        Photographs that tell it.
    left_out : dict of str to str
        Others, and why.
    """

    tag: ClampTag
    used: tuple[str, ...]
    left_out: dict[str, str]


def tag_place(
    paths: Sequence[Path], setting: Setting, tag: ClampTag, *,
    progress: Progress = silent,
) -> TagPlace:  # fmt: skip
    """Measure where the rod leaves the clamp, in the frame of the clamp's tag.

    Parameters
    ----------
    paths : sequence of Path
        Photographs of the rod in the clamp, as for `list_sources`.
    setting : Setting
        With a calibration; a tag that it knows already is not used.
    tag : ClampTag
        Which marker, its side and height.
    progress : callable
        Called as ``progress(done, total)``.

    Raises
    ------
    VisionError
        If no photograph shows both rod and tag, the tag has another size, or the
        photographs disagree.
    """
    if setting.calibration is None:
        raise VisionError("a tag has its place in mm: give a calibration")
    camera = replace(setting.calibration, clamp_tag=None)
    if not tag.height_mm < camera.camera_height_mm:
        raise VisionError(
            "the tag must lie below the camera, which the calibration puts "
            f"{camera.camera_height_mm:.0f} mm above the board; instead received "
            f"{tag.height_mm:g} mm"
        )
    setting = replace(setting, calibration=camera)
    sources = list_sources(paths)
    seen: dict[str, tuple[Reading, SeenTag, float]] = {}
    left_out = {}
    for done, source in enumerate(sources, start=1):
        try:
            photo = oriented(read_source(source, linear=setting.linear), camera)
            seen[source.image] = _reading(photo, setting, tag)
        except MagbendError as error:
            left_out[source.image] = str(error)
        progress(done, len(sources))
    if not seen:
        first, why = next(iter(left_out.items()))
        raise VisionError(f"no photograph shows both rod and tag; {first}: {why}")
    readings, tags, clamp_sd = zip(*seen.values(), strict=True)
    side = _side_mm(tags, tag, camera.camera_height_mm)
    direction = _direction(readings)
    x, y, place_sd = _place(readings, np.array(clamp_sd))
    told = replace(
        tag, side_mm=side, root_x_mm=x, root_y_mm=y, angle_deg=direction.angle_deg,
        place_sd_mm=place_sd, angle_sd_deg=direction.sd_deg,
        board_angle_deg=tags[0].pose.angle_deg,
    )  # fmt: skip
    return TagPlace(tag=told, used=tuple(seen), left_out=left_out)


def _reading(
    photo: Photo, setting: Setting, tag: ClampTag
) -> tuple[Reading, SeenTag, float]:
    """Return clamp in the frame of the tag, the tag, and the place's deviation."""
    camera = setting.calibration
    found = measure(photo, setting)
    if camera is None or not found.ok or found.pose is None:
        raise VisionError(found.reason)
    if NOT_HELD & set(found.flags):
        raise VisionError("the rod is held by no clamp in the picture")
    seen = find_tag(photo.grey, camera, tag)
    if seen is None:
        raise VisionError(f"marker {tag.number} of {tag.dictionary} is not seen")
    (place,) = seen.pose.from_board(np.array([[found.pose.x_mm, found.pose.y_mm]]))
    turn = found.pose.angle_deg - seen.pose.angle_deg
    reading = Reading(
        x_mm=float(place[0]), y_mm=float(place[1]),
        angle_deg=(turn + 180.0) % 360.0 - 180.0,
        sd_deg=math.hypot(found.clamp_angle_sd_deg, seen.angle_sd_deg),
        mm_per_px=camera.mm_per_px(found.clamp_px, height_mm=tag.height_mm),
    )  # fmt: skip
    return reading, seen, found.clamp_sd_mm


def _direction(readings: Sequence[Reading]) -> Direction:
    if len(readings) == 1:
        return Direction(angle_deg=readings[0].angle_deg, sd_deg=readings[0].sd_deg)
    direction = shared_direction(readings)
    if direction is None:
        turns = [reading.angle_deg for reading in readings]
        raise VisionError(
            "the photographs disagree on where the rod leaves the clamp, seen from "
            f"the tag (directions from {min(turns):.2f} to {max(turns):.2f} deg): the "
            "tag came loose, or the rod was clamped anew between them"
        )
    return direction


def _place(readings: Sequence[Reading], sd: np.ndarray) -> tuple[float, float, float]:
    """Return the root's place, and its deviation along the rod, in mm.

    Shade and clamp pull all photographs alike, as they do the direction.
    """
    weights = 1.0 / sd**2
    weights /= weights.sum()
    xy = np.array([[reading.x_mm, reading.y_mm] for reading in readings])
    x, y = weights @ xy
    scatter = float(np.sqrt(weights @ np.sum((xy - (x, y)) ** 2, axis=1)))
    alone = float(np.sqrt(weights**2 @ sd**2))
    common = math.sqrt(ALIKE) * float(sd.min())
    return float(x), float(y), math.hypot(max(alone, common), scatter)


def _side_mm(tags: Sequence[SeenTag], tag: ClampTag, camera_mm: float) -> float:
    """Return the tag's side as it is seen."""
    side = float(np.mean([seen.side_mm for seen in tags]))
    if abs(side / tag.side_mm - 1.0) > SIDE_OFF:
        fits = camera_mm - (camera_mm - tag.height_mm) * tag.side_mm / side
        raise VisionError(
            f"the tag is seen {side:.3f} mm wide, not {tag.side_mm:g} mm: measure it "
            f"with a calliper, and its height (one of {fits:.1f} mm instead of "
            f"{tag.height_mm:g} mm above the board would fit)"
        )
    return side
