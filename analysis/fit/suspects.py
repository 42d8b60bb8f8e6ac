"""Single changes of the model that would explain what a fit leaves.

A score test ranks them all at no cost; the best few are then fitted. Nuisances are
asked without their prior; changes that have none are asked too: a remanence that grows
along the rod, a stiffness that changes gradually, the length of one section, another
field at one photograph than at the others (a wrong gap, or another step's picture).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ... import sim
from ...core.errors import MagbendError
from ...core.specimen import Specimen
from .nuisance import unit_of
from .problem import Problem, with_prior
from .records import Suspect
from .residuals import residuals
from .result import FitResult, result_of
from .search import Limits, on_bounds, priors, search

Array = NDArray[np.float64]

FEW = 4
"""How many of the best are fitted."""

ENOUGH = 3
"""Photographs from which on one can be told from the others."""

ODD_PERCENT = 10.0
"""Least change of the field at one photograph that is tried: a wrong gap or another
step's picture make more, and less is what errors of the whole bench look like."""

FREE = 30.0
"""Prior standard deviations that count as no prior."""


def scored(result: FitResult) -> list[Suspect]:
    """Return all single changes by a score test, best first."""
    asked = _asked(result.problem)
    wide = result.problem
    for (name, index), sd in asked.items():
        wide = with_prior(wide, name, index, sd)
    _, jacobian = residuals(wide, np.append(result.unknowns, np.zeros(len(asked))))
    p = len(wide.names)
    found = []
    for k, (key, sd) in enumerate(zip(wide.nuisances, wide.nuisance_sd, strict=True)):
        step, step_sd = result.linear.score(jacobian[:, p + k])
        if key[0] == "field_percent" and not abs(step * float(sd)) > ODD_PERCENT:
            continue
        if math.isfinite(step_sd):
            found.append(
                Suspect(
                    name=wide.label(k),
                    value=step * float(sd),
                    sd=step_sd * float(sd),
                    unit=unit_of(key[0]),
                    delta_chi2=(step / step_sd) ** 2,
                    key=key,
                )
            )
    return sorted(found, key=lambda suspect: -suspect.delta_chi2)


def _asked(problem: Problem) -> dict[tuple[str, int], float]:
    """Return the changes that are no nuisance, and by how much they are tried."""
    asked = {}
    for rod in dict.fromkeys(shot.owner.rod for shot in problem.shots):
        sections = len(problem.specimen.sections)
        if sections > 1:
            asked[("remanence_profile_percent", rod)] = 3.0
            asked[("stiffness_gradient", rod)] = 0.3
        for i in range(sections - 1):
            asked[(f"section_length_mm[{i}]", rod)] = 0.3
    if len(problem.shots) >= ENOUGH:
        for shot in problem.shots:
            asked[("field_percent", shot.owner.photograph)] = 3.0
    return asked


def refitted(
    result: FitResult, limits: Limits, changes: list[Suspect], *, thorough: bool
) -> list[Suspect]:
    """Fit the best few changes and, if `thorough`, the choice of another rod."""
    found = [
        fitted
        for change in changes[: FEW if thorough else 2]
        if (fitted := _refit(result, limits, change)) is not None
    ]
    if thorough:
        found += _other_rods(result, limits)
    return found


def _refit(result: FitResult, limits: Limits, change: Suspect) -> Suspect | None:
    """Fit along a change that the prior does not hold; None if that fails."""
    problem = result.problem
    known = dict(zip(problem.nuisances, problem.nuisance_sd.tolist(), strict=True))
    sd = FREE * known.get(change.key, change.sd)
    wide = with_prior(problem, *change.key, sd)
    k = len(wide.names) + wide.nuisances.index(change.key)
    begin = np.append(result.unknowns, np.zeros(wide.size - problem.size))
    begin[k] *= known.get(change.key, sd) / sd
    again = alternative(wide, limits, begin)
    if again is None:
        return None
    row = again.nuisance[k - len(wide.names)]
    return replace(
        change,
        value=row["value"],
        sd=row["sd"],
        delta_chi2=result.linear.chi2 - again.linear.chi2,
    )


def alternative(problem: Problem, limits: Limits, begin: Array) -> FitResult | None:
    """Fit another model to the same lines with the same errors; None if that fails."""
    try:
        unknowns = search(problem, limits, begin)
        return result_of(
            problem,
            priors(problem, limits),
            unknowns,
            on_bounds(problem, limits, unknowns),
        )
    except MagbendError:
        return None


def _other_rods(result: FitResult, limits: Limits) -> list[Suspect]:
    """Try the rods of the paper that may have been taken for this one."""
    problem = result.problem
    nominal = problem.specimen
    if any(shot.specimen != nominal for shot in problem.shots):
        return []
    found, seen = [], {_sizes(nominal)}
    for number in range(1, 8):
        other = sim.gmc(number)
        if _sizes(other) in seen or len(other.sections) != len(nominal.sections):
            continue
        seen.add(_sizes(other))
        if abs(other.length_mm / nominal.length_mm - 1.0) > 0.05:
            continue
        again = alternative(_with_rod(problem, other), limits, result.unknowns)
        if again is None:
            continue
        gain = result.linear.chi2 - again.linear.chi2
        if gain > 0.0:
            found.append(
                Suspect(
                    name=f"the rod is {other.name}", value=math.nan, sd=math.nan,
                    unit="", delta_chi2=gain,
                )
            )  # fmt: skip
    return found


def _sizes(specimen: Specimen) -> tuple[float, ...]:
    lengths = (section.length_mm for section in specimen.sections)
    return (*lengths, *specimen.sides_mm)


def _with_rod(problem: Problem, other: Specimen) -> Problem:
    """Return the problem with the sizes of another rod; its material stays."""
    nominal = problem.specimen
    sections = tuple(
        replace(section, length_mm=new.length_mm, side_mm=new.side_mm)
        for section, new in zip(nominal.sections, other.sections, strict=True)
    )
    rod = replace(nominal, sections=sections, side_mm=other.side_mm)
    return replace(
        problem,
        specimen=rod,
        shots=tuple(replace(shot, specimen=rod) for shot in problem.shots),
        data=tuple(replace(datum, specimen=rod) for datum in problem.data),
    )
