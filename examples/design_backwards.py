"""From a wanted bending radius to rods that can be made.

python examples/design_backwards.py [folder]
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt

from magbend.analysis import Design, Makeable, find_designs, radius_goal
from magbend.sim import UniformField, solve

RADIUS_MM, FIELD = 60.0, UniformField(flux_mT=60.0)


def main(folder: Path) -> list[Design]:
    """Draw five rods that bend to the wanted radius; return them, the best first."""
    found = find_designs(radius_goal(RADIUS_MM), FIELD, Makeable(), count=5)
    figure, axes = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
    for number, one in enumerate(found, start=1):
        line = solve(one.specimen, FIELD).centreline
        moduli = "-".join(f"{s.E_MPa:.0f}" for s in one.specimen.sections)
        axes.plot(line.x_mm, line.y_mm, label=f"{number}: {moduli} MPa")
    axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    axes.legend(frameon=False)
    figure.savefig(folder / "design_backwards.svg")
    plt.close(figure)
    return found


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "gallery")
    out.mkdir(parents=True, exist_ok=True)
    for rod in main(out):
        print(f"radius {rod.achieved:.3f} mm, tolerance {rod.tolerance:.2f} mm")
