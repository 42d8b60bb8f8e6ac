"""An independent check in space: least energy of a rod by its curvature.

Nothing is shared with the march of `spatial`: no free tip, no pole load, no pose of the
tip as the unknown. The curvature at the Gauss points of elements is made stationary by
Newton's method with the exact Hessian (`curvature`), whose negative eigenvalues are the
Morse index. With p points an element the tip converges with order 2 p; elements are
halved until the last coefficients of the curvature's polynomials are rounding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...core.checks import listed, shown, vector, whole
from ...core.errors import InputError, SolverError
from ...core.sources import FLUX_LIMIT_T, Uniform
from ...core.specimen import Specimen
from ...core.units import rad_from_deg
from ..fields import Field, Support, as_field
from ..spatial.rod import SpatialRod
from .curvature import Case, cross_matrix, pose
from .quadrature import Quadrature

Array = NDArray[np.float64]

MOST_POINTS = 20
"""Of an element: more leave no more than rounding."""
ALL_POINTS = 600
"""About as many are spent on a rod: the Hessian is dense."""
ROUNDING, ROUGH = 1e-11, 1e-5
"""Last turn of an element's polynomial, in rad, that is enough; on the way there."""
SHORTEST, SHORT = 1e-7, 1e-4
"""Step of the load at which a branch ends; too short to jump to another branch."""
NEAR = 0.1
"""First correction, in rad, of a step of the load."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpatialCheck:
    """An equilibrium of the discretised rod in space.

    Parameters
    ----------
    s_mm : ndarray, shape (q,)
        Arc length of the Gauss points.
    r_mm : ndarray, shape (q, 3)
        Positions there.
    directors : ndarray, shape (q, 3, 3)
        Rows d1, d2 and d3 (the tangent).
    curvature_per_mm : ndarray, shape (q, 3)
        Curvature about d1, d2 and twist about d3.
    tip_mm : tuple of float
        Tip position, in mm.
    energy_J : float
        Elastic plus magnetic energy plus that of the weight.
    error_mm : float
        What the polynomials' last coefficients may move the tip by.
    load : float
        Fraction of the load: below 1 where the branch from zero load ends.
    """

    s_mm: Array
    r_mm: Array
    directors: Array
    curvature_per_mm: Array
    tip_mm: tuple[float, float, float]
    energy_J: float
    error_mm: float
    load: float
    case: Case

    @property
    def morse_index(self) -> int:
        """Number of unstable directions: negative eigenvalues of the Hessian."""
        H = self.case.derivatives(self.curvature_per_mm, self.load)[1]
        return _index(self.case.grid, H)

    def at(self, s_mm: Array) -> Array:
        """Return the positions (n, 3) in mm at any arc lengths."""
        grid = self.case.grid
        edges = np.union1d(grid.edges, s_mm)
        fine = Quadrature.of(edges, len(grid.xi))
        k = grid.at(self.curvature_per_mm, fine.s)
        return pose(fine, self.case.clamp, k).joints[np.searchsorted(edges, s_mm)]


def check_spatial(
    rod: SpatialRod | Specimen,
    field: Field | Sequence[float],
    *,
    support: Support | None = None,
    points: int | None = None,
    elements: int = 1,
    start: tuple[Array, Array] | None = None,
) -> SpatialCheck:
    """Return an equilibrium of the discretised rod in space.

    Parameters
    ----------
    rod, field, support
        As of `solve_spatial`.
    points, elements : int, optional
        Gauss points of an element, and elements a section. Without `points` as many
        elements of many points as it takes.
    start : tuple of ndarray, optional
        s_mm (n,) and curvature_per_mm (n, 3) to start from. Else the equilibrium is
        followed from no load; where that branch ends, its last one is returned.

    Raises
    ------
    InputError
        If a value cannot be, or a weight has no density.
    SolverError
        If Newton's method does not converge.
    """
    support = support or Support()
    if not isinstance(rod, (SpatialRod, Specimen)) or not isinstance(support, Support):
        raise InputError(
            "rod must be a SpatialRod or a Specimen and support a Support; instead "
            f"received {shown(rod)} and {shown(support)}"
        )
    elements = whole(elements, 1, 1000, "elements")
    refines = points is None
    if points is None:
        points = ALL_POINTS // (elements * len(rod.sections))
        points = max(2, min(MOST_POINTS, points))
    points = whole(points, 1, MOST_POINTS, "points")
    grid = Quadrature.of(_edges(rod, elements), points)
    case = Case(rod, _field(field), support, _clamp(support), grid)
    case, k, load = _follow(case, refines) if start is None else _near(case, start)
    if refines:
        case, k = _refined(case, k, load, ROUNDING)
    return _found(case, k, load)


def untwisted(s_mm: Array, r_mm: Array, support: Support) -> tuple[Array, Array]:
    """Return a start: arc lengths (n,), and what curvature bends a rod along points.

    Of the many that do, the one without twist (parallel transport of the directors).
    """
    chords = np.diff(r_mm, axis=0)
    R = _clamp(support)
    turns = np.zeros_like(chords)
    for turn, chord in zip(turns, chords, strict=True):
        t = chord / np.linalg.norm(chord)
        axis, cos = np.cross(R[:, 2], t), R[:, 2] @ t
        turn[:] = R.T @ axis
        V = cross_matrix(axis)
        R = R + V @ R + V @ V @ R / (1.0 + cos)
    step = np.diff(s_mm)
    return s_mm[:-1], turns / (0.5 * (step + np.append(0.0, step[:-1])))[:, None]


def _field(given: Field | Sequence[float]) -> Field:
    numbers = given if isinstance(given, np.ndarray) else listed(given)
    if numbers is None or any(hasattr(one, "kind") for one in numbers):
        return as_field(given)
    limit_mT = FLUX_LIMIT_T * 1e3
    what = "flux_mT (a field, or three floats)"
    x, y, z = vector(numbers, what, "mT", limit_mT)
    return as_field(
        Uniform(
            flux_mT=math.hypot(x, y, z), angle_deg=math.degrees(math.atan2(y, x)),
            elevation_deg=math.degrees(math.atan2(z, math.hypot(x, y))),
        )
    )  # fmt: skip


def _clamp(support: Support) -> Array:
    angle = rad_from_deg(support.clamp_angle_deg)
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    return np.column_stack([np.cross(up, along), up, along])


def _edges(rod: SpatialRod | Specimen, elements: int) -> Array:
    joints = np.cumsum([0.0, *(part.length_mm for part in rod.sections)])
    fine = [np.linspace(a, b, elements + 1)[:-1] for a, b in pairwise(joints)]
    return np.concatenate([*fine, joints[-1:]])


def _found(case: Case, k: Array, load: float) -> SpatialCheck:
    at = case.pose(k)
    x_mm, y_mm, z_mm = at.joints[-1].tolist()
    return SpatialCheck(
        s_mm=case.grid.s, r_mm=at.r, directors=at.R.transpose(0, 2, 1),
        curvature_per_mm=k, tip_mm=(x_mm, y_mm, z_mm),
        energy_J=case.energy(k, load) * 1e-3,
        error_mm=float(case.length_mm * _rest_turns(case.grid, k).sum()),
        load=load, case=case,
    )  # fmt: skip


def _index(grid: Quadrature, H: Array) -> int:
    """Count the negative eigenvalues, of the Hessian by curvature times root weight."""
    try:
        np.linalg.cholesky(H)
    except np.linalg.LinAlgError:
        scale = np.repeat(np.sqrt(grid.weight), 3)
        return int(np.sum(np.linalg.eigvalsh(H / scale / scale[:, None]) < 0.0))
    return 0


def _rest_turns(grid: Quadrature, k: Array) -> Array:
    """Return by how much the last coefficients of elements turn them, in rad."""
    last = np.abs(grid.coefficients(k)[:, -2:]).max(axis=(1, 2))
    turns: Array = 2.0 * grid.half * last
    return turns


def _refined(case: Case, k: Array, load: float, enough: float) -> tuple[Case, Array]:
    """Halve elements until the turns that polynomials leave are small enough."""
    while True:
        grid = case.grid
        turns = _rest_turns(grid, k)
        coarse = turns > enough * (1.0 + 2.0 * grid.half * np.abs(k).max())
        most = ALL_POINTS // len(grid.xi)
        if not coarse.any() or len(turns) + coarse.sum() > most:
            return case, k
        middle = 0.5 * (grid.edges[1:] + grid.edges[:-1])
        edges = np.sort(np.concatenate([grid.edges, middle[coarse]]))
        fine = case.on(Quadrature.of(edges, len(grid.xi)))
        found = _newton(fine, grid.at(k, fine.grid.s), load)
        if found is None:
            return case, k
        case, k = fine, found[0]


def _newton(
    case: Case, k: Array, load: float, first: float = np.inf, damp: float = np.inf
) -> tuple[Array, Array] | None:
    """Return the stationary curvature near k and the last Hessian, or None.

    The first correction must turn the rod by less than `first`, in rad, and the next
    shrink; with `damp`, steps are cut to turns of that size instead.
    """
    weight, before = case.grid.weight, np.inf
    for _ in range(60):
        try:
            gradient, H = case.derivatives(k, load)
            change = np.linalg.solve(H, -gradient.ravel()).reshape(-1, 3)
        except (InputError, np.linalg.LinAlgError):  # inside a source
            return None
        size = float(weight @ np.linalg.norm(change, axis=1))
        if not np.isfinite(size) or size > first:
            return None
        if damp == np.inf and size > 0.5 * before and size > 1e-8:
            return None
        k = k + change * min(1.0, damp / max(size, 1e-300))
        after = size * min(1.0, size / before) if np.isfinite(before) else size
        if after < 1e-12 or (size < 1e-8 and size > 0.3 * before):
            return k, H
        before = size
    return None


def _near(case: Case, start: tuple[Array, Array]) -> tuple[Case, Array, float]:
    s_mm, curvature = start
    k = np.column_stack([np.interp(case.grid.s, s_mm, one) for one in curvature.T])
    found = _newton(case, k, 1.0, damp=0.5)
    if found is None:
        raise SolverError(
            "the check solver found no equilibrium near the solution given; the "
            "solution is not verified"
        )
    return case, found[0], 1.0


def _follow(case: Case, refines: bool) -> tuple[Case, Array, float]:
    """Follow the equilibrium from no load; return it where it is full, or ends.

    As the index changes at single loads only, a step over which it changes is taken
    again in halves until it is too short to have jumped to another branch.
    """
    k, load, jump, index = case.rest.copy(), 0.0, 0.125, 0
    secant = np.zeros_like(k)
    while load < 1.0 and jump > SHORTEST:
        jump = min(jump, 1.0 - load)
        ahead = 1.0 if jump == 1.0 - load else load + jump
        found = _newton(case, k + jump * secant, ahead, first=NEAR)
        there = -1 if found is None else _index(case.grid, found[1])
        if found is None or (there != index and jump > SHORT):
            jump *= 0.5
            continue
        before, grid, old = k, case.grid, load
        k, load, index = found[0], ahead, there
        if refines:
            case, k = _refined(case, k, load, ROUGH)
            before = grid.at(before, case.grid.s)
        secant = (k - before) / (load - old)
        jump *= 2.0
    return case, k, load
