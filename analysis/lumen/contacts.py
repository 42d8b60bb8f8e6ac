"""Where a measured rod touches the walls of its lumen.

The rod's axis is taken from the one of its edges that the camera sees over its top: the
outer one, as seen from below the camera. The other edge is the foot of a side face,
which a wall hides where the rod lies against it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...sim.navigate import Lumen
from ...vision import Calibration, Placed
from .place import entry_of

Array = NDArray[np.float64]

CLOSE = 2.0
"""A gap below so many standard deviations is a contact."""
EDGE_PX = 0.1
"""What an edge beside a wall may be off by, besides its own deviation."""
HOLE_MM = 1.0
"""Contacts on one wall that are nearer than this are one."""
WIDEST = 0.8
"""Share of the widths below the one that is taken: where a wall hides a face the rod
looks thinner, and nowhere thicker."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """A stretch of the rod that lies against a wall.

    Parameters
    ----------
    wall : str
        Name of the wall.
    from_mm, to_mm, at_mm : float
        Where on the rod it begins and ends, and where the gap is least, from the guide.
    gap_mm : float
        The least gap; below zero within the deviation.
    """

    wall: str
    from_mm: float
    to_mm: float
    at_mm: float
    gap_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Fed:
    """A rod in its lumen, as one photograph shows it.

    Parameters
    ----------
    s_mm : ndarray, shape (n,)
        Arc length from where the guide ends.
    points_mm : ndarray, shape (n, 2)
        Of its axis, in the lumen's frame.
    gap_mm, sigma_mm : ndarray, shape (n,)
        From its surface to the nearest wall, and the standard deviation of that.
    wall : ndarray of str, shape (n,)
        The nearest wall.
    touching : ndarray of bool, shape (n,)
        Whether that gap is none, as far as it is known.
    touches : tuple of Touch
        The contacts, root first.
    """

    s_mm: Array
    points_mm: Array
    gap_mm: Array
    sigma_mm: Array
    wall: NDArray[np.str_]
    touching: NDArray[np.bool_]
    touches: tuple[Touch, ...]

    @property
    def fed_mm(self) -> float:
        """How much of the rod is out of its guide."""
        return float(self.s_mm[-1])


def fed(
    points: dict[str, Array],
    edges: Array,
    lumen: Lumen,
    placed: Placed,
    calibration: Calibration,
    *,
    axis_height_mm: float,
    wall_sd_mm: float,
) -> Fed:
    """Return a measured rod in its lumen.

    Parameters
    ----------
    points : dict of str to ndarray, shape (n,)
        As in ``centrelines.csv``.
    edges : ndarray, shape (2 n, 6)
        Of the edge table.
    lumen, placed, calibration
        The channel, where it lies, and the camera.
    axis_height_mm : float
        Of the rod's axis above the board's plane.
    wall_sd_mm : float
        How far the printed walls may be off the lumen file.
    """
    half_mm = 0.5 * float(np.quantile(points["width_mm"], WIDEST))
    middle_px = np.column_stack([points["x_px"], points["y_px"]])
    middle = calibration.to_mm(middle_px, height_mm=axis_height_mm)
    along = np.gradient(middle, axis=0)
    along /= np.hypot(*along.T)[:, None]
    left = np.column_stack([-along[:, 1], along[:, 0]])
    outer = np.sum(left * (middle - calibration.camera_mm[:2]), axis=1) > 0.0
    sides = [edges[edges[:, 0] == side][:, 2:4] for side in (0, 1)]
    edge_px = np.where(outer[:, None], sides[0], sides[1])
    edge = calibration.to_mm(edge_px, height_mm=axis_height_mm + half_mm)
    axis = edge - np.where(outer, half_mm, -half_mm)[:, None] * left
    own = placed.pose.from_board(axis)
    rooms = lumen.rooms_mm(own)
    names = np.array(list(rooms))
    room = np.array(list(rooms.values()))
    nearest = np.argmin(room, axis=0)
    gap = np.min(room, axis=0) - half_mm
    arm = np.hypot(*(own - own.mean(axis=0)).T)
    root_px = (float(middle_px[0, 0]), float(middle_px[0, 1]))
    px_mm = calibration.mm_per_px(root_px, height_mm=axis_height_mm)
    sigma = np.sqrt(
        2.0 * points["sigma_mm"] ** 2
        + (EDGE_PX * px_mm) ** 2
        + placed.sd_mm**2
        + (math.radians(placed.sd_deg) * arm) ** 2
        + wall_sd_mm**2
    )
    ahead = entry_of(lumen).from_board(own[:1])[0, 0]
    s = points["s_mm"] - points["s_mm"][0] + float(ahead)
    touching = (gap < CLOSE * sigma) & (s > 0.0)
    return Fed(
        s_mm=s,
        points_mm=own,
        gap_mm=gap,
        sigma_mm=sigma,
        wall=names[nearest],
        touching=touching,
        touches=_stretches(s, gap, names[nearest], touching),
    )


def _stretches(
    s: Array, gap: Array, wall: NDArray[np.str_], touching: NDArray[np.bool_]
) -> tuple[Touch, ...]:
    """Join neighbouring points that touch one wall."""
    found = []
    for name in dict.fromkeys(wall[touching].tolist()):
        index = np.flatnonzero(touching & (wall == name))
        cuts = np.flatnonzero(np.diff(s[index]) > HOLE_MM) + 1
        for part in np.split(index, cuts):
            k = part[np.argmin(gap[part])]
            found.append(
                Touch(
                    wall=name, from_mm=float(s[part[0]]), to_mm=float(s[part[-1]]),
                    at_mm=float(s[k]), gap_mm=float(gap[k]),
                )
            )  # fmt: skip
    return tuple(sorted(found, key=lambda touch: touch.from_mm))
