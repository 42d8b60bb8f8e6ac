"""Where the twin board looks at its flags, and what holds, alarms and resets do.

Real-time bytes and interrupts only set flags; the firmware looks at them here and
nowhere else. That is why it is deaf where the real one is.
"""

from __future__ import annotations

import math

from .report import status_report
from .state import BoardState, Task


def realtime(board: BoardState) -> Task:
    """Look at the flags; stay here while suspended."""
    yield from _flag_pass(board)
    if board.state == "Sleep" and board.suspended:
        yield from board.print_line("[MSG:Sleeping]")
    while board.suspended and not board.aborted:
        yield math.inf if not board.flags and not board.alarm else board.now_s
        yield from _flag_pass(board)


def _flag_pass(board: BoardState) -> Task:
    if board.alarm:
        yield from _enter_alarm(board)
    if "reset" in board.flags:
        board.aborted = True
        return
    if "status" in board.flags:
        board.flags.discard("status")
        yield from board.print_line(status_report(board))
    if board.flags & {"hold", "cancel", "sleep"}:
        _take_hold(board)
    if "start" in board.flags:
        _take_start(board)
    if "cycle stop" in board.flags:
        _take_cycle_stop(board)


def _enter_alarm(board: BoardState) -> Task:
    code, board.alarm = board.alarm, 0
    board.state = "Alarm"
    yield from board.print_line(f"ALARM:{code}")
    yield from board.pause(0.5)
    if code in (1, 2):
        yield from board.print_line("[MSG:Reset to continue]")
        board.flags.discard("reset")
        while "reset" not in board.flags:
            yield math.inf


def _take_hold(board: BoardState) -> None:
    flags = board.flags & {"hold", "cancel", "sleep"}
    board.flags -= flags
    if board.state in ("Alarm", "Check"):
        if "sleep" in flags:
            board.suspended = board.held = True
            board.state = "Sleep"
        return
    if board.state in ("Run", "Jog") and not board.cancelling:
        board.mover.hold()
        board.stopping = board.suspended = True
        board.cancelling = board.state == "Jog"
    elif board.state == "Idle":
        board.suspended = board.held = True
    if "hold" in flags and board.state not in ("Jog", "Sleep"):
        board.state = "Hold"
        board.suspended = True
    if "sleep" in flags:
        board.state = "Sleep"
        board.counters.overrides = 0  # spindle and coolant are switched off


def _take_start(board: BoardState) -> None:
    board.flags.discard("start")
    if not (board.state == "Idle" or (board.state == "Hold" and board.held)):
        return
    board.suspended = board.held = board.stopping = False
    if board.mover.blocks:
        board.state = "Run"
        board.mover.start(board.now_s)
    else:
        board.state = "Idle"


def _take_cycle_stop(board: BoardState) -> None:
    board.flags.discard("cycle stop")
    waits = board.state in ("Hold", "Sleep")
    if waits and not board.soft_limit and not board.cancelling:
        board.held = True
        board.stopping = False
        return
    if board.cancelling:
        board.mover.kill()
        board.planned = list(board.position)
    board.suspended = board.cancelling = board.stopping = False
    board.state = "Idle"
