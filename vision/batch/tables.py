"""``centrelines.csv``, ``frames.csv`` and the edge table: rows out, measurements in."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.errors import ConfigError
from ..camera.calibration import Calibration
from ..measurement import DEVIATION_COLUMNS, POINT_COLUMNS, Measurement, Pose

Array = NDArray[np.float64]

CENTRELINE_HEADER = ("image", *POINT_COLUMNS, *DEVIATION_COLUMNS)
FRAME_HEADER = (
    "image", "status", "flags", "length_mm", "tip_x_mm", "tip_y_mm", "tip_angle_deg",
    "width_mm", "clamp_x_px", "clamp_y_px", "tip_x_px", "tip_y_px", "clamp_x_mm",
    "clamp_y_mm", "clamp_angle_deg", "rod_height_mm", "reason",
    "clamp_angle_sd_deg", "own_angle_deg", "own_angle_sd_deg", "shared_clamp",
)  # fmt: skip
EDGE_HEADER = ("image", "side", "point", "x_px", "y_px", "x_mm", "y_mm")


@dataclass(frozen=True, slots=True)
class Done:
    """The text that one photograph adds to the tables."""

    image: str
    sha256: str
    frame: str
    centreline: str
    edges: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameRow:
    """One row of ``frames.csv``; lengths in mm, NaN where there is none.

    The direction of `pose`, known to `clamp_angle_sd_deg`, is that of `shared_clamp`,
    the run or video whose photographs give it together; where that is empty it is the
    photograph's own, ``own_angle_deg``, which stays in the table.
    """

    image: str
    status: str
    flags: tuple[str, ...]
    length_mm: float
    tip_mm: tuple[float, float]
    tip_angle_deg: float
    width_mm: float
    clamp_px: tuple[float, float]
    tip_px: tuple[float, float]
    pose: Pose | None
    reason: str
    clamp_angle_sd_deg: float = math.nan
    own_angle_deg: float = math.nan
    own_angle_sd_deg: float = math.nan
    shared_clamp: str = ""

    @property
    def ok(self) -> bool:
        """Whether the photograph could be measured."""
        return self.status == "ok"


def frame_row(image: str, measurement: Measurement) -> str:
    """Return the row of ``frames.csv`` of one photograph, with its line end."""
    m, pose = measurement, measurement.pose
    placed = (
        ("", "", "", "")
        if pose is None
        else tuple(
            number(value)
            for value in (pose.x_mm, pose.y_mm, pose.angle_deg, pose.height_mm)
        )
    )
    sd = number(m.clamp_angle_sd_deg)
    return row(
        image, m.status, ";".join(m.flags), number(m.length_mm), number(m.tip_mm[0]),
        number(m.tip_mm[1]), number(m.tip_angle_deg), number(m.width_mm),
        number(m.clamp_px[0]), number(m.clamp_px[1]), number(m.tip_px[0]),
        number(m.tip_px[1]), *placed, " ".join(m.reason.split()), sd, placed[2], sd, "",
    )  # fmt: skip


def centreline_rows(image: str, measurement: Measurement) -> str:
    """Return the rows of ``centrelines.csv`` of one photograph; none if it failed."""
    if not measurement.ok:
        return ""
    nothing = np.full(len(measurement.points["good"]), np.nan)
    columns = [measurement.points.get(name, nothing) for name in CENTRELINE_HEADER[1:]]
    name = row(image).rstrip("\n")
    lines = [
        f"{name},{','.join(number(value) for value in values)}"
        for values in zip(*columns, strict=True)
    ]
    return "\n".join(lines) + "\n"


def edge_rows(
    image: str, measurement: Measurement, calibration: Calibration | None
) -> str:
    """Return the side-edge points of one photograph, as the paper recorded them.

    Parameters
    ----------
    image : str
        Name for the first column.
    measurement : Measurement
        Its points must hold the edge columns; without them there are no rows.
    calibration : Calibration or None
        Gives the edges in mm in the specimen frame, at the height of the rod's axis.
    """
    points, pose = measurement.points, measurement.pose
    name, lines = row(image).rstrip("\n"), []
    for side in ("left", "right"):
        if f"{side}_x_px" not in points:
            return ""
        px = np.column_stack([points[f"{side}_x_px"], points[f"{side}_y_px"]])
        mm = np.full_like(px, np.nan)
        if calibration is not None and pose is not None:
            mm = pose.from_board(calibration.to_mm(px, height_mm=pose.height_mm))
        for index, values in enumerate(np.column_stack([px, mm])):
            if np.all(np.isfinite(values[:2])):
                cells = ",".join(number(value) for value in values)
                lines.append(f"{name},{side},{index},{cells}\n")
    return "".join(lines)


def number(value: float) -> str:
    """Return a number with ten digits; empty where there is none."""
    return f"{value:.10g}" if math.isfinite(value) else ""


def row(*cells: str) -> str:
    """Return one line of a table, with its end."""
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerow(cells)
    return buffer.getvalue()


def turned(table: str, header: tuple[str, ...], turn_rad: float) -> str:
    """Return lines of a table in a specimen frame that is turned about its origin.

    Parameters
    ----------
    table : str
        Lines of ``centrelines.csv`` or of the edge table, without the header.
    header : tuple of str
        Their columns.
    turn_rad : float
        How far the new frame is turned, counter-clockwise.
    """
    x, y = header.index("x_mm"), header.index("y_mm")
    theta = header.index("theta_rad") if "theta_rad" in header else None
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    lines = []
    for cells in csv.reader(io.StringIO(table)):
        if cells[x]:
            old_x, old_y = float(cells[x]), float(cells[y])
            cells[x] = number(c * old_x + s * old_y)
            cells[y] = number(c * old_y - s * old_x)
            if theta is not None:
                cells[theta] = number(float(cells[theta]) - turn_rad)
        lines.append(row(*cells))
    return "".join(lines)


def header(names: Iterable[str]) -> str:
    """Return the first line of a table."""
    return ",".join(names) + "\n"


def read_frames(path: Path) -> list[FrameRow]:
    """Read a ``frames.csv``.

    Raises
    ------
    ConfigError
        If the file is missing, lacks a column or holds something else than numbers.
    """
    return [_frame(path, cells) for cells in _rows(path, FRAME_HEADER[:12])]


def read_centrelines(path: Path) -> dict[str, dict[str, Array]]:
    """Read a ``centrelines.csv``.

    Returns
    -------
    dict of str to dict of str to ndarray, shape (n,)
        The columns `POINT_COLUMNS` of each image; NaN where a cell is empty.

    Raises
    ------
    ConfigError
        If the file is missing, lacks a column or holds something else than numbers.
    """
    cells: dict[str, list[list[float]]] = {}
    for line in _rows(path, ("image", *POINT_COLUMNS)):
        values = [_float(path, line, name) for name in POINT_COLUMNS]
        cells.setdefault(line["image"], []).append(values)
    return {
        image: dict(zip(POINT_COLUMNS, np.array(values).T, strict=True))
        for image, values in cells.items()
    }


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


def _rows(path: Path, needed: Iterable[str]) -> list[dict[str, str]]:
    from ...core.toml import read_text  # loads pydantic, not needed to write

    reader = csv.DictReader(io.StringIO(read_text(path)))
    missing = [name for name in needed if name not in (reader.fieldnames or ())]
    if missing:
        raise ConfigError(f"{path}: the column {missing[0]} is missing")
    return list(reader)


def _frame(path: Path, cells: dict[str, str]) -> FrameRow:
    def value(name: str) -> float:
        return _float(path, cells, name)

    pose = None
    if cells.get("clamp_angle_deg"):
        pose = Pose(
            x_mm=value("clamp_x_mm"),
            y_mm=value("clamp_y_mm"),
            angle_deg=value("clamp_angle_deg"),
            height_mm=value("rod_height_mm"),
        )
    return FrameRow(
        image=cells["image"],
        status=cells["status"],
        flags=tuple(flag for flag in cells["flags"].split(";") if flag),
        length_mm=value("length_mm"),
        tip_mm=(value("tip_x_mm"), value("tip_y_mm")),
        tip_angle_deg=value("tip_angle_deg"),
        width_mm=value("width_mm"),
        clamp_px=(value("clamp_x_px"), value("clamp_y_px")),
        tip_px=(value("tip_x_px"), value("tip_y_px")),
        pose=pose,
        reason=cells.get("reason") or "",
        clamp_angle_sd_deg=value("clamp_angle_sd_deg"),
        own_angle_deg=value("own_angle_deg"),
        own_angle_sd_deg=value("own_angle_sd_deg"),
        shared_clamp=cells.get("shared_clamp") or "",
    )


def _float(path: Path, cells: dict[str, str], name: str) -> float:
    text = cells.get(name) or ""
    if not text:
        return math.nan
    try:
        return float(text)
    except ValueError:
        raise ConfigError(
            f"{path}: column {name} must hold numbers; instead received {text!r}"
        ) from None
