"""The ``$`` lines of the twin board, and its homing cycle."""

from __future__ import annotations

import math
import re
from collections.abc import Generator

from .gcode import GcodeError, read_line
from .mover import Block
from .orders import run_order, startup_lines
from .realtime import realtime
from .state import BoardState, Task

_HELP = "[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]"
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
_EEPROM_S = 0.008
_POLL_S = 0.002


def system_line(board: BoardState, line: str) -> Task:
    """Carry out a line that begins with ``$``.

    Raises
    ------
    GcodeError
        With the firmware's code.
    """
    body = line[1:]
    if not body:
        yield from board.print_line(_HELP)
    elif body[0] == "J":
        if board.state not in ("Idle", "Jog"):
            raise GcodeError(8)
        if not body.startswith("J="):
            raise GcodeError(3)
        yield from run_order(
            board, read_line(body[2:], board.modal, jog=True), jog=True
        )
    elif body[0] in "$GCX":
        if len(body) > 1:
            raise GcodeError(3)
        yield from _always(board, body)
    elif board.state not in ("Idle", "Alarm"):
        raise GcodeError(8)
    else:
        yield from _standing(board, body)


def _always(board: BoardState, body: str) -> Task:
    if body == "$":
        if board.state in ("Run", "Hold"):
            raise GcodeError(8)
        for row in board.eeprom.lines(board.dialect):
            yield from board.print_line(row)
    elif body == "G":
        yield from board.print_line(f"[GC:{board.modal.text()}]")
    elif body == "X":
        if board.state == "Alarm":
            yield from board.print_line("[MSG:Caution: Unlocked]")
            board.state = "Idle"
    elif board.state == "Check":
        board.reset_from_anywhere()
        yield from board.print_line("[MSG:Disabled]")
    else:
        if board.state != "Idle":
            raise GcodeError(8)
        board.state = "Check"
        yield from board.print_line("[MSG:Enabled]")


def _standing(board: BoardState, body: str) -> Task:
    if body == "#":
        for row in board.offsets_report():
            yield from board.print_line(row)
    elif body[0] == "H":
        if not board.eeprom.flag(22):
            raise GcodeError(5)
        board.state = "Home"
        if body != "H":
            raise GcodeError(3)  # and the state stays Home, as in the real one
        yield from home(board)
    elif body == "SLP":
        board.flags.add("sleep")
    elif body == "I":
        for row in board.dialect.details:
            yield from board.print_line(row)
    elif body[0] == "N":
        yield from _startup(board, body)
    elif body.startswith("RST="):
        if body[4:] not in ("$", "#", "*"):
            raise GcodeError(3)
        board.eeprom.restore()
        yield from board.print_line("[MSG:Restoring defaults]")
        board.reset_from_anywhere()
    else:
        yield from _store(board, body)


def _startup(board: BoardState, body: str) -> Task:
    if body == "N":
        for index, text in enumerate(board.eeprom.startup):
            yield from board.print_line(f"$N{index}={text}")
        return
    match = re.fullmatch(r"N([01])=(.*)", body)
    if not match:
        raise GcodeError(3)
    if board.state != "Idle":
        raise GcodeError(8)
    if match.group(2):
        read_line(match.group(2), board.modal, jog=False)
    board.eeprom.startup[int(match.group(1))] = match.group(2)


def _store(board: BoardState, body: str) -> Task:
    name = re.match(_NUMBER, body)
    if not name:
        raise GcodeError(2 if body[0] not in "SIR" else 3)
    if body[name.end() : name.end() + 1] != "=":
        raise GcodeError(3)
    value = re.match(_NUMBER, body[name.end() + 1 :])
    if not value:
        raise GcodeError(2)
    if name.end() + 1 + value.end() != len(body):
        raise GcodeError(3)
    code = board.eeprom.store(int(float(name.group())), float(value.group()))
    if code:
        raise GcodeError(code)
    # Writing the memory takes milliseconds with interrupts off: bytes are lost.
    board.lose_input(_EEPROM_S)
    yield from board.pause(_EEPROM_S)


def home(board: BoardState) -> Task:
    """``$H`` of the stock build: Z first, then X and Y."""
    board.homing = True
    for axes in ((2,), (0, 1)):
        yield from _home_axes(board, axes)
        if board.aborted:
            board.homing = False
            return
    yield from realtime(board)
    board.homing = False
    if board.aborted:
        return
    board.planned = list(board.position)
    board.switches_seen = board.plant.switches()
    board.state = "Idle"
    yield from startup_lines(board)


def _home_axes(board: BoardState, axes: tuple[int, ...]) -> Task:
    seek, locate, pull_off = (board.eeprom[n] for n in (25, 24, 27))
    longest = 1.5 * max(board.eeprom[130 + axis] for axis in axes)
    phases = (
        (longest, seek, True),
        (pull_off, seek, False),
        (5.0 * pull_off, locate, True),
        (pull_off, seek, False),
    )
    for travel, rate, approach in phases:
        found = yield from _home_phase(board, axes, travel, rate, approach)
        if not found:
            board.reset_from_anywhere()
            yield from realtime(board)
            return
        board.mover.kill()
        board.flags.discard("cycle stop")
        yield from board.pause(board.eeprom[26] / 1000.0)
    for axis in axes:
        reverse = int(board.eeprom[23]) >> axis & 1
        place = pull_off - board.eeprom[130 + axis] if reverse else -pull_off
        place = board.dialect.homed_mm.get(axis, place)
        board.position[axis] = round(place * board.eeprom[100 + axis])


def _home_phase(
    board: BoardState,
    axes: tuple[int, ...],
    travel_mm: float,
    rate_mm_min: float,
    approach: bool,
) -> Generator[float, None, bool]:
    """Move until all switches are found (approach) or the path ends (pull-off)."""
    delta = [0, 0, 0]
    for axis in axes:
        board.position[axis] = 0
        toward = -1 if int(board.eeprom[23]) >> axis & 1 else 1
        sign = toward if approach else -toward
        delta[axis] = round(sign * travel_mm * board.eeprom[100 + axis])
    count = math.sqrt(len(axes))
    board.mover.add(
        Block(
            delta=(delta[0], delta[1], delta[2]),
            length_mm=travel_mm * count,
            speed_mm_s=min(rate_mm_min, *(board.eeprom[110 + a] for a in axes))
            * count / 60.0,
            acceleration_mm_s2=min(board.eeprom[120 + a] for a in axes) * count,
            junction_mm_s=0.0,
        )
    )  # fmt: skip
    wanted = sum(1 << axis for axis in axes)
    board.mover.locked = 0
    board.mover.start(board.now_s)
    while True:
        closed = board.plant.switches() & wanted
        if approach:
            board.mover.locked |= closed
            if board.mover.locked & wanted == wanted:
                return True
        if "reset" in board.flags:
            board.alarm = 6
            return False
        if "cycle stop" in board.flags:
            if not approach and not closed:
                return True
            board.alarm = 9 if approach else 8
            return False
        yield board.now_s + _POLL_S
