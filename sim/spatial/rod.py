"""Rods in space: sections of any profile, magnetisation and rest curvature."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.checks import positive, size, store, vector, within
from ...core.cross_section import torsion_constant_mm4
from ...core.errors import InputError
from ...core.sources import FLUX_LIMIT_T
from ...core.specimen import Specimen, parts
from ...core.units import MU0, rad_from_deg
from ..fields import Support
from .march import AXIAL, C1, C3, K1, K3, MU1, MU2, WIDTH, WX, WZ, H  # fmt: skip

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpatialSection:
    """One section of a rod in space, root first.

    Its directors at the clamp: d1 along the specimen's y, d2 along z, d3 the tangent.

    Parameters
    ----------
    length_mm, E_MPa : float
        Length and Young's modulus.
    width_mm, height_mm : float
        Extent along d1 and d2; for a round section both the diameter.
    round_section : bool
        Circular (or elliptic) instead of rectangular.
    bore_mm : float
        Inner diameter of a circular tube.
    remanence_mT : tuple of float
        Remanence along (d1, d2, d3), in mT: tilted where the first two are not zero.
    rest_curvature_per_mm : tuple of float
        Curvature of the stress-free rod about (d1, d2) and its twist about d3: positive
        about d2 bends toward +y.
    poisson_ratio : float
        For the shear modulus of torsion.
    """

    length_mm: float
    E_MPa: float
    width_mm: float
    height_mm: float
    round_section: bool = False
    bore_mm: float = 0.0
    remanence_mT: Vector = ZERO
    rest_curvature_per_mm: Vector = ZERO
    poisson_ratio: float = 0.49

    def __post_init__(self) -> None:
        limit_mT = FLUX_LIMIT_T * 1e3
        remanence = vector(self.remanence_mT, "section remanence_mT", "mT", limit_mT)
        rest = vector(
            self.rest_curvature_per_mm, "section rest_curvature_per_mm", "1/mm", 1e3
        )
        ratio = within(self.poisson_ratio, -0.99, 0.5, "section poisson_ratio", "")
        store(
            self,
            length_mm=size(self.length_mm, "section length_mm", "mm"),
            E_MPa=size(self.E_MPa, "section E_MPa", "MPa"),
            width_mm=size(self.width_mm, "section width_mm", "mm"),
            height_mm=size(self.height_mm, "section height_mm", "mm"),
            remanence_mT=remanence,
            rest_curvature_per_mm=rest,
            poisson_ratio=ratio,
            bore_mm=within(self.bore_mm, 0.0, 1e9, "section bore_mm", "mm"),
        )
        thin = min(self.width_mm, self.height_mm)
        if self.bore_mm >= thin or (self.bore_mm and not self.round_section):
            raise InputError(
                "section bore_mm must be that of a round section, and below its "
                f"diameter of {thin:g} mm; instead received {self.bore_mm:g} mm"
            )

    @property
    def area_mm2(self) -> float:
        """Area of the cross-section, in mm2."""
        area = self.width_mm * self.height_mm
        return (area - self.bore_mm**2) * math.pi / 4.0 if self.round_section else area

    @property
    def stiffness_Nmm2(self) -> Vector:
        """EI about d1, EI about d2 and GJ, in N mm2."""
        w, h = self.width_mm, self.height_mm
        G_MPa = self.E_MPa / (2.0 * (1.0 + self.poisson_ratio))
        if self.round_section:
            about_d1, about_d2 = math.pi * w * h**3 / 64.0, math.pi * h * w**3 / 64.0
            torsion = math.pi * w**3 * h**3 / (16.0 * (w**2 + h**2))
            hole = math.pi * self.bore_mm**4 / 64.0
            about_d1, about_d2 = about_d1 - hole, about_d2 - hole
            torsion -= 2.0 * hole
        else:
            about_d1, about_d2 = w * h**3 / 12.0, h * w**3 / 12.0
            torsion = torsion_constant_mm4(w, h)
        return self.E_MPa * about_d1, self.E_MPa * about_d2, G_MPa * torsion


@dataclass(frozen=True, slots=True, kw_only=True)
class SpatialRod:
    """A clamped rod of sections, root first.

    Parameters
    ----------
    sections : tuple of SpatialSection
        A property that varies along the rod is given as many short sections.
    density_kg_m3 : float, optional
        Needed only where weight is taken into account.
    """

    sections: tuple[SpatialSection, ...]
    density_kg_m3: float | None = None

    def __post_init__(self) -> None:
        store(self, sections=parts(self.sections, SpatialSection, "a spatial rod"))
        if self.density_kg_m3 is not None:
            density = positive(self.density_kg_m3, "density_kg_m3", "kg/m3")
            store(self, density_kg_m3=density)

    @property
    def length_mm(self) -> float:
        """Length from clamp to tip, in mm."""
        return sum(section.length_mm for section in self.sections)

    @classmethod
    def from_specimen(cls, specimen: Specimen) -> SpatialRod:
        """Return the specimen as a rod in space."""
        return cls(
            sections=tuple(
                SpatialSection(
                    length_mm=part.length_mm, E_MPa=part.E_MPa,
                    width_mm=across.width_mm, height_mm=across.height_mm,
                    bore_mm=across.bore_mm, round_section=across.is_round,
                    remanence_mT=(y, z, remanence),
                    rest_curvature_per_mm=(0.0, curvature, 0.0),
                    poisson_ratio=specimen.poisson_ratio,
                )
                for part, across, (y, z), remanence, curvature in zip(
                    specimen.sections, specimen.cross_sections, specimen.transverse_mT,
                    specimen.remanences_mT, specimen.natural_curvatures_per_mm,
                    strict=True,
                )
            ),
            density_kg_m3=specimen.density_kg_m3,
        )  # fmt: skip


def clamp_of(support: Support) -> Array:
    """Return the clamp as the kernels take it: the directors there as columns."""
    angle = rad_from_deg(support.clamp_angle_deg)
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[-sin, 0.0, cos], [cos, 0.0, sin], [0.0, 1.0, 0.0]])


def rod_table(rod: SpatialRod, support: Support) -> Array:
    """Return the rod as the kernels take it, tip first, shape (n, 13).

    Raises
    ------
    InputError
        If weight is asked for and the rod has no density, or numbers overflow.
    """
    length_mm = rod.length_mm
    unit_Nmm2 = rod.sections[0].stiffness_Nmm2[1]
    per_N = length_mm**2 / unit_Nmm2
    weight = any(support.gravity_m_s2)
    if weight and rod.density_kg_m3 is None:
        raise InputError(
            "the rod must have a density_kg_m3 in kg/m3 for its weight to be taken "
            "into account; instead received none"
        )
    density = rod.density_kg_m3 or 0.0
    table = np.zeros((len(rod.sections), WIDTH))
    for row, part in zip(table[::-1], rod.sections, strict=True):
        d1, d2, axial = part.remanence_mT
        magnetic = support.load_factor * part.area_mm2 * 1e-9 / MU0 * per_N
        weight_N = density * part.area_mm2 * length_mm * 1e-9 if weight else 0.0
        row[H] = part.length_mm / length_mm
        row[C1 : C3 + 1] = [unit_Nmm2 / value for value in part.stiffness_Nmm2]
        row[[AXIAL, MU1, MU2]] = [magnetic * value for value in (axial, d1, d2)]
        row[K1 : K3 + 1] = [k * length_mm for k in part.rest_curvature_per_mm]
        row[WX : WZ + 1] = [weight_N * g * per_N for g in support.gravity_m_s2]
    if not np.all(np.isfinite(table)):
        raise InputError(
            "the rod's sizes in mm and moduli in MPa must be of comparable size; "
            f"instead received a rod of {length_mm:g} mm whose loads overflow"
        )
    return table
