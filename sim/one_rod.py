"""`solve`: one rod, one field, one equilibrium."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..core.centreline import Centreline
from ..core.checks import shown, whole
from ..core.errors import InputError
from ..core.jit import plain_first
from ..core.specimen import Specimen
from ..core.units import mT_from_T, rad_from_deg
from .ending import STRAIGHT, buckled_tips, ending
from .fields import (
    PULLED_IN,
    STABLE,
    UNSTABLE,
    Field,
    Support,
    as_field,
    check_case,
    refuse_outside,
)
from .planar.outcomes import GONE
from .planar.solver import ORDER, STEP, failure, solve_planar, solve_rows
from .planar.swing import swing_index
from .scaling import MOST_POINTS, field_array, rod_array, stations, stiffness_Nmm2
from .solution import Solution

Array = NDArray[np.float64]
STATUS = (STABLE, UNSTABLE, PULLED_IN)
NO_SUPPORT = Support()
POINTS = 61
"""Points of a shape, by default."""
Tips = tuple[tuple[float, float], ...]


@plain_first(solve_rows)
def solve(
    specimen: Specimen,
    field: Field,
    *,
    support: Support = NO_SUPPORT,
    model: str = "rod",
    poisson_ratio: float | None = None,
    points: int = POINTS,
) -> Solution:
    """Return the equilibrium that the rod reaches when its load grows from zero.

    Parameters
    ----------
    specimen : Specimen
        The rod.
    field : UniformField, MagnetField, Field, or sources
        What bends it.
    support : Support
        Clamp direction, weight, and a factor on the magnetic load.
    model : {"rod", "solid"}
        Plain inextensible rod, or a rod with shear, stretch and the clamped face of a
        solid (`solid`).
    poisson_ratio : float, optional
        Of the material, for the solid model; that of the specimen by default. The plain
        rod twists with the specimen's.
    points : int
        Number of points of the shape, equally spaced from clamp to tip.

    Returns
    -------
    Solution
        With its status, Morse index and error bound. "pulled in: no equilibrium" is a
        result: the branch from zero load ends before the full load, or touches the
        magnet.

    Raises
    ------
    InputError
        If a value cannot be, or the undeformed rod would touch the magnet.
    SolverError
        If no answer was found that could be vouched for.

    Examples
    --------
    >>> from magbend.sim import UniformField, gmc, solve
    >>> solution = solve(gmc(2), UniformField(flux_mT=50.0))
    >>> [round(value, 5) for value in solution.centreline.tip_mm]
    [29.53532, 4.70952]
    """
    field = as_field(field)
    check_case(specimen, field, support)
    points = whole(points, 2, MOST_POINTS, "points")
    if not isinstance(model, str) or model not in ("rod", "solid"):
        raise InputError(
            f"model must be 'rod' or 'solid'; instead received {shown(model)}"
        )
    if model == "solid":
        from .solid.solver import solve_solid

        return solve_solid(
            specimen, field, support=support, poisson_ratio=poisson_ratio, points=points
        )
    if not bends_in_plane(specimen, field, support):
        from .spatial.solver import solve_spatial

        spatial = solve_spatial(specimen, field, support=support, points=points)
        return spatial.seen_from_above()
    return solve_in_plane(specimen, field, support, points)[0]


def bends_in_plane(specimen: Specimen, field: Field, support: Support) -> bool:
    """Tell whether nothing makes a rod leave the plane."""
    return support.in_plane and field.in_plane and specimen.is_plain


def solve_in_plane(
    specimen: Specimen, field: Field, support: Support, points: int
) -> tuple[Solution, Array]:
    """Solve a rod that stays in the plane (arguments of `solve`, checked).

    Returns
    -------
    Solution
    ndarray, shape (4,)
        The unknowns of the march (`planar.solver.solve_planar`).
    """
    rod, length_mm, margin, unit_Nm, units = _held(specimen, support)
    s = stations(points)
    flux = field_array(field, length_mm)
    case = rod, flux, rad_from_deg(support.clamp_angle_deg), margin
    outcome, index, load, error, bx, by, moment, table, tip = solve_planar(
        *case, s, ORDER, STEP
    )
    if outcome > GONE:
        raise failure(outcome, specimen, field, load)
    centreline = stable_in_space = None
    buckled: Tips = ()
    if outcome != GONE:
        x_mm, y_mm, theta, kappa_per_mm = table * units
        centreline = Centreline._trusted(s * length_mm, x_mm, y_mm, theta, kappa_per_mm)
        refuse_outside(field, x_mm, y_mm, 1.0)
        if index > 0 and np.all(np.abs(table[3]) < STRAIGHT):
            buckled = buckled_tips(case, length_mm)
        stable_in_space = index == 0 and _holds(specimen, support, rod, flux, tip)
    solution = Solution(
        centreline=centreline,
        status=STATUS[outcome],
        morse_index=index if centreline else -1,
        error_mm=error * length_mm if centreline else math.nan,
        flux_tip_mT=(mT_from_T(bx), mT_from_T(by)),
        root_moment_Nm=moment * unit_Nm,
        load_limit=load,
        stable_in_space=stable_in_space,
        ending=ending(case, load, length_mm) if outcome == GONE else None,
        buckled_tips_mm=buckled,
    )
    return solution, tip


def _holds(
    specimen: Specimen, support: Support, rod: Array, flux: Array, tip: Array
) -> bool | None:
    """Tell whether a rod that is stable in the plane stays in it; None: not known."""
    if math.isnan(tip[0]):
        return None
    if specimen.shape != "rectangle":
        return bool(swing_index(rod, flux, tip, STEP) == 0)
    from .spatial.beside import index_in_space

    index = index_in_space(specimen, support, flux, tip)
    return None if index < 0 else index == 0


@lru_cache(maxsize=256)
def _held(
    specimen: Specimen, support: Support
) -> tuple[Array, float, float, float, Array]:
    """Return a held rod as the kernel takes it, and what turns its numbers into units.

    The array, the length in mm, half the largest side over the length, and the units of
    moments in N m and of the shape, shape (4, 1).
    """
    rod = rod_array(specimen, support)
    length_mm = specimen.length_mm
    margin = 0.5 * max(specimen.sides_mm) / length_mm
    unit_Nm = stiffness_Nmm2(specimen)[0] / length_mm * 1e-3
    units = np.array([[length_mm], [length_mm], [1.0], [1.0 / length_mm]])
    return rod, length_mm, margin, unit_Nm, units
