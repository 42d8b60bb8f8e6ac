"""Time the planar simulator: single calls, batches, paths, first calls, commands.

    python benchmarks/bench_sim.py

All times are processor time, the best of several runs, so that they mean something on a
busy machine. `bench_peers.py` sets other people's solvers beside it.
"""

from __future__ import annotations

import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np

from magbend.core.magnet import Magnet
from magbend.sim import (
    Coil,
    Cuboid,
    Cylinder,
    Field,
    MagnetField,
    Uniform,
    UniformField,
    follow_path,
    gmc,
    sensitivities,
    solve,
    solve_many,
)

COMMANDS = (
    "--help",
    "sim --help",
    "sim shape --gmc 2 --field-mT 50",
    "sim shape --gmc 2 --field-mT 50 --model solid",
    "sim shape --gmc 2 --field-mT 50 --density-kg-m3 2640 --gravity-m-s2 0 0 -9.81",
    "sim shape --gmc 2 --field-mT 50 --verify",
    "sim equilibria --gmc 2",
    "sim magnet",
)
FIRST = {
    "solve": "solve(gmc(2), UniformField(flux_mT=50.0))",
    "solve_spatial": "solve_spatial(gmc(2), UniformField(flux_mT=50.0))",
    "solve_many": "solve_many({'length_mm': [[10.0]] * 1000, 'E_MPa': [[10.0]] * 1000,"
    " 'side_mm': 1.0, 'remanence_mT': 20.0, 'flux_mT': 50.0})",
}
"""Calls that a new session makes first."""
TIP = np.array([29.5353236353478, 4.70952405678937])
CUBE = Magnet.cube(55.0, 1.305)


def cost(call: Callable[[], object], runs: int, times: int = 7) -> float:
    """Processor time of one call in s, the best of `times` means over `runs`."""
    best = np.inf
    for _ in range(times):
        start = time.process_time()
        for _ in range(runs):
            call()
        best = min(best, (time.process_time() - start) / runs)
    return float(best)


def designs(n: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    rods = [gmc(int(k)) for k in rng.integers(1, 8, n)]
    return {
        "length_mm": np.array([[s.length_mm for s in r.sections] for r in rods]),
        "E_MPa": np.array([[s.E_MPa for s in r.sections] for r in rods]),
        "side_mm": np.array([r.side_mm for r in rods]),
        "remanence_mT": np.array([r.remanence_mT for r in rods]),
    }


def single_calls() -> None:
    field, magnet = UniformField(flux_mT=50.0), MagnetField(magnet=CUBE, gap_mm=60.0)
    rod = gmc(2)
    line = solve(rod, field).centreline
    assert line is not None
    uniform = cost(lambda: solve(rod, field), 300)
    cube = cost(lambda: solve(rod, magnet), 300)
    error = np.abs(np.array(line.tip_mm) - TIP).max()
    print(
        f"solve, uniform field         {uniform * 1e6:8.1f} us   error {error:.1e} mm"
    )
    print(f"solve, cube magnet           {cube * 1e6:8.1f} us")


def derivatives() -> None:
    """Sensitivities of every point's x, y and angle, in units of one solve."""
    rod, magnet = gmc(2), MagnetField(magnet=CUBE, gap_mm=60.0)
    base = cost(lambda: solve(rod, magnet), 300)
    names = [f"{kind}[{i}]" for kind in ("E_MPa", "length_mm") for i in range(3)]
    names += ["side_mm", "remanence_mT", "gap_mm", "magnet.remanence_T"]
    for few in (names[:1], names):
        one = cost(lambda p=few: sensitivities(rod, magnet, parameters=p), 100)
        print(
            f"sensitivities, {len(few):2d} of them     {one * 1e6:8.1f} us   "
            f"{one / base:.1f} solves, {one / base / len(few):.1f} a parameter"
        )


def batches(n: int = 100_000) -> None:
    rng = np.random.default_rng(1)
    rods = designs(n)
    cases = {
        "uniform": (rods | {"flux_mT": rng.uniform(10, 120, n)}, None),
        "cube": (rods | {"gap_mm": rng.uniform(50, 120, n)}, CUBE),
    }
    for name, (columns, magnet) in cases.items():
        found = solve_many(columns, magnet=magnet)
        worst = np.nanmax(found["error_mm"])
        one = (
            cost(lambda c=columns, m=magnet: solve_many(c, magnet=m, threads=1), 1) / n
        )
        start = time.perf_counter()
        solve_many(columns, magnet=magnet)
        wall = (time.perf_counter() - start) / n
        print(
            f"solve_many, {name:8s}         {one * 1e6:8.2f} us a solve a core, "
            f"{wall * 1e6:.2f} us wall on all; error below {worst:.1e} mm"
        )


def sums(n: int = 20_000) -> None:
    """Fields of sources, in units of the one magnet."""
    cube = Cuboid(sides_mm=55.0, remanence_T=1.305)
    beside = Cuboid(
        sides_mm=(20.0, 20.0, 30.0), remanence_T=-1.2, axis_angle_deg=-60.0,
        centre_mm=(-10.0, 70.0, 0.0),
    )  # fmt: skip
    cylinder = Cylinder(
        diameter_mm=40.0, length_mm=30.0, remanence_T=1.3, axis_angle_deg=180.0,
        centre_mm=(90.0, 40.0, 0.0),
    )  # fmt: skip
    coil = Coil(diameter_mm=80.0, current_A=5.0, turns=200, centre_mm=(0.0, -40.0, 0.0))
    fields = {
        "a cuboid": Field(cube),
        "a cylinder": Field(cylinder),
        "cuboid and uniform": Field(cube, Uniform(flux_mT=-2.0)),
        "2 cuboids, cylinder, coil": Field(cube, beside, cylinder, coil),
    }
    rod = gmc(2)
    rods = designs(n) | {"gap_mm": np.random.default_rng(2).uniform(50, 100, n)}
    one = cost(lambda: solve(rod, MagnetField(magnet=CUBE, gap_mm=60.0)), 200)
    each = cost(lambda: solve_many(rods, magnet=CUBE, threads=1), 1) / n
    for name, field in fields.items():
        near = field.at_gap(60.0)
        given = rods
        if not field.follows_gap:
            given = {key: of for key, of in rods.items() if key != "gap_mm"}
        single = cost(lambda f=near: solve(rod, f), 200)
        many = cost(lambda f=field, g=given: solve_many(g, magnet=f, threads=1), 1) / n
        worst = np.nanmax(solve_many(given, magnet=field)["error_mm"])
        print(
            f"{name:25} solve {single * 1e6:5.1f} us, ratio {single / one:.2f}; "
            f"solve_many {many * 1e6:5.2f} us, ratio {many / each:.1f}; "
            f"error below {worst:.1e} mm"
        )


def paths() -> None:
    """A path toward the cube and back, and one of a turning field that snaps."""
    cube = Field(Cuboid(sides_mm=55.0, remanence_T=1.305))
    turned = Field(Uniform(flux_mT=420.0))
    for name, field, way in (
        ("gap 120:30:120 mm", cube, {"gap_mm": (120.0, 30.0, 120.0)}),
        ("angle 100:260:100 deg", turned, {"angle_deg": (100.0, 260.0, 100.0)}),
    ):
        path = follow_path(gmc(2), field, **way)
        each = cost(lambda f=field, w=way: follow_path(gmc(2), f, **w), 1)
        points = len(path.points)
        base = cost(lambda f=field.at_gap(60.0): solve(gmc(2), f), 100)
        print(
            f"path, {name:22} {each * 1e3:6.1f} ms, {points} points, "
            f"{each / points / base:.1f} solves a point, {len(path.folds)} folds"
        )


def first_calls() -> None:
    """The first call of a session, where nothing is compiled yet."""
    for name, call in FIRST.items():
        code = (
            "import time; start = time.process_time()\n"
            f"from magbend.sim import gmc, UniformField, {name}\n"
            f"{call}\nprint(time.process_time() - start)"
        )
        with tempfile.TemporaryDirectory() as empty:
            told = subprocess.run(
                [sys.executable, "-c", code], check=True, capture_output=True,
                text=True, env=os.environ | {"NUMBA_CACHE_DIR": empty},
            ).stdout  # fmt: skip
        print(f"first {name}, imports and all {float(told):6.2f} s")


def processor_ms(arguments: list[str], runs: int = 7) -> float:
    """Processor time of a whole process, children and all, the best of some runs."""
    best = math.inf
    for _ in range(runs):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        best = min(best, used * 1e3)
    return best


def start_up() -> None:
    """Whole commands beside the imports that compiled kernels cannot do without."""
    base = processor_ms(["-c", "import numpy, numba"])
    print(f"import numpy, numba {base:6.0f} ms")
    for typed in COMMANDS:
        whole = processor_ms(["-m", "magbend.cli.main", *typed.split()])
        print(f"{whole:6.0f} ms, ratio {whole / base:.2f}: magbend {typed}")


def main() -> None:
    single_calls()
    sums()
    derivatives()
    batches()
    paths()
    first_calls()
    start_up()


if __name__ == "__main__":
    main()
