"""Virtual boards by name, and one that outlives the program in a JSON file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from ....core.errors import StageError
from ....core.files import write_text
from .dialect import DIALECTS
from .firmware import GrblBoard
from .marlin import MarlinBoard
from .plant import Plant

_SETTINGS = {1: 255.0, 10: 3.0, 20: 1.0, 21: 1.0, 22: 1.0, 130: 180.0}


Board = GrblBoard | MarlinBoard


def make_board(
    kind: str = "grbl",
    plant: Plant | None = None,
    settings: dict[int, float] | None = None,
) -> Board:
    """Return a new board with homing and limits on.

    Parameters
    ----------
    kind : {"grbl", "grblhal", "fluidnc", "marlin"}
        Which firmware it plays.
    plant, settings : optional
        Its mechanics, and the ``$`` settings that differ (not of Marlin).

    Raises
    ------
    StageError
        If there is no such kind.
    """
    if kind == "marlin":
        return MarlinBoard(plant)
    if kind not in DIALECTS:
        raise StageError(
            f"the twin plays {', '.join(DIALECTS)} or marlin; instead received {kind!r}"
        )
    return GrblBoard(plant, {**_SETTINGS, **(settings or {})}, DIALECTS[kind])


def load_board(path: Path | None, kind: str = "grbl") -> Board:
    """Return the board of a file, or a new one with homing and limits on.

    Raises
    ------
    StageError
        If the file is none of `save_board`, or there is no such kind of board.
    """
    if path is None or not path.exists():
        return make_board(kind)
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
        x, y, z = (float(place) for place in state["carriage_mm"])
        settings = {int(name): float(v) for name, v in state["settings"].items()}
        position = [int(steps) for steps in state["position"]]
        locked = bool(state["locked"])
        dialect = DIALECTS[state.get("dialect", "grbl")]
        feed_mm_min = float(state.get("feed_mm_min", 0.0))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StageError(f"{path}: is no file of a virtual board: {error}") from None
    board = GrblBoard(Plant(start_mm=(x, y, z)), settings, dialect)
    board.advance(0.1)
    board.position = position
    board.assume_position(locked=locked)
    board.modal = replace(board.modal, feed_mm_min=feed_mm_min)
    return board


def save_board(board: Board, path: Path) -> None:
    """Write settings and position, whole or not at all; a Marlin board keeps none."""
    if isinstance(board, MarlinBoard):
        return
    names = {dialect: name for name, dialect in DIALECTS.items()}
    state = {
        "dialect": names[board.dialect],
        "settings": {str(name): v for name, v in board.eeprom.values.items()},
        "carriage_mm": board.plant.carriage_mm,
        "position": board.position,
        "locked": board.state == "Alarm",
        "feed_mm_min": board.modal.feed_mm_min,
    }
    write_text(path, json.dumps(state, indent=1) + "\n")
