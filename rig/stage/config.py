"""The tables ``[stage]`` and ``[limits]`` of the rig file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    Field,
    PrivateAttr,
    ValidationInfo,
    field_validator,
    model_validator,
)

from ...core.plugins import offered
from ...core.toml import FileModel
from ..ports import allowed_port, twin_under

OWN_DRIVERS = ("grbl", "marlin")
GROUP = "magbend.stages"
"""Entry points by which other packages offer drivers."""

_FEEDS_MM_MIN = (1.0, 100_000.0)
"""What a stage of this kind can do; the board's own limit is asked on connecting."""

PositiveNumber = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


class MeasuredConfig(FileModel):
    """The table ``[stage.measured]``: what `magbend rig set-gap` found and wrote."""

    gap_mm: float
    machine_mm: float
    direction_tested: bool = False
    time_utc: str = ""
    firmware: str = ""
    settings: dict[str, str] = Field(default_factory=dict)


class StageConfig(FileModel):
    """How the stage is reached, what its controller must be set to, and its map.

    The map is ``gap_mm = gap_at_zero_mm + direction * machine_mm``. Without
    `gap_at_zero_mm` the bench was never measured: it may be homed and jogged.
    """

    network: bool = False
    driver: str = "grbl"
    port: str = "auto"
    baud: int = Field(default=115200, gt=0)
    axis: Literal["X", "Y", "Z"] = "X"
    gap_at_zero_mm: float | None = None
    direction: Literal[1, -1] = 1
    feed_mm_min: float = Field(
        default=300.0,
        json_schema_extra={"minimum": _FEEDS_MM_MIN[0], "maximum": _FEEDS_MM_MIN[1]},
    )
    backlash_mm: NotNegative = 0.5
    piece_mm: PositiveNumber = 10.0
    homing: Literal["switches", "manual"] = "switches"
    home_command: str = "$H"
    homed_at_mm: float | None = None
    home_timeout_s: PositiveNumber | None = None
    busy_factor: Annotated[float, Field(ge=1.0)] = 4.0
    answer_timeout_s: PositiveNumber = 3.0
    boot_s: NotNegative = 5.0
    reset_on_connect: bool = True
    dtr: bool | None = None
    steps_per_mm: PositiveNumber | None = None
    travel_mm: PositiveNumber | None = None
    max_feed_mm_min: PositiveNumber | None = None
    acceleration_mm_s2: PositiveNumber | None = None
    settings: dict[str, float] = Field(default_factory=dict)
    options: dict[str, Any] = Field(default_factory=dict)
    measured: MeasuredConfig | None = None
    _folder: Path = PrivateAttr(default=Path())

    @property
    def address(self) -> str:
        """The port, with the file of a virtual board where the rig file lies."""
        return twin_under(self.port, self._folder)

    def lying_in(self, folder: Path) -> StageConfig:
        """Return the same table of a rig file in `folder`."""
        table = self.model_copy()
        table._folder = folder
        return table

    @field_validator("port")
    @classmethod
    def _may_be_named(cls, port: str, info: ValidationInfo) -> str:
        return allowed_port(port, network=info.data.get("network", False))

    @field_validator("feed_mm_min")
    @classmethod
    def _feed_is_of_a_stage(cls, feed_mm_min: float) -> float:
        low, high = _FEEDS_MM_MIN
        if not low <= feed_mm_min <= high:
            raise ValueError(f"must be from {low:g} to {high:.0f} mm/min")
        return feed_mm_min

    @field_validator("driver")
    @classmethod
    def _driver_is_offered(cls, driver: str) -> str:
        if driver not in OWN_DRIVERS and driver not in offered(GROUP):
            known = ", ".join(sorted({*OWN_DRIVERS, *offered(GROUP)}))
            raise ValueError(f"must be one of {known}")
        return driver

    @model_validator(mode="after")
    def _options_are_of_the_driver(self) -> StageConfig:
        if self.options and self.driver in OWN_DRIVERS:
            raise ValueError(
                f"[stage.options] is for drivers of other packages; {self.driver} has "
                "none"
            )
        return self

    @model_validator(mode="after")
    def _home_command_is_a_homing(self) -> StageConfig:
        allowed = ("$H", f"$H{self.axis}")
        if self.driver == "grbl" and self.home_command not in allowed:
            raise ValueError(
                f"home_command must be '$H' (all axes) or '$H{self.axis}' (stage.axis "
                f"alone); instead received {self.home_command!r}"
            )
        return self

    @model_validator(mode="after")
    def _settings_are_of_the_driver(self) -> StageConfig:
        if self.driver == "marlin" and self.settings:
            raise ValueError(
                "[stage.settings] lists the $ numbers of GRBL; a Marlin board has none"
            )
        return self


class LimitsConfig(FileModel):
    """Where the stage may go, as gaps in mm from the magnet's N face.

    `min_gap_mm` is the interlock. `contact_gap_mm` is the gap at which something
    touches (zero: the rod's undeformed tip reaches the face): between the two the
    stage must be able to stop from full speed.
    """

    min_gap_mm: NotNegative
    max_gap_mm: PositiveNumber
    contact_gap_mm: float = 0.0
    retract_gap_mm: PositiveNumber | None = None

    @model_validator(mode="after")
    def _ordered(self) -> LimitsConfig:
        if self.max_gap_mm <= self.min_gap_mm:
            raise ValueError("max_gap_mm must be above min_gap_mm")
        if self.contact_gap_mm > self.min_gap_mm:
            raise ValueError("contact_gap_mm must not be above min_gap_mm")
        retract = self.retract_gap_mm
        if retract is not None and not self.min_gap_mm <= retract <= self.max_gap_mm:
            raise ValueError("retract_gap_mm must be from min_gap_mm to max_gap_mm")
        return self
