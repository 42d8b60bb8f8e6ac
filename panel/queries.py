"""What a page may look at, by name: nothing here changes anything."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.door import file_below
from ..core.errors import InputError, StoreError
from .bench.sight import pack
from .photos.actions import figure_of
from .photos.gallery import list_photos, photo_path, shrunk, upright
from .runs.listing import list_runs, run_detail
from .runs.plan_file import check_plan, plan_values
from .setup import board
from .setup.magnet import judge_newest_scan
from .setup.steps import setup_state
from .workspace import require

if TYPE_CHECKING:
    from .panel import Panel

Query = Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class File:
    """A file that is made when it is asked for."""

    data: bytes
    kind: str


SERVED = {".png", ".jpg", ".jpeg", ".html", ".pdf", ".svg", ".csv", ".json", ".toml"}
"""What of a run folder is shown."""


def _plan(panel: Panel, query: Query) -> Any:
    """Return the plan's values, or what the given values would do."""
    files = panel.workspace.files()
    if "values" not in query:
        plan = require(files.plan, files.problems, "plan")
        return {"values": plan_values(plan)}
    try:
        values = json.loads(query["values"])
    except ValueError:
        raise InputError("the plan's values must be JSON") from None
    if not isinstance(values, dict):
        raise InputError("the plan's values must be one JSON object")
    return check_plan(panel.workspace, values)


def _picture(panel: Panel, _query: Query) -> File:
    return File(data=pack(panel.snapshot()).jpeg, kind="image/jpeg")


def _board_pdf(_panel: Panel, _query: Query) -> File:
    from ..vision import write_board

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "board.pdf"
        write_board(board.board_of(), path)
        return File(data=path.read_bytes(), kind="application/pdf")


def _photo(panel: Panel, query: Query) -> File:
    image = upright(photo_path(panel.workspace, query.get("name", "")))
    return File(data=shrunk(image, query.get("width", "1600")), kind="image/jpeg")


def _photo_size(panel: Panel, query: Query) -> Any:
    image = upright(photo_path(panel.workspace, query.get("name", "")))
    return {"size_px": list(image.shape[1::-1])}


def _ports(_panel: Panel, _query: Query) -> Any:
    from ..rig import list_ports

    return [asdict(port) for port in list_ports()]


def run_file(panel: Panel, run: str, path: str, width: str) -> Path | File:
    """Return a file of a run folder, or a small JPEG of a photograph in it.

    Raises
    ------
    InputError, StoreError
        If there is no such run, or no such file that may be shown.
    """
    found = file_below(panel.workspace.run_path(run), path)
    if found is None or found.suffix.lower() not in SERVED:
        raise StoreError(f"the run {run} has no file {path!r} to show")
    if not width:
        return found
    return File(data=shrunk(upright(found), width), kind="image/jpeg")


QUERIES: dict[str, Callable[[Panel, Query], Any]] = {
    "plan": _plan,
    "picture": _picture,
    "setup": lambda panel, _query: setup_state(panel),
    "board": lambda panel, _query: board.look(panel),
    "ports": _ports,
    "design-figure": lambda panel, query: File(
        data=figure_of(panel.workspace, query.get("name", "")).read_bytes(),
        kind="image/svg+xml",
    ),
    "photos": lambda panel, _query: list_photos(panel.workspace),
    "photo": _photo,
    "photo-size": _photo_size,
    "board-pdf": _board_pdf,
    "scan": lambda panel, _query: judge_newest_scan(panel.workspace),
    "runs": lambda panel, _query: list_runs(panel.workspace),
    "run": lambda panel, query: run_detail(panel.workspace, query.get("name", "")),
}
"""Every query by its name in the address of a GET."""
