"""The field of a step: a reading, the run's magnet, or any sources."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ... import sim
from ...core.errors import InputError
from ...core.magnet import Magnet
from ..runs.data import RunData, Step

USABLE_FLUX = ("ok", "manual", "none")

UNSTATED = 0.01
"""Relative sd of a remanence from one reading without an sd: what hand meters claim."""


FAR_OFF = 4.0
"""Factor between sources and readings that no magnet or probe is off by."""

FAINT_MT = 1.0
"""Readings below this may be mostly the earth's field and the probe's zero."""


def check_sources(run: RunData, sources: sim.Field | None) -> None:
    """Refuse sources that cannot be what a run stood before.

    Raises
    ------
    InputError
        If none waits for a gap, and steps have different ones; or if their field at the
        undeformed tip is many times what the run's meter read there, or less.
    """
    if sources is None:
        return
    gaps = {step.gap_mm for step in run.steps if math.isfinite(step.gap_mm)}
    if len(gaps) > 1 and not sources.follows_gap:
        raise InputError(
            f"every source stands at a place of its own, but the gap of {run.label} "
            f"goes from {min(gaps):g} to {max(gaps):g} mm; leave centre_mm and gap_mm "
            "out of the source that the stage moves"
        )
    ratios = [
        ratio for step in run.steps if (ratio := _over_reading(step, run, sources))
    ]
    ratio = float(np.median(ratios)) if ratios else 1.0
    if not 1.0 / FAR_OFF < ratio < FAR_OFF:
        raise InputError(
            f"the sources give {ratio:.2g} times what the Tesla-meter of {run.label} "
            "read at the tip: look at the units of both (a map in gauss is headed "
            "Bx (G)), at remanences and at places"
        )


def _over_reading(step: Step, run: RunData, sources: sim.Field) -> float | None:
    """Return the sources' field at the tip over the reading; None without one."""
    if not usable_flux(step) or abs(step.flux_mT) < FAINT_MT:
        return None
    field = field_of(step, "magnet", sources, run.specimen.length_mm)
    if isinstance(field, str):
        return None
    return flux_at_tip_mT(field, run.specimen.length_mm)[0] / abs(step.flux_mT)


def fit_run_magnet(
    run: RunData, *, farther_mm: float = 0.0
) -> tuple[sim.MagnetFit | None, Magnet | None]:
    """Fit one remanence to the readings of a run.

    Parameters
    ----------
    run : RunData
        With its readings.
    farther_mm : float
        How much farther than stated the magnet stands.

    Returns
    -------
    fit : MagnetFit or None
        None where the run has no magnet or no usable reading.
    magnet : Magnet or None
        The run's magnet with the fitted remanence; the nominal one without readings.
    """
    steps = [s for s in run.steps if usable_flux(s) and math.isfinite(s.gap_mm)]
    if run.magnet is None or not steps:
        return None, run.magnet
    sd = [s.flux_sd_mT for s in steps]
    fit = sim.fit_magnet(
        [s.gap_mm + farther_mm for s in steps],
        [s.flux_mT for s in steps],
        sides_mm=run.magnet.sides_mm,
        sd_mT=sd if all(math.isfinite(value) and value > 0.0 for value in sd) else None,
    )
    return fit, replace(run.magnet, remanence_T=fit.remanence_T)


def remanence_sd_T(fit: sim.MagnetFit) -> float:
    """Return how sure a run's remanence is; one reading alone may not tell."""
    stated = fit.remanence_sd_T
    return stated if math.isfinite(stated) else UNSTATED * abs(fit.remanence_T)


def usable_flux(step: Step) -> bool:
    """Return whether the Tesla-meter's reading of a step is a number to work with."""
    return math.isfinite(step.flux_mT) and step.flux_status in USABLE_FLUX


def field_of(
    step: Step, model: str, magnet: Magnet | sim.Field | None, length_mm: float
) -> sim.Field | str:
    """Return the field of a step, or a sentence that says why there is none.

    `length_mm` is that of the rod, to whose undeformed tip the gap counts.
    """
    if model == "magnet":
        if magnet is None:
            return "no magnet: no rig file and no analysis import --magnet names one"
        if isinstance(magnet, sim.Field) and not magnet.follows_gap:
            return magnet
        if not math.isfinite(step.gap_mm):
            return "no gap: the table of this run does not say it"
        if isinstance(magnet, sim.Field):
            return magnet.at_gap(step.gap_mm)
        return sim.MagnetField(magnet=magnet, gap_mm=step.gap_mm)
    if not usable_flux(step):
        return f"no field reading: the Tesla-meter said {step.flux_status}"
    angle_deg = flux_angle_deg(step, magnet, length_mm)
    return sim.UniformField(flux_mT=step.flux_mT, angle_deg=angle_deg)


def flux_angle_deg(
    step: Step, magnet: Magnet | sim.Field | None, length_mm: float
) -> float:
    """Return the direction of the flux that a meter at the undeformed tip reads."""
    if not isinstance(magnet, sim.Field):
        return magnet.axis_angle_deg if magnet else 90.0
    if magnet.follows_gap and not math.isfinite(step.gap_mm):
        return 90.0
    field = magnet.at_gap(step.gap_mm) if magnet.follows_gap else magnet
    return flux_at_tip_mT(field, length_mm)[1]


def flux_at_tip_mT(field: sim.Field, length_mm: float) -> tuple[float, float]:
    """Return size and direction (deg) of the flux at the undeformed tip."""
    x, y, z = sim.flux_mT(field, np.array([length_mm, 0.0, 0.0]), length_mm=length_mm)
    return float(np.linalg.norm([x, y, z])), math.degrees(math.atan2(y, x))
