"""What is made of points on a photograph: a rescued measurement, a wanted curve."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.checks import finite
from ...core.errors import InputError
from ...core.files import write_text
from ..arguments import Arguments, Outcome, number
from ..workspace import Workspace, now_name, require
from .gallery import photo_path

if TYPE_CHECKING:
    from ..panel import Panel

Point = tuple[float, float]
MOST_POINTS = 200
COUNT = 3
DESIGNS = "designs"


def point_out(panel: Panel, arguments: Arguments) -> Outcome:
    """Queue ``magbend vision points``: the rod between a clamp and a tip."""
    name = str(arguments.get("photo"))
    path = photo_path(panel.workspace, name)
    points = _points(arguments, "points", 2)
    command = [
        "vision", "points", name, "--clamp", _word(points[0]), "--tip",
        _word(points[-1]), "--out", _out(panel, name),
    ]  # fmt: skip
    if len(points) > 2:
        command += ["--via", " ".join(_word(point) for point in points[1:-1])]
    if arguments.get("ruler"):
        ends = _points(arguments, "ruler", 2)
        length_mm = number(arguments, "ruler_mm", "mm")
        command += ["--ruler", f"{_word(ends[0])} {_word(ends[1])} {length_mm:g}"]
    elif panel.workspace.files().calibration is not None:
        command += ["--calibration", panel.workspace.calibration_path.name]
    panel.jobs.add("points", path.name, command)
    return {"text": "measuring between the points"}


def _out(panel: Panel, name: str) -> str:
    """Return where the tables go: the run's folder, or one of their own."""
    parts = name.split("/")
    in_run = len(parts) == 4 and parts[0] == panel.workspace.runs_path.name
    return "/".join(parts[:2]) if in_run else "measured"


def design_from(panel: Panel, arguments: Arguments) -> Outcome:
    """Queue ``magbend analysis design``: rods that take a curve drawn on a picture."""
    files = panel.workspace.files()
    calibration = require(files.calibration, files.problems, "calibration")
    rig = require(files.rig, files.problems, "rig")
    magnet = require(rig.magnet, {}, "[magnet]")
    gap_mm = number(arguments, "gap_mm", "mm")
    points = _points(arguments, "points", 3)
    name = now_name()
    folder = panel.workspace.folder / DESIGNS / name
    command = [
        "analysis", "design", "--polyline", f"{DESIGNS}/{name}/curve.csv",
        "--calibration", panel.workspace.calibration_path.name,
        "--rod-height-mm", f"{calibration.rod_height_mm or 0.0:g}",
        "--magnet", f"{DESIGNS}/{name}/magnet.toml", "--gap-mm", f"{gap_mm:g}",
        "--figure", f"{DESIGNS}/{name}/design.svg", "--out", f"{DESIGNS}/{name}",
        "--count", str(COUNT), *_limits(arguments),
    ]  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    rows = "".join(f"{x:.1f},{y:.1f}\n" for x, y in points)
    write_text(folder / "curve.csv", f"x_px,y_px\n{rows}")
    write_text(folder / "magnet.toml", _magnet_text(magnet))
    panel.jobs.add("design", name, command)
    return {"text": "seeking rods", "design": name}


def _magnet_text(magnet: Any) -> str:
    import tomlkit

    return tomlkit.dumps(magnet.model_dump(mode="json", exclude_none=True))


def _limits(arguments: Arguments) -> list[str]:
    """Return the options for what can be made."""
    options = []
    for key, option, unit in (
        ("side_mm", "--side-mm", "mm"), ("E_MPa", "--E-MPa", "MPa"),
    ):  # fmt: skip
        given = arguments.get(key)
        if given is None:
            continue
        if not isinstance(given, list) or len(given) != 2:
            raise InputError(f"{key} must be [low, high] in {unit}")
        low, high = (finite(value, key, unit) for value in given)
        options += [option, f"{low:g}:{high:g}"]
    if arguments.get("remanence_mT") is not None:
        options += ["--remanence-mT", f"{number(arguments, 'remanence_mT', 'mT'):g}"]
    return options


def figure_of(workspace: Workspace, name: str) -> Path:
    """Return the figure of a design by its name.

    Raises
    ------
    InputError
        If there is none.
    """
    path = workspace.folder / DESIGNS / name / "design.svg"
    if Path(name).name != name or not path.is_file():
        raise InputError(f"there is no design {name!r}")
    return path


def _points(arguments: Arguments, name: str, least: int) -> list[Point]:
    given = arguments.get(name)
    if not isinstance(given, list) or not least <= len(given) <= MOST_POINTS:
        raise InputError(
            f"{name} must be from {least} to {MOST_POINTS} points; point at the picture"
        )
    points = []
    for pair in given:
        if not isinstance(pair, list) or len(pair) != 2:
            raise InputError(f"{name} must be pairs of pixels")
        points.append((finite(pair[0], name, "px"), finite(pair[1], name, "px")))
    return points


def _word(point: Point) -> str:
    return f"{point[0]:.1f},{point[1]:.1f}"
