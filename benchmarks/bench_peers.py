"""Solve one rod with other people's solvers, to equal errors, in one run.

    python benchmarks/bench_peers.py [plane] [space] [batch]

GMC 2 at 50 mT across; the same with its weight across the plane; a thousand designs at
once. Peers: exudyn (compiled C++: cubic cable elements, static Newton), scipy's
solve_bvp with its Jacobians given, shooting with scipy's DOP853 and variational
columns, PyElastica (damped dynamics until at rest, extrapolated by Richardson). One
that is not installed is passed over.

Each row: processor time of one solve, the best of several; its ratio to ours; the
largest error of the tip against the exact answer of *the same rod*: PyElastica's
stretches and shears, exudyn's stretches, the others do neither. Peers are given the
dead load at the tip that the field reduces to, so none of them evaluates a field.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from peers import (
    BEND,
    DENSITY_KG_M3,
    LENGTH_M,
    LOAD_N,
    PARTS,
    PIECE_M,
    SIDE_M,
    STRETCH_N,
    E_Pa,
    at_rest,
    bvp_in_plane,
    cables,
    exact,
    marched,
    shot_in_space,
)

from magbend.core.units import GRAVITY_M_PER_S2
from magbend.sim import (
    Support,
    UniformField,
    gmc,
    solve,
    solve_many,
    solve_spatial,
)

Array = NDArray[np.float64]
Row = tuple[str, float, float]
"""Setting, time of one solve in s, error in mm."""

ROD = replace(gmc(2), density_kg_m3=DENSITY_KG_M3)
FIELD = UniformField(flux_mT=50.0)
WEIGHT = Support(gravity_m_s2=(0.0, 0.0, -GRAVITY_M_PER_S2))
AIM = 1e-6 * LENGTH_M * 1e3
"""The error that peers are asked for, in mm: a millionth of the length."""


def cost(call: Callable[[], object], runs: int = 3, times: int = 5) -> float:
    """Return the processor time of one call in s, the best of `times` means."""
    call()
    best = np.inf
    for _ in range(times):
        start = time.process_time()
        for _ in range(runs):
            call()
        best = min(best, (time.process_time() - start) / runs)
    return float(best)


def worst(tip_mm: Array, truth_mm: Array) -> float:
    """Return the largest error of a coordinate, in mm."""
    return float(np.abs(tip_mm - truth_mm).max())


def ours_in_plane() -> Iterator[Row]:
    """With 61 points, status, stability and error bound."""

    def call() -> Array:
        line = solve(ROD, FIELD).centreline
        assert line is not None
        return np.array(line.tip_mm)

    yield "solve", cost(call, 300), worst(call(), exact())


def shooting() -> Iterator[Row]:
    """One rod, by scipy's DOP853."""
    for tolerance in (1e-3, 1e-6, 1e-9):

        def call(t: float = tolerance) -> Array:
            return 1e3 * LENGTH_M * marched(BEND[:, None], t)[0]

        yield f"shooting, rtol {tolerance:g}", cost(call), worst(call(), exact())


def bvp() -> Iterator[Row]:
    """With the Jacobians, and once without."""
    for tolerance, given in ((1e-3, True), (1e-6, False), (1e-6, True), (1e-9, True)):

        def call(t: float = tolerance, g: bool = given) -> Array:
            return bvp_in_plane(t, given=g)

        name = f"solve_bvp, tol {tolerance:g}" + ("" if given else ", no Jacobian")
        yield name, cost(call), worst(call(), exact())


def exudyn() -> Iterator[Row]:
    """Cubic cable elements that stretch and do not shear."""
    truth = exact(STRETCH_N)
    for elements in (3, 6, 12, 24):
        call = cables(elements, weight=False)
        yield f"exudyn, {elements} cables", cost(call), worst(call(), truth)


def pyelastica() -> Iterator[Row]:
    """Damped dynamics until at rest, then Richardson's extrapolation in the element."""
    at_rest(6)  # compiles
    spent, rows = 0.0, []
    for elements in (6, 12, 24, 48):
        start = time.process_time()
        tip, truth = at_rest(elements)
        took = time.process_time() - start
        spent += took
        rows = [tip, *rows]
        for order in range(1, len(rows)):
            rows[order] = rows[order - 1] + (rows[order - 1] - rows[order]) / (
                2.0**order - 1.0
            )
        yield f"PyElastica, {elements} elements", took, worst(tip, truth)
        if len(rows) > 1:
            yield f"PyElastica, 6 to {elements}", spent, worst(rows[-1], truth)


def ours_in_space() -> Iterator[Row]:
    """With 61 points, stability and error bound."""

    def call() -> Array:
        return solve_spatial(ROD, FIELD, support=WEIGHT).r_mm[-1]

    yield "solve_spatial", cost(call, 50), worst(call(), shot_in_space(1e-12))


def exudyn_in_space() -> Iterator[Row]:
    """Cubic cable elements without torsion, which an untwisted rod has none of."""
    truth = shot_in_space(1e-12, LOAD_N / STRETCH_N)
    for elements in (3, 6, 12, 24):
        call = cables(elements, weight=True)
        yield f"exudyn, {elements} cables", cost(call), worst(call(), truth)


def shooting_in_space() -> Iterator[Row]:
    """One rod, by scipy's `root` and DOP853."""
    truth = shot_in_space(1e-12)
    for tolerance in (1e-4, 1e-7):

        def call(t: float = tolerance) -> Array:
            return shot_in_space(t)

        yield f"shooting, rtol {tolerance:g}", cost(call, 1), worst(call(), truth)


def batch(n: int = 1000) -> Iterator[Row]:
    """Many rods at once: each time is that of one, the error the largest of all."""
    rng = np.random.default_rng(19)
    flux, E = rng.uniform(10.0, 120.0, n), rng.uniform(5.0, 30.0, (n, PARTS))
    columns = {
        "length_mm": np.full((n, PARTS), 1e3 * PIECE_M), "E_MPa": E, "flux_mT": flux,
        "side_mm": 1e3 * SIDE_M, "remanence_mT": ROD.remanence_mT,
    }  # fmt: skip
    bend = BEND[0] * (flux / 50.0) * (E_Pa[0] / 1e6 / E).T
    truth = 1e3 * LENGTH_M * marched(bend, 1e-13)

    def ours() -> Array:
        found = solve_many(columns, threads=1)
        return np.stack([found["tip_x_mm"], found["tip_y_mm"]], axis=1)

    yield "solve_many, one core", cost(ours, 20) / n, worst(ours(), truth)
    for tolerance in (1e-3, 1e-6, 1e-9):

        def call(t: float = tolerance) -> Array:
            return 1e3 * LENGTH_M * marched(bend, t)

        took = cost(call, 1) / n
        yield f"shooting, rtol {tolerance:g}", took, worst(call(), truth)


TABLES = {
    "plane": (ours_in_plane, exudyn, bvp, shooting, pyelastica),
    "space": (ours_in_space, exudyn_in_space, shooting_in_space),
    "batch": (batch,),
}


def main() -> None:
    """Print the tables, or those named."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("tables", nargs="*", help=f"of {', '.join(TABLES)}")
    names = asked.parse_args().tables or list(TABLES)
    if unknown := set(names) - set(TABLES):
        asked.error(f"there is no table {', '.join(unknown)}")
    print(f"a millionth of the length is {AIM:.0e} mm")
    for name in names:
        print(f"\n{name:34} {'time':>13} {'ratio':>9} {'error, mm':>10}")
        ours = 0.0
        for peer in TABLES[name]:
            try:
                for told, took, error in peer():
                    ours = ours or took
                    print(
                        f"{told:34} {took * 1e6:10.1f} us {took / ours:9.1f} "
                        f"{error:10.1e}"
                    )
            except ImportError as missing:
                print(f"{peer.__name__}: {missing.name} is not installed")


if __name__ == "__main__":
    main()
