"""The raw stage that a rig file names."""

from __future__ import annotations

from ..clock import Clock
from ..wire_log import WireLog
from .config import StageConfig
from .protocol import Stage


def make_stage(
    config: StageConfig, clock: Clock, *, log: WireLog | None = None
) -> Stage:
    """Return the driver of ``stage.driver``, not yet connected."""
    if config.driver == "marlin":
        from .marlin.stage import MarlinStage

        return MarlinStage(config, clock, log=log)
    from .grbl.stage import GrblStage

    return GrblStage(config, clock, log=log)
