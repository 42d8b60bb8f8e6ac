"""The status report of the twin board, with the firmware's own rhythm of extras."""

from __future__ import annotations

import math

from .state import BoardState

_BUSY = ("Home", "Run", "Hold", "Jog")
_OFFSET_EVERY = {True: 30, False: 10}
_OVERRIDES_EVERY = {True: 20, False: 10}


def status_report(board: BoardState) -> str:
    """Return the answer to ``?``."""
    busy = board.state in _BUSY
    mask = int(board.eeprom[10])
    place = [
        _divide(steps, board.eeprom[100 + axis])
        for axis, steps in enumerate(board.position)
    ]
    offset = board.offset_mm()
    if mask & 1:
        parts = [_state(board), f"MPos:{_axes(place)}"]
    else:
        work = [a - b for a, b in zip(place, offset, strict=True)]
        parts = [_state(board), f"WPos:{_axes(work)}"]
    if mask & 2:
        parts.append(f"Bf:{board.mover.free_blocks},{board.rx_free}")
    speed = board.mover.speed_mm_s * 60.0 if busy else 0.0
    parts.append(f"FS:{speed:.0f},0")
    switches = board.plant.switches()
    letters = "".join(n for bit, n in enumerate("XYZ") if switches >> bit & 1)
    if letters + board.plant.pressed:
        parts.append(f"Pn:{letters}{board.plant.pressed}")
    return "<" + "|".join(parts + _extras(board, busy, offset)) + ">"


def _extras(board: BoardState, busy: bool, offset: list[float]) -> list[str]:
    counters, extras = board.counters, []
    if counters.offset > 0:
        counters.offset -= 1
    else:
        counters.offset = _OFFSET_EVERY[busy] - 1
        if counters.overrides == 0:
            counters.overrides = 1
        extras.append(f"WCO:{_axes(offset)}")
    if counters.overrides > 0:
        counters.overrides -= 1
    else:
        counters.overrides = _OVERRIDES_EVERY[busy] - 1
        extras.append("Ov:" + ",".join(f"{value}" for value in board.overrides))
    return extras


def _state(board: BoardState) -> str:
    if board.state == "Hold":
        return "Hold:0" if board.held else "Hold:1"
    return board.state


def _divide(steps: int, per_mm: float) -> float:
    if per_mm:
        return steps / per_mm
    return math.copysign(math.inf, steps) if steps else 0.0


def _axes(values: list[float]) -> str:
    return ",".join(_number(value) for value in values)


def _number(value: float) -> str:
    if math.isinf(value):  # the firmware's conversion saturates
        return "-2147483.648" if value < 0 else "2147483.647"
    return f"{value + 0.0:.3f}"
