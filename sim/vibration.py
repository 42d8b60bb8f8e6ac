"""How a straight rod vibrates in its clamp: its natural frequencies, without a field.

Small bending vibrations of a slender beam of sections, rho A w_tt + (EI w_ss)_ss = 0,
clamped at the root and free at the tip, in finite elements with Hermite's cubics
(Przemieniecki 1968, section 11.6): twelve a section, whose first frequency is right to
1e-6. Shear and the turning of sections lower it by 0.1 % on a rod thirty times as long
as thick; weight across the plane of motion does not count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError
from ..core.specimen import Specimen

Array = NDArray[np.float64]

ELEMENTS = 12

_STIFFNESS = np.array(
    [[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], dtype=np.float64
)
_MASS = np.array(
    [[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]],
    dtype=np.float64,
)
"""Of an element of unit length, and of unit EI or, times 420, unit mass."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """The first vibration of a rod.

    Parameters
    ----------
    frequency_Hz : float
        Of the undamped vibration.
    shares : tuple of float
        Share of each section in its elastic energy, root first: by so many percent the
        square of the frequency rises where the section's modulus does by one.
    """

    frequency_Hz: float
    shares: tuple[float, ...]


def first_mode(specimen: Specimen) -> Mode:
    """Return the first vibration of a rod within its xy plane.

    Parameters
    ----------
    specimen : Specimen
        With its density.

    Raises
    ------
    InputError
        If the density is missing.

    Examples
    --------
    The first root of cos x cosh x = -1 is 1.8751; f = x^2 / (2 pi L^2) (EI / rho A)^0.5

    >>> from magbend.sim import first_mode
    >>> from magbend.core import Section, Specimen
    >>> rod = Specimen(
    ...     name="rod", side_mm=1.0, remanence_mT=0.0, density_kg_m3=2000.0,
    ...     sections=(Section(length_mm=30.0, E_MPa=10.0),),
    ... )
    >>> round(first_mode(rod).frequency_Hz, 2)
    12.69
    """
    if specimen.density_kg_m3 is None:
        raise InputError(
            f"a vibration needs the mass of specimen {specimen.name!r}: give its "
            "density_kg_m3"
        )
    lengths = [1e-3 * section.length_mm / ELEMENTS for section in specimen.sections]
    size = 2 * ELEMENTS * len(lengths) + 2
    stiff, mass = np.zeros((len(lengths), size, size)), np.zeros((size, size))
    for k, (length, section, cut) in enumerate(
        zip(lengths, specimen.sections, specimen.cross_sections, strict=True)
    ):
        turn = np.diag([1.0, length, 1.0, length])
        EI = 1e-6 * section.E_MPa * cut.in_plane_mm4
        element = turn @ _STIFFNESS @ turn * EI / length**3
        line_density = 1e-6 * specimen.density_kg_m3 * cut.area_mm2
        weighty = turn @ _MASS @ turn * line_density * length / 420.0
        for i in range(k * ELEMENTS, (k + 1) * ELEMENTS):
            at = slice(2 * i, 2 * i + 4)
            stiff[k, at, at] += element
            mass[at, at] += weighty
    free = slice(2, None)  # the clamp holds place and slope of the first node
    # The slowest vibration is the largest value of K^-1 M, and so the best known.
    half = np.linalg.cholesky(stiff.sum(axis=0)[free, free])
    scaled = np.linalg.solve(half, mass[free, free])
    values, vectors = np.linalg.eigh(np.linalg.solve(half, scaled.T))
    shape = np.linalg.solve(half.T, vectors[:, -1])
    energy = np.array([shape @ part[free, free] @ shape for part in stiff])
    return Mode(
        frequency_Hz=1.0 / (2.0 * math.pi * math.sqrt(float(values[-1]))),
        shares=tuple(float(share) for share in energy / energy.sum()),
    )
