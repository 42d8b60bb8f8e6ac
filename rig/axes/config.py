"""The tables ``[[axis]]`` of the rig file and ``[[scan]]`` of a plan."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import (
    Field,
    NonNegativeFloat,
    PositiveFloat,
    ValidationInfo,
    field_validator,
    model_validator,
)

from ...core.toml import FileModel
from ..ports import allowed_port

_FINITE = Annotated[float, Field(allow_inf_nan=False)]


class AxisConfig(FileModel):
    """One more thing that a plan may set, within limits of its own.

    The driver ``line`` sends `set_line` with the value in place of ``{value}`` and, if
    there is a `read_line`, asks until the answer is within `tolerance`. `rest` is where
    it goes for references, baselines and at the end.
    """

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9]*_[A-Za-z0-9_]+$")
    driver: Literal["line", "twin"] = "line"
    network: bool = False
    port: str = ""
    baud: int = Field(default=9600, gt=0)
    min: _FINITE
    max: _FINITE
    rest: _FINITE | None = None
    set_line: str = ""
    read_line: str = ""
    line_end: str = "\n"
    tolerance: PositiveFloat = 1e-3
    settle_s: NonNegativeFloat = 0.5
    timeout_s: PositiveFloat = 10.0

    @field_validator("port")
    @classmethod
    def _may_be_named(cls, port: str, info: ValidationInfo) -> str:
        return allowed_port(port, network=info.data.get("network", False))

    @model_validator(mode="after")
    def _is_whole(self) -> AxisConfig:
        if self.max <= self.min:
            raise ValueError("max must be above min")
        if self.rest is not None and not self.min <= self.rest <= self.max:
            raise ValueError("rest must be from min to max")
        if self.driver == "line" and not self.port:
            raise ValueError("driver line needs a port")
        if self.driver == "line" and "{value" not in self.set_line:
            raise ValueError('set_line must hold {value}, such as "CURR {value:.4f}"')
        return self

    def text(self, value: float) -> str:
        """Return the line that sets a value."""
        return self.set_line.format(value=value)


class ScanConfig(FileModel):
    """The values of one axis, each taken at each gap."""

    axis: str
    values: list[_FINITE] = Field(min_length=1, max_length=1000)


def why_not_set(axis: AxisConfig, value: float) -> str:
    """Return why a value may not be set, in a clause; empty if it may."""
    if math.isfinite(value) and axis.min <= value <= axis.max:
        return ""
    return f"must be from {axis.min:g} to {axis.max:g}; instead received {value:g}"
