"""The solid in the plane, at small strains: its rows, and its solution."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.errors import InputError
from ...core.specimen import Specimen
from ...core.units import mT_from_T, rad_from_deg
from ..fields import PULLED_IN, STABLE, UNSTABLE, Field, Support, refuse_outside
from ..magnet.flux import flux_at
from ..planar.outcomes import GONE
from ..planar.solver import COARSE_ORDER as START_ORDER
from ..planar.solver import STEP as PLAIN_STEP
from ..planar.solver import failure, solve_planar
from ..scaling import field_array, rod_array, stations, stiffness_Nmm2
from ..solution import Solution
from .constants import joint_share, solid_constants
from .march import (  # fmt: skip
    ALPHA,
    CHI,
    DEEP,
    JOINT,
    RHO,
    SIDE,
    SOFT,
    WIDTH,
    WX,
    WY,
    E,
    G,
    H,
    M,
    T,
)
from .newton import solve_shape

Array = NDArray[np.float64]

LOAD_LIMIT = 900.0
"""Largest P L^2 / EI: beyond, tip angles are too close to the field for differences."""


def solve_in_plane(
    specimen: Specimen, field: Field, support: Support, poisson_ratio: float,
    points: int,
) -> tuple[Solution, float]:  # fmt: skip
    """Return the equilibrium of a solid loaded within the plane, and its strain.

    The strain is the largest at the points and at the root, with that of tension; not
    finite where only the solid has no equilibrium.
    """
    held = _held(specimen, support, poisson_ratio)
    L = held.length_mm
    flux = field_array(field, L)
    clamp = rad_from_deg(support.clamp_angle_deg)
    outcome, _, limit, _, bx, by, moment, _, tip = solve_planar(
        held.plain, flux, clamp, held.margin, stations(61), START_ORDER, PLAIN_STEP
    )
    if outcome > GONE:
        raise failure(outcome, specimen, field, limit)
    load = held.magnetic * math.hypot(bx, by) + held.weight
    _refuse_load(load * held.softest)
    base = np.array([held.turn, held.shift, load])
    if outcome == GONE:
        tip[0] = math.nan
    s = stations(points)
    table = np.empty((4, points))
    index, limit, error, moment = solve_shape(
        held.rod, flux, base, clamp, tip, s, table
    )
    if index < 0:
        gone = Solution(
            centreline=None, status=PULLED_IN, morse_index=-1, error_mm=math.nan,
            flux_tip_mT=(mT_from_T(bx), mT_from_T(by)), root_moment_Nm=0.0,
            load_limit=limit,
        )  # fmt: skip
        return gone, 0.0 if outcome == GONE else math.inf
    x, y, theta, kappa = table
    refuse_outside(field, x, y, L)
    centreline = Centreline._trusted(s * L, x * L, y * L, theta, kappa / L)
    solution = Solution(
        centreline=centreline,
        status=STABLE if index == 0 else UNSTABLE,
        morse_index=index,
        error_mm=error * L,
        flux_tip_mT=_flux_mT(flux, x[-1], y[-1]),
        root_moment_Nm=-moment * held.unit_Nm,
    )
    return solution, _strain(held, s, kappa, load, moment)


class _Held(NamedTuple):
    """A held rod: its arrays (dimensionless, tip first) and what they come to."""

    plain: Array
    rod: Array
    turn: float
    shift: float
    margin: float
    magnetic: float
    weight: float
    softest: float
    stretch: float
    length_mm: float
    unit_Nm: float


@lru_cache(maxsize=256)
def _held(specimen: Specimen, support: Support, poisson_ratio: float) -> _Held:
    """Return what of a solve depends on the rod and its support alone.

    `plain` is the rod as `planar.march` takes it, (n, 5), `rod` as `solid.march` does,
    (n, 14). Then turn and shift of the base per root curvature; half the largest side;
    the largest magnetic load per tesla, and the weight; the largest compliances in
    bending and stretch; and the units.
    """
    plain = rod_array(specimen, support)
    L = specimen.length_mm
    rod = np.zeros((len(plain), WIDTH))
    rod[:, :T] = plain
    sections = specimen.cross_sections[::-1]
    found = [solid_constants(across, poisson_ratio) for across in sections]
    for row, across, constants in zip(rod, sections, found, strict=True):
        side = across.width_mm / L
        row[RHO] = across.in_plane_mm4 / across.area_mm2 / L**2
        row[T] = row[E] * row[RHO]
        row[G] = row[T] * 2.0 * (1.0 + poisson_ratio) / constants.shear
        row[ALPHA] = constants.tension_bending
        row[CHI] = constants.soften[1] * side**2
        row[SIDE] = side
        row[DEEP] = math.sqrt(across.across_mm4 / across.area_mm2) / L
    moduli = [section.E_MPa for section in specimen.sections[::-1]]
    for i in range(len(rod) - 1):
        if sections[i] == sections[i + 1]:
            low, high = sorted(moduli[i : i + 2])
            turn = found[i].turn[1] * rod[i, SIDE]
            rod[i, JOINT] = joint_share(low / high) * turn
            rod[i, SOFT] = max(rod[i, E], rod[i + 1, E])
    root = float(rod[-1, SIDE])
    return _Held(
        plain=plain,
        rod=rod,
        turn=found[-1].turn[1] * root,
        shift=found[-1].shift[1] * root**2,
        margin=0.5 * float(rod[:, SIDE].max()),
        magnetic=float(np.abs(rod[:, M]).max()),
        weight=float(np.hypot(rod[:, WX], rod[:, WY]) @ rod[:, H]),
        softest=float(rod[:, E].max()),
        stretch=float(rod[:, T].max()),
        length_mm=L,
        unit_Nm=stiffness_Nmm2(specimen)[0] / L * 1e-3,
    )


def _refuse_load(load: float) -> None:
    if load > LOAD_LIMIT:
        raise InputError(
            f"the load P L^2 / EI must be below {LOAD_LIMIT:g} for the solid model; "
            f"instead received {load:.3g}: use the plain rod"
        )


def _strain(held: _Held, s: Array, kappa: Array, load: float, moment: float) -> float:
    """Return the largest strain; near the root, where `kappa` is a profile, its own."""
    rod = held.rod[::-1]
    joints = np.cumsum(rod[:, H])[:-1]
    half = 0.5 * rod[np.searchsorted(joints, s, side="right"), SIDE]
    bent = np.abs(kappa * half)[s > rod[0, SIDE]]
    root = 0.5 * abs(moment) * rod[0, E] * rod[0, SIDE]
    return float(np.max(bent, initial=root)) + load * held.stretch


def _flux_mT(flux: Array, x: float, y: float) -> tuple[float, float]:
    out = np.empty(12)
    flux_at(flux, x, y, 0.0, out)
    return mT_from_T(float(out[0])), mT_from_T(float(out[1]))
