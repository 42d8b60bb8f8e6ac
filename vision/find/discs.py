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
        return np.asarray(mask & near_core(depth, float(radius), float(radius)))
    size = 2 * radius + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, disc), np.uint8)


@njit(cache=True)
def near_core(depth: NDArray[np.float32], core: float, reach: float) -> Mask:
    """Mark what is within `reach` of where the depth exceeds `core`."""
    height, width = depth.shape
    near = np.zeros((height, width), np.uint8)
    rows = int(reach)
    aside = np.sqrt(reach**2 - np.arange(rows + 1) ** 2).astype(np.int64)
    for i in range(height):
        j = 0
        while j < width:
            first = j
            while j < width and depth[i, j] > core:
                j += 1
            if j > first:
                for k in range(max(i - rows, 0), min(i + rows + 1, height)):
                    span = aside[abs(k - i)]
                    near[k, max(first - span, 0) : j + span] = 1
            j += 1
    return near
