"""Walls of a printed channel as the camera sees them: ridges that stand on the paper.

A ridge is cut into triangles, so that it may wind as it likes; their exact areas add up
(`raster.coverage_of`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..camera.calibration import Calibration
from ..picture.raster import coverage_of
from .parts import Ridge

Picture = NDArray[np.float32]

LEVELS = 6
"""Heights at which a wall or a shadow is drawn, from the paper to its top."""


def ridge_faces(ridges: Sequence[Ridge], camera: Calibration) -> Picture:
    """Return where ridges are seen, their faces and tops, from 0 to 1."""
    seen = [ridges_at(ridges, camera, part) for part in np.linspace(0.0, 1.0, LEVELS)]
    return np.asarray(np.max(seen, axis=0), np.float32)


def ridge_tops(ridges: Sequence[Ridge], camera: Calibration) -> Picture:
    """Return where the tops of ridges are seen, from 0 to 1."""
    return ridges_at(ridges, camera, 1.0)


def ridge_shade(
    ridges: Sequence[Ridge], camera: Calibration, shift: NDArray[np.float64]
) -> Picture:
    """Return where ridges keep the lamp's light from the paper, with a sharp edge.

    `shift`, shape (2,), is how far a shadow lies from its object, mm per mm of height.
    """
    cast = [
        ridges_at(ridges, camera, 0.0, part * shift)
        for part in np.linspace(0.0, 1.0, LEVELS)
    ]
    return np.asarray(np.max(cast, axis=0), np.float32)


def ridges_at(
    ridges: Sequence[Ridge],
    camera: Calibration,
    part: float,
    shift: NDArray[np.float64] | None = None,
) -> Picture:
    """Return the ridges' section at a part of their height, seen by a camera.

    Where a `shift` is given the section is moved by it for each mm of height.
    """
    triangles = []
    for ridge in ridges:
        moved = 0.0 if shift is None else ridge.height_mm * shift
        height_mm = part * ridge.height_mm
        face = camera.to_px(ridge.face_mm + moved, height_mm=height_mm)
        back = camera.to_px(ridge.back_mm + moved, height_mm=height_mm)
        corners = zip(face[:-1], face[1:], back[:-1], back[1:], strict=True)
        for a, b, c, d in corners:
            triangles += [np.array([a, b, d]), np.array([a, d, c])]
    return coverage_of(triangles, [1] * len(triangles), *camera.image_size_px)
