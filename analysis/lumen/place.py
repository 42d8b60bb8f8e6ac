"""Where the channel lies under the camera, and what that says before a rod is sought.

The lumen file knows the walls, so they need not be told from the rod by their looks:
they are found in a picture of the empty channel, which is then divided out of the
others.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...sim.navigate import Lumen, outline
from ...vision import Calibration, Photo, Placed, Pose, Setting, oriented, place_outline

Array = NDArray[np.float64]

EVERY_MM = 0.2
"""Distance of points along a wall."""
GUIDE_SIDES = (8.0, 16.0)
"""Width and length of the guide that counts as a clamp, in sides of the rod."""


def faces_of(lumen: Lumen) -> list[tuple[Array, Array]]:
    """Return points along each wall, in mm, and their normals into the lumen."""
    faces = []
    for wall in lumen.walls:
        drawn = outline(wall.arcs)
        s = np.append(0.0, np.cumsum(np.hypot(*np.diff(drawn, axis=0).T)))
        at = np.arange(0.5 * EVERY_MM, s[-1], EVERY_MM)
        points = np.column_stack([np.interp(at, s, part) for part in drawn.T])
        along = np.gradient(points, axis=0)
        along /= np.hypot(*along.T)[:, None]
        left = np.column_stack([-along[:, 1], along[:, 0]])
        faces.append((points, lumen.side_of(wall) * left))
    return faces


def entry_of(lumen: Lumen) -> Pose:
    """Return where the guide ends, and its direction, in the lumen's frame."""
    x, y = lumen.entry_mm
    return Pose(x_mm=x, y_mm=y, angle_deg=lumen.entry_angle_deg)


def place(
    lumen: Lumen,
    bare: Photo,
    calibration: Calibration,
    *,
    wall_height_mm: float,
    setting: Setting,
    side_mm: float,
) -> tuple[Placed, Setting]:
    """Find the channel; return where it lies, and how its rod is to be measured.

    Parameters
    ----------
    lumen : Lumen
        The channel.
    bare : Photo
        Of the empty channel.
    calibration : Calibration
        The camera.
    wall_height_mm : float
        Of the walls above the board's plane.
    setting : Setting
        What is known of the rod.
    side_mm : float
        Its side.

    Raises
    ------
    VisionError
        If the walls are not to be seen.
    """
    seen = oriented(bare, calibration)
    calibration.check_size(*seen.size_px)
    placed = place_outline(seen, calibration, faces_of(lumen), height_mm=wall_height_mm)
    wide, long = (0.5 * GUIDE_SIDES[0] * side_mm, GUIDE_SIDES[1] * side_mm)
    box = np.array([[0.0, wide], [0.0, -wide], [-long, -wide], [-long, wide]])
    corners = placed.pose.to_board(entry_of(lumen).to_board(box))
    px = calibration.to_px(corners, height_mm=setting.axis_height_mm)
    guide = tuple((float(x), float(y)) for x, y in px)
    return placed, replace(
        setting, calibration=calibration, bare=bare, guide_px=guide, side_mm=side_mm
    )
