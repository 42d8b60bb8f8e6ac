"""From specimens and fields to the dimensionless arrays of the planar kernels."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import ParamSpec

import numpy as np
from numpy.typing import NDArray

from ..core.checks import whole
from ..core.errors import InputError
from ..core.specimen import Specimen
from ..core.units import MU0, T_from_mT, rad_from_deg
from .fields import FLUX_LIMIT_T, Field, MagnetField, Support, UniformField
from .magnet.field import BLOCK_SIZE, magnet_block
from .planar.march import CUBOID, UNIFORM

Array = NDArray[np.float64]
P = ParamSpec("P")

MOST_POINTS = 1_000_000
"""Of one shape."""


def array_cache(maxsize: int) -> Callable[[Callable[P, Array]], Callable[P, Array]]:
    """Keep the arrays that a function returns, and hand out copies.

    A caller may write into his copy. Handing out the array itself, read-only, would
    make numba compile every kernel once more, for another type.
    """

    def decorate(function: Callable[P, Array]) -> Callable[P, Array]:
        kept = lru_cache(maxsize)(function)

        @wraps(function)
        def copy(*args: P.args, **kwargs: P.kwargs) -> Array:
            return kept(*args, **kwargs).copy()  # type: ignore[arg-type]

        return copy

    return decorate


@lru_cache(maxsize=256)
def stiffness_Nmm2(specimen: Specimen) -> tuple[float, ...]:
    """Return the bending stiffness E a^4 / 12 of each section, root first, in N mm2."""
    return tuple(
        section.E_MPa * side**4 / 12.0
        for section, side in zip(specimen.sections, specimen.sides_mm, strict=True)
    )


@array_cache(maxsize=256)
def rod_array(specimen: Specimen, support: Support) -> Array:
    """Return the rod as the kernels take it, tip first (see `planar.march`).

    Raises
    ------
    InputError
        If weight is asked for and the specimen has no density, or a remanence is above
        30 T.
    """
    length_mm = specimen.length_mm
    EI = stiffness_Nmm2(specimen)
    per_N = length_mm**2 / EI[0]
    gx, gy, _ = support.gravity_m_s2
    density = checked_density(specimen, support)
    rows = []
    for section, side, remanence_mT, stiffness in zip(
        specimen.sections, specimen.sides_mm, specimen.remanences_mT, EI, strict=True
    ):
        if abs(remanence_mT) > FLUX_LIMIT_T * 1e3:
            raise InputError(
                f"remanence_mT must be within {FLUX_LIMIT_T * 1e3:g} mT; instead "
                f"received {remanence_mT!r}"
            )
        # A in mm2 times B_r in mT over mu0 is m in 1e-9 A m; m B is a force in N.
        moment_Am = side**2 * remanence_mT * 1e-9 / MU0
        weight_N = density * side**2 * length_mm * 1e-9
        rows.append(
            (
                section.length_mm / length_mm,
                EI[0] / stiffness,
                support.load_factor * moment_Am * per_N,
                weight_N * gx * per_N,
                weight_N * gy * per_N,
            )
        )
    rod = np.array(rows[::-1], dtype=np.float64)
    if not np.all(np.isfinite(rod)):
        raise InputError(
            "the specimen's sizes in mm and moduli in MPa must be of comparable size; "
            f"instead received a rod of {length_mm!r} mm whose loads overflow"
        )
    return rod


def checked_density(specimen: Specimen, support: Support) -> float:
    """Return the density where weight acts, 0 where it does not.

    Raises
    ------
    InputError
        If weight is asked for and the specimen has no density.
    """
    if not any(support.gravity_m_s2):
        return 0.0
    if specimen.density_kg_m3 is None:
        raise InputError(
            f"specimen {specimen.name!r} must have a density_kg_m3 in kg/m3 for its "
            "weight to be taken into account; instead received none"
        )
    return specimen.density_kg_m3


@array_cache(maxsize=1024)
def field_array(field: Field, length_mm: float) -> Array:
    """Return the field as the kernels take it (see `planar.march`)."""
    out = np.zeros(1 + BLOCK_SIZE)
    if isinstance(field, UniformField):
        angle = rad_from_deg(field.angle_deg)
        quarter, rest = divmod(field.angle_deg, 90.0)
        out[0] = UNIFORM
        if rest == 0.0:  # exact zeros for the directions along the axes
            out[1:3] = ((1, 0), (0, 1), (-1, 0), (0, -1))[int(quarter) % 4]
        else:
            out[1:3] = np.cos(angle), np.sin(angle)
        out[1:3] *= T_from_mT(field.flux_mT)
    elif isinstance(field, MagnetField):
        out[0] = CUBOID
        block = magnet_block(field.magnet, length_mm=length_mm, gap_mm=field.gap_mm)
        block[:6] /= length_mm
        out[1:] = block
    else:
        raise InputError(
            "field must be a UniformField in mT or a MagnetField in mm; instead "
            f"received {type(field).__name__}"
        )
    return out


@array_cache(maxsize=64)
def stations(points: int) -> Array:
    """Return `points` stations from 0 to 1.

    Raises
    ------
    InputError
        If there are fewer than 2 or more than a million.
    """
    return np.linspace(0.0, 1.0, whole(points, 2, MOST_POINTS, "points"))
