"""What a bench does not know and nobody asks for: priors of a fit's nuisances."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

from ...core.checks import shown
from ...core.errors import InputError
from ...core.magnet import Magnet
from ...core.specimen import Specimen

FRAME_ANGLE_SD_DEG = 0.3
"""Taken where a photograph does not state how sure its clamp direction is."""

SIDE_PERCENT = 1.0
"""Taken where the specimen states no deviation: a calliper on a soft rod."""

REMANENCE_PERCENT = 6.6
"""Taken where the specimen states none: scatter of the paper's three rods of one recipe
(GMC 2, 6 and 7 read 20.07, 19.19 and 21.82 mT)."""

DENSITY_PERCENT = 5.0
"""Taken where the specimen states none: a density computed from the recipe."""

LENGTH_MM = 0.1
"""Taken where the specimen states none: a rod cut by hand."""

CURVATURE_PER_MM = 1e-4
"""Taken where the specimen states none: 0.045 mm at the tip of 30 mm."""

MAGNET_PERCENT = 10.0
"""Taken where the rig file states none: its figure may be a catalogue's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Nuisance:
    """Standard deviations of parameters around their nominal values; 0 holds one.

    Attributes
    ----------
    clamp_angle_deg : float
        Direction of the clamp against the field, of a run: half a degree each for the
        clamp and the axis of the magnet, as a square leaves them.
    magnet_offset_mm : float
        Place of the magnet's axis along the rod, of a run.
    gap_mm : float
        How much farther than stated the magnet stands, of a run; its readings were
        taken there too.
    scale_percent : float
        Millimetres per pixel, of a run.
    clamp_position_mm : float
        Place of the measured frame across the rod, of a photograph.
    frame_angle_deg : float or None
        Direction of the measured frame, of a photograph, or of all that share a clamp.
        None takes what each states itself (``clamp_angle_sd_deg`` of ``frames.csv``).
    magnet_percent : float or None
        Remanence of the magnet about that of the rig file. None takes what that states,
        else `MAGNET_PERCENT`.
    meter_percent, meter_offset_mT : float
        Gain and zero of the Tesla-meter.
    side_percent : float or None
        Side of the rod; the measured width is set against it. None takes what the
        specimen states, else `SIDE_PERCENT`.
    length_mm : float or None
        Length of the rod, at its tip; the measured length is set against it. None takes
        what the specimen states, else `LENGTH_MM`.
    joint_mm : float
        Place of each joint.
    remanence_percent : float or None
        Remanence of the rod. None takes what the specimen states, else
        `REMANENCE_PERCENT`.
    density_percent : float or None
        Density of the rod, where weight acts. None takes what the specimen states, else
        `DENSITY_PERCENT`.
    natural_curvature_per_mm : float or None
        Curvature of the rod without load. None takes what the specimen states, else
        `CURVATURE_PER_MM`.

    Raises
    ------
    InputError
        If one is negative or no number.
    """

    clamp_angle_deg: float = 0.7
    magnet_offset_mm: float = 0.5
    gap_mm: float = 0.5
    scale_percent: float = 0.2
    clamp_position_mm: float = 0.05
    frame_angle_deg: float | None = None
    magnet_percent: float | None = None
    meter_percent: float = 1.0
    meter_offset_mT: float = 0.2
    side_percent: float | None = None
    length_mm: float | None = None
    joint_mm: float = 0.2
    remanence_percent: float | None = None
    density_percent: float | None = None
    natural_curvature_per_mm: float | None = None

    def __post_init__(self) -> None:
        for name in NUISANCE_NAMES:
            value = getattr(self, name)
            if value is None and name in _TOLD_BY_FILES:
                continue
            if value is None or not (math.isfinite(value) and value >= 0.0):
                raise InputError(
                    f"prior of {name} must be zero (held) or above; "
                    f"instead received {shown(value)}"
                )

    def frame_sd_deg(self, stated_deg: float) -> float:
        """Return the prior of a photograph that states `stated_deg` (NaN: nothing)."""
        if self.frame_angle_deg is not None:
            return self.frame_angle_deg
        return stated_deg if math.isfinite(stated_deg) else FRAME_ANGLE_SD_DEG

    def magnet_sd_percent(self, magnet: Magnet | None) -> float:
        """Return the prior of a magnet, as the rig file states it, or of sources."""
        if self.magnet_percent is not None:
            return self.magnet_percent
        if magnet is None:
            return MAGNET_PERCENT
        return _percent(magnet.remanence_sd_T, magnet.remanence_T, MAGNET_PERCENT)

    def of_rod(self, specimen: Specimen) -> dict[str, float]:
        """Return the priors of one rod, with what its file states."""
        side = _percent(specimen.side_sd_mm, specimen.side_mm, SIDE_PERCENT)
        remanence = _percent(
            specimen.remanence_sd_mT, specimen.remanence_mT, REMANENCE_PERCENT
        )
        density = _percent(
            specimen.density_sd_kg_m3, specimen.density_kg_m3, DENSITY_PERCENT
        )
        length, bow = specimen.length_sd_mm, specimen.natural_curvature_sd_per_mm
        told = {
            "side_percent": side,
            "remanence_percent": remanence,
            "density_percent": density,
            "length_mm": LENGTH_MM if length is None else length,
            "natural_curvature_per_mm": CURVATURE_PER_MM if bow is None else bow,
        }
        priors = {
            name: stated if (own := getattr(self, name)) is None else own
            for name, stated in told.items()
        }
        for joint in range(len(specimen.sections) - 1):
            priors[f"joint_mm[{joint}]"] = self.joint_mm
        return priors


def _percent(stated: float | None, size: float | None, default: float) -> float:
    return default if stated is None or not size else 100.0 * stated / abs(size)


NUISANCE_NAMES = tuple(field.name for field in fields(Nuisance))
_TOLD_BY_FILES = (
    "frame_angle_deg", "magnet_percent", "side_percent", "length_mm",
    "remanence_percent", "density_percent", "natural_curvature_per_mm",
)  # fmt: skip


class Owner(NamedTuple):
    """To what a measured line belongs: index of its photograph, run, rod and bench.

    `frame` is the first photograph whose clamp direction, and so its error, is the
    same. A number a run states (a reading, say) has no photograph: -1.
    """

    photograph: int
    frame: int
    run: int
    rod: int
    bench: int


_SCOPES = {
    "clamp_position_mm": "photograph",
    "field_percent": "photograph",
    "frame_angle_deg": "frame",
    "clamp_angle_deg": "run",
    "magnet_offset_mm": "run",
    "gap_mm": "run",
    "scale_percent": "run",
    "magnet_percent": "bench",
    "meter_percent": "bench",
    "meter_offset_mT": "bench",
}


def scope_of(name: str) -> str:
    """Return which index of `Owner` a nuisance counts by; the rod's if nothing else."""
    return _SCOPES.get(name, "rod")


def unit_of(name: str) -> str:
    """Return the unit that ends a name: ``joint_mm[1]`` is in mm."""
    base = name.partition("[")[0]
    if base.endswith("_per_mm"):
        return "1/mm"
    unit = base.rpartition("_")[2]
    return {"percent": "%"}.get(unit, unit if unit in ("mm", "deg", "mT", "T") else "")
