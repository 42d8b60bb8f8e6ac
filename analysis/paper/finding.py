"""One number of the paper, what became of it, and what several checks need.

``reproduced``: the number comes out. ``differs``: it does not. ``matters``: an effect
that was left out is not small. ``negligible``: it is small. ``supports``: evidence for
a reading of a number that the paper does not give.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from ... import sim
from ...core.magnet import Magnet
from ...core.specimen import Specimen

READINGS = ((70.0, 38.0, 1.3578), (60.0, 50.0, 1.3050), (50.0, 66.0, 1.2938))
"""Gap in mm, flux density in mT and the remanence in T that the paper prints for it."""

DENSITY_KG_M3 = 2640.0
"""Of NdFeB (7500) and PCL (1145) mixed 2:1 by weight without voids; the paper gives
none: 3 / (2 / 7500 + 1 / 1145) = 2632."""

CUBE = Magnet.cube(55.0, 1.305)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One number of the paper and what became of it.

    Attributes
    ----------
    claim : str
        What the paper says or assumes.
    evidence : str
        What we compute, with numbers and units.
    verdict : {"reproduced", "differs", "matters", "negligible", "supports"}
    value : float
        The number that decides.
    """

    claim: str
    evidence: str
    verdict: str
    value: float

    def as_dict(self) -> dict[str, Any]:
        """Return the finding for a machine."""
        return asdict(self)


def tip_y_mm(
    specimen: Specimen, field: sim.Field, support: sim.Support | None = None
) -> float:
    """Return the deflection of the tip; NaN without an equilibrium."""
    solution = sim.solve(specimen, field, support=support or sim.Support())
    return solution.centreline.tip_mm[1] if solution.centreline else math.nan
