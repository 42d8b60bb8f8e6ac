"""The field that a line was measured in: a reading, the run's magnet, or any sources.

What waits for a gap stands at that of the step. All that is not known of sources is how
strong they are together, how far away, and how far along the rod those on the stage.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

from ... import sim
from ...core.errors import InputError
from ..compare.field import field_of
from ..runs.data import RunData, Step

Values = dict[str, float]


def field_in(
    run: RunData, step: Step, model: str, sources: sim.Field | None
) -> sim.Field | str:
    """Return the field of a step, or a sentence that says why there is none."""
    if sources is not None:
        if sources.follows_gap and not math.isfinite(step.gap_mm):
            return "no gap: the table of this run does not say it"
        return sources
    # Where a magnet is known, `uniform` is its flux at the tip, taken everywhere.
    known = "magnet" if run.magnet or model != "uniform" else "uniform"
    field = field_of(step, known, run.magnet, run.specimen.length_mm)
    if isinstance(field, sim.MagnetField):
        return sim.before(field.magnet)
    return field


def is_read(field: sim.Field) -> bool:
    """Tell whether a field is known by the meter's reading alone."""
    return isinstance(field, sim.UniformField)


def field_at(field: sim.Field, gap_mm: float, values: Values) -> sim.Field:
    """Return the field at a gap, with what the unknowns change of its place."""
    if isinstance(field, sim.UniformField):
        true_mT = field.flux_mT - values.get("meter_offset_mT", 0.0)
        true_mT /= 1.0 + values.get("meter_percent", 0.0) / 100.0
        return replace(field, flux_mT=true_mT)
    gap_mm += values.get("gap_mm", 0.0)
    return _shifted(field, gap_mm, values.get("magnet_offset_mm", 0.0))


@lru_cache(maxsize=256)  # most derivatives leave it where it is
def _shifted(field: sim.Field, gap_mm: float, along_mm: float) -> sim.Field:
    return sim.Field(_moved(one, gap_mm, along_mm) for one in field.sources)


def _moved(source: Any, gap_mm: float, along_mm: float) -> Any:
    if not source.follows_gap:
        return source
    x, y, z = source.offset_mm
    return replace(source, gap_mm=gap_mm, offset_mm=(x + along_mm, y, z))


def strength(field: sim.Field, values: Values) -> float:
    """Return by what factor the unknowns change the strength of all sources."""
    factor = 1.0 + values.get("field_percent", 0.0) / 100.0
    if is_read(field):
        return factor
    factor *= 1.0 + values.get("magnet_percent", 0.0) / 100.0
    if "magnet_remanence_T" in values:
        factor *= values["magnet_remanence_T"] / remanence_T(field)
    return factor


def remanence_T(field: sim.Field) -> float:
    """Return the remanence of the one magnet of a field.

    Raises
    ------
    InputError
        If there is none, or several sources.
    """
    known = [getattr(one, "remanence_T", None) for one in field.sources]
    if len(known) != 1 or known[0] is None:
        raise InputError(
            "magnet_remanence_T in T can be fitted to one magnet alone; instead "
            f"received {', '.join(one.kind for one in field.sources)}"
        )
    return float(known[0])
