"""The light of a picture at places between its pixels."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def nearest_pixels(image: NDArray[Any], places: Array) -> NDArray[Any]:
    """Return the pixels nearest to places, shape (...) or (..., c).

    Parameters
    ----------
    image : ndarray, shape (h, w) or (h, w, c)
        Any picture.
    places : ndarray, shape (..., 2)
        Where (x, y); those beyond the picture are taken at its border.
    """
    nearest, (height, width) = np.rint(places).astype(np.intp), image.shape[:2]
    x, y = (  # far quicker than `clip`
        np.minimum(np.maximum(nearest[..., k], 0), size - 1)
        for k, size in enumerate((width, height))
    )
    return np.asarray(image[y, x])


def bilinear(image: NDArray[np.float32], places: Array) -> Array:
    """Return light that runs straight between pixels, shape (n, k).

    Parameters
    ----------
    image : ndarray, shape (h, w)
        Light.
    places : ndarray, shape (n, k, 2)
        Where (x, y); those beyond the picture are taken at its border.
    """
    x, y = (np.ascontiguousarray(places[..., k], np.float32) for k in (0, 1))
    light = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(light, np.float64)
