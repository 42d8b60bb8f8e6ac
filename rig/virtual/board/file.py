"""A virtual board that outlives the program: settings and position in a JSON file."""

from __future__ import annotations

import json
from pathlib import Path

from ....core.errors import StageError
from ....core.files import write_text
from .firmware import GrblBoard
from .plant import Plant

_SETTINGS = {1: 255.0, 10: 3.0, 20: 1.0, 21: 1.0, 22: 1.0, 130: 180.0}


def load_board(path: Path | None) -> GrblBoard:
    """Return the board of a file, or a new one with homing and limits on.

    Raises
    ------
    StageError
        If the file is none of `save_board`.
    """
    if path is None or not path.exists():
        return GrblBoard(Plant(), dict(_SETTINGS))
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
        x, y, z = (float(place) for place in state["carriage_mm"])
        settings = {int(name): float(v) for name, v in state["settings"].items()}
        position = [int(steps) for steps in state["position"]]
        locked = bool(state["locked"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StageError(f"{path}: is no file of a virtual board: {error}") from None
    board = GrblBoard(Plant(start_mm=(x, y, z)), settings)
    board.advance(0.1)
    board.position = position
    board.assume_position(locked=locked)
    return board


def save_board(board: GrblBoard, path: Path) -> None:
    """Write settings and position, whole or not at all."""
    state = {
        "settings": {str(name): v for name, v in board.eeprom.values.items()},
        "carriage_mm": board.plant.carriage_mm,
        "position": board.position,
        "locked": board.state == "Alarm",
    }
    write_text(path, json.dumps(state, indent=1) + "\n")
