"""The rod in space: weight in any direction, magnets off the plane, tilted moments.

Kirchhoff rod with straight or curved rest shape, sections of rectangular or round
profile (EI about both axes, GJ by Saint-Venant's series), marched from the free tip.
The magnetisation along the axis acts as a pole load, exactly; its transverse part as
distributed torque and force with the field's closed-form gradient.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.checks import shown, vector, whole
from ...core.errors import InputError, SolverError
from ...core.jit import plain_first
from ...core.sources import FLUX_LIMIT_T
from ...core.specimen import Specimen
from ...core.units import mT_from_T
from ..fields import (
    PULLED_IN,
    STABLE,
    UNSTABLE,
    Field,
    Support,
    as_field,
    gap_of,
    refuse_outside,
)
from ..magnet.flux import UNIFORM, WIDTH, flux_at
from ..planar.contact import load_before_touching, touches
from ..planar.ends import end_of
from ..scaling import MOST_POINTS, field_array, stations
from ..solution import Ending, Solution
from .law import axis
from .march import AXIAL, K1, K3, MU1, MU2, WX, WY, WZ, H, loads_on
from .newton import LOST, solve_rod
from .rod import SpatialRod, SpatialSection, Vector, clamp_of, rod_table
from .rows import REACH_LIMIT, TURN_LIMIT

__all__ = ["SpatialRod", "SpatialSection", "SpatialSolution", "solve_spatial"]

Array = NDArray[np.float64]

LOADS = [AXIAL, MU1, MU2, WX, WY, WZ]
"""Columns of the rod's table that are loads."""

PLACE = [12, 13, 14, 2, 5, 8]
"""Position and tangent among a station's numbers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpatialSolution:
    """The equilibrium in space that the rod reaches when its load grows from zero.

    Parameters
    ----------
    s_mm : ndarray, shape (n,)
        Arc length; empty where there is no equilibrium, as the arrays below.
    r_mm : ndarray, shape (n, 3)
        Positions in the specimen frame.
    directors : ndarray, shape (n, 3, 3)
        Rows d1, d2 and d3 (the tangent) in the specimen frame.
    curvature_per_mm : ndarray, shape (n, 3)
        Curvature about d1, d2 and twist about d3.
    status, morse_index, error_mm, load_limit, ending
        As of `Solution`; the index counts unstable directions in space.
    flux_tip_mT : tuple of float
        Flux density (x, y, z) at the tip.
    root_moment_Nm : tuple of float
        Moment (x, y, z) at the clamp.
    """

    s_mm: Array
    r_mm: Array
    directors: Array
    curvature_per_mm: Array
    status: str
    morse_index: int
    error_mm: float
    flux_tip_mT: Vector
    root_moment_Nm: Vector
    load_limit: float = 1.0
    ending: Ending | None = None

    @property
    def tangent(self) -> Array:
        """Unit tangents, shape (n, 3)."""
        return self.directors[:, 2]

    def seen_from_above(self) -> Solution:
        """Return what the top camera sees: x, y, and the angle of the view's curve.

        `s_mm` stays the arc length of the rod in space, longer than that of its view;
        `kappa_per_mm` is the derivative of the view's angle by it.
        """
        centreline = None
        if len(self.s_mm):
            t = self.tangent
            slope = np.cross(self._turn(), t)
            flat = t[:, 0] ** 2 + t[:, 1] ** 2
            if np.any(flat < 1e-12):
                raise SolverError(
                    "the rod points at the camera somewhere: its view from above has "
                    "no angle there; use the shape in space (solve_spatial)"
                )
            centreline = Centreline(
                s_mm=self.s_mm,
                x_mm=self.r_mm[:, 0],
                y_mm=self.r_mm[:, 1],
                theta_rad=np.unwrap(np.arctan2(t[:, 1], t[:, 0])),
                kappa_per_mm=(t[:, 0] * slope[:, 1] - t[:, 1] * slope[:, 0]) / flat,
            )
        return Solution(
            centreline=centreline, status=self.status, morse_index=self.morse_index,
            error_mm=self.error_mm, flux_tip_mT=self.flux_tip_mT[:2],
            root_moment_Nm=self.root_moment_Nm[2], load_limit=self.load_limit,
            stable_in_space=self.morse_index == 0 if centreline else None,
            z_mm=self.r_mm[:, 2].copy() if centreline else None, ending=self.ending,
        )  # fmt: skip

    def _turn(self) -> Array:
        """Darboux vector in the specimen frame, shape (n, 3)."""
        turn: Array = np.einsum("nk,nki->ni", self.curvature_per_mm, self.directors)
        return turn

    def to_csv(self) -> str:
        """Return the shape as CSV: s, x, y, z, tangent, curvatures; 15 digits."""
        names = "s_mm,x_mm,y_mm,z_mm,tx,ty,tz,kappa1_per_mm,kappa2_per_mm,twist_per_mm"
        table = np.column_stack(
            [self.s_mm, self.r_mm, self.tangent, self.curvature_per_mm]
        )
        rows = (",".join(f"{value:.15g}" for value in row) for row in table)
        return "\n".join([names, *rows]) + "\n"


@plain_first(solve_rod)
def solve_spatial(
    rod: SpatialRod | Specimen,
    field: Field | Sequence[float],
    *,
    support: Support | None = None,
    points: int = 61,
) -> SpatialSolution:
    """Return the equilibrium in space.

    Parameters
    ----------
    rod : SpatialRod or Specimen
        The rod.
    field : UniformField, MagnetField or three floats
        Three floats are a uniform flux density (x, y, z) in mT.
    support : Support, optional
        Clamp angle, weight (any direction), load factor.
    points : int
        Number of points of the shape, equally spaced from clamp to tip.

    Raises
    ------
    InputError
        If a value cannot be, the load is out of range, the weight lacks a density, or
        the undeformed rod would touch the magnet.
    SolverError
        If the rod is drawn to where its load is too large to tell how it ends.

    Examples
    --------
    >>> from magbend.sim import UniformField, gmc
    >>> tip = solve_spatial(gmc(2), UniformField(flux_mT=50.0)).r_mm[-1]
    >>> [round(float(value), 5) for value in tip]
    [29.53532, 4.70952, 0.0]
    """
    support = support or Support()
    if not isinstance(rod, (SpatialRod, Specimen)) or not isinstance(support, Support):
        raise InputError(
            "rod must be a SpatialRod or a Specimen and support a Support; instead "
            f"received {shown(rod)} and {shown(support)}"
        )
    points = whole(points, 2, MOST_POINTS, "points")
    table, margin, length_mm, unit_Nmm = _held(rod, support)
    return solve_table(table, margin, length_mm, unit_Nmm, field, support, points)


def solve_table(
    table: Array, margin: float, length_mm: float, unit_Nmm: float,
    field: Field | Sequence[float], support: Support, points: int,
    laws: Array | None = None,
) -> SpatialSolution:  # fmt: skip
    """Return the equilibrium of a rod as the kernels take it, tip first.

    Parameters
    ----------
    table : ndarray, shape (n, 13) or wider
        As of `rod_table`; wider, of a solid (`law`).
    margin : float
        Half its largest side over its length.
    length_mm, unit_Nmm : float
        Its length, and its unit of moments.
    field, support, points
        As of `solve_spatial`.
    laws : ndarray, optional
        Of a solid, in the place of each row the section whose law tells the curvature.
    """
    L, clamp = length_mm, clamp_of(support)
    flux = _flux_array(field, L)
    s = stations(points)
    unloaded = _unloaded(table, clamp, s)
    if flux[0] != UNIFORM and touches(flux, margin, s, unloaded):
        raise InputError(
            "gap_mm (or centre_mm) must leave the undeformed rod clear of the magnet, "
            f"with half its side to spare; instead received {gap_of(field)}"
        )
    n = _steps(table, flux, unloaded[-1, :3])
    rest = flux, n, clamp, margin, s
    index, load, error, states = _equilibrium(table, *rest)
    if index == LOST:
        way_out = "a weaker field" if flux[0] == UNIFORM else "a larger gap_mm"
        raise SolverError(
            f"the rod comes to a place where its load is too large for the march: "
            f"followed up to {load:.3g} of its load, it may be pulled in or not; give "
            f"{way_out}, or use `solve` where all lies within the plane"
        )
    if index < 0:

        def shape_at(part: float) -> Array | None:
            less = table.copy()
            less[:, LOADS] *= part
            found, _, _, states = _equilibrium(less, *rest)
            return states[:, PLACE[:3]].T.copy() if found >= 0 else None

        load = load_before_touching(load, lambda part: shape_at(part) is not None)
        end = end_of(shape_at, load, flux, margin, L)
        return replace(_gone(flux, L, load, unloaded[-1]), ending=end)
    if not _is_vector(field):
        x, y, z = states[:, 12:15].T
        refuse_outside(as_field(field), x, y, L, z)
    solution = _solution(L, unit_Nmm * 1e-3, flux, s, states, index, error)
    if laws is not None:
        joints = np.cumsum(table[::-1, H])[:-1]
        rows = laws[::-1][np.searchsorted(joints, s, side="right")]
        directors, curvature = np.empty((points, 3, 3)), np.empty((points, 3))
        axis(rows, states[:, :18], directors, curvature)
        return replace(solution, directors=directors, curvature_per_mm=curvature / L)
    return solution


def _unloaded(table: Array, clamp: Array, s: Array) -> Array:
    """Return positions and tangents of the unloaded rod, shape (n, 6)."""
    direction = clamp[:, 2].copy()
    if not table[:, K1 : K3 + 1].any():
        line = np.empty((len(s), 6))
        line[:, :3] = s[:, None] * direction
        line[:, 3:] = direction
        return line
    bare, nothing = table.copy(), np.zeros(WIDTH)
    bare[:, LOADS] = 0.0
    n = _steps(bare, nothing, direction)
    R, r, states = np.empty((3, 3)), np.empty(3), np.empty((len(s), 21))
    solve_rod(bare, nothing, n, clamp, R, r, s, states)
    return states[:, PLACE]


def _equilibrium(
    table: Array, flux: Array, n: float, clamp: Array, margin: float, s: Array
) -> tuple[int, float, float, Array]:
    """Return Morse index (-1: none clear of the magnet), load, error and states."""
    R, r = np.empty((3, 3)), np.empty(3)
    states = np.empty((len(s), 21))
    index, load, error = solve_rod(table, flux, n, clamp, R, r, s, states)
    near = index >= 0 and flux[0] != UNIFORM
    if near and touches(flux, margin, s, states[:, PLACE]):
        index = -1
    return index, load, error, states


@lru_cache(maxsize=256)
def _held(
    rod: SpatialRod | Specimen, support: Support
) -> tuple[Array, float, float, float]:
    """Return a rod's table for the kernels, margin, length, and unit of moments."""
    if isinstance(rod, Specimen):
        rod = SpatialRod.from_specimen(rod)
    sides = [min(part.width_mm, part.height_mm) for part in rod.sections]
    L = rod.length_mm
    unit_Nmm = rod.sections[0].stiffness_Nmm2[1] / L
    return rod_table(rod, support), 0.5 * max(sides) / L, L, unit_Nmm


def _flux_array(field: Field | Sequence[float], length_mm: float) -> Array:
    if not _is_vector(field):
        return field_array(
            as_field(field, "or three floats (x, y, z) in mT"), length_mm
        )
    what = "flux_mT (a field, or three floats)"
    flux_mT = vector(field, what, "mT", FLUX_LIMIT_T * 1e3)  # type: ignore[arg-type]
    out = np.zeros(WIDTH)
    out[1:4] = np.array(flux_mT) * 1e-3
    return out


def _is_vector(field: Any) -> bool:
    """Tell three numbers from a field and from sources."""
    if isinstance(field, np.ndarray):
        return True
    listing = isinstance(field, (tuple, list))
    return listing and not any(hasattr(one, "kind") for one in field)  # type: ignore[index]


def _steps(table: Array, flux: Array, tip: Array) -> float:
    """Return steps per length of the rod; refuse loads beyond the march's reach."""
    reach, turns = loads_on(table, flux, tip)
    if reach > REACH_LIMIT:
        raise InputError(
            f"the load on the rod must be below {REACH_LIMIT**2:g} times its stiffness "
            f"EI / L^2; instead received {reach**2:.3g} times: check the units of "
            "E_MPa, remanence_mT and flux"
        )
    if turns > TURN_LIMIT:
        raise InputError(
            "rest_curvature_per_mm must turn the whole rod by less than "
            f"{TURN_LIMIT:g} rad; instead received {turns:.3g} rad"
        )
    return 5.0 + 9.0 * float(reach) + 4.0 * float(turns)


def _gone(flux: Array, length_mm: float, load: float, tip: Array) -> SpatialSolution:
    none = np.zeros((0, 3))
    return SpatialSolution(
        s_mm=np.zeros(0), r_mm=none, directors=np.zeros((0, 3, 3)),
        curvature_per_mm=none, status=PULLED_IN, morse_index=-1,
        error_mm=math.nan, flux_tip_mT=_flux_mT(flux, tip),
        root_moment_Nm=(0.0, 0.0, 0.0), load_limit=load,
    )  # fmt: skip


def _flux_mT(flux: Array, point: Array) -> Vector:
    b = np.zeros(12)
    flux_at(flux, point[0], point[1], point[2], b)
    return mT_from_T(b[0]), mT_from_T(b[1]), mT_from_T(b[2])


def _solution(
    L: float, unit_Nm: float, flux: Array, s: Array, states: Array, index: int,
    error: float,
) -> SpatialSolution:  # fmt: skip
    moment = states[0, :9].reshape(3, 3) @ states[0, 9:12] * unit_Nm
    return SpatialSolution(
        s_mm=s * L,
        r_mm=states[:, 12:15] * L,
        directors=states[:, :9].reshape(-1, 3, 3).transpose(0, 2, 1),
        curvature_per_mm=states[:, 18:] / L,
        status=STABLE if index == 0 else UNSTABLE,
        morse_index=index,
        error_mm=error * L,
        flux_tip_mT=_flux_mT(flux, states[-1, 12:15]),
        root_moment_Nm=(float(moment[0]), float(moment[1]), float(moment[2])),
    )
