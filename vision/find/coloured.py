"""Whether colour shows something like a rod where lightness shows nothing, or another.

A red rod on a green board may be as light as the board, while its shade is dark; beside
a striped rod a black one looks clearer. What lightness alone has found is then in
doubt.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..picture.photo import Photo
from .binarise import Binary
from .candidate import Candidate
from .rod import find_candidates

_GLANCE_PX = 400
"""The longer side of the picture looked at, roughly: enough to see that something is
there."""

_HUE = 0.12
"""Distance from the paper in a and b of CIELAB, over 100, of what is coloured."""

_LEAST_COLOURED = 40
"""Coloured pixels, of the small picture, fewer of which are no rod."""


def shows_another(photo: Photo, rod: Candidate) -> bool:
    """Whether something of another colour than the paper is like a rod, but not it.

    Parameters
    ----------
    photo : Photo
        The photograph; a grey one shows nothing.
    rod : Candidate
        What lightness has found.
    """
    tinted = _tinted(photo)
    if tinted is None:
        return False
    return any(
        0.5 < other.width_px / rod.width_px < 2.0
        and other.length_px > 0.4 * rod.length_px
        and not other.lies_on(rod)
        for other in find_candidates(tinted)
    )


def _tinted(photo: Photo) -> Binary | None:
    """Return a small picture whose mask is what has another colour than the paper."""
    pixels = None if photo.decode is None else photo.decode()
    if pixels is None or pixels.ndim != 3 or pixels.dtype != np.uint8:
        return None
    factor = max(1, round(max(pixels.shape) / _GLANCE_PX))
    height, width = (side // factor for side in pixels.shape[:2])
    whole = pixels[: height * factor, : width * factor, :3]
    small = cv2.resize(whole, (width, height), interpolation=cv2.INTER_NEAREST)
    small = cv2.blur(small, (3, 3))  # of the grain; means of all pixels take longer
    lab = cv2.cvtColor(small, cv2.COLOR_BGR2Lab).astype(np.float32)
    _, a, b = (hue - np.float32(np.median(hue[::3, ::3])) for hue in cv2.split(lab))
    away = cv2.magnitude(a, b) / np.float32(100.0)
    mask = np.asarray((away > _HUE).view(np.uint8))
    if cv2.countNonZero(mask) < _LEAST_COLOURED:
        return None
    return Binary(
        ratio=np.asarray(1.0 - away, np.float32), mask=mask, factor=factor,
        inverted=False, dark=0.0, threshold=1.0 - _HUE,
    )  # fmt: skip
