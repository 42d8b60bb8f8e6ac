"""The table ``[camera]`` of the rig file."""

from __future__ import annotations

from typing import Literal

from pydantic import NonNegativeFloat, PositiveFloat, PositiveInt

from ...core.toml import FileModel


class CameraConfig(FileModel):
    """The ``[camera]`` table: where pictures come from and how long they may take."""

    backend: Literal["auto", "opencv", "mjpeg", "folder", "video", "twin"] = "auto"
    source: str | int = 0
    watch: bool = False
    width_px: PositiveInt | None = None
    height_px: PositiveInt | None = None
    exposure: float | None = None
    gain: float | None = None
    white_balance_K: PositiveFloat | None = None
    frame_timeout_s: PositiveFloat = 5.0
    latency_s: NonNegativeFloat = 0.2
    warmup_s: NonNegativeFloat = 1.0
    brightness_drift_percent: PositiveFloat = 3.0
