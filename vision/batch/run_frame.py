"""The photographs of a run in the frame of its one clamp, and back in their own.

Rows of the tables in, rows of the tables out: what a photograph read by itself stays in
its row (``own_angle_deg``), so that nothing is lost and a run can be resumed.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

from ..extraction.quality import direction_is_doubtful
from .shared_clamp import Direction, Reading, shared_direction
from .tables import (
    CENTRELINE_HEADER,
    EDGE_HEADER,
    FRAME_HEADER,
    Done,
    number,
    row,
    turned,
)

MOVED = "clamp_moved"
_DOUBTFUL = "direction_doubtful"
_NOT_HELD = frozenset({"no_clamp", "clamp_at_border"})
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
        run = runs.get(each.image)
        if run and (reading := _reading(each)) is not None:
            groups.setdefault(run, {})[index] = reading
    for run, readings in groups.items():
        if len(readings) < 2:
            continue
        direction = shared_direction(list(readings.values()))
        for index in readings:
            ready[index] = (
                _flagged(ready[index])
                if direction is None
                else _in_frame(ready[index], direction, run)
            )
    return ready


def in_own_frame(done: Done) -> Done:
    """Return a photograph as it was before `in_run_frames`."""
    cells = _cells(done)
    if not cells["shared_clamp"] and MOVED not in cells["flags"].split(";"):
        return done
    own = Direction(
        angle_deg=float(cells["own_angle_deg"]), sd_deg=float(cells["own_angle_sd_deg"])
    )
    return _in_frame(done, own, "")


def _in_frame(done: Done, to: Direction, run: str) -> Done:
    cells = _cells(done)
    turn_deg = to.angle_deg - float(cells["clamp_angle_deg"])
    turn_deg = (turn_deg + 180.0) % 360.0 - 180.0
    turn = math.radians(turn_deg)
    c, s = math.cos(turn), math.sin(turn)
    x, y = float(cells["tip_x_mm"]), float(cells["tip_y_mm"])
    flags = [f for f in cells["flags"].split(";") if f not in ("", MOVED, _DOUBTFUL)]
    if direction_is_doubtful(to.sd_deg, float(cells["length_mm"])):
        flags.append(_DOUBTFUL)
    cells |= {
        "flags": ";".join(flags),
        "tip_x_mm": number(c * x + s * y),
        "tip_y_mm": number(c * y - s * x),
        "tip_angle_deg": number(float(cells["tip_angle_deg"]) - turn_deg),
        "clamp_angle_deg": number(to.angle_deg),
        "clamp_angle_sd_deg": number(to.sd_deg),
        "shared_clamp": run,
    }
    return replace(
        done,
        frame=row(*cells.values()),
        centreline=turned(done.centreline, CENTRELINE_HEADER, turn),
        edges=turned(done.edges, EDGE_HEADER, turn),
    )


def _flagged(done: Done) -> Done:
    cells = _cells(done)
    cells["flags"] = ";".join(filter(None, [cells["flags"], MOVED]))
    return replace(done, frame=row(*cells.values()))


def _reading(done: Done) -> Reading | None:
    """Return how a photograph sees the clamp; None where it does not, in mm."""
    cells = _cells(done)
    if not cells["own_angle_sd_deg"] or _NOT_HELD & set(cells["flags"].split(";")):
        return None
    value = {
        name: float(cells[name])
        for name in FRAME_HEADER
        if name.endswith(("_mm", "_px", "_deg")) and cells[name]
    }
    chord_px = math.hypot(
        value["tip_x_px"] - value["clamp_x_px"], value["tip_y_px"] - value["clamp_y_px"]
    )
    return Reading(
        x_mm=value["clamp_x_mm"],
        y_mm=value["clamp_y_mm"],
        angle_deg=value["own_angle_deg"],
        sd_deg=value["own_angle_sd_deg"],
        mm_per_px=math.hypot(value["tip_x_mm"], value["tip_y_mm"]) / chord_px,
    )


def _cells(done: Done) -> dict[str, str]:
    (cells,) = csv.reader(io.StringIO(done.frame))
    return dict(zip(FRAME_HEADER, cells, strict=True))
