"""The photographs of a run in the frame of its one clamp, and back in their own.

What a photograph read by itself stays in its row (``own_angle_deg``), so that nothing
is lost and a run can be resumed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..extraction.quality import direction_is_doubtful
from .shared_clamp import Direction, Reading, shared_direction
from .tables import Done, FrameRow

Array = NDArray[np.float64]

MOVED, LENGTH_DIFFERS = "clamp_moved", "length_differs"
_OF_RUN = frozenset({MOVED, LENGTH_DIFFERS})
"""What only the photographs of a run together tell."""
_LENGTH_SDS, _LENGTH_PART = 4.0, 0.003
"""A rod keeps its length: a photograph that differs from the others by more than so
many deviations, and by this part, is seen by a camera that does not fit, or wrong."""
_DOUBTFUL = "direction_doubtful"
NOT_HELD = frozenset({"no_clamp", "clamp_at_border"})
"""Rods that no clamp in the picture holds have no direction to share."""


def in_run_frames(done: Iterable[Done], runs: Mapping[str, str]) -> list[Done]:
    """Return photographs in the frames of their runs, in the same order.

    Parameters
    ----------
    done : iterable of Done
        Photographs in their own frames, in the order in which they were taken.
    runs : mapping of str to str
        The run of each image; an image without one keeps its own frame.
    """
    ready = list(done)
    groups: dict[str, dict[int, Reading]] = {}
    for index, each in enumerate(ready):
        run = runs.get(each.row.image)
        if run and (reading := _reading(each.row)) is not None:
            groups.setdefault(run, {})[index] = reading
    for run, readings in groups.items():
        if len(readings) < 2:
            continue
        direction = shared_direction(list(readings.values()))
        longer = _of_other_length([ready[index].row for index in readings])
        for index in readings:
            ready[index] = (
                _flagged(ready[index], MOVED)
                if direction is None
                else _in_frame(ready[index], direction, run)
            )
            if ready[index].row.image in longer:
                ready[index] = _flagged(ready[index], LENGTH_DIFFERS)
    return ready


def _of_other_length(rows: list[FrameRow]) -> set[str]:
    """Return the images whose rod is longer or shorter than in most of its run."""
    length = np.array([row.length_mm for row in rows])
    sd = np.array([row.length_sd_mm for row in rows])
    off = np.abs(length - np.median(length))
    least = np.maximum(_LENGTH_SDS * sd, _LENGTH_PART * np.median(length))
    return {
        row.image for row, differs in zip(rows, off > least, strict=True) if differs
    }


def in_own_frame(done: Done) -> Done:
    """Return a photograph as it was before `in_run_frames`."""
    row = done.row
    if not row.shared_clamp and not _OF_RUN & set(row.flags):
        return done
    own = Direction(angle_deg=row.own_angle_deg, sd_deg=row.own_angle_sd_deg)
    return _in_frame(done, own, "")


def _in_frame(done: Done, to: Direction, run: str) -> Done:
    row = done.row
    if row.pose is None:
        return done
    turn_deg = to.angle_deg - row.pose.angle_deg
    turn_deg = (turn_deg + 180.0) % 360.0 - 180.0
    turn = math.radians(turn_deg)
    flags = tuple(flag for flag in row.flags if flag not in _OF_RUN | {_DOUBTFUL})
    if direction_is_doubtful(to.sd_deg, row.length_mm):
        flags = (*flags, _DOUBTFUL)
    tip = np.array(row.tip_mm)
    (x,), (y,) = _turned(tip[:1], tip[1:], turn)
    turned_row = replace(
        row,
        flags=flags,
        tip_mm=(float(x), float(y)),
        tip_angle_deg=row.tip_angle_deg - turn_deg,
        pose=replace(row.pose, angle_deg=to.angle_deg),
        clamp_angle_sd_deg=to.sd_deg,
        tip_sd_mm=_tip_sd_mm(row, to.sd_deg),
        shared_clamp=run,
    )
    points, edges = dict(done.points), done.edges.copy()
    if points:
        points["x_mm"], points["y_mm"] = _turned(points["x_mm"], points["y_mm"], turn)
        points["theta_rad"] = points["theta_rad"] - turn
    edges[:, 4], edges[:, 5] = _turned(edges[:, 4], edges[:, 5], turn)
    return replace(done, row=turned_row, points=points, edges=edges)


def _tip_sd_mm(row: FrameRow, sd_deg: float) -> tuple[float, float]:
    """Return the tip's deviations with another one of the direction at the clamp."""
    change = math.radians(sd_deg) ** 2 - math.radians(row.clamp_angle_sd_deg) ** 2
    (x, y), (sd_x, sd_y) = row.tip_mm, row.tip_sd_mm
    return (
        math.sqrt(max(sd_x**2 + change * y**2, 0.0)),
        math.sqrt(max(sd_y**2 + change * x**2, 0.0)),
    )


def _turned(x: Array, y: Array, turn: float) -> tuple[Array, Array]:
    """Return points in a frame that is turned counter-clockwise about its origin."""
    c, s = math.cos(turn), math.sin(turn)
    return c * x + s * y, c * y - s * x


def _flagged(done: Done, flag: str) -> Done:
    return replace(done, row=replace(done.row, flags=(*done.row.flags, flag)))


def _reading(row: FrameRow) -> Reading | None:
    """Return how a photograph sees the clamp; None where it does not, in mm."""
    if row.pose is None or not math.isfinite(row.own_angle_sd_deg):
        return None
    if NOT_HELD & set(row.flags):
        return None
    return Reading(
        x_mm=row.pose.x_mm,
        y_mm=row.pose.y_mm,
        angle_deg=row.own_angle_deg,
        sd_deg=row.own_angle_sd_deg,
        mm_per_px=math.hypot(*row.tip_mm) / math.dist(row.tip_px, row.clamp_px),
    )
