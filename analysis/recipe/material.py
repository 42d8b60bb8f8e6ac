"""What a rod is mixed from: soft and rigid PCL, and magnetic powder.

A specimen file says it in its table ``[recipe]``: ``pcl`` is soft to rigid PCL by
weight, a ratio for every section, root first, or one for all; ``ndfeb`` is the powder
in percent of the weight of PCL.

    [recipe]
    pcl = "2:1 5:1 6:1"
    ndfeb = 200
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...core.errors import InputError
from ...core.specimen import Specimen

NDFEB_KG_M3, PCL_KG_M3 = 7500.0, 1145.0
"""Densities of NdFeB powder (7400 to 7600 in data sheets) and of PCL (data sheets)."""

POWDER_T = 0.75
"""Remanence of an isotropic NdFeB powder once magnetised (MQP grades: 0.7 to 0.9 T)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mixture:
    """The material of one section.

    Attributes
    ----------
    soft_per_rigid : float
        Soft PCL over rigid PCL, by weight.
    ndfeb_percent : float
        Powder, in percent of the weight of PCL.

    Raises
    ------
    InputError
        If a ratio is below zero or no number.
    """

    soft_per_rigid: float
    ndfeb_percent: float

    def __post_init__(self) -> None:
        for name, value in (
            ("the ratio of soft to rigid PCL", self.soft_per_rigid),
            ("ndfeb in percent", self.ndfeb_percent),
        ):
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(
                    f"{name} must be above zero; instead received {value:g}"
                )

    @property
    def rigid_share(self) -> float:
        """Rigid PCL by weight of all PCL."""
        return 1.0 / (1.0 + self.soft_per_rigid)

    @property
    def volume_share(self) -> float:
        """Powder by volume, without voids."""
        filler = self.ndfeb_percent / 100.0 / NDFEB_KG_M3
        return filler / (filler + 1.0 / PCL_KG_M3)

    @property
    def density_kg_m3(self) -> float:
        """Density without voids."""
        share = self.volume_share
        return share * NDFEB_KG_M3 + (1.0 - share) * PCL_KG_M3


def read_ratio(text: str) -> float:
    """Return soft over rigid PCL of a ratio such as ``5:1``.

    Raises
    ------
    InputError
        If it is no ratio of two numbers above zero.
    """
    soft, colon, rigid = text.partition(":")
    try:
        value = float(soft) / float(rigid) if colon else math.nan
    except (ValueError, ZeroDivisionError):
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(
            "a PCL ratio must be soft:rigid by weight, such as 5:1; instead received "
            f"{text!r}"
        )
    return value


def mixtures(specimen: Specimen) -> tuple[Mixture, ...]:
    """Return the material of each section, root first.

    Raises
    ------
    InputError
        If the specimen file does not say it.
    """
    recipe = dict(specimen.recipe)
    if "pcl" not in recipe or "ndfeb" not in recipe:
        raise InputError(
            f"specimen {specimen.name!r} must have a [recipe] with pcl and ndfeb, such "
            'as pcl = "2:1 5:1 6:1" and ndfeb = 200; instead it has '
            f"{', '.join(recipe) or 'none'}"
        )
    ratios = [read_ratio(part) for part in str(recipe["pcl"]).split()]
    sections = len(specimen.sections)
    if len(ratios) not in (1, sections):
        raise InputError(
            f"pcl of {specimen.name!r} must have one ratio or {sections}, one a "
            f"section; instead received {recipe['pcl']!r}"
        )
    try:
        ndfeb = float(recipe["ndfeb"])
    except ValueError:
        raise InputError(
            f"ndfeb of {specimen.name!r} must be a number in percent of the weight of "
            f"PCL; instead received {recipe['ndfeb']!r}"
        ) from None
    if len(ratios) == 1:
        ratios *= sections
    return tuple(Mixture(soft_per_rigid=r, ndfeb_percent=ndfeb) for r in ratios)
