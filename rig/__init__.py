"""Stage, camera, Tesla-meter, the runner and the run folder; and their twins.

Names are loaded when first used, so that a command pays only for what it needs.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .clock import Clock, ScaledClock, SteppedClock, SystemClock
    from .config import Plan, RigModel, read_plan, read_rig
    from .devices import Devices
    from .gap_stage import GapStage, GapStatus, MoveRecord
    from .grbl import GrblStage
    from .link import WireLog
    from .marlin import MarlinStage
    from .open_devices import open_devices
    from .ports import PortInfo, list_ports
    from .read_run import Run
    from .runner import RunSummary, run
    from .stage import (
        AlarmError,
        InterlockError,
        LinkLostError,
        PositionLostError,
        Stage,
        StageTimeoutError,
        StoppedError,
    )
    from .stage_config import LimitsConfig, StageConfig
    from .stages import make_stage
    from .verify import verify_run

# Now, not when first used: importing the submodule `read_run` for itself would leave
# the module, not the function, under this name.
from .read_run import read_run as read_run

_HOME = {
    "AlarmError": "stage",
    "Clock": "clock",
    "Devices": "devices",
    "GapStage": "gap_stage",
    "GapStatus": "gap_stage",
    "GrblStage": "grbl",
    "InterlockError": "stage",
    "LimitsConfig": "stage_config",
    "LinkLostError": "stage",
    "MarlinStage": "marlin",
    "MoveRecord": "gap_stage",
    "Plan": "config",
    "PortInfo": "ports",
    "PositionLostError": "stage",
    "RigModel": "config",
    "Run": "read_run",
    "RunSummary": "runner",
    "ScaledClock": "clock",
    "Stage": "stage",
    "StageConfig": "stage_config",
    "StageTimeoutError": "stage",
    "SteppedClock": "clock",
    "StoppedError": "stage",
    "SystemClock": "clock",
    "WireLog": "link",
    "list_ports": "ports",
    "make_stage": "stages",
    "open_devices": "open_devices",
    "read_plan": "config",
    "read_rig": "config",
    "run": "runner",
    "verify_run": "verify",
}

__all__ = [
    "AlarmError",
    "Clock",
    "Devices",
    "GapStage",
    "GapStatus",
    "GrblStage",
    "InterlockError",
    "LimitsConfig",
    "LinkLostError",
    "MarlinStage",
    "MoveRecord",
    "Plan",
    "PortInfo",
    "PositionLostError",
    "RigModel",
    "Run",
    "RunSummary",
    "ScaledClock",
    "Stage",
    "StageConfig",
    "StageTimeoutError",
    "SteppedClock",
    "StoppedError",
    "SystemClock",
    "WireLog",
    "list_ports",
    "make_stage",
    "open_devices",
    "read_plan",
    "read_rig",
    "read_run",
    "run",
    "verify_run",
]


def __getattr__(name: str) -> object:
    """Load a public name from the module that holds it."""
    home = _HOME.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{home}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return sorted(__all__)
