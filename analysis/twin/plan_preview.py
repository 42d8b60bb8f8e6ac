"""What a plan will probably show: field and shape at each gap."""

from __future__ import annotations

from dataclasses import dataclass

from ...core.magnet import Magnet, Vector
from ...core.specimen import Specimen
from ...sim import MagnetField, Support, solve


@dataclass(frozen=True, slots=True, kw_only=True)
class StepPreview:
    """The predicted state at one gap.

    Parameters
    ----------
    gap_mm : float
        The gap.
    flux_mT : float
        Flux density at the undeformed tip, along the magnet's axis.
    tip_mm : tuple of float, or None
        Predicted tip (x, y) in the specimen frame.
    status : str
        ``stable``, ``unstable`` or ``pulled in: no equilibrium``.
    """

    gap_mm: float
    flux_mT: float
    tip_mm: tuple[float, float] | None
    status: str


def preview_plan(
    specimen: Specimen,
    magnet: Magnet,
    gaps_mm: tuple[float, ...],
    *,
    gravity_m_s2: Vector = (0.0, 0.0, 0.0),
) -> tuple[StepPreview, ...]:
    """Return what the simulator expects at each gap of a plan."""
    from ...sim import magnet_flux_mT

    support = Support(gravity_m_s2=gravity_m_s2)
    steps = []
    length_mm = specimen.length_mm
    for gap_mm in gaps_mm:
        place = MagnetField(magnet=magnet, gap_mm=gap_mm)
        found = solve(specimen, place, support=support)
        field = magnet_flux_mT(
            magnet, [[length_mm, 0.0, 0.0]], length_mm=length_mm, gap_mm=gap_mm
        )[0]
        along = sum(
            float(b) * axis for b, axis in zip(field, magnet.axes()[2], strict=True)
        )
        steps.append(
            StepPreview(
                gap_mm=gap_mm,
                flux_mT=along,
                status=found.status,
                tip_mm=found.centreline.tip_mm if found.centreline else None,
            )
        )
    return tuple(steps)
