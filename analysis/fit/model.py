"""What the unknowns of a fit mean: a rod in a field, as its photograph shows it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import sim
from ...core.centreline import Centreline
from ...core.cross_section import ALL_SIZES
from ...core.errors import InputError, MagbendError
from ...core.specimen import Section, Specimen
from ..compare.field import flux_at_tip_mT
from ..compare.metrics import position_at
from .fields import field_at, is_read, strength
from .nuisance import Owner
from .problem import Datum, Problem, Shot

Array = NDArray[np.float64]
Values = dict[str, float]

VIEW = ("frame_angle_deg", "scale_percent", "clamp_position_mm")
"""What changes how a shape is seen, and not the shape."""

CURVATURE = "natural_curvature_per_mm"
CURVATURE_STEP = 1e-4
"""1/mm, of the difference that gives the effect of a natural curvature."""

OF_ROD = {
    "E_MPa", "length_mm", "joint_mm", "section_length_mm", "side_percent",
    "remanence_mT", "remanence_percent", "remanence_profile_percent",
    "density_percent", "stiffness_gradient",
}  # fmt: skip
"""What changes the rod itself; of each section where it has a number in brackets."""

PARTS = 4
"""Pieces of a section whose stiffness changes gradually."""


def values_of(problem: Problem, owner: Owner, unknowns: Array) -> Values:
    """Return what the unknowns are for something of `owner`, in their own units."""
    return {
        name: problem.value(k, float(unknowns[k])) for k, name in problem.held_by(owner)
    }


def shape_of(problem: Problem, shot: Shot, values: Values) -> Array | None:
    """Return the predicted points, shape (n, 2) in mm; None without an equilibrium."""
    nominal, per_curvature = shot.bow
    specimen = straight(rod_of(shot.specimen, values))
    xy_mm = solved_mm(problem, shot, specimen, values)
    if xy_mm is None:
        return None
    return np.asarray(xy_mm + nominal + values.get(CURVATURE, 0.0) * per_curvature)


def solved_mm(
    problem: Problem, shot: Shot, specimen: Specimen, values: Values
) -> Array | None:
    """Return the points of a rod in the field of a shot, as `shape_of` does."""
    field = field_at(shot.field, shot.gap_mm, values)
    if problem.model == "uniform" and not is_read(shot.field):
        flux_mT, angle_deg = flux_at_tip_mT(field, shot.specimen.length_mm)
        field = sim.UniformField(flux_mT=flux_mT, angle_deg=angle_deg)
    # Only a straight rod can be solved as a solid.
    solid = problem.model == "solid" and specimen.is_plain
    support = _support_of(problem, shot, values)
    shape = _solved(specimen, field, support, "solid" if solid else "rod")
    if shape is None:
        return None
    # A measured line may be a little longer than the rod, never asked beyond its tip.
    return np.column_stack(position_at(shape, shot.line.s_mm))


@lru_cache(maxsize=1024)  # not all that changes a line as it is seen changes the rod
def _solved(
    specimen: Specimen, field: sim.Field, support: sim.Support, model: str
) -> Centreline | None:
    return sim.solve(
        specimen, field, support=support, model=model, points=241
    ).centreline


def with_bow(problem: Problem, unknowns: Array) -> Problem:
    """Return the problem with what natural curvature does to its shapes.

    A curved rod needs the solver in space, 15 times slower; its curvature is small.
    So its effect is taken once, around `unknowns`, and added to the straight rod's.
    """
    return replace(
        problem, shots=tuple(_bowed(problem, shot, unknowns) for shot in problem.shots)
    )


def _bowed(problem: Problem, shot: Shot, unknowns: Array) -> Shot:
    values = values_of(problem, shot.owner, unknowns)
    rod = rod_of(shot.specimen, values)
    at = [straight(rod)]
    at += [
        replace(rod, natural_curvature_per_mm=rod.natural_curvature_per_mm + step)
        for step in (0.0, CURVATURE_STEP, -CURVATURE_STEP)
    ]
    if any(section.natural_curvature_per_mm is not None for section in rod.sections):
        at[2:] = []  # each section has its own: it is taken as it is
    try:
        solved = [solved_mm(problem, shot, specimen, values) for specimen in at]
    except MagbendError:
        if not np.any(unknowns):
            raise
        # A search that other errors drove where no rod can stand: the bow there was.
        return shot
    seen = [xy_mm for xy_mm in solved if xy_mm is not None]
    if len(seen) < len(at):
        return shot
    column = np.zeros_like(shot.bow[1])
    if len(seen) > 2:
        column = (seen[2] - seen[3]) / (2.0 * CURVATURE_STEP)
    return replace(shot, bow=np.stack([seen[1] - seen[0], column]))


def straight(rod: Specimen) -> Specimen:
    """Return the rod without its natural curvature."""
    if not any(rod.natural_curvatures_per_mm):
        return rod
    sections = tuple(
        replace(section, natural_curvature_per_mm=None) for section in rod.sections
    )
    return replace(rod, natural_curvature_per_mm=0.0, sections=sections)


def across_mm(shot: Shot, values: Values, xy_mm: Array) -> Array:
    """Return measured minus predicted, across the measured line, shape (n,) in mm.

    The measured frame leaves the clamp along the rod: the prediction is turned back by
    the clamp's angle, then by the error of the frame, shifted across, and scaled.
    """
    turn = math.radians(
        values.get("frame_angle_deg", 0.0) - values.get("clamp_angle_deg", 0.0)
    )
    c, s = math.cos(turn), math.sin(turn)
    scale = 1.0 + values.get("scale_percent", 0.0) / 100.0
    seen = scale * xy_mm @ np.array([[c, s], [-s, c]])
    seen[:, 1] += values.get("clamp_position_mm", 0.0)
    measured = np.column_stack([shot.line.x_mm, shot.line.y_mm])
    return np.asarray(np.sum((measured - seen) * shot.normals, axis=1))


def stated(datum: Datum, values: Values) -> float:
    """Return what a run's number should be."""
    scale = 1.0 + values.get("scale_percent", 0.0) / 100.0
    if datum.kind == "length_mm":
        return scale * (datum.specimen.length_mm + values.get("length_mm", 0.0))
    if datum.kind == "width_mm":
        side_mm = float(np.mean(datum.specimen.sides_mm))
        return scale * side_mm * (1.0 + values.get("side_percent", 0.0) / 100.0)
    if datum.field is None:
        raise InputError(f"a datum of {datum.kind} needs the field it was read in")
    field = field_at(datum.field, datum.gap_mm, values)
    gain = 1.0 + values.get("meter_percent", 0.0) / 100.0
    gain *= strength(datum.field, values)
    flux_mT, _ = flux_at_tip_mT(field, datum.specimen.length_mm)
    return gain * flux_mT + values.get("meter_offset_mT", 0.0)


def rod_of(nominal: Specimen, values: Values) -> Specimen:
    """Return the rod with all that the unknowns change of it."""
    own = [item for item in values.items() if item[0].partition("[")[0] in OF_ROD]
    return _changed(nominal, tuple(own))


@lru_cache(maxsize=512)  # most derivatives, and all photographs, share their rods
def _changed(nominal: Specimen, changes: tuple[tuple[str, float], ...]) -> Specimen:
    values = dict(changes)
    count = len(nominal.sections)
    ends = np.cumsum([section.length_mm for section in nominal.sections])
    middles = ends - 0.5 * np.diff(ends, prepend=0.0)
    for i in range(count):
        ends[i] += values.get(f"joint_mm[{i}]", 0.0)
        ends[i:] += values.get(f"section_length_mm[{i}]", 0.0)
    ends[-1] += values.get("length_mm", 0.0)
    size = 1.0 + values.get("side_percent", 0.0) / 100.0
    remanence = 1.0 + values.get("remanence_percent", 0.0) / 100.0
    if "remanence_mT" in values:
        remanence *= values["remanence_mT"] / nominal.remanence_mT
    density = 1.0 + values.get("density_percent", 0.0) / 100.0
    slope = values.get("remanence_profile_percent", 0.0) / 100.0
    along = 2.0 * middles / nominal.length_mm - 1.0
    sections = tuple(
        replace(
            nominal.sections[i],
            length_mm=float(length),
            E_MPa=values[f"E_MPa[{i}]"],
            **_scaled(nominal.sections[i], ALL_SIZES, size),
            remanence_mT=nominal.remanences_mT[i] * remanence * (1 + slope * along[i]),
            **_scaled(
                nominal.sections[i], ("remanence_y_mT", "remanence_z_mT"), remanence
            ),
        )
        for i, length in enumerate(np.diff(ends, prepend=0.0))
    )
    known = nominal.density_kg_m3
    changed = replace(
        nominal,
        **_scaled(nominal, ALL_SIZES, size),
        **_scaled(nominal, ("remanence_y_mT", "remanence_z_mT"), remanence),
        sections=sections,
        density_kg_m3=None if known is None else known * density,
    )
    share = values.get("stiffness_gradient", 0.0)
    return _graded(changed, share) if share else changed


def _scaled(
    part: Specimen | Section, names: Sequence[str], factor: float
) -> dict[str, Any]:
    """Return the numbers that a part has of its own, times a factor."""
    own = {name: getattr(part, name) for name in names}
    return {name: factor * value for name, value in own.items() if value is not None}


def _graded(rod: Specimen, share: float) -> Specimen:
    """Return the rod with a share of the way from steps to a smooth gradient of E."""
    ends = np.array([0.0, *rod.joints_mm, rod.length_mm])
    logs = np.log([section.E_MPa for section in rod.sections])
    pieces = []
    for i, section in enumerate(rod.sections):
        edges = np.linspace(ends[i], ends[i + 1], PARTS + 1)
        middles = 0.5 * (edges[1:] + edges[:-1])
        smooth = np.interp(middles, 0.5 * (ends[1:] + ends[:-1]), logs)
        for value in logs[i] + share * (smooth - logs[i]):
            pieces.append(
                replace(
                    section, length_mm=section.length_mm / PARTS, E_MPa=math.exp(value)
                )
            )
    return replace(rod, sections=tuple(pieces))


def _support_of(problem: Problem, shot: Shot, values: Values) -> sim.Support:
    base = problem.support
    factor = values.get("load_factor", base.load_factor)
    return replace(
        base,
        clamp_angle_deg=base.clamp_angle_deg + values.get("clamp_angle_deg", 0.0),
        load_factor=factor * strength(shot.field, values),
    )
