"""Photographs turned as another photograph of the same camera was turned.

A camera notes in EXIF how its picture is to be turned to be upright, by its gravity
sensor; looking straight down that is chance. Photographs are shown upright, but a lens
and a calibration belong to the sensor.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .photo import Photo

_BACK = {6: 8, 8: 6}
"""Orientations that are not their own inverse."""


def turned(photo: Photo, orientation: int) -> Photo:
    """Return an upright photograph turned as one of another EXIF orientation would be.

    Parameters
    ----------
    photo : Photo
        Upright, of the orientation that its file notes.
    orientation : int
        EXIF's 1 to 8 of the photograph to agree with.
    """
    own = photo.orientation
    if own == orientation:
        return photo
    decode = photo.decode
    return replace(
        photo,
        grey=np.ascontiguousarray(_as_sensor(photo.grey, own, orientation)),
        orientation=orientation,
        decode=None if decode is None else partial(_decoded, decode, own, orientation),
    )


def turned_points(
    points_px: NDArray[np.float64], photo: Photo, orientation: int
) -> NDArray[np.float64]:
    """Return where points of an upright photograph lie once it is `turned`.

    Parameters
    ----------
    points_px : ndarray, shape (n, 2)
        x and y in `photo`.
    photo : Photo
        As it was before.
    orientation : int
        Of the photograph to agree with.
    """
    own = photo.orientation
    if own == orientation:
        return points_px
    x, y = points_px.T
    width, height = photo.size_px
    for turn in (_BACK.get(own, own), orientation):
        if turn in (5, 6, 7, 8):
            x, y, width, height = y, x, height, width
        if turn in (3, 4, 7, 8):
            y = height - 1 - y
        if turn in (2, 3, 6, 7):
            x = width - 1 - x
    return np.column_stack([x, y])


def _decoded(decode: Any, own: int, other: int) -> NDArray[Any]:
    return np.ascontiguousarray(_as_sensor(decode(), own, other))


def _as_sensor(pixels: NDArray[Any], own: int, other: int) -> NDArray[Any]:
    """Turn back to the sensor's picture, and on as the other orientation asks."""
    return _upright(_upright(pixels, _BACK.get(own, own)), other)


def _upright(pixels: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Turn and mirror as EXIF asks."""
    if orientation in (5, 6, 7, 8):
        pixels = np.swapaxes(pixels, 0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return pixels
