"""``frames.csv``, ``centrelines.csv`` and the edge table: the only place of their text.

Rows stay numbers until they are written, and are numbers again once they are read.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.errors import ConfigError
from ...core.table import Table, read_table
from ..camera.calibration import Calibration
from ..measurement import DEVIATION_COLUMNS, NAN2, POINT_COLUMNS, Measurement, Pose

Array = NDArray[np.float64]

CENTRELINE_COLUMNS = (*POINT_COLUMNS, *DEVIATION_COLUMNS)
CENTRELINE_HEADER = ("image", *CENTRELINE_COLUMNS)
FRAME_HEADER = (
    "image", "status", "flags", "length_mm", "tip_x_mm", "tip_y_mm", "tip_angle_deg",
    "width_mm", "clamp_x_px", "clamp_y_px", "tip_x_px", "tip_y_px", "clamp_x_mm",
    "clamp_y_mm", "clamp_angle_deg", "rod_height_mm", "reason",
    "clamp_angle_sd_deg", "own_angle_deg", "own_angle_sd_deg", "shared_clamp",
    "length_sd_mm", "tip_x_sd_mm", "tip_y_sd_mm", "width_sd_mm", "clamp_sd_mm",
    "blur_px", "hints",
)  # fmt: skip
_FRAME_TEXTS = ("image", "status", "flags", "reason", "shared_clamp", "hints")
_FRAME_NUMBERS = tuple(name for name in FRAME_HEADER if name not in _FRAME_TEXTS)
EDGE_HEADER = ("image", "side", "point", "x_px", "y_px", "x_mm", "y_mm")
SIDES = ("left", "right")


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameRow:
    """One row of ``frames.csv``; lengths in mm, NaN where there is none.

    The direction of `pose`, known to `clamp_angle_sd_deg`, is that of `shared_clamp`,
    the run or video whose photographs give it together; where that is empty it is the
    photograph's own, ``own_angle_deg``, which stays in the table. ``..._sd_...`` are
    standard deviations, as in `Measurement`. `hints` is what a person
    pointed at (`extraction.hints`).
    """

    image: str
    status: str
    flags: tuple[str, ...] = ()
    length_mm: float = math.nan
    tip_mm: tuple[float, float] = NAN2
    tip_angle_deg: float = math.nan
    width_mm: float = math.nan
    clamp_px: tuple[float, float] = NAN2
    tip_px: tuple[float, float] = NAN2
    pose: Pose | None = None
    reason: str = ""
    clamp_angle_sd_deg: float = math.nan
    own_angle_deg: float = math.nan
    own_angle_sd_deg: float = math.nan
    shared_clamp: str = ""
    length_sd_mm: float = math.nan
    tip_sd_mm: tuple[float, float] = NAN2
    width_sd_mm: float = math.nan
    clamp_sd_mm: float = math.nan
    blur_px: float = math.nan
    hints: str = ""

    @property
    def ok(self) -> bool:
        """Whether the photograph could be measured."""
        return self.status == "ok"


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """What one photograph adds to the tables.

    Parameters
    ----------
    row : FrameRow
        Its row of ``frames.csv``.
    sha256 : str
        Digest of the photograph; empty where it could not be read.
    points : mapping of str to ndarray, shape (n,)
        `CENTRELINE_COLUMNS`; empty where it failed.
    edges : ndarray, shape (m, 6)
        Side (0 left, 1 right), point, x_px, y_px, x_mm and y_mm of the edge table.
    """

    row: FrameRow
    sha256: str
    points: Mapping[str, Array] = field(default_factory=dict)
    edges: Array = field(default_factory=lambda: np.empty((0, 6)))


def done_with(
    image: str, sha256: str, found: Measurement, calibration: Calibration | None,
    *, edges: bool,
) -> Done:  # fmt: skip
    """Return what a measurement adds to the tables, with or without its edges."""
    angle = math.nan if found.pose is None else found.pose.angle_deg
    row = FrameRow(
        image=image, status=found.status, flags=found.flags, length_mm=found.length_mm,
        tip_mm=found.tip_mm, tip_angle_deg=found.tip_angle_deg, width_mm=found.width_mm,
        clamp_px=found.clamp_px, tip_px=found.tip_px, pose=found.pose,
        reason=" ".join(found.reason.split()),
        clamp_angle_sd_deg=found.clamp_angle_sd_deg,
        own_angle_deg=angle, own_angle_sd_deg=found.clamp_angle_sd_deg,
        length_sd_mm=found.length_sd_mm, tip_sd_mm=found.tip_sd_mm,
        width_sd_mm=found.width_sd_mm, clamp_sd_mm=found.clamp_sd_mm,
        blur_px=found.blur_px,
    )  # fmt: skip
    if not found.ok:
        return Done(row=row, sha256=sha256)
    nothing = np.full(len(found.points["good"]), np.nan)
    points = {name: found.points.get(name, nothing) for name in CENTRELINE_COLUMNS}
    if not edges:
        return Done(row=row, sha256=sha256, points=points)
    sides = edge_points(found, calibration)
    return Done(row=row, sha256=sha256, points=points, edges=sides)


def edge_points(found: Measurement, calibration: Calibration | None) -> Array:
    """Return the side-edge points of one photograph, as the paper recorded them.

    Parameters
    ----------
    found : Measurement
        Its points must hold the edge columns; without them there are no rows.
    calibration : Calibration or None
        Gives the edges in mm in the specimen frame, at the height of the rod's axis.

    Returns
    -------
    ndarray, shape (m, 6)
        As in `Done`.
    """
    rows = []
    for number, side in enumerate(SIDES):
        if f"{side}_x_px" not in found.points:
            return np.empty((0, 6))
        columns = [found.points[f"{side}_{axis}_px"] for axis in "xy"]
        px = np.column_stack(columns)
        mm = np.full_like(px, np.nan)
        if calibration is not None and found.pose is not None:
            height = found.pose.height_mm
            mm = found.pose.from_board(calibration.to_mm(px, height_mm=height))
        count = np.arange(len(px))
        rows.append(np.column_stack([np.full(len(px), number), count, px, mm]))
    table = np.concatenate(rows)
    return np.asarray(table[np.all(np.isfinite(table[:, 2:4]), axis=1)])


def write_frames(rows: Iterable[FrameRow]) -> str:
    """Return the text of a ``frames.csv``."""
    return _table([FRAME_HEADER, *(_frame_cells(row) for row in rows)])


def write_centrelines(done: Iterable[Done]) -> str:
    """Return the text of a ``centrelines.csv``."""
    points = (_points_text(each) for each in done if each.points)
    return _table([CENTRELINE_HEADER]) + "".join(points)


def _points_text(done: Done) -> str:
    """Return the rows of one photograph; of a film, that is most of the tables."""
    values = np.column_stack([done.points[name] for name in CENTRELINE_COLUMNS])
    image = done.row.image
    if not np.all(np.isfinite(values)):
        return _table([image, *map(_cell, row)] for row in values.tolist())
    name = _table([(image,)]).rstrip("\n").replace("%", "%%")
    row = name + ",%.10g" * len(CENTRELINE_COLUMNS) + "\n"
    return (row * len(values)) % tuple(values.ravel().tolist())


def write_edges(done: Iterable[Done]) -> str:
    """Return the text of an edge table."""
    lines = (
        [each.row.image, SIDES[int(values[0])], *map(_cell, values[1:])]
        for each in done
        for values in each.edges
    )
    return _table([EDGE_HEADER, *lines])


def read_frames(path: Path) -> list[FrameRow]:
    """Read a ``frames.csv``; columns that it lacks are NaN or empty.

    Raises
    ------
    ConfigError
        If the file is missing, is no table, lacks image or status, or holds something
        else than numbers.
    """
    table = _read(path, ("image", "status"))
    texts = {name: table.texts(name) for name in _FRAME_TEXTS}
    numbers = {name: _numbers(table, name) for name in _FRAME_NUMBERS}
    return [
        _frame(
            {name: column[i] for name, column in texts.items()},
            {name: float(column[i]) for name, column in numbers.items()},
        )
        for i in range(len(table.rows))
    ]


def read_centrelines(path: Path) -> dict[str, dict[str, Array]]:
    """Read a ``centrelines.csv``.

    Returns
    -------
    dict of str to dict of str to ndarray, shape (n,)
        `CENTRELINE_COLUMNS` of each image; NaN where a cell is empty, or the file has
        no such column.

    Raises
    ------
    ConfigError
        If the file is missing, is no table, lacks image, s_mm, x_mm, y_mm or theta_rad,
        or holds something else than numbers.
    """
    return _by_image(_read(path, CENTRELINE_HEADER[:5]), CENTRELINE_COLUMNS)


def read_edges(path: Path) -> dict[str, Array]:
    """Read an edge table: by image, as in `Done`."""
    table = _read(path, EDGE_HEADER)
    sides = [float(SIDES.index(side)) for side in table.texts("side") if side in SIDES]
    if len(sides) < len(table.rows):
        raise ConfigError(f"{path}: the column side must hold left or right")
    columns = [np.array(sides), *(_numbers(table, name) for name in EDGE_HEADER[2:])]
    values = np.column_stack(columns)
    return {image: values[rows] for image, rows in _rows_of(table).items()}


def to_centreline(columns: Mapping[str, Array]) -> Centreline:
    """Return the centreline in mm of one image of `read_centrelines`.

    Raises
    ------
    InputError
        If it has no mm (an uncalibrated photograph).
    """
    return Centreline(
        s_mm=columns["s_mm"],
        x_mm=columns["x_mm"],
        y_mm=columns["y_mm"],
        theta_rad=columns["theta_rad"],
        kappa_per_mm=columns["kappa_per_mm"],
    )


def _frame_cells(row: FrameRow) -> list[str]:
    pose = row.pose
    placed = (
        NAN2 * 2
        if pose is None
        else (pose.x_mm, pose.y_mm, pose.angle_deg, pose.height_mm)
    )
    sizes = (
        row.length_mm, *row.tip_mm, row.tip_angle_deg, row.width_mm, *row.clamp_px,
        *row.tip_px, *placed,
    )  # fmt: skip
    angles = row.clamp_angle_sd_deg, row.own_angle_deg, row.own_angle_sd_deg
    deviations = row.length_sd_mm, *row.tip_sd_mm, row.width_sd_mm, row.clamp_sd_mm
    return [
        row.image, row.status, ";".join(row.flags), *map(_cell, sizes), row.reason,
        *map(_cell, angles), row.shared_clamp, *map(_cell, deviations),
        _cell(row.blur_px), row.hints,
    ]  # fmt: skip


def _frame(text: Mapping[str, str], number: Mapping[str, float]) -> FrameRow:
    value = number.__getitem__

    def pair(name: str, unit: str) -> tuple[float, float]:
        return value(f"{name}_x_{unit}"), value(f"{name}_y_{unit}")

    pose = None
    if math.isfinite(angle := value("clamp_angle_deg")):
        x_mm, y_mm = pair("clamp", "mm")
        height_mm = value("rod_height_mm")
        height_mm = height_mm if math.isfinite(height_mm) else 0.0
        pose = Pose(x_mm=x_mm, y_mm=y_mm, angle_deg=angle, height_mm=height_mm)
    return FrameRow(
        image=text["image"],
        status=text["status"],
        flags=tuple(text["flags"].replace(";", " ").split()),
        length_mm=value("length_mm"),
        tip_mm=pair("tip", "mm"),
        tip_angle_deg=value("tip_angle_deg"),
        width_mm=value("width_mm"),
        clamp_px=pair("clamp", "px"),
        tip_px=pair("tip", "px"),
        pose=pose,
        reason=text["reason"],
        clamp_angle_sd_deg=value("clamp_angle_sd_deg"),
        own_angle_deg=value("own_angle_deg"),
        own_angle_sd_deg=value("own_angle_sd_deg"),
        shared_clamp=text["shared_clamp"],
        length_sd_mm=value("length_sd_mm"),
        tip_sd_mm=(value("tip_x_sd_mm"), value("tip_y_sd_mm")),
        width_sd_mm=value("width_sd_mm"),
        clamp_sd_mm=value("clamp_sd_mm"),
        blur_px=value("blur_px"),
        hints=text["hints"],
    )


def _cell(value: float) -> str:
    """Return a number with ten digits; empty where there is none."""
    return f"{value:.10g}" if math.isfinite(value) else ""


def _table(lines: Iterable[Sequence[str]]) -> str:
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(lines)
    return buffer.getvalue()


def _read(path: Path, needed: tuple[str, ...]) -> Table:
    table = read_table(path, comments="", limit_MB=1024.0, rows=False)
    table.require(*needed, hint="magbend vision extract writes such a table")
    return table


def _numbers(table: Table, name: str) -> Array:
    """Return a column; NaN where a cell is empty, or there is no such column."""
    if not table.has(name):
        return np.full(len(table.rows), np.nan)
    return table.numbers(name, blanks=True)


def _by_image(table: Table, wanted: Sequence[str]) -> dict[str, dict[str, Array]]:
    """Return the wanted columns of each image."""
    columns = {name: _numbers(table, name) for name in wanted}
    return {
        image: {name: column[rows] for name, column in columns.items()}
        for image, rows in _rows_of(table).items()
    }


def _rows_of(table: Table) -> dict[str, list[int]]:
    rows: dict[str, list[int]] = {}
    for i, image in enumerate(table.texts("image")):
        rows.setdefault(image, []).append(i)
    return rows
