"""The specimen: a straight rod of sections, root first (a GMC, or any other)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from .checks import finite, listed, positive, shown, size, store
from .errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """One section of the rod.

    Parameters
    ----------
    length_mm : float
        Length along the rod, in mm.
    E_MPa : float
        Young's modulus, in MPa.
    side_mm : float, optional
        Side of the square cross-section in mm, where it differs from the specimen's.
    remanence_mT : float, optional
        Axial remanence in mT, signed (+ points root to tip), where it differs from the
        specimen's.

    Raises
    ------
    InputError
        If a length, modulus or side is not a finite number above zero, or the
        remanence is not finite.
    """

    length_mm: float
    E_MPa: float
    side_mm: float | None = None
    remanence_mT: float | None = None

    def __post_init__(self) -> None:
        store(
            self,
            length_mm=size(self.length_mm, "section length_mm", "mm"),
            E_MPa=size(self.E_MPa, "section E_MPa", "MPa"),
        )
        if self.side_mm is not None:
            store(self, side_mm=size(self.side_mm, "section side_mm", "mm"))
        if self.remanence_mT is not None:
            remanence = finite(self.remanence_mT, "section remanence_mT", "mT")
            store(self, remanence_mT=remanence)


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
    """A clamped rod of square cross-section, magnetised along its axis.

    Parameters
    ----------
    name : str
        What people call it.
    side_mm : float
        Side of the square cross-section, in mm.
    remanence_mT : float
        Axial remanence (residual flux density B_r) in mT; + points root to tip.
    sections : tuple of Section
        Root first.
    density_kg_m3 : float, optional
        Needed only where weight is taken into account.

    Raises
    ------
    InputError
        If there is no section, or a value cannot be.
    """

    name: str
    side_mm: float
    remanence_mT: float
    sections: tuple[Section, ...]
    density_kg_m3: float | None = None

    def __post_init__(self) -> None:
        store(
            self,
            side_mm=size(self.side_mm, "side_mm", "mm"),
            remanence_mT=finite(self.remanence_mT, "remanence_mT", "mT"),
            sections=parts(self.sections, Section, f"specimen {self.name!r}"),
        )
        if self.density_kg_m3 is not None:
            density = positive(self.density_kg_m3, "density_kg_m3", "kg/m3")
            store(self, density_kg_m3=density)

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
        """Side of each section, in mm."""
        return tuple(
            self.side_mm if section.side_mm is None else section.side_mm
            for section in self.sections
        )

    @property
    def remanences_mT(self) -> tuple[float, ...]:
        """Signed remanence of each section, in mT."""
        return tuple(
            self.remanence_mT if section.remanence_mT is None else section.remanence_mT
            for section in self.sections
        )
