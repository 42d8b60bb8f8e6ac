"""Where a line of the twin board leads: targets, offsets, travel, planned blocks."""

from __future__ import annotations

import math

from .gcode import Order
from .mover import Block
from .state import BoardState


def target_of(board: BoardState, order: Order) -> list[float]:
    """Return the machine position in mm that a line asks for."""
    target, offset = board.planned_mm(), board.offset_mm()
    for axis, value in order.axes.items():
        if order.machine:
            target[axis] = value
        elif order.incremental:
            target[axis] += value
        else:
            target[axis] = value + offset[axis]
    return target


def set_offset(board: BoardState, order: Order) -> None:
    """Carry out G92, G92.1 or G10."""
    board.counters.offset = 0
    if order.kind == "G92.1":
        board.g92 = [0.0, 0.0, 0.0]
        return
    here = board.planned_mm()
    row = board.modal.system if order.offset_row == 0 else 53 + order.offset_row
    system = board.eeprom.offsets[f"G{row}"]
    for axis, value in order.axes.items():
        if order.kind == "G92":
            board.g92[axis] = here[axis] - system[axis] - value
        elif order.offset_mode == 2:
            system[axis] = value
        else:
            system[axis] = here[axis] - board.g92[axis] - value


def outside(board: BoardState, target: list[float]) -> bool:
    """Return whether a target in mm lies beyond the travel."""
    for axis, place in enumerate(target):
        travel = board.eeprom[130 + axis]
        low, high = (0.0, travel) if board.dialect.counts_up else (-travel, 0.0)
        if not low <= place <= high:
            return True
    return False


def plan(board: BoardState, target: list[float], feed_mm_min: float) -> None:
    """Queue a straight motion to a target in mm, if it is one step away at least."""
    per_mm = [board.eeprom[100 + axis] for axis in range(3)]
    steps = [round(place * k) for place, k in zip(target, per_mm, strict=True)]
    delta = tuple(a - b for a, b in zip(steps, board.planned, strict=True))
    if not any(delta):
        return
    moves = [d / k if k else 0.0 for d, k in zip(delta, per_mm, strict=True)]
    length = math.hypot(*moves) or 1.0
    unit = [abs(move) / length for move in moves]
    ceilings = [
        (board.eeprom[110 + a] / 60.0 / u, board.eeprom[120 + a] / u)
        for a, u in enumerate(unit)
        if u
    ]
    rate = min(c[0] for c in ceilings) if ceilings else 1.0
    block = Block(
        delta=(delta[0], delta[1], delta[2]),
        length_mm=length,
        speed_mm_s=min(feed_mm_min / 60.0, rate),
        acceleration_mm_s2=min((c[1] for c in ceilings), default=10.0),
        junction_mm_s=_junction(board, moves, length),
    )
    board.mover.add(block)
    board.direction = [move / length for move in moves]
    board.planned = steps


def _junction(board: BoardState, moves: list[float], length_mm: float) -> float:
    """Return the speed through the corner: straight on is free, back is a stop."""
    if not board.mover.blocks:
        return 0.0
    cosine = sum(a * b / length_mm for a, b in zip(board.direction, moves, strict=True))
    if cosine > 0.9999:
        return math.inf
    if cosine < -0.9999:
        return 0.0
    sine = math.sqrt(0.5 * (1.0 + cosine))
    return math.sqrt(board.eeprom[120] * board.eeprom[11] * sine / (1.0 - sine))
