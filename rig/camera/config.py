"""The table ``[camera]`` of the rig file."""

from __future__ import annotations

from typing import Any

from pydantic import (
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
    field_validator,
    model_validator,
)

from ...core.plugins import offered
from ...core.toml import FileModel

OWN_BACKENDS = ("auto", "opencv", "mjpeg", "folder", "video", "twin")
GROUP = "magbend.cameras"
"""Entry points by which other packages offer cameras."""


class CameraConfig(FileModel):
    """The ``[camera]`` table: where pictures come from and how long they may take."""

    backend: str = "auto"
    options: dict[str, Any] = Field(default_factory=dict)
    source: str | int = 0
    watch: bool = False
    width_px: PositiveInt | None = None
    height_px: PositiveInt | None = None
    exposure: float | None = None
    gain: float | None = None
    white_balance_K: PositiveFloat | None = None
    focus: float | None = None
    frame_timeout_s: PositiveFloat = 5.0
    latency_s: NonNegativeFloat = 0.2
    warmup_s: NonNegativeFloat = 1.0
    brightness_drift_percent: PositiveFloat = 3.0

    @field_validator("backend")
    @classmethod
    def _backend_is_offered(cls, backend: str) -> str:
        if backend not in OWN_BACKENDS and backend not in offered(GROUP):
            known = ", ".join(sorted({*OWN_BACKENDS, *offered(GROUP)}))
            raise ValueError(f"must be one of {known}")
        return backend

    @model_validator(mode="after")
    def _options_are_of_the_backend(self) -> CameraConfig:
        if self.options and self.backend in OWN_BACKENDS:
            raise ValueError(
                f"[camera.options] is for backends of other packages; {self.backend} "
                "has none"
            )
        return self
