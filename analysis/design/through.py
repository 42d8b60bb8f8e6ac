"""Rods that pass a lumen with the least force on its walls.

The softest rod always presses least, and cannot push. So all rods are compared at one
stiffness against a side force at the tip: lengths, side and the ratios of the moduli
are searched, and the moduli are then scaled until the rod has it. Sobol points over
what can be made go through the lumen on coarse steps; from the best, Nelder and Mead's
simplex goes on; the best of all is pushed through again on fine steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from ...core.checks import positive, whole
from ...core.errors import SolverError
from ...core.progress import Progress, silent
from ...core.specimen import Specimen
from ...sim import Field
from ...sim.navigate import Lumen, Passage, navigate, navigate_many
from ...sim.tube import Tube
from ..library.space import sobol_points
from .makeable import Candidates, Makeable, choices, dimension, rods, specimen_of

Array = NDArray[np.float64]

COARSE_MM, FINE_MM = 1.0, 0.5
"""Steps of the insertion, of the search and of the answer."""
COARSE_ELEMENTS = 16
POLISH = 60
"""Rods that the simplex tries."""
JAM_N = 1e3
"""What a rod that does not pass counts as pressing, in N; less if it comes far."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Through:
    """A rod that passes a lumen.

    Parameters
    ----------
    specimen : Specimen
        The rod.
    passage : Passage
        Its way, on fine steps.
    tip_stiffness_N_mm : float
        Side force at the tip over its deflection.
    """

    specimen: Specimen
    passage: Passage
    tip_stiffness_N_mm: float


def tip_stiffness_N_mm(specimen: Specimen) -> float:
    """Return a side force on the tip over its deflection: 1 / int s^2 / EI.

    Parameters
    ----------
    specimen : Specimen
        Of square sections.
    """
    ends = specimen.length_mm - np.cumsum(
        [0.0, *(section.length_mm for section in specimen.sections)]
    )
    EI = np.array(
        [
            section.E_MPa * across.in_plane_mm4
            for section, across in zip(
                specimen.sections, specimen.cross_sections, strict=True
            )
        ]
    )
    return float(1.0 / np.sum((ends[:-1] ** 3 - ends[1:] ** 3) / (3.0 * EI)))


def design_through(
    lumen: Lumen | Tube,
    field: Field,
    makeable: Makeable,
    *,
    stiffness_N_mm: float,
    friction: float = 0.0,
    gate: str | None = None,
    trials: int = 64,
    count: int = 3,
    seed: int = 0,
    progress: Progress = silent,
) -> list[Through]:
    """Return rods that pass a lumen, the one that presses least on its walls first.

    Parameters
    ----------
    lumen, field : Lumen, Field
        Where, and in what field.
    makeable : Makeable
        What can be made.
    stiffness_N_mm : float
        Of every rod, against a side force at its tip, in N/mm.
    friction : float
        Coefficient of friction.
    gate : str, optional
        The gate to pass; else the whole rod must be inserted.
    trials : int
        Sobol points.
    count : int
        How many rods to return, at most.
    seed : int
        Of the Sobol points.

    Raises
    ------
    SolverError
        If no rod that can be made has the stiffness, or none that has it passes.
    """
    positive(stiffness_N_mm, "stiffness_N_mm", "N/mm")
    whole(trials, 8, 100_000, "trials")
    z = sobol_points(dimension(makeable), 0, trials, seed)
    kinds = np.arange(trials) % len(choices(makeable))
    made = [_made(makeable, z[i], kinds[i], stiffness_N_mm) for i in range(trials)]
    index = [i for i, rod in enumerate(made) if rod is not None]
    if not index:
        raise SolverError(
            f"no rod that can be made has a tip stiffness of {stiffness_N_mm:g} N/mm: "
            "ask for another, or widen E_MPa or side_mm of what can be made"
        )
    coarse: dict[str, Any] = {
        "friction": friction, "step_mm": COARSE_MM, "elements": COARSE_ELEMENTS,
        "push_limit_N": 1e3 * stiffness_N_mm,
    }  # fmt: skip
    ways = navigate_many(
        [rod for rod in made if rod is not None], lumen, field,
        progress=progress, **coarse,
    )  # fmt: skip
    force = np.array([_force(way, gate) for way in ways])
    order = [index[i] for i in np.argsort(force, kind="stable")]
    start = order[0]

    def press(point: Array) -> float:
        rod = _made(makeable, point, kinds[start], stiffness_N_mm)
        if rod is None:
            return 2.0 * JAM_N
        return _force(navigate_many([rod], lumen, field, **coarse)[0], gate)

    polished = minimize(
        press, z[start], method="Nelder-Mead", bounds=[(0.0, 1.0)] * z.shape[1],
        options={"maxfev": POLISH, "initial_simplex": _simplex(z[start])},
    )  # fmt: skip
    best = _made(makeable, polished.x, kinds[start], stiffness_N_mm)
    candidates = [best, *(made[i] for i in order[: count - 1 if count > 1 else 0])]
    found = []
    for number, rod in enumerate(candidates, start=1):
        if rod is None:
            continue
        named = replace(rod, name=f"design {number}")
        way = navigate(named, lumen, field, friction=friction, step_mm=FINE_MM)
        if _passes(way, gate):
            found.append(
                Through(
                    specimen=named,
                    passage=way,
                    tip_stiffness_N_mm=tip_stiffness_N_mm(named),
                )
            )
    if not found:
        raise SolverError(
            f"no rod of {trials} tried, with a tip stiffness of {stiffness_N_mm:g} "
            f"N/mm, passes lumen {lumen.name!r}"
        )
    found.sort(key=lambda one: one.passage.most("wall_N"))
    return found[:count]


def _simplex(start: Array) -> Array:
    """Return the corners of a simplex within the unit cube."""
    corners = np.tile(start, (len(start) + 1, 1))
    for k in range(len(start)):
        corners[k + 1, k] += 0.2 if start[k] < 0.5 else -0.2
    return corners


def _made(
    makeable: Makeable, z: Array, kind: int, stiffness_N_mm: float
) -> Specimen | None:
    """Return the rod at a point of the unit cube, scaled to the stiffness, or None."""
    point = Candidates(z=np.clip(z, 0.0, 1.0)[None], choice=np.array([kind]))
    table = rods(makeable, point)
    rod = specimen_of(table, 0, "trial")
    factor = stiffness_N_mm / tip_stiffness_N_mm(rod)
    if makeable.recipe:
        return rod if abs(factor - 1.0) < 0.05 else None
    low, high = makeable.E_MPa
    moduli = [factor * section.E_MPa for section in rod.sections]
    if min(moduli) < low or max(moduli) > high:
        return None
    sections = tuple(
        replace(section, E_MPa=round(E, 3))
        for section, E in zip(rod.sections, moduli, strict=True)
    )
    return replace(rod, sections=sections)


def _passes(way: Passage | None, gate: str | None) -> bool:
    if way is None:
        return False
    return gate in way.gates if gate else way.outcome == "inserted"


def _force(way: Passage | None, gate: str | None) -> float:
    """Return what a rod presses at most in N; much, if it does not pass."""
    if way is None:
        return JAM_N
    if not _passes(way, gate):
        return JAM_N / (1.0 + way.reached_mm)
    return way.most("wall_N")
