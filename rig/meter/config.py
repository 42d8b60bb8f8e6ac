"""The table ``[meter]`` of the rig file."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationInfo, field_validator

from ...core.toml import FileModel
from ..ports import allowed_port


class MeterConfig(FileModel):
    """The ``[meter]`` table: which Tesla-meter, and on which port."""

    network: bool = False
    driver: str = "manual"
    port: str = ""
    description: Path | None = None
    zero_mT: float = 0.0
    sign: Literal[-1, 1] = 1
    options: dict[str, Any] = Field(default_factory=dict)

    @field_validator("port")
    @classmethod
    def _may_be_named(cls, port: str, info: ValidationInfo) -> str:
        return allowed_port(port, network=info.data.get("network", False))
