"""How often no answer is found for random rods: before cubes and coils, both signs.

Paper-like rods (side 0.75 to 1.3 mm, three sections of 3 to 20 MPa, 20 to 60 mm long)
at 1, 5 and 20 times the printed remanence, 30 to 120 mm from their source. Prints how
many are stable, unstable, pulled in, touching and not solved.

    python benchmarks/bench_never_give_up.py [rods of each kind]
"""

from __future__ import annotations

import sys
import time
from collections import Counter

import numpy as np

from magbend.core.errors import MagbendError
from magbend.core.magnet import Magnet
from magbend.sim import Coil, Cuboid, Field, Rod, Section, solve, solve_many
from magbend.sim.batch import OUTCOMES
from magbend.sim.fields import before


def rods(rng: np.random.Generator, n: int, times: float) -> dict[str, np.ndarray]:
    """Return random designs, shape by column as `solve_many` takes them."""
    share = rng.dirichlet([2.0, 2.0, 2.0], n)
    sign = rng.choice([-1.0, 1.0], n)
    return {
        "length_mm": share * rng.uniform(20.0, 60.0, (n, 1)),
        "E_MPa": rng.uniform(3.0, 20.0, (n, 3)),
        "side_mm": rng.uniform(0.75, 1.3, n),
        "remanence_mT": sign * times * rng.uniform(14.0, 26.0, n),
        "gap_mm": rng.uniform(30.0, 120.0, n),
    }


def main() -> None:
    """Print a row for each source and remanence."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 20000
    sources = {
        "cube": Magnet.cube(55.0, 1.305),
        "cube turned": Field(
            Cuboid(sides_mm=55.0, remanence_T=1.305, axis_angle_deg=50.0)
        ),
        "coil": Field(Coil(diameter_mm=80.0, current_A=100.0, turns=500)),
    }
    why: Counter[str] = Counter()
    print(
        "source         times", *(f"{name[:12]:>13}" for name in OUTCOMES), "   us each"
    )
    for seed, (name, source) in enumerate(sources.items()):
        for times in (1.0, 5.0, 20.0):
            designs = rods(np.random.default_rng([seed, int(times)]), n, times)
            begin = time.process_time()
            found = solve_many(designs, magnet=source)
            each = (time.process_time() - begin) / n * 1e6
            counts = np.bincount(found["outcome"], minlength=len(OUTCOMES))
            print(
                f"{name:14} {times:5g}", *(f"{c:13}" for c in counts), f"{each:10.1f}"
            )
            for i in np.flatnonzero(found["outcome"] == OUTCOMES.index("not solved")):
                why[_why(designs, i, source)] += 1
    print("not solved, by what solve says:", dict(why))


def _why(designs: dict[str, np.ndarray], i: int, source: Magnet | Field) -> str:
    """Return the kind of error that `solve` has for a design."""
    parts = zip(designs["length_mm"][i], designs["E_MPa"][i], strict=True)
    rod = Rod(
        name="random", side_mm=designs["side_mm"][i],
        remanence_mT=designs["remanence_mT"][i],
        sections=tuple(Section(length_mm=mm, E_MPa=MPa) for mm, MPa in parts),
    )  # fmt: skip
    try:
        solve(rod, before(source).at_gap(designs["gap_mm"][i]))
    except MagbendError as error:
        return f"{type(error).__name__}: {str(error)[:60]}"
    return "solved"


if __name__ == "__main__":
    main()
