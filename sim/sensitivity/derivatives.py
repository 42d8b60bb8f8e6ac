"""Exact derivatives of the shape with respect to every parameter of the experiment.

The unknowns u of the march satisfy R(u, p) = 0 at the clamp, so du/dp = -R_u^-1 R_p
(implicit function theorem). R_p and what it does to the shape come from one more column
of the same Taylor march per parameter: no differences, no step to choose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.arrays import real_array
from ...core.checks import listed, shown
from ...core.errors import InputError, SolverError
from ...core.specimen import Specimen
from ..fields import Field, Support, as_field, check_case
from ..one_rod import NO_SUPPORT, POINTS, bends_in_plane, solve, solve_in_plane
from ..planar.solver import ORDER, STEP
from ..scaling import field_array, rod_array, stations
from ..solution import Solution
from .march import parameter_columns
from .moved import Case
from .parameters import Change, change_of
from .space import shape_changes

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivities:
    """Derivatives of a shape at fixed arc lengths from the clamp.

    Parameters
    ----------
    solution : Solution
        The equilibrium.
    s_mm : ndarray, shape (n,)
        Where.
    parameters : tuple of str
        With respect to what; the unit is the one in the name.
    dx_mm, dy_mm, dz_mm, dtheta_rad : ndarray, shape (n, p)
        Derivatives of x, y, z and the tangent angle (as seen from above), per unit of
        each parameter.
    error : float
        Of a rod in space, by how much of its largest derivative one may be off; 0 in
        the plane, where nothing is left but rounding.
    """

    solution: Solution
    s_mm: Array
    parameters: tuple[str, ...]
    dx_mm: Array
    dy_mm: Array
    dz_mm: Array
    dtheta_rad: Array
    error: float = 0.0


def sensitivities(
    specimen: Specimen,
    field: Field,
    *,
    parameters: Sequence[str],
    support: Support = NO_SUPPORT,
    s_mm: ArrayLike | None = None,
) -> Sensitivities:
    """Return the derivatives of the equilibrium shape (plain rod).

    Parameters
    ----------
    specimen, field, support
        As for `solve`.
    parameters : sequence of str
        Of ``E_MPa[i]``, ``length_mm[i]``, ``side_mm[i]``, ``remanence_mT[i]`` (section
        i, 0 at the root), ``side_mm``, ``remanence_mT`` (all sections together),
        ``flux_mT``, ``angle_deg``, ``gap_mm``, ``magnet.remanence_T``,
        ``magnet.axis_angle_deg``, ``magnet.offset_mm[0|1|2]``, ``clamp_angle_deg``,
        ``load_factor``, ``gravity_m_s2[0|1]``, ``density_kg_m3``. Of a rod that leaves
        the plane: each of these, of `Specimen`'s numbers and of the sources', such as
        ``remanence_y_mT[1]``, ``source[0].elevation_deg``, ``gravity_m_s2[2]``.
    s_mm : array_like, shape (n,), optional
        Increasing arc lengths from the clamp; 61 equally spaced ones by default.

    Returns
    -------
    Sensitivities
        At arc lengths that stay fixed: where a length changes, the tip moves on from
        s = L by its tangent besides. The undeformed tip, from which the gap counts,
        moves with it.

    Raises
    ------
    InputError
        If a parameter is unknown or has no meaning for this case, or an arc length lies
        outside the rod.
    SolverError
        If there is no equilibrium, or it stands at a fold.
    """
    field = as_field(field)
    check_case(specimen, field, support)
    names = _names(parameters)
    in_plane = bends_in_plane(specimen, field, support)
    if in_plane:
        solution, u = solve_in_plane(specimen, field, support, POINTS)
    else:
        solution = solve(specimen, field, support=support)
    if solution.centreline is None:
        raise SolverError(
            f"{specimen.name!r} has no equilibrium at this load, so its shape has no "
            f"derivatives; the branch ends at {solution.load_limit:.4g} of the load"
        )
    s = _stations(s_mm, specimen.length_mm)
    if not in_plane:
        return _in_space(solution, (specimen, field, support), names, s)
    if math.isnan(u[0]):
        raise SolverError(
            f"the tip of {specimen.name!r} does not fix its root at this load, which "
            "its derivatives ask for; try a smaller flux_mT or remanence_mT"
        )
    rod = rod_array(specimen, support)
    array = field_array(field, specimen.length_mm)
    of_names = [change_of(name, rod, specimen, field, support) for name in names]
    good, out = _derivatives(rod, array, u, of_names, s / specimen.length_mm)
    if not good or not np.all(np.isfinite(out)):
        raise SolverError(
            f"{specimen.name!r} stands at a fold of its equilibria: its shape has no "
            "derivatives at this load"
        )
    return Sensitivities(
        solution=solution,
        s_mm=s,
        parameters=names,
        dx_mm=out[:, 1] * specimen.length_mm,
        dy_mm=out[:, 2] * specimen.length_mm,
        dz_mm=np.zeros((len(s), len(names))),
        dtheta_rad=out[:, 0].copy(),
    )


def _in_space(
    solution: Solution, case: Case, names: tuple[str, ...], s: Array
) -> Sensitivities:
    positions, tangents, t, error = shape_changes(case, names, s)
    flat = t[:, 0] ** 2 + t[:, 1] ** 2
    turn = t[:, :1] * tangents[:, 1] - t[:, 1:2] * tangents[:, 0]
    return Sensitivities(
        solution=solution, s_mm=s, parameters=names, dx_mm=positions[:, 0],
        dy_mm=positions[:, 1], dz_mm=positions[:, 2],
        dtheta_rad=turn / flat[:, None], error=error,
    )  # fmt: skip


def _derivatives(
    rod: Array, field: Array, u: Array, parameters: Sequence[Change], s: Array
) -> tuple[bool, Array]:
    """Return theta, x and y by parameter, shape (n, 3, p), and whether they exist."""
    blocks = (3 + len(parameters) + 3) // 4
    rods = np.zeros((len(rod), blocks, 4, rod.shape[1]))
    changes = np.zeros((blocks, 4, len(parameters[0].field) if parameters else 1, 6))
    clamps = np.zeros((blocks, 4))
    for column, change in enumerate(parameters, start=3):
        n, a = divmod(column, 4)
        rods[:, n, a] = change.rod
        changes[n, a] = change.field
        clamps[n, a] = change.clamp
    out = np.empty((len(s), 3, 4 * blocks))
    good = parameter_columns(
        rod, field, u, rods, changes, clamps, s, ORDER + 4, STEP, out
    )
    return good, out[:, :, 3 : 3 + len(parameters)]


def _names(parameters: Sequence[str]) -> tuple[str, ...]:
    names = listed(parameters)
    if names is None or not all(isinstance(name, str) for name in names):
        raise InputError(
            "parameters must be a sequence of names such as ['E_MPa[0]', 'side_mm']; "
            f"instead received {shown(parameters)}"
        )
    return names


def _stations(s_mm: ArrayLike | None, length_mm: float) -> Array:
    if s_mm is None:
        return stations(POINTS) * length_mm
    s = real_array(s_mm, "s_mm", "mm")
    if (
        s.ndim != 1
        or len(s) == 0
        or np.any(np.diff(s) < 0.0)
        or s[0] < 0.0
        or s[-1] > length_mm * (1.0 + 1e-12)
    ):
        raise InputError(
            f"s_mm must be arc lengths from 0 to {length_mm:g} mm that do not fall; "
            f"instead received an array of shape {s.shape}"
        )
    return s
