"""Time the rod in space in units of the same rod in the plane.

    python benchmarks/bench_sim_3d.py

GMC 2 at 50 mT or before the cube magnet, with 61 points, index and error bound; then
2000 designs at once, drawn here, on one core. All times are processor time, the best of
several runs; `bench_peers.py` sets other people's solvers beside it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from bench_sim import CUBE, cost

from magbend.core.units import GRAVITY_M_PER_S2
from magbend.sim import (
    MagnetField,
    Support,
    UniformField,
    gmc,
    solve,
    solve_spatial,
    solve_spatial_many,
)

FIELD = UniformField(flux_mT=50.0)
MAGNET = MagnetField(magnet=CUBE, gap_mm=60.0)
WEIGHT = Support(gravity_m_s2=(0.0, 0.0, -GRAVITY_M_PER_S2))
ROD = replace(gmc(2), density_kg_m3=2640.0)
TILTED = replace(ROD, remanence_y_mT=10.0, remanence_z_mT=5.0)
CASES = {
    "planar": (ROD, FIELD, Support()),
    "weight across": (ROD, FIELD, WEIGHT),
    "weight, cube": (ROD, MAGNET, WEIGHT),
    "tilted": (TILTED, FIELD, Support()),
    "tilted, weight, cube": (TILTED, MAGNET, WEIGHT),
}


def draw(count: int, *, cube: bool, tilted: bool) -> dict:
    """Return rods of three sections, of a seed that nothing was tuned on."""
    rng = np.random.default_rng([1905, cube, tilted])
    designs = {
        "length_mm": rng.uniform(5.0, 15.0, (count, 3)),
        "E_MPa": rng.uniform(8.0, 30.0, (count, 3)),
        "side_mm": rng.uniform(0.7, 1.3, count),
        "remanence_mT": rng.uniform(-25.0, 25.0, count),
        "density_kg_m3": 2640.0,
    }
    if tilted:
        designs["remanence_y_mT"] = rng.uniform(-10.0, 10.0, count)
        designs["remanence_z_mT"] = rng.uniform(-10.0, 10.0, count)
    if cube:
        return designs | {"gap_mm": rng.uniform(50.0, 90.0, count)}
    return designs | {"flux_mT": rng.uniform(10.0, 60.0, count)}


def batches(count: int, plane: float) -> None:
    """Print what a design costs among many."""
    for tilted in (False, True):
        for cube in (False, True):
            designs = draw(count, cube=cube, tilted=tilted)
            case = {"magnet": CUBE if cube else None, "support": WEIGHT, "threads": 1}
            took = cost(lambda d=designs, c=case: solve_spatial_many(d, **c), 1, 5)
            found = solve_spatial_many(designs, **case)
            name = f"weight{', tilted' * tilted}{', cube' * cube}"
            print(
                f"solve_spatial_many, {name:22} {took / count * 1e6:5.1f} us a "
                f"design   ratio {took / count / plane:5.2f}   error bound "
                f"{np.nanmedian(found['error_mm']):.1e} mm (median), "
                f"{np.nanmax(found['error_mm']):.1e} mm"
            )


def main() -> None:
    """Print the table."""
    plane = cost(lambda: solve(ROD, MAGNET), 300)
    print(f"{'solve, cube, in the plane':34} {plane * 1e6:8.1f} us")
    for name, (rod, field, support) in CASES.items():
        found = solve_spatial(rod, field, support=support)
        took = cost(
            lambda r=rod, f=field, s=support: solve_spatial(r, f, support=s), 10
        )
        print(
            f"solve_spatial, {name:20} {took * 1e6:7.1f} us   ratio {took / plane:6.1f}"
            f"   error bound {found.error_mm:.1e} mm"
        )
    batches(2000, plane)


if __name__ == "__main__":
    main()
