"""Materials that can be mixed by a law of mixing, for a search to choose from."""

from __future__ import annotations

import itertools

import numpy as np

from ..recipe.law import Law, predict_mixture
from ..recipe.material import Mixture
from .makeable import Recipe

RATIOS, POWDERS = 7, 5
"""How many PCL ratios and amounts of powder within those that were fitted."""


def mixed_recipes(law: Law, sections: int) -> list[Recipe]:
    """Return materials whose sections soften from root to tip.

    Ratios are those of the rods that were fitted and between them, rounded to what a
    balance and a note can hold; nothing outside is offered.
    """
    low, high = (1.0 / share - 1.0 for share in reversed(law.rigid_share))
    ratios = sorted({round(2.0 * r) / 2.0 for r in np.linspace(low, high, RATIOS)})
    ratios = [r for r in ratios if low - 1e-9 <= r <= high + 1e-9]
    powders = sorted({5.0 * round(p / 5.0) for p in np.linspace(
        *law.ndfeb_percent, POWDERS)})  # fmt: skip
    recipes = []
    for powder, chosen in itertools.product(
        powders, itertools.combinations_with_replacement(ratios, sections)
    ):
        found = [
            predict_mixture(law, Mixture(soft_per_rigid=r, ndfeb_percent=powder))
            for r in chosen
        ]
        recipes.append(
            Recipe(
                name=f"PCL {' '.join(f'{r:g}:1' for r in chosen)}, NdFeB {powder:g} %",
                E_MPa=[round(one.E_MPa, 3) for one in found],
                remanence_mT=round(found[0].remanence_mT, 3),
                mixture={
                    "pcl": " ".join(f"{r:g}:1" for r in chosen), "ndfeb": powder
                },
            )
        )  # fmt: skip
    return recipes
