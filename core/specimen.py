"""The specimen: a rod of sections, root first (a GMC, or any other)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeVar

from .checks import finite, listed, positive, shown, size, store, within
from .cross_section import ALL_SIZES, SIZES, CrossSection, cross_section
from .errors import InputError

SIGNED = {
    "remanence_mT": "mT",
    "remanence_y_mT": "mT",
    "remanence_z_mT": "mT",
    "natural_curvature_per_mm": "1/mm",
}
"""Numbers of either sign that a rod has and a section may have of its own."""
DEVIATIONS = {
    "side_sd_mm": "mm",
    "length_sd_mm": "mm",
    "remanence_sd_mT": "mT",
    "density_sd_kg_m3": "kg/m3",
    "natural_curvature_sd_per_mm": "1/mm",
}
"""Standard deviations that a specimen may state, and their units."""
_COLOUR = re.compile("#[0-9a-fA-F]{6}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """One section of the rod; what is not given is that of the whole rod.

    Parameters
    ----------
    length_mm : float
        Length along the rod, in mm.
    E_MPa : float
        Young's modulus, in MPa.
    side_mm, width_mm, height_mm, diameter_mm, bore_mm : float, optional
        Sizes of the cross-section in mm, those that the rod's shape is given by.
    remanence_mT : float, optional
        Remanence along the axis in mT, signed (+ points root to tip).
    remanence_y_mT, remanence_z_mT : float, optional
        Remanence across the axis, along the rod's own y and z, in mT.
    natural_curvature_per_mm : float, optional
        Curvature of the stress-free rod in its xy plane, in 1/mm; + bends toward +y.

    Raises
    ------
    InputError
        If a length, modulus or size is not a finite number above zero, or another
        number is not finite.
    """

    length_mm: float
    E_MPa: float
    side_mm: float | None = None
    remanence_mT: float | None = None
    width_mm: float | None = None
    height_mm: float | None = None
    diameter_mm: float | None = None
    bore_mm: float | None = None
    remanence_y_mT: float | None = None
    remanence_z_mT: float | None = None
    natural_curvature_per_mm: float | None = None

    def __post_init__(self) -> None:
        store(
            self,
            length_mm=size(self.length_mm, "section length_mm", "mm"),
            E_MPa=size(self.E_MPa, "section E_MPa", "MPa"),
        )
        for name in ALL_SIZES:
            if (given := getattr(self, name)) is not None:
                store(self, **{name: size(given, f"section {name}", "mm")})
        for name, unit in SIGNED.items():
            if (given := getattr(self, name)) is not None:
                store(self, **{name: finite(given, f"section {name}", unit)})


Part = TypeVar("Part")


def parts(given: object, kind: type[Part], whose: str) -> tuple[Part, ...]:
    """Return the sections of a rod, in any sequence, as a tuple.

    Raises
    ------
    InputError
        If there is none, or something that is no section of this `kind`.
    """
    sections = listed(given)
    if not sections:
        raise InputError(
            f"{whose} must have at least one section; instead received {shown(given)}"
        )
    for section in sections:
        if not isinstance(section, kind):
            raise InputError(
                f"sections of {whose} must each be a {kind.__name__}; instead received "
                f"{shown(section)}"
            )
    return sections


@dataclass(frozen=True, slots=True, kw_only=True)
class Specimen:
    """A clamped rod: of one shape, straight or curved, magnetised along any direction.

    Parameters
    ----------
    name : str
        What people call it.
    sections : tuple of Section
        Root first. A property that varies along the rod is given as many short
        sections (`profile_sections`).
    shape : {"square", "rectangle", "round", "tube"}
        Of the cross-section. It fixes which sizes are given.
    side_mm : float
        Side of a square, in mm. Of another shape it is filled in: the extent within
        the xy plane, which the camera sees.
    width_mm, height_mm : float, optional
        Extent of a rectangle within the xy plane, and along z.
    diameter_mm, bore_mm : float, optional
        Diameter of a round rod, outer and inner diameter of a tube.
    remanence_mT : float
        Remanence (residual flux density B_r) along the axis in mT; + points root to
        tip.
    remanence_y_mT, remanence_z_mT : float
        Remanence across the axis, along the rod's own y and z.
    natural_curvature_per_mm : float
        Curvature of the stress-free rod in its xy plane, in 1/mm; + bends toward +y.
    density_kg_m3 : float, optional
        Needed only where weight is taken into account.
    poisson_ratio : float
        For the torsion of rods that leave the plane.
    side_sd_mm, length_sd_mm, remanence_sd_mT, density_sd_kg_m3, \
    natural_curvature_sd_per_mm : float, optional
        Standard deviations of what was measured.
    recipe : mapping, optional
        What the material was mixed from: names and amounts; kept as pairs.
    colour : str, optional
        As a picture of it on white paper shows it, ``#rrggbb``: tells the rod from its
        shade and from other things in a photograph.

    Raises
    ------
    InputError
        If there is no section, or a value cannot be.
    """

    name: str
    side_mm: float = 0.0
    remanence_mT: float
    sections: tuple[Section, ...]
    density_kg_m3: float | None = None
    shape: str = "square"
    width_mm: float | None = None
    height_mm: float | None = None
    diameter_mm: float | None = None
    bore_mm: float | None = None
    remanence_y_mT: float = 0.0
    remanence_z_mT: float = 0.0
    natural_curvature_per_mm: float = 0.0
    poisson_ratio: float = 0.49
    side_sd_mm: float | None = None
    length_sd_mm: float | None = None
    remanence_sd_mT: float | None = None
    density_sd_kg_m3: float | None = None
    natural_curvature_sd_per_mm: float | None = None
    recipe: tuple[tuple[str, float | str], ...] = ()
    colour: str | None = None
    cross_sections: tuple[CrossSection, ...] = field(
        init=False, repr=False, compare=False
    )
    """Cross-section of each section."""

    def __post_init__(self) -> None:
        store(
            self,
            sections=parts(self.sections, Section, f"specimen {self.name!r}"),
            poisson_ratio=within(self.poisson_ratio, -0.99, 0.5, "poisson_ratio", ""),
            recipe=_pairs(self.recipe),
        )
        for name, unit in SIGNED.items():
            store(self, **{name: finite(getattr(self, name), name, unit)})
        self._store_sizes()
        if self.density_kg_m3 is not None:
            density = positive(self.density_kg_m3, "density_kg_m3", "kg/m3")
            store(self, density_kg_m3=density)
        for name, unit in DEVIATIONS.items():
            if (given := getattr(self, name)) is not None:
                store(self, **{name: within(given, 0.0, 1e9, name, unit)})
        if self.colour is not None and not _COLOUR.fullmatch(str(self.colour)):
            raise InputError(
                "colour must be red, green and blue in hexadecimal digits, such as "
                f"#c8af8c; instead received {shown(self.colour)}"
            )

    def _store_sizes(self) -> None:
        """Store the sizes of the shape, and what the camera sees as the side."""
        if self.shape == "square":
            store(self, side_mm=size(self.side_mm, "side_mm", "mm"))
        sizes = {name: getattr(self, name) for name in ALL_SIZES}
        seen = sizes["diameter_mm"] or sizes["width_mm"]
        if self.shape != "square" and sizes["side_mm"] == seen:
            sizes["side_mm"] = None
        found = cross_section(self.shape, f"specimen {self.name!r}", **sizes)
        store(self, side_mm=found.width_mm)
        for name in SIZES[self.shape]:
            store(self, **{name: float(getattr(self, name))})
        store(self, cross_sections=self._cross_sections())

    def _cross_sections(self) -> tuple[CrossSection, ...]:
        own = {name: getattr(self, name) for name in SIZES[self.shape]}
        whose = f"a section of specimen {self.name!r}"
        found = []
        for section in self.sections:
            given = {name: getattr(section, name) for name in ALL_SIZES}
            sizes = {name: given[name] or own.get(name) for name in ALL_SIZES}
            found.append(cross_section(self.shape, whose, **sizes))
        return tuple(found)

    @property
    def length_mm(self) -> float:
        """Length from clamp to tip, in mm."""
        return sum(section.length_mm for section in self.sections)

    @property
    def joints_mm(self) -> tuple[float, ...]:
        """Arc length of the inner joints between sections, in mm."""
        joints: list[float] = []
        s_mm = 0.0
        for section in self.sections[:-1]:
            s_mm += section.length_mm
            joints.append(s_mm)
        return tuple(joints)

    @property
    def sides_mm(self) -> tuple[float, ...]:
        """Extent of each section within the xy plane, in mm: a square's side."""
        return tuple(section.width_mm for section in self.cross_sections)

    @property
    def remanences_mT(self) -> tuple[float, ...]:
        """Signed remanence of each section along the axis, in mT."""
        return self._of_sections("remanence_mT")

    @property
    def transverse_mT(self) -> tuple[tuple[float, float], ...]:
        """Remanence of each section along its own y and z, in mT."""
        along_y = self._of_sections("remanence_y_mT")
        return tuple(zip(along_y, self._of_sections("remanence_z_mT"), strict=True))

    @property
    def natural_curvatures_per_mm(self) -> tuple[float, ...]:
        """Curvature of each section without stress, in 1/mm."""
        return self._of_sections("natural_curvature_per_mm")

    @property
    def is_plain(self) -> bool:
        """Whether it is straight and magnetised along its axis."""
        parts: tuple[Specimen | Section, ...] = (self, *self.sections)
        for part in parts:
            if (
                part.natural_curvature_per_mm
                or part.remanence_y_mT
                or part.remanence_z_mT
            ):
                break
        else:
            return True
        curved = any(self.natural_curvatures_per_mm)
        return not curved and not any(any(pair) for pair in self.transverse_mT)

    def _of_sections(self, name: str) -> tuple[float, ...]:
        own: float = getattr(self, name)
        given = (getattr(section, name) for section in self.sections)
        return tuple(own if value is None else value for value in given)


def _pairs(given: object) -> tuple[tuple[str, float | str], ...]:
    """Return a recipe as pairs that can be hashed."""
    items = listed(given.items() if isinstance(given, Mapping) else given) or ()
    return tuple((str(name), amount) for name, amount in items)
