"""A whole bench of virtual devices: the real drivers on a twin board, camera, meter."""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Any

from ..bench.config import RigModel
from ..bench.devices import Devices
from ..clock import Clock, SteppedClock
from ..stage.gap import GapStage
from ..stage.make import make_stage
from ..wire_log import WireLog
from .axis import VirtualAxis
from .board.file import Board, make_board
from .board.marlin import MarlinBoard
from .board.plant import Plant
from .camera import Render, VirtualCamera
from .faults import TwinParts, schedule_faults
from .meter import FluxAt, VirtualMeter
from .protocol_twin import register_board

_ZERO_MM = 150.0
# Homing, hard and soft limits on, motors always on, reports with the buffer state.
_BOARD_SETTINGS = {1: 255, 10: 3, 20: 1, 21: 1, 22: 1, 130: 180, 120: 50}


def twin_board(*, backlash_mm: float = 0.0, kind: str = "grbl") -> Board:
    """Return a board with homing switches whose machine zero is the switch."""
    if kind == "marlin":
        low = Plant(
            start_mm=(-20.0,) * 3, switch_low_mm=-180.0, backlash_mm=backlash_mm
        )
        return make_board(kind, low)
    plant = Plant(switch_high_mm=0.0, backlash_mm=backlash_mm)
    return make_board(kind, plant, dict(_BOARD_SETTINGS))


def open_twin(
    rig: RigModel,
    render: Render,
    flux: FluxAt,
    *,
    seed: int = 0,
    clock: Clock | None = None,
    board: Board | None = None,
    log: WireLog | None = None,
    camera: Mapping[str, Any] | None = None,
    meter: Mapping[str, Any] | None = None,
) -> Devices:
    """Open the twin of a bench: the stage is connected, nothing has moved.

    The stage driver is the one of the hardware; it talks to a simulated GRBL board. The
    camera and the meter look at where the simulated carriage truly is.

    Parameters
    ----------
    rig : RigModel
        The rig file; its port, camera source and meter port are not used, its table
        ``[twin]`` says what goes wrong.
    render : callable
        ``render(gap_mm, time_s)`` returns the photograph.
    flux : callable
        ``flux(gap_mm)`` returns the flux density in mT at the probe.
    seed : int
        Of the meter's noise.
    clock : Clock, optional
        By default one that only steps: a run takes as long as it computes.
    board : GrblBoard, optional
        By default `twin_board`.
    log : WireLog, optional
        Where every byte is recorded.
    camera, meter : mapping, optional
        Options of `VirtualCamera` (swing, faults) and `VirtualMeter` (noise, overload).

    Returns
    -------
    Devices
        Close them when done.
    """
    clock = clock or SteppedClock()
    board = board or twin_board(kind=rig.twin.board)
    url = register_board(f"bench-{id(board):x}", board, clock)
    driver = "marlin" if isinstance(board, MarlinBoard) else "grbl"
    zero = rig.stage.gap_at_zero_mm
    own = {
        "driver": driver,
        "port": url,
        "measured": None,
        "gap_at_zero_mm": _ZERO_MM if zero is None else zero,
    }
    config = rig.stage.model_copy(update=own)
    stage = GapStage(make_stage(config, clock, log=log), config, rig.limits, clock)
    axis = "XYZ".index(config.axis)

    def gap_mm() -> float:
        return stage.to_gap_mm(board.plant.carriage_mm[axis])

    swing: dict[str, Any] = {"swing_mm": 3.0, "swing_Hz": 1.4, "damping_s": 0.4}
    eye = VirtualCamera(render, gap_mm, clock, **{**swing, **(camera or {})})
    probe = VirtualMeter(flux, gap_mm, random.Random(seed), **(meter or {}))
    stage.connect()
    parts = TwinParts(board=board, camera=eye, meter=probe, clock=clock, gap=gap_mm)
    schedule_faults(rig.twin.fault, parts)
    axes = {axis.name: VirtualAxis(axis, clock) for axis in rig.axis}
    return Devices(
        axes=axes, stage=stage, camera=eye, meter=probe, clock=clock, log=log
    )
