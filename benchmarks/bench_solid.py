"""Compare the solid model with finite elements, and its cost with the plain rod's.

    python benchmarks/bench_solid.py

Prints tip deflection and RMS distance against every shape in fixtures/fem, for both
models, and the ratio of their times in this run.
"""

from __future__ import annotations

import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from magbend.core.magnet import Magnet
from magbend.sim import MagnetField, UniformField, gmc
from magbend.sim.one_rod import solve

FEM = Path(__file__).parents[1] / "fixtures" / "fem"


def case(name: str):
    """Return the rod and the field that a file's name tells."""
    rod = gmc(int(re.search(r"rod(\d)", name)[1]))
    if "gap" in name:
        gap_mm = float(re.search(r"gap(\d+)", name)[1])
        sign = -1.0 if "minus" in name else 1.0
        rod = replace(rod, remanence_mT=sign * rod.remanence_mT)
        return rod, MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=gap_mm)
    flux, angle = re.search(r"B(\d+)_a(\d+)", name).groups()
    return rod, UniformField(flux_mT=float(flux), angle_deg=float(angle))


def misses(name: str, model: str) -> tuple[float, float]:
    """Return the error of the tip's deflection in % and the RMS distance in um."""
    fem = np.loadtxt(FEM / name, delimiter=",", skiprows=1)
    rod, field = case(name)
    points = solve(rod, field, model=model).centreline.points_mm
    start = np.array([30.0, 0.0])
    ratio = np.linalg.norm(points[-1] - start) / np.linalg.norm(fem[-1, 1:] - start)
    rms = np.sqrt(np.mean(np.sum((points - fem[:, 1:]) ** 2, axis=1)))
    return (ratio - 1.0) * 100.0, rms * 1e3


def cost_us(field, model: str) -> float:
    """Return the least CPU time of a call, in us."""
    times = []
    for _ in range(7):
        start = time.thread_time()
        for _ in range(50):
            solve(gmc(2), field, model=model)
        times.append((time.thread_time() - start) / 50)
    return min(times) * 1e6


def main() -> None:
    """Print the table and the ratios."""
    print(f"{'shape':28s} {'rod tip %':>9s} {'rms um':>7s} {'solid tip %':>11s} rms um")
    for path in sorted(FEM.glob("*.csv")):
        plain, solid = misses(path.name, "rod"), misses(path.name, "solid")
        print(
            f"{path.name:28s} {plain[0]:9.4f} {plain[1]:7.2f} {solid[0]:11.4f} "
            f"{solid[1]:6.3f}"
        )
    magnet = MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=60.0)
    for name, field in (("uniform", UniformField(flux_mT=50.0)), ("magnet", magnet)):
        plain, solid = cost_us(field, "rod"), cost_us(field, "solid")
        print(
            f"{name}: solve() {plain:.0f} us as rod, {solid:.0f} us as solid: "
            f"{solid / plain:.2f} times"
        )


if __name__ == "__main__":
    main()
