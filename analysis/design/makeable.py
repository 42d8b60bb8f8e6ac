"""What a lab can make, as a box to search: ranges, lists, recipes, fabrication scatter.

A `Makeable` is read from a TOML file or built from options. Continuous choices are
coordinates of the unit cube (`feasible`): moduli, unit lengths, total length, side.
Discrete ones (recipes of material, moulds of given side) are a number a design.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from ...core.specimen import Section, Specimen
from ...core.toml import FileModel
from ...sim import Designs
from ...sim import Field as LoadField
from ..shapes.feasible import falling_moduli, fitting_lengths

Array = NDArray[np.float64]
Range = tuple[float, float]


class Recipe(FileModel):
    """A material recipe: moduli root first, and the remanence that goes with them."""

    name: str
    E_MPa: list[PositiveFloat] = Field(min_length=1)
    remanence_mT: float
    mixture: dict[str, float | str] = Field(default_factory=dict)


class Scatter(FileModel):
    """Fabrication scatter, one standard deviation of each section by itself."""

    side_mm: float = Field(default=0.01, ge=0.0)
    length_mm: float = Field(default=0.2, ge=0.0)
    E_percent: float = Field(default=5.0, ge=0.0, lt=30.0)
    remanence_percent: float = Field(default=3.0, ge=0.0, lt=30.0)


PAPER_RECIPES = (
    Recipe(name="200 % NdFeB", E_MPa=[20.0, 15.0, 10.0], remanence_mT=20.07),
    Recipe(name="150 % NdFeB", E_MPa=[16.0, 12.0, 8.0], remanence_mT=19.71),
    Recipe(name="100 % NdFeB", E_MPa=[14.0, 10.0, 7.5], remanence_mT=16.18),
)
"""Table 1 of the paper, with the remanences of GMC 2, 4 and 5."""
PAPER_SIDES_MM = (0.75, 1.0, 1.25)


class Makeable(FileModel):
    """What can be made (`--makeable FILE.toml`); every key has a default.

    ``side_mm``, ``E_MPa``, ``unit_length_mm`` and ``total_length_mm`` are [low, high];
    ``sides_mm`` lists moulds instead of a range; ``[[recipe]]`` lists materials instead
    of free moduli.
    """

    sections: int = Field(default=3, ge=1, le=12)
    side_mm: tuple[PositiveFloat, PositiveFloat] = (0.75, 1.35)
    sides_mm: list[PositiveFloat] = Field(default_factory=list)
    E_MPa: tuple[PositiveFloat, PositiveFloat] = (8.0, 50.0)
    unit_length_mm: tuple[PositiveFloat, PositiveFloat] = (5.0, 20.0)
    total_length_mm: tuple[PositiveFloat, PositiveFloat] = (30.0, 30.0)
    remanence_mT: float = 20.07
    recipe: list[Recipe] = Field(default_factory=list)
    scatter: Scatter = Scatter()

    def model_post_init(self, _context: object) -> None:
        """Check that ranges rise and lengths can add up.

        Raises
        ------
        ValueError
            One sentence, which the reader of the file passes on.
        """
        for name in ("side_mm", "E_MPa", "unit_length_mm", "total_length_mm"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(
                    f"{name}: must be [low, high], not {low:g} to {high:g}"
                )
        low, high = (self.sections * end for end in self.unit_length_mm)
        if self.total_length_mm[0] > high or self.total_length_mm[1] < low:
            raise ValueError(
                f"the lengths do not add up: {self.sections} sections of "
                f"{self.unit_length_mm[0]:g} to {self.unit_length_mm[1]:g} mm give "
                f"{low:g} to {high:g} mm, total_length_mm asks for "
                f"{self.total_length_mm[0]:g} to {self.total_length_mm[1]:g} mm"
            )
        for recipe in self.recipe:
            if len(recipe.E_MPa) != self.sections:
                raise ValueError(
                    f"recipe {recipe.name!r} must give {self.sections} moduli; "
                    f"instead received {len(recipe.E_MPa)}"
                )
        if self.remanence_mT == 0.0:
            raise ValueError("remanence_mT must not be zero: such a rod never bends")


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidates:
    """Designs as the search sees them.

    Parameters
    ----------
    z : ndarray, shape (n, d)
        Coordinates from 0 to 1: moduli (k), lengths (k - 1), total length, side.
    choice : ndarray, shape (n,)
        Index into `choices`.
    """

    z: Array
    choice: NDArray[np.int64]

    def take(self, index: Any) -> Candidates:
        """Return the chosen rows."""
        return replace(self, z=self.z[index], choice=self.choice[index])


def dimension(makeable: Makeable) -> int:
    """Return the number of coordinates of a design."""
    return 2 * makeable.sections + 1


def choices(makeable: Makeable) -> list[tuple[Recipe | None, float | None]]:
    """Return every pair of recipe and mould; None stands for a free choice."""
    recipes: list[Recipe | None] = [*makeable.recipe] or [None]
    moulds: list[float | None] = [*makeable.sides_mm] or [None]
    return list(itertools.product(recipes, moulds))


def rods(makeable: Makeable, candidates: Candidates) -> dict[str, Array]:
    """Return ``length_mm, E_MPa (n, k)`` and ``side_mm, remanence_mT (n,)``."""
    k, z = makeable.sections, candidates.z
    pairs = choices(makeable)
    if makeable.recipe:
        table = np.array([pair[0].E_MPa for pair in pairs if pair[0] is not None])
        magnetic = np.array([p[0].remanence_mT for p in pairs if p[0] is not None])
        E, remanence = table[candidates.choice], magnetic[candidates.choice]
    else:
        ends = (np.full(k, end) for end in makeable.E_MPa)
        E = falling_moduli(z[:, :k], *ends)
        remanence = np.full(len(z), makeable.remanence_mT)
    low, high = makeable.unit_length_mm
    shortest = max(makeable.total_length_mm[0], k * low)
    longest = min(makeable.total_length_mm[1], k * high)
    total = shortest + z[:, 2 * k - 1] * (longest - shortest)
    length = fitting_lengths(
        z[:, k : 2 * k - 1], np.full(k, low), np.full(k, high), total
    )
    if makeable.sides_mm:
        side = np.array([pair[1] for pair in pairs], dtype=float)[candidates.choice]
    else:
        low, high = makeable.side_mm
        side = low + z[:, 2 * k] * (high - low)
    return {"length_mm": length, "E_MPa": E, "side_mm": side, "remanence_mT": remanence}


def designs_in(rods_: dict[str, Array], field: LoadField) -> Designs:
    """Return rods in a field, ready to be solved together."""
    n = len(rods_["side_mm"])
    uniform = field.uniform
    flux, angle = None, np.full(n, 90.0)
    if uniform is not None:
        flux, angle = np.full(n, uniform.flux_mT), np.full(n, uniform.angle_deg)
    return Designs(
        length_mm=rods_["length_mm"], E_MPa=rods_["E_MPa"], side_mm=rods_["side_mm"],
        remanence_mT=rods_["remanence_mT"], flux_mT=flux, angle_deg=angle,
        magnet=field if uniform is None else None,
    )  # fmt: skip


def mixture_of(makeable: Makeable, specimen: Specimen) -> dict[str, float | str]:
    """Return what a design is mixed from; nothing where its moduli are free."""
    moduli = [section.E_MPa for section in specimen.sections]
    for recipe in makeable.recipe:
        close = np.allclose(recipe.E_MPa, moduli, atol=1e-3)
        if close and math.isclose(recipe.remanence_mT, specimen.remanence_mT):
            return recipe.mixture
    return {}


def specimen_of(rods_: dict[str, Array], i: int, name: str) -> Specimen:
    """Return rod `i` with the digits one can make (side 0.1 um, others 1 um, 1 kPa).

    Lengths are rounded so that they still add up.
    """
    length = rods_["length_mm"][i]
    ends = np.round(np.cumsum(length), 3)
    rounded = np.diff(ends, prepend=0.0)
    return Specimen(
        name=name,
        side_mm=round(float(rods_["side_mm"][i]), 4),
        remanence_mT=float(rods_["remanence_mT"][i]),
        sections=tuple(
            Section(length_mm=round(float(h), 3), E_MPa=round(float(E), 3))
            for h, E in zip(rounded, rods_["E_MPa"][i], strict=True)
        ),
    )


def scattered(
    specimen: Specimen, scatter: Scatter, samples: int, rng: np.random.Generator
) -> dict[str, Array]:
    """Return `samples` rods as fabrication would make them."""
    k = len(specimen.sections)
    length = np.array([section.length_mm for section in specimen.sections])
    E = np.array([section.E_MPa for section in specimen.sections])
    noise = rng.standard_normal((samples, 2 * k + 2))
    lengths = length + scatter.length_mm * noise[:, :k]
    side = specimen.side_mm + scatter.side_mm * noise[:, 2 * k]
    strength = 1.0 + scatter.remanence_percent / 100.0 * noise[:, 2 * k + 1]
    return {
        "length_mm": np.maximum(lengths, 0.1 * length),
        "E_MPa": E * np.exp(scatter.E_percent / 100.0 * noise[:, k : 2 * k]),
        "side_mm": np.maximum(side, 0.1 * specimen.side_mm),
        "remanence_mT": specimen.remanence_mT * strength,
    }


def binding(makeable: Makeable, rods_: dict[str, Array], i: int) -> list[str]:
    """Return which limits a design stands at, in words."""
    said = []

    def at(value: float, ends: Range, what: str, unit: str) -> None:
        for end, word in zip(ends, ("lower", "upper"), strict=True):
            if ends[0] < ends[1] and abs(value - end) < 2e-3 * (ends[1] - ends[0]):
                said.append(f"{what} at its {word} limit {end:g} {unit}")

    if makeable.sides_mm:
        side = float(rods_["side_mm"][i])
        said.append(f"the mould of {side:g} mm out of {sorted(makeable.sides_mm)}")
    else:
        at(float(rods_["side_mm"][i]), makeable.side_mm, "side_mm", "mm")
    if makeable.recipe:
        said.append("the listed recipes")
    for j in range(makeable.sections):
        if not makeable.recipe:
            value = float(rods_["E_MPa"][i, j])
            at(value, makeable.E_MPa, f"E_MPa of section {j + 1}", "MPa")
        value = float(rods_["length_mm"][i, j])
        at(value, makeable.unit_length_mm, f"length_mm of section {j + 1}", "mm")
    total = float(rods_["length_mm"][i].sum())
    if makeable.total_length_mm[0] == makeable.total_length_mm[1]:
        said.append(f"total_length_mm fixed at {total:g} mm")
    else:
        at(total, makeable.total_length_mm, "total_length_mm", "mm")
    return said
