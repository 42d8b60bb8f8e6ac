"""How often no answer is found for random rods: before cubes and coils, both signs.

Paper-like rods (side 0.75 to 1.3 mm, three sections of 3 to 20 MPa, 20 to 60 mm long)
at 1, 5 and 20 times the printed remanence, 30 to 120 mm from their source or in up to
200 mT; magnetised one way, or each section either way. Prints how many are stable,
unstable, pulled in, touching and not solved.

    python benchmarks/bench_never_give_up.py [rods of each kind] [seed]
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from itertools import product

import numpy as np

from magbend.core.errors import MagbendError
from magbend.core.magnet import Magnet
from magbend.sim import Coil, Cuboid, Field, Rod, Section, Uniform, solve, solve_many
from magbend.sim.batch import OUTCOMES
from magbend.sim.fields import before


def rods(
    rng: np.random.Generator, n: int, times: float, signs: int
) -> dict[str, np.ndarray]:
    """Return random designs, shape by column as `solve_many` takes them."""
    share = rng.dirichlet([2.0, 2.0, 2.0], n)
    sign = rng.choice([-1.0, 1.0], (n, 3 if signs > 1 else 1))
    return {
        "length_mm": share * rng.uniform(20.0, 60.0, (n, 1)),
        "E_MPa": rng.uniform(3.0, 20.0, (n, 3)),
        "side_mm": rng.uniform(0.75, 1.3, n),
        "remanence_mT": sign * times * rng.uniform(14.0, 26.0, (n, 1)) + np.zeros(3),
    }


def main() -> None:
    """Print a row for each source, remanence and number of signs."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 20000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    sources = {
        "uniform": None,
        "cube": Magnet.cube(55.0, 1.305),
        "cube turned": Field(
            Cuboid(sides_mm=55.0, remanence_T=1.305, axis_angle_deg=50.0)
        ),
        "coil": Field(Coil(diameter_mm=80.0, current_A=100.0, turns=500)),
    }
    why: Counter[str] = Counter()
    total = np.zeros(len(OUTCOMES), dtype=np.int64)
    names = (f"{name[:12]:>13}" for name in OUTCOMES)
    print("source       times signs", *names, "   us each")
    for name, times, signs in product(sources, (1.0, 5.0, 20.0), (1, 2)):
        rng = np.random.default_rng(
            [seed, list(sources).index(name), int(times), signs]
        )
        designs = rods(rng, n, times, signs)
        if sources[name] is None:
            designs["flux_mT"] = rng.uniform(10.0, 200.0, n)
            designs["angle_deg"] = rng.uniform(0.0, 180.0, n)
        else:
            designs["gap_mm"] = rng.uniform(30.0, 120.0, n)
        begin = time.process_time()
        found = solve_many(designs, magnet=sources[name])
        each = (time.process_time() - begin) / n * 1e6
        counts = np.bincount(found["outcome"], minlength=len(OUTCOMES))
        total += counts
        row = (f"{c:13}" for c in counts)
        print(f"{name:12} {times:5g} {signs:5}", *row, f"{each:10.1f}", flush=True)
        for i in np.flatnonzero(found["outcome"] == OUTCOMES.index("not solved")):
            why[_why(designs, i, sources[name])] += 1
    print(f"{total.sum()} rods".ljust(24), *(f"{c:13}" for c in total))
    print("not solved, by what solve says:", dict(why))


def _why(designs: dict[str, np.ndarray], i: int, source: Magnet | Field | None) -> str:
    """Return the kind of error that `solve` has for a design."""
    one = {name: column[i] for name, column in designs.items()}
    parts = zip(one["length_mm"], one["E_MPa"], one["remanence_mT"], strict=True)
    rod = Rod(
        name="random", side_mm=one["side_mm"], remanence_mT=1.0,
        sections=tuple(
            Section(length_mm=mm, E_MPa=MPa, remanence_mT=mT) for mm, MPa, mT in parts
        ),
    )  # fmt: skip
    try:
        if source is None:
            solve(rod, Uniform(flux_mT=one["flux_mT"], angle_deg=one["angle_deg"]))
        else:
            solve(rod, before(source).at_gap(one["gap_mm"]))
    except MagbendError as error:
        return f"{type(error).__name__}: {str(error)[:60]}"
    return "solved"


if __name__ == "__main__":
    main()
