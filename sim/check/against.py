"""`verify`: a solution against that of the check solver, in the plane or in space."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.checks import shown
from ...core.errors import InputError
from ...core.specimen import Specimen
from ..fields import Field, Support, as_field, check_case
from ..solution import Solution
from ..spatial.rod import SpatialRod
from ..spatial.solver import SpatialSolution
from .solver import check_solve
from .space import check_spatial, untwisted

Array = NDArray[np.float64]

MORE_ELEMENTS = (1, 2, 4, 8)
"""Of a section in the plane, until the check solver is as exact as the solution."""


def verify(
    specimen: Specimen | SpatialRod,
    field: Field | Sequence[float],
    solution: Solution | SpatialSolution,
    *,
    support: Support | None = None,
    degree: int = 12,
) -> float:
    """Return the largest distance between a solution and the check solver's, in mm.

    Parameters
    ----------
    specimen, field, support
        What `solution` is a solution of.
    solution : Solution or SpatialSolution
        From `solve` with the plain rod model, or from `solve_spatial`.
    degree : int
        Of the polynomials of a shape in the plane.

    Raises
    ------
    InputError
        If the solution has no shape, as of a rod that is pulled in or touches a magnet,
        or is of another rod.
    SolverError
        If the check solver finds no equilibrium near the solution.
    """
    if not isinstance(solution, (Solution, SpatialSolution)):
        raise InputError(
            "solution must be a Solution or a SpatialSolution; instead received "
            f"{shown(solution)}"
        )
    support = support or Support()
    flat = None
    if isinstance(solution, SpatialSolution):
        s_mm, r_mm = solution.s_mm, solution.r_mm
    else:
        check_case(specimen, field, support)
        line, r_mm = solution.centreline, solution.points_mm
        s_mm = np.zeros(0) if line is None else line.s_mm
        flat = line if solution.z_mm is None else None
    _check_shape(s_mm, solution.status, specimen)
    if flat is not None and isinstance(specimen, Specimen):
        case = specimen, as_field(field), support
        return _in_plane(*case, flat, degree, solution.error_mm)
    if isinstance(solution, SpatialSolution):
        start = s_mm, solution.curvature_per_mm
    else:
        start = untwisted(s_mm, r_mm, support)
    check = check_spatial(specimen, field, support=support, start=start)
    return float(np.linalg.norm(check.at(s_mm) - r_mm, axis=1).max())


def _check_shape(s_mm: Array, status: str, rod: Specimen | SpatialRod) -> None:
    if not len(s_mm):
        raise InputError(
            f"a solution to verify must have a shape; instead received one with status "
            f"{status!r}"
        )
    if abs(s_mm[-1] - rod.length_mm) > 1e-9 * rod.length_mm:
        raise InputError(
            f"a solution to verify must be of a rod of {rod.length_mm:g} mm, as the "
            f"specimen is; instead received one of {s_mm[-1]:g} mm"
        )


def _in_plane(
    specimen: Specimen, field: Field, support: Support, shape: Centreline, degree: int,
    error_mm: float,
) -> float:  # fmt: skip
    off_mm = np.inf
    for elements in MORE_ELEMENTS:
        check = check_solve(
            specimen, field, support=support, degree=degree, elements=elements,
            start=(shape.s_mm, shape.theta_rad),
        )  # fmt: skip
        x_mm, y_mm = check.at(shape.s_mm)
        off_mm = float(np.max(np.hypot(x_mm - shape.x_mm, y_mm - shape.y_mm)))
        if off_mm <= error_mm:
            break
    return off_mm
