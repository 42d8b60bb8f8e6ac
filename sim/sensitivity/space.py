"""Derivatives of shapes in space, by the implicit function theorem.

From a tip (R, r) the march leads to a root, and misses the clamp by G(u, p): no miss,
G = 0, fixes the tip's unknowns u for all parameters p, so du/dp = -G_u^-1 G_p, and the
shape F(u, p) has the derivative F_p + F_u du/dp. All four are differences of the sixth
order of single marches, which have no iteration in them and are smooth to rounding: so
every number that a case has is a parameter. Differences of the fourth order tell how
exact they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.errors import SolverError
from ...core.specimen import Specimen
from ..scaling import field_array
from ..spatial.newton import march_from, solve_rod
from ..spatial.rod import SpatialRod, clamp_of, rod_table
from ..spatial.solver import _steps
from .moved import Case, move_of

Array = NDArray[np.float64]
Tip = tuple[Array, Array, float]

STEP = 4e-3
"""Of the differences, in scales of what is moved."""
SIXTH = np.array([45.0, -9.0, 1.0]) / 60.0
FOURTH = np.array([8.0, -1.0, 0.0]) / 12.0
FINER = 3.0
"""Steps of these marches over those that a solution has at least."""


def shape_changes(
    case: Case, names: Sequence[str], s_mm: Array
) -> tuple[Array, Array, Array, float]:
    """Return the derivatives of a shape in space, which has an equilibrium.

    Returns
    -------
    positions, tangents : ndarray, shape (n, 3, p)
        Derivatives at fixed arc lengths.
    tangent : ndarray, shape (n, 3)
        The tangents themselves.
    error : float
        By which differences of two orders differ, relative to the largest derivative
        by the same parameter.

    Raises
    ------
    InputError
        If a parameter is unknown or has no meaning for this case.
    SolverError
        If the shape stands at a fold.
    """
    tip = _tip(case)
    shape, curvature = _marched(tip, case, np.zeros(6), s_mm)[1:]

    def by_pose(a: int) -> Callable[[float], tuple[Array, Array]]:
        return lambda step: _marched(tip, case, step * np.eye(6)[a], s_mm)[:2]

    ends = [_slope(by_pose(a), STEP) for a in range(6)]
    matrix = np.column_stack([end[0] for end in ends])
    if not np.linalg.cond(matrix) < 1e12:
        raise SolverError(
            f"{case[0].name!r} stands at a fold of its equilibria: its shape has no "
            "derivatives at this load"
        )
    by_tip = np.stack([end[1] for end in ends], axis=-1)
    out = np.empty((len(s_mm), 6, len(names)))
    error = 0.0
    for k, name in enumerate(names):
        move = move_of(name, case)
        grown = _grown(case[0], move.grows, s_mm)

        def by_name(step: float, move=move, grown=grown) -> tuple[Array, Array]:  # type: ignore[no-untyped-def]
            there = s_mm + step * grown
            return _marched(tip, move.moved(step), np.zeros(6), there)[:2]

        misses, shapes, rough = _slope(by_name, STEP * move.scale)
        change = np.linalg.solve(matrix, -misses)
        out[:, :, k] = shapes + by_tip @ change
        out[:, :3, k] -= grown[:, None] * shape[:, 3:]
        out[:, 3:, k] -= grown[:, None] * curvature
        rough += sum(abs(c) * end[2] for c, end in zip(change, ends, strict=True))
        error = max(error, rough / max(np.abs(out[:, :, k]).max(), 1e-300))
    return out[:, :3], out[:, 3:], shape[:, 3:], error


def _slope(
    function: Callable[[float], tuple[Array, Array]], step: float
) -> tuple[Array, Array, float]:
    """Return the derivatives at 0 of miss and shape, and how exact the latter is."""
    shapes, misses = [], []
    for k in (1, 2, 3):
        up, down = function(k * step), function(-k * step)
        misses.append((up[0] - down[0]) / step)
        shapes.append((up[1] - down[1]) / step)
    rough = np.abs(np.tensordot(SIXTH - FOURTH, shapes, 1)).max()
    return (
        np.tensordot(SIXTH, misses, 1), np.tensordot(SIXTH, shapes, 1), float(rough)
    )  # fmt: skip


def _tip(case: Case) -> Tip:
    """Return the tip of the equilibrium, and the steps of marches from it."""
    rod, field, clamp = _arrays(case)
    R, r, s, states = np.empty((3, 3)), np.empty(3), np.zeros(1), np.empty((1, 21))
    n = FINER * _steps(rod, field, clamp[:, 2])
    solve_rod(rod, field, n, clamp, R, r, s, states)
    return R, r, 2.0 * n


def _marched(tip: Tip, case: Case, x: Array, s_mm: Array) -> tuple[Array, Array, Array]:
    """March a case like that of the tip from it, turned and shifted by `x` (6,).

    Returns by how much the root misses the clamp (6,), positions and tangents (n, 6),
    and the tangents' slope (n, 3).
    """
    R, r, n = tip
    rod, field, clamp = _arrays(case)
    L = case[0].length_mm
    states = np.empty((len(s_mm), 21))
    x = np.ascontiguousarray(x)
    miss = march_from(rod, field, n, clamp, R, r, x, s_mm / L, states)
    E = states[:, :9].reshape(-1, 3, 3)
    turn = states[:, 18:] / L
    bend = E[:, :, 0] * turn[:, 1, None] - E[:, :, 1] * turn[:, 0, None]
    return miss, np.hstack([states[:, 12:15] * L, E[:, :, 2]]), bend


def _arrays(case: Case) -> tuple[Array, Array, Array]:
    specimen, field, support = case
    rod = rod_table(SpatialRod.from_specimen(specimen), support)
    return rod, field_array(field, specimen.length_mm), clamp_of(support)


def _grown(specimen: Specimen, section: int | None, s_mm: Array) -> Array:
    """Return how far each station moves on as a section grows by 1 mm."""
    if section is None:
        return np.zeros_like(s_mm)
    start = sum(part.length_mm for part in specimen.sections[:section])
    return np.clip((s_mm - start) / specimen.sections[section].length_mm, 0.0, 1.0)
