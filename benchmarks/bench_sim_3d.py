"""Time the rod in space in units of the same rod in the plane.

    python benchmarks/bench_sim_3d.py

GMC 2 at 50 mT or before the cube magnet, with 61 points, index and error bound. All
times are processor time, the best of several runs; `bench_peers.py` sets other people's
solvers beside it.
"""

from __future__ import annotations

from dataclasses import replace

from bench_sim import CUBE, cost

from magbend.core.units import GRAVITY_M_PER_S2
from magbend.sim import MagnetField, Support, UniformField, gmc, solve, solve_spatial

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


if __name__ == "__main__":
    main()
