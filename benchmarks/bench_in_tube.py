"""What a step through a tube costs, and how the error falls with the elements.

python benchmarks/bench_in_tube.py

CPU time of one thread for a whole passage over its steps, Python and all, the best of
three; as a ratio to the planar solver in a like bend in the same run. Errors: of a free
rod from `solve_spatial`, of one in a tube from the same on 96 elements. Tubes of no
test: drawn once with a seed, those that turn too tight left out.
"""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np

from magbend.core.errors import InputError
from magbend.sim import Field, Uniform, UniformField, gmc, solve_spatial
from magbend.sim.navigate import channel, navigate, read_lumen
from magbend.sim.tube import Tube, helix

ROD = gmc(2)
NOTHING = UniformField(flux_mT=0.0)
OBLIQUE = Field(Uniform(flux_mT=50.0, angle_deg=70.0, elevation_deg=40.0))
LUMENS = Path(__file__).parents[1] / "fixtures" / "lumens"
SEED = 2026


def cost_ms(lumen, field=NOTHING) -> float:
    """Return the CPU time of a step, in ms."""
    best = math.inf
    for _ in range(3):
        start = time.process_time()
        way = navigate(ROD, lumen, field, refine=False)
        best = min(best, (time.process_time() - start) / len(way.steps))
    return 1e3 * best


def drawn(count: int) -> list[tuple[Tube, Field]]:
    """Return tubes that wander, and fields from anywhere."""
    rng = np.random.default_rng(SEED)
    found: list[tuple[Tube, Field]] = []
    while len(found) < count:
        towards, points = np.array([1.0, 0.0, 0.0]), [np.zeros(3)]
        for _ in range(7):
            towards = towards + rng.normal(size=3) * rng.uniform(0.1, 0.7)
            towards /= np.linalg.norm(towards)
            points.append(points[-1] + towards * rng.uniform(4.0, 8.0))
        radius = tuple(rng.uniform(0.9, 2.5, len(points)))
        field = Field(
            Uniform(
                flux_mT=rng.uniform(0.0, 60.0),
                angle_deg=rng.uniform(-180.0, 180.0),
                elevation_deg=rng.uniform(-80.0, 80.0),
            )
        )
        try:
            found.append(
                (Tube(name="drawn", points_mm=points, radius_mm=radius), field)
            )
        except InputError:
            continue
    return found


def main() -> None:
    wide = Tube(name="wide", points_mm=[(0, 0, 0), (80, 0, 0)], radius_mm=60.0)
    free = solve_spatial(ROD, OBLIQUE).r_mm[-1]
    for n in (4, 8, 16, 24):
        last = navigate(ROD, wide, OBLIQUE, elements=n, step_mm=15.0, refine=False)
        off = math.dist(last.steps[-1].tip_mm, free)
        print(f"{n:4d} elements, free rod: tip off by {off:.1e} mm")
    arch = read_lumen(LUMENS / "arch.toml")
    tips = {
        n: navigate(ROD, arch, OBLIQUE, elements=n, refine=False).steps[-1].tip_mm
        for n in (6, 12, 24, 48, 96)
    }
    for n in (6, 12, 24, 48):
        print(
            f"{n:4d} elements, arch: tip off by {math.dist(tips[n], tips[96]):.1e} mm"
        )
    bend = channel("bend", width_mm=3.0, legs=[(5.0, 0.0), (18.0, 90.0), (20.0, 0.0)])
    planar = cost_ms(bend)
    turns = {
        "arch": arch,
        "helix": Tube(name="helix", points_mm=helix(12.0, 25.0, 1.0), radius_mm=2.0),
        "tight helix": Tube(
            name="helix", points_mm=helix(12.0, 25.0, 1.0), radius_mm=0.9
        ),
    }
    for name, tube in turns.items():
        ms = cost_ms(tube)
        print(f"{name:12s} {ms:6.2f} ms a step (CPU), {ms / planar:.1f} planar steps")
    times, worst, through = [], 0.0, 0
    for tube, field in drawn(24):
        start = time.process_time()
        way = navigate(ROD, tube, field, refine=False)
        times.append(1e3 * (time.process_time() - start) / len(way.steps))
        worst = max(worst, way.most("overlap_mm"))
        through += way.outcome == "inserted"
    print(
        f"{len(times)} drawn tubes: {through} inserted, {np.median(times):.1f} ms a "
        f"step (median), {max(times):.1f} at most; overlap {worst:.1e} mm at most"
    )


if __name__ == "__main__":
    main()
