"""Growing and opening a mask by true discs, at a cost that hardly grows with them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit

Mask = NDArray[np.uint8]

_SMALL = 3
"""Radius up to which a kernel is quicker than distances."""


def opened(mask: Mask, radius: int) -> Mask:
    """Return a mask less whatever no disc of this radius inside it covers."""
    if radius > _SMALL:
        depth = np.asarray(cv2.distanceTransform(mask, cv2.DIST_L2, 5), np.float32)
        core = near_core(depth, places_of(mask), float(radius), float(radius))
        return np.asarray(mask & core)
    size = 2 * radius + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, disc), np.uint8)


@njit(cache=True)
def places_of(mask: Mask) -> NDArray[np.intp]:
    """Return the flat indices of what is not 0.

    Numpy takes ten times as long: here eight pixels are looked at in one.
    """
    flat = mask.ravel()
    words = flat[: flat.size // 8 * 8].view(np.uint64)
    found, count = np.empty(flat.size, np.intp), 0
    for word in range(words.size + 1):
        if word == words.size or words[word]:
            for place in range(8 * word, min(8 * word + 8, flat.size)):
                if flat[place]:
                    found[count] = place
                    count += 1
    return found[:count]


@njit(cache=True)
def near_core(
    depth: NDArray[np.float32], places: NDArray[np.intp], core: float, reach: float
) -> Mask:
    """Mark what is within `reach` of where the depth exceeds `core`.

    It is 0 but at places, given by rising flat indices.
    """
    height, width = depth.shape
    near = np.zeros((height, width), np.uint8)
    rows = int(reach)
    aside = np.sqrt(reach**2 - np.arange(rows + 1) ** 2).astype(np.int64)
    deep, n = depth.ravel(), 0
    while n < places.size:
        if not deep[places[n]] > core:
            n += 1
            continue
        i = places[n] // width
        first = last = places[n] - i * width
        while last < width and deep[i * width + last] > core:
            last, n = last + 1, n + 1
        for k in range(max(i - rows, 0), min(i + rows + 1, height)):
            span = aside[abs(k - i)]
            near[k, max(first - span, 0) : last + span] = 1
    return near
