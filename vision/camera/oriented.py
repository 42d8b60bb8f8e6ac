"""A photograph in the orientation in which its camera was calibrated."""

from __future__ import annotations

from ...core.errors import VisionError
from ..picture.photo import Photo
from ..picture.turn import turned
from .calibration import Calibration

_HALF = (2, 3, 4)
"""EXIF orientations that keep width and height."""


def oriented(photo: Photo, calibration: Calibration) -> Photo:
    """Return a photograph turned as the one that the calibration was made of.

    A lens belongs to the sensor: applied to a picture that was turned by half a turn
    since, a calibration made a rod 2.5 % too long.

    Raises
    ------
    VisionError
        If the calibration's file does not say how its picture was turned, and that
        matters.
    """
    own, size = calibration.orientation, tuple(calibration.image_size_px)
    if own is None and photo.size_px == size:
        if photo.orientation in _HALF and not calibration.is_scale_alone:
            raise VisionError(
                f"{photo.source}: was turned or mirrored by its camera, and the "
                "calibration's file does not say how its own picture was: calibrate "
                "again with this version"
            )
        return photo
    seen = turned(photo, own or 1)
    # A picture of the board that was saved upright no longer says that it was turned.
    return photo if seen.size_px != size == photo.size_px else seen
