"""The scene without its rod: a photograph whose light is divided out of the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from ...core.errors import VisionError
from ..edge.state import LostError
from ..picture.photo import Photo, read_photo
from ..picture.raster import coverage
from ..picture.turn import turned

EDGE_PX = 0.7
"""Blur of a guide that is laid over a picture, as of a lens."""


def read_bare(path: Path, *, linear: bool | None = None) -> Photo:
    """Read the photograph of the bare scene.

    Raises
    ------
    VisionError
        If it cannot be read or is dark.
    """
    photo = read_photo(path, linear=linear)
    if float(np.median(photo.grey)) < 0.02:
        raise VisionError(f"{path}: the bare frame must show lit paper; it is dark")
    return photo


def flattened(
    photo: Photo, bare: Photo, guide_px: Sequence[tuple[float, float]] = ()
) -> Photo:
    """Return a photograph with its light divided by that of the bare scene.

    Parameters
    ----------
    photo, bare : Photo
        Of one size, from one camera that stood still.
    guide_px : sequence of tuple of float
        Corners of the guide that a rod slides out of. With them the bare scene is an
        empty channel: it is divided out pixel by pixel, so that its walls are gone, and
        the guide is laid in black over what is left, as a clamp.
    """
    bare = turned(bare, photo.orientation)
    if bare.size_px != photo.size_px:
        raise LostError(
            "bare_mismatch",
            "the bare frame and the photograph differ in size: "
            f"{bare.size_px} and {photo.size_px} px",
        )
    channel = len(guide_px) > 0
    light = bare.grey if channel else cv2.GaussianBlur(bare.grey, (0, 0), 4.0)
    typical = float(np.median(light))
    grey = photo.grey * (typical / np.maximum(light, 0.05 * typical))
    if channel:
        sharp = coverage(np.array(guide_px, dtype=np.float64), *photo.size_px)
        guide = cv2.GaussianBlur(sharp, (0, 0), EDGE_PX)
        grey += guide * (0.05 * typical - grey)
    return replace(photo, grey=np.asarray(grey, dtype=np.float32), decode=None)
