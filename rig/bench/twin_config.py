"""The table ``[twin]`` of the rig file: which board it plays, what goes wrong, when."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from ...core.toml import FileModel

FaultKind = Literal[
    "alarm 1", "alarm 2", "alarm 3", "alarm 8", "alarm 9", "restart", "unplug",
    "silence", "deafness", "no stop", "lost steps", "stall", "garbage",
    "torn line", "hold button",
    "camera stall", "camera dark", "meter overload", "meter silence",
]  # fmt: skip


class FaultConfig(FileModel):
    """One fault: its kind, one moment, and how long it lasts (for ever if not said).

    The moment is a time of the bench (`at_s`, from its opening), the arrival at a step
    of the plan (`at_step`, from 0), or the carriage passing a gap on its way to the
    magnet (`at_gap_mm`); `after_s` later it strikes. `lost_mm` is what ``lost steps``
    loses.
    """

    kind: FaultKind
    at_s: NonNegativeFloat | None = None
    at_step: Annotated[int, Field(ge=0)] | None = None
    at_gap_mm: PositiveFloat | None = None
    after_s: NonNegativeFloat = 0.0
    for_s: PositiveFloat | None = None
    lost_mm: PositiveFloat = 1.5

    @model_validator(mode="after")
    def _one_moment(self) -> FaultConfig:
        moments = (self.at_s, self.at_step, self.at_gap_mm)
        if sum(moment is not None for moment in moments) != 1:
            raise ValueError("must have one of at_s, at_step and at_gap_mm")
        return self


class TwinConfig(FileModel):
    """The table ``[twin]`` of the rig file: read by the computed bench alone."""

    board: Literal["grbl", "grblhal", "fluidnc", "marlin"] = "grbl"
    fault: list[FaultConfig] = Field(default_factory=list)
