"""From rod to solid: a rod that predicts three-dimensional finite elements.

A plain rod is 0.3 to 0.6 % too soft at the tip against a hard-magnetic neo-Hookean
solid whose root face is fixed. Five effects, each a term of the rod's equations, close
the gap; `docs/explanations/solid.md` tells what each is worth and how its constant
was found.

* Stretch EA, and shear k GA with Cowper's k = 10 (1 + nu) / (12 + 11 nu) for rectangles
  (J. Appl. Mech. 33, 335, 1966).
* The magnetic energy is -(1/mu0) (F Br).B: it follows r', stretched and sheared, not
  the unit tangent. The pole reduction stays exact: the load is the traction Br B / mu0
  on the end face, taken at four Gauss points of the face.
* A fixed face cannot contract sideways, so that bending cannot bow it: seen from afar
  the rod starts turned back by c a kappa(0) and shifted by d a^2 kappa(0).
* The same, smaller, at joints where E jumps: c (1 - r)^2 / (1 + 1.4 r) a kappa of the
  softer side, r the ratio of the moduli.
* Second-order elasticity: tension stiffens against bending, bending stretches the axis
  (alpha), and large curvature softens (chi).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.checks import within
from ...core.errors import InputError
from ...core.specimen import Specimen
from ...core.units import mT_from_T, rad_from_deg
from ..fields import (  # fmt: skip
    PULLED_IN,
    STABLE,
    UNSTABLE,
    Field,
    Support,
    as_field,
    check_case,
    check_plain,
    refuse_outside,
)
from ..magnet.flux import flux_at
from ..planar.solver import COARSE_ORDER as START_ORDER
from ..planar.solver import GONE, failure, solve_planar
from ..planar.solver import STEP as PLAIN_STEP
from ..scaling import field_array, rod_array, stations, stiffness_Nmm2
from ..solution import Solution
from .march import (  # fmt: skip
    ALPHA,
    CHI,
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
STRAIN_LIMIT = 0.1
"""Largest axial strain and half-thickness strain for which the expansion is used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolidConstants:
    """What Poisson's ratio makes of a square section (dimensionless).

    Parameters
    ----------
    shear : float
        Cowper's shear coefficient k.
    base_turn, base_shift : float
        The rod starts turned by -base_turn a kappa(0) and shifted by base_shift a^2
        kappa(0), seen from beyond the clamp's end zone.
    stretch_bow : float
        Axial strain per a^2 kappa^2 in bending without tension.
    soften : float
        Increase of curvature per a^2 kappa^2 at a given moment.
    """

    shear: float
    base_turn: float
    base_shift: float
    stretch_bow: float
    soften: float


def solid_constants(poisson_ratio: float) -> SolidConstants:
    """Return the constants of a square prism.

    Parameters
    ----------
    poisson_ratio : float
        From 0 to 0.5.

    Raises
    ------
    InputError
        If it lies outside.

    Notes
    -----
    `base_turn` and `base_shift` fit linear finite elements of a fixed face (Q2/P-1
    hexahedra, graded to 0.01 a, eleven ratios from 0 to 0.499) to 0.03 % and 0.6 %;
    `stretch_bow` and `soften` fit neo-Hookean pure bending to kappa a = 0.05 at six
    ratios, to 0.1 % and 1 %. At 0 the fixed face does nothing; at 0.49 the turn is
    0.0647, at 0.45 0.0534, at 0.3 0.0224.
    """
    nu = within(poisson_ratio, 0.0, 0.5, "poisson_ratio", "")
    return SolidConstants(
        shear=10.0 * (1.0 + nu) / (12.0 + 11.0 * nu),
        base_turn=nu**2 * (0.23629 + nu * (0.04322 + nu * (-0.09383 + nu * 0.29469))),
        base_shift=nu * (0.008882 + nu * (0.026715 - nu * 0.003997)),
        stretch_bow=0.064892 + nu * (0.212961 - nu * 0.185333),
        soften=0.32504 + nu * (-0.61351 + nu * (1.32821 - nu * 1.00537)),
    )


def joint_turn(poisson_ratio: float, E_ratio: float) -> float:
    """Return how far a joint turns, per a kappa of its softer side.

    Parameters
    ----------
    poisson_ratio : float
        From 0 to 0.5.
    E_ratio : float
        Softer over stiffer modulus, 0 to 1: 0 is a rigid neighbour, the clamp.

    Notes
    -----
    The factor 1.4 fits linear finite elements of two blocks at moduli 1 to 1.33, 1.5,
    2, 3 and 10 within 4 % of the turn of the clamp.
    """
    within(E_ratio, 0.0, 1.0, "E_ratio", "")
    clamp = solid_constants(poisson_ratio).base_turn
    return clamp * (1.0 - E_ratio) ** 2 / (1.0 + 1.4 * E_ratio)


def solve_solid(
    specimen: Specimen,
    field: Field,
    *,
    support: Support | None = None,
    poisson_ratio: float = 0.49,
    points: int = 61,
) -> Solution:
    """Return the equilibrium of the solid, as `solve` does of the plain rod.

    Parameters
    ----------
    specimen, field, support, points
        As of `solve`; weight and magnet within the plane.
    poisson_ratio : float
        Of all sections, from 0 to 0.5.

    Returns
    -------
    Solution
        `s_mm` of the centreline counts undeformed material, so that its length along
        the curve differs from `length_mm` by the stretch; `theta_rad` is the direction
        of the deformed axis, `kappa_per_mm` its derivative by `s_mm`.

    Raises
    ------
    InputError
        If the load is not planar, the load or the strain is beyond the model, or the
        ratio is not from 0 to 0.5.
    SolverError
        If no answer was found that could be vouched for.
    """
    support = support or Support()
    field = as_field(field)
    check_case(specimen, field, support)
    check_plain(specimen)
    if specimen.shape != "square":
        raise InputError(
            "the solid model takes square rods; instead received shape "
            f"{specimen.shape!r}: use model 'rod'"
        )
    _refuse_spatial(field, support)
    ratio = within(poisson_ratio, 0.0, 0.5, "poisson_ratio", "")
    held = _held(specimen, support, ratio)
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
    else:
        _refuse_strain(held, load, moment)
    s = stations(points)
    table = np.empty((4, points))
    index, limit, error, moment = solve_shape(
        held.rod, flux, base, clamp, tip, s, table
    )
    if index < 0:
        return Solution(
            centreline=None, status=PULLED_IN, morse_index=-1, error_mm=math.nan,
            flux_tip_mT=(mT_from_T(bx), mT_from_T(by)), root_moment_Nm=0.0,
            load_limit=limit,
        )  # fmt: skip
    _refuse_strain(held, load, moment)
    x, y, theta, kappa = table
    refuse_outside(field, x, y, L)
    centreline = Centreline._trusted(s * L, x * L, y * L, theta, kappa / L)
    return Solution(
        centreline=centreline,
        status=STABLE if index == 0 else UNSTABLE,
        morse_index=index,
        error_mm=error * L,
        flux_tip_mT=_flux_mT(flux, x[-1], y[-1]),
        root_moment_Nm=-moment * held.unit_Nm,
    )


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
    root: float
    length_mm: float
    unit_Nm: float


@lru_cache(maxsize=256)
def _held(specimen: Specimen, support: Support, poisson_ratio: float) -> _Held:
    """Return what of a solve depends on the rod and its support alone.

    `plain` is the rod as `planar.march` takes it, (n, 5), `rod` as `solid.march` does,
    (n, 13). Then turn and shift of the base per root curvature; half the largest side;
    the largest magnetic load per tesla, and the weight; the largest compliances in
    bending and stretch; strain at the root's surface per moment; and the units.
    """
    constants = solid_constants(poisson_ratio)
    plain = rod_array(specimen, support)
    L = specimen.length_mm
    sides = np.array(specimen.sides_mm[::-1]) / L
    rod = np.zeros((len(plain), WIDTH))
    rod[:, :T] = plain
    rod[:, T] = rod[:, E] * sides**2 / 12.0
    rod[:, G] = rod[:, T] * 2.0 * (1.0 + poisson_ratio) / constants.shear
    rod[:, ALPHA] = 24.0 * constants.stretch_bow
    rod[:, RHO] = sides**2 / 12.0
    rod[:, CHI] = constants.soften * sides**2
    rod[:, SIDE] = sides
    moduli = [section.E_MPa for section in specimen.sections[::-1]]
    for i in range(len(rod) - 1):
        if sides[i] == sides[i + 1]:
            low, high = sorted(moduli[i : i + 2])
            rod[i, JOINT] = joint_turn(poisson_ratio, low / high) * sides[i]
            rod[i, SOFT] = max(rod[i, E], rod[i + 1, E])
    return _Held(
        plain=plain,
        rod=rod,
        turn=constants.base_turn * float(sides[-1]),
        shift=constants.base_shift * float(sides[-1]) ** 2,
        margin=0.5 * float(sides.max()),
        magnetic=float(np.abs(rod[:, M]).max()),
        weight=float(np.hypot(rod[:, WX], rod[:, WY]) @ rod[:, H]),
        softest=float(rod[:, E].max()),
        stretch=float(rod[:, T].max()),
        root=float(rod[-1, E] * sides[-1]) / 2.0,
        length_mm=L,
        unit_Nm=stiffness_Nmm2(specimen)[0] / L * 1e-3,
    )


def _refuse_load(load: float) -> None:
    if load > LOAD_LIMIT:
        raise InputError(
            f"the load P L^2 / EI must be below {LOAD_LIMIT:g} for the solid model; "
            f"instead received {load:.3g}: use the plain rod"
        )


def _refuse_strain(held: _Held, load: float, moment: float) -> None:
    stretch = load * held.stretch
    bending = abs(moment) * held.root
    if max(stretch, bending) > STRAIN_LIMIT:
        raise InputError(
            f"strains must be below {STRAIN_LIMIT:g} for the solid model; instead "
            f"received {stretch:.2g} along and {bending:.2g} in bending: the rod is "
            "too thick or too soft for a rod model"
        )


def _refuse_spatial(field: Field, support: Support) -> None:
    if not support.in_plane or not field.in_plane:
        raise InputError(
            "the solid model takes magnets and weight within the plane z = 0; instead "
            f"received gravity_m_s2 {support.gravity_m_s2} m/s2 and {field}: use "
            "model 'rod'"
        )


def _flux_mT(flux: Array, x: float, y: float) -> tuple[float, float]:
    out = np.empty(12)
    flux_at(flux, x, y, 0.0, out)
    return mT_from_T(float(out[0])), mT_from_T(float(out[1]))
