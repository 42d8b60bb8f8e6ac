"""Compare the solid model with finite elements, and its cost with the plain rod's.

    python benchmarks/bench_solid.py

Prints tip deflection and RMS distance against every shape in fixtures/fem, for both
models: those in the plane that constants were fitted to or checked with, and those in
space that were drawn once the model stood. Then the ratio of their times in this run.
"""

from __future__ import annotations

import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from solid_cases import read_case

from magbend.core.magnet import Magnet
from magbend.sim import MagnetField, Support, UniformField, gmc
from magbend.sim.one_rod import solve
from magbend.sim.solid.space import largest_strain, solve_in_space

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


def drawn(path) -> str:
    """Return a line: distance of both models from the axis of a drawn case."""
    axis = np.loadtxt(path, delimiter=",", skiprows=1)[:, 1:]
    rod, field, support, nu = read_case(path.with_suffix(".json"))
    rod = replace(rod, poisson_ratio=nu)
    deflection = np.linalg.norm(axis[-1] - [rod.length_mm, 0.0, 0.0])
    line = f"{path.stem:11s}"
    solid = solve_in_space(rod, field, support, nu, 61)
    line += f" {largest_strain(rod, support, solid):6.3f}"
    for points in (
        solve(rod, field, support=support).points_mm,
        solve(rod, field, support=support, model="solid", poisson_ratio=nu).points_mm,
    ):
        miss = np.linalg.norm(points - axis, axis=1)
        rms = np.sqrt(np.mean(miss**2)) * 1e3
        line += f" {miss[-1] / deflection * 100.0:9.4f} {rms:7.2f}"
    return f"{line}  {rod.shape}"


def cost_us(field, model: str, support=None) -> float:
    """Return the least CPU time of a call, in us."""
    rod = replace(gmc(2), density_kg_m3=2640.0)
    times = []
    for _ in range(7):
        start = time.thread_time()
        for _ in range(50):
            solve(rod, field, model=model, support=support or Support())
        times.append((time.thread_time() - start) / 50)
    return min(times) * 1e6


def main() -> None:
    """Print the table and the ratios."""
    print(f"{'shape':28s} {'rod tip %':>9s} {'rms um':>7s} {'solid tip %':>11s} rms um")
    for path in sorted(FEM.glob("*_rod*.csv")):
        plain, solid = misses(path.name, "rod"), misses(path.name, "solid")
        print(
            f"{path.name:28s} {plain[0]:9.4f} {plain[1]:7.2f} {solid[0]:11.4f} "
            f"{solid[1]:6.3f}"
        )
    print(f"{'drawn':11s} {'strain':>6s} {'rod tip %':>9s} {'rms um':>7s} solid")
    for path in sorted(FEM.glob("drawn_*.csv")):
        print(drawn(path))
    magnet = MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=60.0)
    for name, field in (("uniform", UniformField(flux_mT=50.0)), ("magnet", magnet)):
        plain, solid = cost_us(field, "rod"), cost_us(field, "solid")
        print(
            f"{name}: solve() {plain:.0f} us as rod, {solid:.0f} us as solid: "
            f"{solid / plain:.2f} times"
        )
    above = Support(gravity_m_s2=(0.0, 0.0, -9.80665))
    plain, solid = (cost_us(magnet, model, above) for model in ("rod", "solid"))
    print(
        f"seen from above, weighed: solve() {plain:.0f} us as rod, {solid:.0f} us as "
        f"solid: {solid / plain:.2f} times"
    )


if __name__ == "__main__":
    main()
