"""What a bench does not know and nobody asks for: priors of a fit's nuisances."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from ...core.errors import InputError

FRAME_ANGLE_SD_DEG = 0.3
"""Taken where a photograph does not state how sure its clamp direction is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Nuisance:
    """Standard deviations of parameters around their nominal values; 0 holds one.

    Attributes
    ----------
    clamp_angle_deg : float
        Direction of the clamp against the field, of a run: half a degree each for the
        clamp and the axis of the magnet, as a square leaves them.
    clamp_position_mm : float
        Place of the measured frame across the rod, of a photograph.
    frame_angle_deg : float or None
        Direction of the measured frame, of a photograph, or of all that share a clamp.
        None takes what each states itself (``clamp_angle_sd_deg`` of ``frames.csv``).
    scale_percent : float
        Millimetres per pixel, of a run.
    magnet_percent : float
        Remanence of the magnet (so, calibration of the Tesla-meter), of a run; the
        scatter of the readings comes on top.
    gap_mm : float
        How much farther than stated the magnet stands, of a run. The readings, taken at
        the true gap, are kept: the remanence follows.
    weight_percent : float
        Weight of the rod, of a run.

    Raises
    ------
    InputError
        If one is negative or no number.
    """

    clamp_angle_deg: float = 0.7
    clamp_position_mm: float = 0.05
    frame_angle_deg: float | None = None
    scale_percent: float = 0.2
    magnet_percent: float = 0.5
    gap_mm: float = 0.5
    weight_percent: float = 0.0

    def __post_init__(self) -> None:
        for name in NUISANCE_NAMES:
            value = getattr(self, name)
            if name == "frame_angle_deg" and value is None:
                continue
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(
                    f"prior of {name} must be zero (held) or above; "
                    f"instead received {value!r}"
                )

    def frame_sd_deg(self, stated_deg: float) -> float:
        """Return the prior of a photograph that states `stated_deg` (NaN: nothing)."""
        if self.frame_angle_deg is not None:
            return self.frame_angle_deg
        return stated_deg if math.isfinite(stated_deg) else FRAME_ANGLE_SD_DEG


NUISANCE_NAMES = tuple(field.name for field in fields(Nuisance))
