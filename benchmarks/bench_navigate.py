"""What a step through a lumen costs, and how the error falls with the elements.

python benchmarks/bench_navigate.py

CPU time of one thread for a whole passage over its steps, Python and all; batches on
all cores as a ratio to one thread in the same run. The error is the distance of the
last tip, which lies along a wall, from the one on 192 elements.
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

from magbend.sim import UniformField, gmc
from magbend.sim.navigate import channel, navigate, navigate_many

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from does_grading_help import NOTHING, lumens

ROD = gmc(2)


def cost_ms(task: str, friction: float) -> float:
    """Return the CPU time of a step, in ms."""
    lumen = lumens(ROD.side_mm)[task]
    best = math.inf
    for _ in range(3):
        start = time.process_time()
        way = navigate(ROD, lumen, NOTHING, friction=friction, refine=False)
        best = min(best, (time.process_time() - start) / len(way.steps))
    return 1e3 * best


def main() -> None:
    for task in ("45 degrees", "90 degrees", "S", "fork"):
        plain, rubbed = cost_ms(task, 0.0), cost_ms(task, 0.2)
        print(f"{task:12s} {plain:6.2f} ms a step, {rubbed:6.2f} with friction (CPU)")
    bend = channel("bend", width_mm=2.5, legs=[(5.0, 0.0), (12.0, 60.0), (20.0, 0.0)])
    field = UniformField(flux_mT=20.0)
    tips = {
        n: navigate(ROD, bend, field, elements=n, refine=False).steps[-1].tip_mm
        for n in (6, 12, 24, 48, 96, 192)
    }
    for n in (6, 12, 24, 48, 96):
        print(f"{n:4d} elements: tip off by {math.dist(tips[n], tips[192]):.1e} mm")
    rods = [gmc(1 + n % 7) for n in range(28)]
    walls = []
    for threads in (1, None):
        start = time.perf_counter()
        navigate_many(rods, bend, field, threads=threads)
        walls.append(time.perf_counter() - start)
    print(f"28 rods on all cores: {walls[0] / walls[1]:.2f} times as fast as on one")


if __name__ == "__main__":
    main()
