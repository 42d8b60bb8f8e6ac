"""The rig file and the plan file: TOML in, checked before anything moves.

A rig file says what stands on the bench; a plan says what is to be done with it. Paths
inside a file are relative to that file.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from ...core.door import real_path
from ...core.errors import ConfigError
from ...core.magnet import Vector
from ...core.specimen import Specimen
from ...core.specimen_file import MagnetModel, SpecimenModel, read_specimen
from ...core.toml import FileModel, line_of, read_text, read_toml
from ...core.units import GRAVITY_M_PER_S2
from ..axes.config import AxisConfig, ScanConfig, why_not_set
from ..camera.config import CameraConfig
from ..meter.config import MeterConfig
from ..stage.config import LimitsConfig, StageConfig
from .stops import FAR, Order, Route, Stop, Sweep, out_of_order, stops_of
from .twin_config import TwinConfig

_MOST_STOPS = 10_000
FEED = "insertion_mm"
"""The axis that feeds a rod into its lumen."""


class SettleConfig(FileModel):
    """The ``[settle]`` table: when the rod counts as still.

    By ``image``: after `time_s` pictures are compared; by ``time``: after `time_s`.
    """

    by: Literal["image", "time"] = "image"
    time_s: Annotated[float, Field(ge=0.0, le=86400.0)] = 2.0
    image_change_percent: PositiveFloat = 0.02
    frames: int = Field(default=5, ge=2)
    window_s: NonNegativeFloat = 0.5
    timeout_s: PositiveFloat = 30.0


class PhotographConfig(FileModel):
    """The ``[photograph]`` table: how many frames make one photograph (median).

    After it `series` single frames are kept too, `interval_s` apart.
    """

    frames: int = Field(default=3, ge=1, le=99)
    series: int = Field(default=0, ge=0, le=1000)
    interval_s: NonNegativeFloat = 0.2


class FluxConfig(FileModel):
    """The ``[flux]`` table: how many readings make one flux density, and their judge.

    Each reading is held against the magnet of the rig file within `magnet_percent`, and
    against the earlier readings of its run within `run_percent`; what disagrees is
    flagged, and by `policy` the run pauses or ends after that step. With `baseline` the
    run ends far from the magnet, with a last reading for the meter's drift.
    """

    baseline: bool = False
    samples: int = Field(default=5, ge=1, le=10_000)
    policy: Literal["flag", "pause", "abort"] = "flag"
    magnet_percent: PositiveFloat = 5.0
    run_percent: PositiveFloat = 2.0


class AbortConfig(FileModel):
    """The ``[abort]`` table: stay where it is, or retract from the magnet."""

    policy: Literal["hold", "retract"] = "hold"


class BenchModel(FileModel):
    """The ``[bench]`` table: how the bench stands.

    `up` points upward in the specimen frame (x along the undeformed rod, z toward the
    camera); its length does not matter.
    """

    up: Vector

    def model_post_init(self, _context: object) -> None:
        """Check that there is a direction."""
        length = math.hypot(*self.up)
        if not 0.0 < length < math.inf:
            raise ValueError("up must be a direction, such as [0.0, 0.0, 1.0]")

    def gravity_m_s2(self, specimen: Specimen) -> Vector:
        """Return the weight of a rod a kilogram, in m/s2; none without its density."""
        if specimen.density_kg_m3 is None:
            return (0.0, 0.0, 0.0)
        scale = -GRAVITY_M_PER_S2 / math.hypot(*self.up)
        x, y, z = self.up
        return (scale * x + 0.0, scale * y + 0.0, scale * z + 0.0)  # no -0.0


class RigModel(FileModel):
    """A rig file."""

    name: str = "bench"
    bench: BenchModel | None = None
    stage: StageConfig
    limits: LimitsConfig
    camera: CameraConfig = CameraConfig()
    meter: MeterConfig = MeterConfig()
    magnet: MagnetModel | None = None
    axis: list[AxisConfig] = Field(default_factory=list)
    settle: SettleConfig | None = None
    twin: TwinConfig = TwinConfig()

    @model_validator(mode="after")
    def _names_differ(self) -> RigModel:
        names = [axis.name for axis in self.axis]
        if len(set(names)) != len(names):
            raise ValueError("every [[axis]] must have a name of its own")
        return self


class LumenConfig(FileModel):
    """The ``[lumen]`` table: the rod is fed through a printed channel.

    `file` says where its walls are (`docs/navigation.md`); they stand still under the
    camera, and an axis ``insertion_mm`` feeds the rod.
    """

    file: Path
    wall_height_mm: PositiveFloat


class PlanModel(FileModel):
    """A plan file that names the file of its specimen."""

    name: str
    operator: str = ""
    notes: str = ""
    specimen: Path
    rig: Path
    gaps_mm: list[PositiveFloat] = Field(min_length=1, max_length=1000)
    order: Order = "falling"
    sweep: Sweep = "approach"
    repeats: int = Field(default=1, ge=1, le=1000)
    reference: bool = False
    reference_gap_mm: PositiveFloat | None = None
    scan: list[ScanConfig] = Field(default_factory=list)
    along: list[ScanConfig] = Field(default_factory=list)
    lumen: LumenConfig | None = None
    settle: SettleConfig | None = None
    photograph: PhotographConfig = PhotographConfig()
    flux: FluxConfig = FluxConfig()
    abort: AbortConfig = AbortConfig()


class InlinePlanModel(PlanModel):
    """A plan file that describes its specimen itself, in a ``[specimen]`` table."""

    specimen: SpecimenModel  # type: ignore[assignment]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A plan with its rig and its specimen read and checked against each other.

    Parameters
    ----------
    path, text : Path and str
        The plan file and what it says.
    model : PlanModel
        The plan as typed.
    rig : RigModel
        The rig it runs on.
    rig_path : Path
        Where the rig file is.
    specimen : Specimen
        The rod on the stage.
    settle : SettleConfig
        From the plan, else from the rig file, else the defaults.
    lumen_text : str
        What the file of its lumen says; empty without one.
    """

    path: Path
    text: str
    model: PlanModel
    rig: RigModel
    rig_path: Path
    specimen: Specimen
    settle: SettleConfig
    lumen_text: str = ""

    @property
    def stops(self) -> tuple[Stop, ...]:
        """Every step of the run, in turn."""
        return _stops(self.model, self.rig)

    @property
    def gaps_mm(self) -> tuple[float, ...]:
        """The gaps of all steps in turn, in mm."""
        return tuple(stop.gap_mm for stop in self.stops)

    @property
    def gravity_m_s2(self) -> Vector:
        """Free fall in the specimen frame, in m/s2; zero if the weight is not known."""
        bench = self.rig.bench
        return bench.gravity_m_s2(self.specimen) if bench else (0.0, 0.0, 0.0)

    def as_dict(self) -> dict[str, Any]:
        """Return the plan as the manifest of a run keeps it, defaults written out."""
        data = self.model.model_dump(mode="json")
        data.pop("specimen")
        if self.lumen_text:
            data["lumen"]["text"] = self.lumen_text
        data["gaps_mm"] = list(self.gaps_mm)
        data["stops"] = [stop.kind for stop in self.stops]
        data["settings"] = [dict(stop.settings) for stop in self.stops]
        data["rig"] = self.rig_path.name
        data["settle"] = self.settle.model_dump(mode="json")
        return data


def read_rig(path: Path) -> RigModel:
    """Read a rig file.

    Raises
    ------
    ConfigError
        One sentence with file, line and key.
    """
    rig = read_toml(path, RigModel)
    folder = real_path(path).parent
    here = folder == Path.cwd()  # a short name in messages and records, where it can be
    stage = rig.stage if here else rig.stage.lying_in(folder)
    return rig.model_copy(update={"stage": stage})


def read_plan(path: Path) -> Plan:
    """Read a plan file with the rig and the specimen that it names.

    Raises
    ------
    ConfigError
        One sentence with file, line and key, if a file is missing or wrong, a gap is
        asked for twice, out of order, or closer than the interlock allows.
    """
    text = read_text(path)
    # Two models instead of a union: its errors would not name key and line.
    is_inline = re.search(
        r"^\s*(\[\s*specimen\b|specimen\s*=\s*\{)", text, re.MULTILINE
    )
    model = read_toml(path, InlinePlanModel if is_inline else PlanModel)
    rig_path = real_path(path.parent / model.rig)
    rig = read_rig(rig_path)
    if isinstance(model, InlinePlanModel):
        specimen = model.specimen.specimen()
    else:
        specimen = read_specimen(real_path(path.parent / model.specimen))
    _check_gaps(path, text, model, rig, rig_path)
    lumen = model.lumen
    return Plan(
        path=path, text=text, model=model, rig=rig, rig_path=rig_path,
        specimen=specimen, settle=model.settle or rig.settle or SettleConfig(),
        lumen_text="" if lumen is None else read_text(path.parent / lumen.file),
    )  # fmt: skip


def _check_gaps(
    path: Path, text: str, model: PlanModel, rig: RigModel, rig_path: Path
) -> None:
    line = line_of(text, ("gaps_mm",))
    where = f"{path}, line {line}" if line else f"{path}"
    for each in model.along:
        if len(each.values) != len(model.gaps_mm):
            raise ConfigError(
                f"{where}: [[along]] {each.axis} must give one value a gap, "
                f"{len(model.gaps_mm)}; instead it gives {len(each.values)}"
            )
    stops = _stops(model, rig)
    if len(stops) > _MOST_STOPS:
        raise ConfigError(
            f"{where}: repeats and sweeps unfold to {len(stops)} steps; at most "
            f"{_MOST_STOPS} are taken in one run"
        )
    gaps = [(f"gaps_mm[{i}]", gap_mm) for i, gap_mm in enumerate(model.gaps_mm)]
    far = [("reference_gap_mm", s.gap_mm) for s in stops if s.kind in FAR]
    for name, gap_mm in [*gaps, *far]:
        found = _why_not_there(gap_mm, rig)
        if found:
            reason, keys = found
            raise ConfigError(
                f"{where}: {name} = {gap_mm:g} mm {reason} ({rig_path.name}, {keys})"
            )
    _check_scans(path, text, model, rig, rig_path)
    wrong = out_of_order(model.gaps_mm) if model.order == "falling" else None
    if wrong is not None:
        raise ConfigError(
            f"{where}: gaps_mm must fall, so that the magnet is approached from the "
            f"far side only; instead gaps_mm[{wrong}] = {model.gaps_mm[wrong]:g} mm "
            f"follows {model.gaps_mm[wrong - 1]:g} mm; for the way back write sweep = "
            '"return", for an order of your own order = "free"'
        )


def _check_scans(
    path: Path, text: str, model: PlanModel, rig: RigModel, rig_path: Path
) -> None:
    """Refuse to set what the rig has not, twice, or beyond its limits."""
    line = line_of(text, ("scan",)) or line_of(text, ("along",))
    where = f"{path}, line {line}" if line else f"{path}"
    axes = {axis.name: axis for axis in rig.axis}
    seen: set[str] = set()
    for scan in [*model.scan, *model.along]:
        if scan.axis not in axes:
            known = ", ".join(axes) or "none"
            raise ConfigError(
                f"{where}: axis = {scan.axis!r} is no [[axis]] of {rig_path.name} "
                f"(there: {known})"
            )
        if scan.axis in seen:
            raise ConfigError(f"{where}: {scan.axis} is scanned twice")
        seen.add(scan.axis)
        for value in scan.values:
            why = why_not_set(axes[scan.axis], value)
            if why:
                raise ConfigError(f"{where}: {scan.axis} {why} ({rig_path.name})")
    if model.lumen is not None and FEED not in seen:
        raise ConfigError(
            f"{path}: a rod in a [lumen] must be fed by an axis {FEED}; name its "
            f"values in [[along]], one a gap, or in [[scan]]"
        )


def _stops(model: PlanModel, rig: RigModel) -> tuple[Stop, ...]:
    far_mm = model.reference_gap_mm or rig.limits.max_gap_mm
    scans = {scan.axis: scan.values for scan in model.scan}
    along = {each.axis: each.values for each in model.along}
    used = scans | along
    rest = {a.name: a.rest for a in rig.axis if a.rest is not None and a.name in used}
    return stops_of(
        Route(
            gaps_mm=model.gaps_mm,
            order=model.order,
            sweep=model.sweep,
            repeats=model.repeats,
            far_mm=far_mm,
            reference=model.reference,
            baseline=model.flux.baseline,
            scans=scans,
            along=along,
            rest=rest,
        )
    )


def _why_not_there(gap_mm: float, rig: RigModel) -> tuple[str, str] | None:
    """Return why a gap is out of bounds, and the keys that say so."""
    stage, limits = rig.stage, rig.limits
    if gap_mm < limits.min_gap_mm:
        low = f"{limits.min_gap_mm:g} mm"
        return f"is under the interlock of {low}", "limits.min_gap_mm"
    if gap_mm > limits.max_gap_mm:
        high = f"{limits.max_gap_mm:g} mm"
        return f"is beyond the largest gap of {high}", "limits.max_gap_mm"
    # Boards count from a switch, into the negative or into the positive.
    zero_mm, travel_mm = stage.gap_at_zero_mm, stage.travel_mm
    if stage.homing != "switches" or travel_mm is None or zero_mm is None:
        return None
    machine_mm = abs(gap_mm - zero_mm)
    if machine_mm > travel_mm:
        return (
            f"lies {machine_mm:g} mm from the machine's zero, beyond its travel of "
            f"{travel_mm:g} mm",
            "stage.travel_mm, gap_at_zero_mm",
        )
    return None
