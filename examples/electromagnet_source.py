"""A field source of one's own: an electromagnet, its supply's current in the file.

A package declares it, and a field file names it:

    [project.entry-points."magbend.sources"]
    electromagnet = "my_package:Electromagnet"

    [[source]]
    kind = "electromagnet"
    current_A = 4.0

Its iron core is taken for two poles, a disc's worth of dipoles apart: what a Hall probe
read at 1 A along the axis gives the strength. Saturation is in the supply's own curve.

python examples/electromagnet_source.py [folder]
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from magbend.sim import Field, gmc, sampled_map, solve

CURRENTS_A = (2.0, 8.0)
SATURATION_A = 6.0
"""Current at which the core gives tanh(1) of what it would without saturation."""


class Electromagnet:
    """Two poles on a line through the undeformed tip, the north pole facing it.

    Parameters
    ----------
    current_A : float
        Of the supply.
    tip_flux_mT_per_A : float
        What a probe read at the rod's undeformed tip, at small current.
    gap_mm, core_mm : float
        From the near pole to that tip, and from pole to pole.
    length_mm : float
        Of the rod: the tip is at (length_mm, 0, 0).
    """

    def __init__(
        self,
        current_A: float,
        tip_flux_mT_per_A: float = 12.0,
        gap_mm: float = 60.0,
        core_mm: float = 120.0,
        length_mm: float = 30.0,
    ) -> None:
        self.box_mm = ((-5.0, -35.0, -15.0), (45.0, 35.0, 15.0))
        self._poles = np.array(
            [[length_mm, -gap_mm, 0.0], [length_mm, -gap_mm - core_mm, 0.0]]
        )
        alone = 1.0 / gap_mm**2 - 1.0 / (gap_mm + core_mm) ** 2
        driven = SATURATION_A * np.tanh(current_A / SATURATION_A)
        self._strength = tip_flux_mT_per_A * driven / alone

    def flux_mT(self, points_mm: np.ndarray) -> np.ndarray:
        """Return the flux density at points, shape (n, 3), in mT."""
        away = points_mm[:, None] - self._poles
        fields = away / np.linalg.norm(away, axis=2, keepdims=True) ** 3
        return self._strength * (fields[:, 0] - fields[:, 1])


def main(folder: Path) -> dict[float, float]:
    """Draw GMC 2 at several currents; return the tip's y at each, in mm."""
    figure, axes = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
    tips = {}
    for current_A in CURRENTS_A:
        magnet = Electromagnet(current_A)
        field = Field(sampled_map(magnet.flux_mT, magnet.box_mm))
        line = solve(gmc(2), field).centreline
        tips[current_A] = line.tip_mm[1]
        axes.plot(line.x_mm, line.y_mm, label=f"{current_A:g} A")
    axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    axes.legend(frameon=False)
    figure.savefig(folder / "electromagnet_source.svg")
    plt.close(figure)
    return tips


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "gallery")
    out.mkdir(parents=True, exist_ok=True)
    for current, tip_mm in main(out).items():
        print(f"{current:g} A: tip at y = {tip_mm:.3f} mm")
