"""Design backwards: random reachable radii, share hit, time a target.

Run by hand: python benchmarks/bench_design.py [targets]
"""

from __future__ import annotations

import sys
import time

import numpy as np

from magbend.analysis.design import goals
from magbend.analysis.design.makeable import (
    Candidates,
    Makeable,
    designs_in,
    dimension,
    rods,
)
from magbend.analysis.design.search import find_designs
from magbend.core.errors import SolverError
from magbend.sim import UniformField
from magbend.sim.batch.shapes import solve_shapes


def main(targets: int) -> None:
    limits, rng = Makeable(), np.random.default_rng(2026)
    radius = goals.radius_goal(1.0)
    hits, all_five, wall, cpu = 0, 0, [], []
    find_designs(
        goals.radius_goal(100.0), UniformField(flux_mT=50.0), limits
    )  # warm-up
    for _ in range(targets):
        z = rng.random((1, dimension(limits)))
        made = rods(limits, Candidates(z=z, choice=np.zeros(1, dtype=np.int64)))
        field = UniformField(flux_mT=float(rng.uniform(10.0, 120.0)))
        shape = solve_shapes(designs_in(made, field)).points
        wanted = float(goals.achieved(radius, shape)[0])
        start, start_cpu = time.perf_counter(), time.process_time()
        try:
            found = find_designs(goals.radius_goal(wanted), field, limits, count=5)
        except SolverError as error:
            print(f"missed {wanted:.4g} mm at {field.flux_mT:.3g} mT: {error}")
            found = []
        wall.append(time.perf_counter() - start)
        cpu.append(time.process_time() - start_cpu)
        hits += bool(found) and found[0].error <= goals.HIT_PERCENT
        all_five += len(found) == 5
    print(f"{targets} random reachable radii, 10 to 120 mT, five designs each")
    print(f"hit within {goals.HIT_PERCENT} %: {hits / targets:.1%} (goal 99 %)")
    print(f"all five designs distinct: {all_five / targets:.1%}")
    print(f"processor time: median {np.median(cpu):.3f} s, worst {max(cpu):.3f} s")
    print(f"wall time: median {np.median(wall):.3f} s, worst {max(wall):.3f} s")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
