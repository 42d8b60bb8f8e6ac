"""Carry out a checked line of G-code on the twin board: motions, dwells, offsets."""

from __future__ import annotations

import math

from .gcode import GcodeError, Modal, Order, read_line
from .motion import outside, plan, set_offset, target_of
from .realtime import realtime
from .state import BoardState, Task

_TICK_S = 0.005


def auto_start(board: BoardState) -> None:
    """Start what is queued, if the board is idle."""
    if board.mover.blocks and board.state == "Idle":
        board.flags.add("start")


def _wait_until_done(board: BoardState) -> Task:
    auto_start(board)
    while True:
        yield from realtime(board)
        if board.aborted or not (board.mover.blocks or board.state == "Run"):
            return
        yield math.inf if not board.flags else board.now_s


def run_order(board: BoardState, order: Order, *, jog: bool = False) -> Task:
    """Carry out one checked line."""
    if not jog:
        if order.modal.system != board.modal.system:
            board.counters.offset = 0
        board.modal = order.modal
    if order.kind == "dwell" and board.state != "Check":
        yield from _wait_until_done(board)
        if not board.aborted:
            yield from _dwell(board, order.seconds)
    elif order.kind in ("G92", "G92.1", "G10"):
        yield from _wait_until_done(board)
        set_offset(board, order)
    elif order.kind in ("G28.1", "G30.1"):
        board.eeprom.offsets[order.kind[:3]] = board.planned_mm()
    elif order.kind in ("G28", "G30"):
        target = list(board.eeprom.offsets[order.kind])
        yield from _line(board, target, order)
    elif order.kind == "move":
        target = target_of(board, order)
        if jog and board.eeprom.flag(20) and outside(board, target):
            raise GcodeError(15)
        yield from _line(board, target, order, jog=jog)
    elif order.kind == "end":
        board.modal = Modal(units=board.modal.units, tool=board.modal.tool)
        yield from board.print_line("[MSG:Pgm End]")


def _dwell(board: BoardState, duration_s: float) -> Task:
    end_s = board.now_s + duration_s
    while board.now_s < end_s and not board.aborted:
        yield min(end_s, board.now_s + 0.05)
        yield from realtime(board)


def _line(
    board: BoardState, target: list[float], order: Order, *, jog: bool = False
) -> Task:
    if not jog and board.eeprom.flag(20) and outside(board, target):
        yield from _soft_limit_alarm(board)
        return
    if board.state == "Check":
        return
    while True:
        yield from realtime(board)
        if board.aborted:
            return
        if board.mover.free_blocks > 0:
            break
        auto_start(board)
        yield board.now_s + _TICK_S
    feed = math.inf if order.rapid else order.feed_mm_min
    plan(board, target, feed * board.overrides[0] / 100.0)
    if jog and board.state == "Idle" and board.mover.blocks:
        board.state = "Jog"
        board.mover.start(board.now_s)


def _soft_limit_alarm(board: BoardState) -> Task:
    board.soft_limit = True
    if board.state == "Run":
        board.flags.add("hold")
        while board.state != "Idle":
            yield from realtime(board)
            if board.aborted:
                return
            yield math.inf if not board.flags else board.now_s
    board.reset_from_anywhere()
    board.alarm = 2
    yield from realtime(board)


def startup_lines(board: BoardState) -> Task:
    """Run ``$N0`` and ``$N1`` and echo them."""
    for text in board.eeprom.startup:
        if text:
            yield from run_order(board, read_line(text, board.modal, jog=False))
            yield from board.print_line(f">{text}:ok")
