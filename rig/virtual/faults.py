"""Faults on schedule: the twin bench goes wrong when its rig file says so."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..bench.twin_config import FaultConfig
from ..clock import Clock
from .board.file import Board
from .camera import VirtualCamera
from .meter import VirtualMeter

Strike = Callable[[float], None]
"""Called when the moment has come, with the seconds until the fault begins."""

_EVER_S = 1e9
_BEYOND_TRAVEL = b"G90G21G53G1X-5000F300\n"
_TROUBLES: dict[str, str] = {
    "camera stall": "stall", "camera dark": "dark",
    "meter overload": "overload", "meter silence": "silent",
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinParts:
    """What faults strike: the devices of a twin, and its time."""

    board: Board
    camera: VirtualCamera
    meter: VirtualMeter
    clock: Clock
    gap: Callable[[], float]


def schedule_faults(faults: Sequence[FaultConfig], twin: TwinParts) -> None:
    """Let every fault of a rig file strike its device at its moment."""
    for fault in faults:
        strike = _on_device(fault, twin) or _on_board(fault, twin.board)
        if fault.at_s is not None:
            strike(fault.at_s + fault.after_s)
        elif fault.at_step is not None:
            twin.camera.on_step(fault.at_step, _bound(strike, fault.after_s))
        elif fault.at_gap_mm is not None:
            action = _bound(strike, fault.after_s)
            twin.board.plant.watch(_passing(twin.gap, fault.at_gap_mm, action))


def _bound(strike: Strike, after_s: float) -> Callable[[], None]:
    return lambda: strike(after_s)


def _passing(
    gap: Callable[[], float], at_gap_mm: float, action: Callable[[], None]
) -> Callable[[], None]:
    """Return what calls `action` once, when the gap falls through `at_gap_mm`."""
    before_mm = gap()
    is_due = True

    def look() -> None:
        nonlocal before_mm, is_due
        now_mm = gap()
        if is_due and now_mm <= at_gap_mm < before_mm:
            is_due = False
            action()
        before_mm = now_mm

    return look


def _on_device(fault: FaultConfig, twin: TwinParts) -> Strike | None:
    """Return what troubles the camera or the meter for a while, by the twin's time."""
    if fault.kind not in _TROUBLES:
        return None
    device: Any = twin.camera if fault.kind.startswith("camera") else twin.meter
    before, now_s, trouble = (
        device.trouble,
        twin.clock.monotonic_s,
        _TROUBLES[fault.kind],
    )
    begin_s = _EVER_S

    def strike(in_s: float) -> None:
        nonlocal begin_s
        begin_s = now_s() + in_s

    def present() -> object:
        is_on = 0.0 <= now_s() - begin_s <= (fault.for_s or _EVER_S)
        return trouble if is_on else before()

    device.trouble = present
    return strike


def _on_board(fault: FaultConfig, board: Board) -> Strike:
    """Return what does the fault to the board, and mends it when its time is over."""
    for_s = fault.for_s or _EVER_S

    def switch(target: object, name: str, *, during: bool) -> None:
        setattr(target, name, during)
        board.at(board.now_s + for_s, lambda: setattr(target, name, not during))

    actions: dict[str, Callable[[], None]] = {
        "alarm 1": lambda: switch(board.plant, "stuck", during=True),
        "alarm 2": lambda: board.receive(_BEYOND_TRAVEL),
        "alarm 3": lambda: board.receive(b"\x18"),
        "alarm 8": lambda: switch(board.plant, "stuck", during=True),
        "alarm 9": lambda: switch(board.plant, "is_blind", during=True),
        "restart": lambda: board.power_cycle(boot_s=fault.for_s or 0.0),
        "unplug": lambda: switch(board, "plugged", during=False),
        "silence": lambda: board.lose_output(for_s),
        "deafness": lambda: board.lose_input(for_s),
        "no stop": lambda: switch(board, "heeds_stops", during=False),
        "lost steps": lambda: board.plant.lose(fault.lost_mm),
        "stall": lambda: switch(board.mover, "stalled", during=True),
        "garbage": lambda: board.send(b"\xff\x00~{\r\n"),
        "torn line": lambda: board.send(b"<Run|MP"),
        "hold button": lambda: board.receive(b"!"),
    }
    return lambda in_s: board.at(board.now_s + in_s, actions[fault.kind])
