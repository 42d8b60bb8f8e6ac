"""How far the colour of a thing is from that a specimen is known to have.

The camera's white balance and the lamp tint everything alike: where the paper is nearly
without colour it is taken for white, so that only a coloured board tells nothing.
Lightness counts half, since gloss and exposure change it and not the hue.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from ..picture.photo import Photo

Array = NDArray[np.float64]

ALIKE = 18.0
"""Distance in CIELAB, lightness at half its weight, beyond which it is another colour:
red from brown is 30, tan from its own grey shade 21."""

_EVERY_PX = 8
_CAST = 25.0
"""Colour (chroma) of the picture's ground below which it is white in tinted light."""

_WHITE = 0.998
_LIGHTNESS = 0.5


def distance_from(photo: Photo, colour: str) -> Callable[[Array], float]:
    """Return how far, in CIELAB, things along given points are from a colour.

    Parameters
    ----------
    photo : Photo
        The photograph; of a grey one, or one whose blue, green and red are alike as
        files of grey cameras have them, only the lightness tells.
    colour : str
        Blue, green and red of a rod on white paper, as ``#rrggbb`` (sRGB).

    Returns
    -------
    callable
        Of points inside a thing, shape (n, 2), px.

    References
    ----------
    CIE 015:2018; the ground as white: von Kries, Festschrift Univ. Freiburg (1902).
    """
    every = (slice(None, None, _EVERY_PX),) * 2
    colours = photo.colour(every)
    light = photo.grey[every][..., None] if colours is None else colours
    white = _white(light)
    code = [int(colour[k : k + 2], 16) for k in (5, 3, 1)]
    srgb = np.array([[code]], np.float32) / np.float32(255.0)
    known = np.asarray(cv2.cvtColor(srgb, cv2.COLOR_BGR2Lab)[0, 0], np.float64)
    if not np.ptp(light, axis=2).any():
        known = np.array([known[0], 0.0, 0.0])

    def distance(points_px: Array) -> float:
        thing = np.median(photo.light_at(points_px), axis=0)
        away = _lab(thing / white) - known
        return float(np.hypot(_LIGHTNESS * away[0], np.hypot(*away[1:])))

    return distance


def _white(light: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what white paper would be: as light as the lightest, tinted as the ground.

    Shape (3,) or, of a grey picture, (1,).
    """
    ground = np.median(light, axis=(0, 1))
    lightest = np.float32(np.quantile(light.max(axis=2), _WHITE))
    lightest = max(lightest, ground.max(), np.float32(1e-3))
    tint = ground / max(ground.max(), np.float32(1e-3))
    if np.hypot(*_lab(tint)[1:]) > _CAST:
        tint = np.ones_like(ground)
    return np.asarray(lightest * np.maximum(tint, np.float32(1e-3)))


def _lab(light: NDArray[np.floating]) -> Array:
    """Return L, a and b of linear blue, green and red."""
    bgr = np.broadcast_to(np.clip(light, 0.0, 1.0), (1, 1, 3)).astype(np.float32)
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_LBGR2Lab)[0, 0], np.float64)
