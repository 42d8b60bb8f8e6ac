"""From specimens to the dimensionless arrays of the planar kernels."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache, wraps
from typing import ParamSpec

import numpy as np
from numpy.typing import NDArray

from ...core.checks import whole
from ...core.cross_section import SIZES
from ...core.errors import InputError
from ...core.jit import njit
from ...core.sources import FLUX_LIMIT_T
from ...core.specimen import Specimen
from ...core.units import MU0
from ..fields import Support
from ..magnet.flux import PART
from ..planar.march import WX, WY, E, H, M

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
    """Return the in-plane bending stiffness of each section, root first, in N mm2."""
    return tuple(
        section.E_MPa * across.in_plane_mm4
        for section, across in zip(
            specimen.sections, specimen.cross_sections, strict=True
        )
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
    for section, across, remanence_mT, stiffness in zip(
        specimen.sections, specimen.cross_sections, specimen.remanences_mT, EI,
        strict=True,
    ):  # fmt: skip
        area_mm2 = across.area_mm2
        if abs(remanence_mT) > FLUX_LIMIT_T * 1e3:
            raise InputError(
                f"remanence_mT must be within {FLUX_LIMIT_T * 1e3:g} mT; instead "
                f"received {remanence_mT:g}"
            )
        # A in mm2 times B_r in mT over mu0 is m in 1e-9 A m; m B is a force in N.
        moment_Am = area_mm2 * remanence_mT * 1e-9 / MU0
        weight_N = density * area_mm2 * length_mm * 1e-9
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
            f"instead received a rod of {length_mm:g} mm whose loads overflow"
        )
    return rod


def loads_per_unit(specimen: Specimen) -> tuple[Array, Array]:
    """Return m per mT of remanence and weight per (kg/m3 m/s2), tip first."""
    length_mm = specimen.length_mm
    per_N = length_mm**2 / stiffness_Nmm2(specimen)[0]
    area = np.array([across.area_mm2 for across in specimen.cross_sections[::-1]])
    return area * 1e-9 / MU0 * per_N, area * length_mm * 1e-9 * per_N


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


def many_rods(
    length_mm: Array, E_MPa: Array, sizes_mm: Mapping[str, Array], remanence_mT: Array
) -> tuple[Array, Array, Array]:
    """Return many weightless rods as the kernels take them.

    Parameters
    ----------
    length_mm, E_MPa, remanence_mT : ndarray, shape (n, sections)
        Root first.
    sizes_mm : mapping of ndarray, shape (n, sections)
        Those by which one shape is given (`core.cross_section.SIZES`).

    Returns
    -------
    rods : ndarray, shape (n, sections, 5)
        Tip first (see `planar.march`).
    total_mm, margins : ndarray, shape (n,)
        Lengths, and half the largest side over the length.

    Raises
    ------
    InputError
        If a load overflows.
    """
    rods = np.empty((*length_mm.shape, 5))
    total_mm, margins = np.empty(len(length_mm)), np.empty(len(length_mm))
    shape = next(name for name, given in SIZES.items() if set(given) == set(sizes_mm))
    first, *second = (sizes_mm[name] for name in SIZES[shape])
    given = length_mm, E_MPa, first, second[0] if second else first, remanence_mT
    code = ("square", "rectangle", "round", "tube").index(shape)
    if not _pack(*given, code, 1e-9 / MU0, rods, total_mm, margins):
        raise InputError(
            "designs: length_mm, side_mm in mm and E_MPa in MPa must be of comparable "
            "size; instead received a design whose loads overflow"
        )
    return rods, total_mm, margins


@njit(**PART)
def _section(code, width, other):  # type: ignore[no-untyped-def]
    """Return area and second moment of a section (`core.cross_section`)."""
    square = width * width
    if code == 0:
        return square, square * square / 12.0
    if code == 1:
        return width * other, other * width * square / 12.0
    hole = other * other if code == 3 else 0.0
    return (
        math.pi / 4.0 * (square - hole),
        math.pi / 64.0 * (square * square - hole * hole),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _pack(length, modulus, width, other, remanence, code, moment, rods, total, margin):  # type: ignore[no-untyped-def]
    """Fill `rods` from columns of shape (n, sections), root first.

    `width` and `other` are the sizes of a shape with the number `code`, `moment` that
    of 1 mm2 and 1 mT, in A m. Return whether all is finite.
    """
    n, sections = length.shape
    nothing = 0.0
    for i in range(n):
        total[i] = 0.0
        widest = 0.0
        for k in range(sections):
            total[i] += length[i, k]
            widest = max(widest, width[i, k])
        margin[i] = widest / (2.0 * total[i])
        EI = modulus[i, 0] * _section(code, width[i, 0], other[i, 0])[1]
        per_N = total[i] * total[i] / EI
        for k in range(sections):
            row = rods[i, sections - 1 - k]
            area, second = _section(code, width[i, k], other[i, k])
            row[H] = length[i, k] / total[i]
            row[E] = EI / (modulus[i, k] * second)
            row[M] = area * remanence[i, k] * moment * per_N
            row[WX] = row[WY] = 0.0
            nothing += 0.0 * (row[H] + row[E] + row[M])
    return nothing == 0.0


@array_cache(maxsize=64)
def stations(points: int) -> Array:
    """Return `points` stations from 0 to 1.

    Raises
    ------
    InputError
        If there are fewer than 2 or more than a million.
    """
    return np.linspace(0.0, 1.0, whole(points, 2, MOST_POINTS, "points"))
