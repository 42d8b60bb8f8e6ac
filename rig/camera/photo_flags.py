"""Doubts about one photograph that the bench can see without measuring it."""

from __future__ import annotations

import numpy as np

from .protocol import Image

_SATURATED_SHARE = 0.05


def photo_flags(
    image: Image, level: float, reference: float, drift_percent: float
) -> list[str]:
    """Return the flags of a photograph.

    Parameters
    ----------
    image : ndarray, shape (h, w) or (h, w, 3)
        The photograph.
    level, reference : float
        Background brightness of this and of the first photograph, from 0 to 1.
    drift_percent : float
        Largest change of brightness before ``brightness_drift`` is said: the exposure
        was not locked, or a lamp failed.

    Returns
    -------
    list of str
        Any of ``brightness_drift``, ``overexposed``, ``dark``.
    """
    full = 1.0 if image.dtype.kind == "f" else float(np.iinfo(image.dtype).max)
    flags = []
    if abs(level - reference) * 100.0 > drift_percent * max(reference, 1e-3):
        flags.append("brightness_drift")
    if float(np.mean(image >= full)) > _SATURATED_SHARE:
        flags.append("overexposed")
    if level < 0.1:
        flags.append("dark")
    return flags
