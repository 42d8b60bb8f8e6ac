"""The scene without its rod: a photograph whose light is divided out of the others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from ...core.errors import VisionError
from ..edge.state import LostError
from ..picture.photo import Photo, read_photo
from ..picture.turn import turned


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


def flattened(photo: Photo, bare: Photo) -> Photo:
    """Return a photograph with its light divided by that of the bare scene."""
    bare = turned(bare, photo.orientation)
    if bare.size_px != photo.size_px:
        raise LostError(
            "bare_mismatch",
            "the bare frame and the photograph differ in size: "
            f"{bare.size_px} and {photo.size_px} px",
        )
    smooth = cv2.GaussianBlur(bare.grey, (0, 0), 4.0)
    typical = float(np.median(smooth))
    grey = photo.grey * (typical / np.maximum(smooth, 0.05 * typical))
    return replace(photo, grey=np.asarray(grey, dtype=np.float32), decode=None)
