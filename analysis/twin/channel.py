"""A printed channel for the twin: the walls of a lumen as ridges on the paper."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...sim.navigate import Lumen, outline
from ...vision import Pose
from ...vision.synthetic import Ridge

Array = NDArray[np.float64]

THICK_MM = 1.2
"""Of the printed walls."""


def ridges_of(lumen: Lumen, pose: Pose, height_mm: float) -> tuple[Ridge, ...]:
    """Return the walls of a lumen as printed ridges, solid away from the lumen.

    Parameters
    ----------
    lumen : Lumen
        The lumen.
    pose : Pose
        Where its frame lies on the board.
    height_mm : float
        Of the walls above the paper.
    """
    ridges = []
    for wall in lumen.walls:
        face = outline(wall.arcs)
        normal = normals(face, closed=wall.closed)
        back = face - lumen.side_of(wall) * THICK_MM * normal
        ridges.append(
            Ridge(
                face_mm=pose.to_board(face),
                back_mm=pose.to_board(back),
                height_mm=height_mm,
            )
        )
    return tuple(ridges)


def normals(points: Array, *, closed: bool) -> Array:
    """Return the unit normals to the left at the points of a polyline."""
    steps = np.diff(points, axis=0)
    steps /= np.hypot(*steps.T)[:, None]
    before = np.vstack([steps[-1:] if closed else steps[:1], steps])
    after = np.vstack([steps, steps[:1] if closed else steps[-1:]])
    along = before + after
    along /= np.hypot(*along.T)[:, None]
    return np.column_stack([-along[:, 1], along[:, 0]])
