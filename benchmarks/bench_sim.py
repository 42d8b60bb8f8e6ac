"""Time the planar simulator beside scipy's boundary value solver and PyElastica.

Run by hand: ``python benchmarks/bench_sim.py [--elastica]``. All times are processor
time, the best of several runs, so that they mean something on a busy machine.
"""

from __future__ import annotations

import math
import resource
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_bvp

from magbend.core.magnet import Magnet
from magbend.core.units import MU0
from magbend.sim import (
    MagnetField,
    UniformField,
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


def boundary_value_problem() -> np.ndarray:
    """GMC 2 at 50 mT, 90 deg, by solve_bvp on its three sections side by side."""
    E, length, side = np.array([20e6, 15e6, 10e6]), 0.01, 1e-3
    load = side**2 * 20.07e-3 / MU0 * 50e-3
    EI = E * side**4 / 12.0

    def slope(_t: np.ndarray, y: np.ndarray) -> np.ndarray:
        theta, moment = y[0:3], y[3:6]
        return np.vstack(
            [
                length * moment / EI[:, None],
                -length * load * np.cos(theta),
                length * np.cos(theta),
                length * np.sin(theta),
            ]
        )

    def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        joints = [b[i] - a[i + 1] for i in (0, 1, 3, 4, 6, 7, 9, 10)]
        return np.array([a[0], a[6], a[9], b[5], *joints])

    mesh = np.linspace(0.0, 1.0, 11)
    found = solve_bvp(slope, ends, mesh, np.zeros((12, 11)), tol=1e-6)
    return 1e3 * np.array([found.y[8, -1], found.y[11, -1]])


def designs(n: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    rods = [gmc(int(k)) for k in rng.integers(1, 8, n)]
    return {
        "length_mm": np.array([[s.length_mm for s in r.sections] for r in rods]),
        "E_MPa": np.array([[s.E_MPa for s in r.sections] for r in rods]),
        "side_mm": np.array([r.side_mm for r in rods]),
        "remanence_mT": np.array([r.remanence_mT for r in rods]),
    }


def single_calls() -> float:
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
    return uniform


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


def elastica(ours: float) -> None:
    """PyElastica, damped dynamics until 0.25 s, 60 elements."""
    import elastica as ea

    class Simulator(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping):
        pass

    system = Simulator()
    n, length, side = 60, 0.03, 1e-3
    rod = ea.CosseratRod.straight_rod(
        n, np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), length,
        np.sqrt(side**2 / np.pi), 2640.0, youngs_modulus=15e6, shear_modulus=5e6,
    )  # fmt: skip
    # A square of the same area is stiffer by pi / 3 than the circle.
    for first, E in ((0, 20e6), (20, 15e6), (40, 10e6)):
        rod.bend_matrix[..., first : first + 20] *= E / 15e6 * np.pi / 3.0
    system.append(rod)
    system.constrain(rod).using(
        ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,)
    )
    load = side**2 * 20.07e-3 / MU0 * 50e-3
    system.add_forcing_to(rod).using(
        ea.EndpointForces, np.zeros(3), np.array([0, load, 0.0]), ramp_up_time=1e-3
    )
    step = 1.7e-6
    system.dampen(rod).using(
        ea.AnalyticalLinearDamper, uniform_damping_constant=150.0, time_step=step
    )
    system.finalize()
    start = time.process_time()
    t = 0.0
    stepper = ea.PositionVerlet()
    for _ in range(int(0.25 / step)):
        t = stepper.step(system, t, step)
    theirs = time.process_time() - start
    error = abs(rod.position_collection[1, -1] * 1e3 - TIP[1])
    print(
        f"PyElastica, 0.25 s           {theirs * 1e6:8.0f} us   error {error:.1e} mm"
        f"   ratio {theirs / ours:.0f}"
    )


def main() -> None:
    ours = single_calls()
    error = np.abs(boundary_value_problem() - TIP).max()
    theirs = cost(boundary_value_problem, 10)
    print(
        f"scipy solve_bvp, tol 1e-6    {theirs * 1e6:8.1f} us   error {error:.1e} mm"
        f"   ratio {theirs / ours:.0f}"
    )
    derivatives()
    batches()
    start_up()
    if "--elastica" in sys.argv:
        elastica(ours)


if __name__ == "__main__":
    main()
