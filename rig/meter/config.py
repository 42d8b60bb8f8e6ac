"""The table ``[meter]`` of the rig file."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from ...core.toml import FileModel


class MeterConfig(FileModel):
    """The ``[meter]`` table: which Tesla-meter, and on which port."""

    driver: str = "manual"
    port: str = ""
    description: Path | None = None
    zero_mT: float = 0.0
    sign: Literal[-1, 1] = 1
