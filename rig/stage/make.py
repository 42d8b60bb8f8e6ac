"""The raw stage that a rig file names."""

from __future__ import annotations

from ...core.plugin_options import checked_options
from ...core.plugins import load_plugin
from ..clock import Clock
from ..wire_log import WireLog
from .config import GROUP, OWN_DRIVERS, StageConfig
from .protocol import Stage


def make_stage(
    config: StageConfig, clock: Clock, *, log: WireLog | None = None
) -> Stage:
    """Return the driver of ``stage.driver``, not yet connected.

    Raises
    ------
    ConfigError
        If it is a driver of another package that cannot be loaded, or whose options
        do not fit.
    """
    if config.driver == "marlin":
        from .marlin.stage import MarlinStage

        return MarlinStage(config, clock, log=log)
    if config.driver == "grbl":
        from .grbl.stage import GrblStage

        return GrblStage(config, clock, log=log)
    driver = load_plugin(GROUP, config.driver, own=OWN_DRIVERS)
    options = checked_options(driver, config.options, "stage.options")
    stage: Stage = driver(config, options, clock, log=log)
    return stage
