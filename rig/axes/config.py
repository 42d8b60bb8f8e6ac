"""The tables ``[[axis]]`` of the rig file and ``[[scan]]`` of a plan."""

from __future__ import annotations

import math
import re
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
_PLACE = re.compile(r"\{value(:[-+ ]?0?\d{0,2}(\.\d{1,2})?[eEfFgG]?)?\}")
"""Where `set_line` takes the value, and in which of Python's formats of numbers."""


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
        rest, places = _PLACE.subn("", self.set_line)
        odd = places > 1 or "{" in rest or "}" in rest
        if odd or (self.driver == "line" and not places):
            raise ValueError(
                'set_line must hold {value} once, such as "CURR {value:.4f}", and no '
                "other braces"
            )
        return self

    def text(self, value: float) -> str:
        """Return the line that sets a value."""
        return self.set_line.format(value=value)

    def written(self, value: float) -> float:
        """Return the number that the device will read, rounded as `set_line` says."""
        place = _PLACE.search(self.set_line)
        return float(place.group().format(value=value)) if place else value


class ScanConfig(FileModel):
    """The values of one axis: each at each gap (`scan`), or one a gap (`along`)."""

    axis: str
    values: list[_FINITE] = Field(min_length=1, max_length=1000)


def why_not_set(axis: AxisConfig, value: float) -> str:
    """Return why a value may not be set, in a clause; empty if it may."""
    if not (math.isfinite(value) and axis.min <= value <= axis.max):
        return f"must be from {axis.min:g} to {axis.max:g}; instead received {value:g}"
    written = axis.written(value)
    if not axis.min <= written <= axis.max:
        return (
            f"must be from {axis.min:g} to {axis.max:g} as set_line writes it; instead "
            f"it writes {value:g} as {written:g}"
        )
    return ""
