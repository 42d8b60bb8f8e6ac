"""Time the rod in space against scipy's solve_bvp and PyElastica on one case.

GMC 2 at 50 mT and 90 deg; the same with weight out of the plane; and before the cube
magnet. Run by hand:

    python benchmarks/bench_sim_3d.py

Prints CPU microseconds per solve of the kernel (the tip's pose), of the whole call
with 61 points, and of the peers, with the tip errors against the planar solver.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from scipy.integrate import solve_bvp

from magbend.core.magnet import Magnet
from magbend.core.units import MU0
from magbend.sim import MagnetField, Support, UniformField, gmc
from magbend.sim.one_rod import solve
from magbend.sim.scaling import field_array
from magbend.sim.spatial.index import morse_index, unknowns
from magbend.sim.spatial.march import workspace
from magbend.sim.spatial.newton import COARSE, newton
from magbend.sim.spatial.rod import rod_table
from magbend.sim.spatial.solver import SpatialRod, _steps, solve_spatial

FIELD = UniformField(flux_mT=50.0)
WEIGHT = Support(gravity_m_s2=(0.0, 0.0, -9.80665))
CLAMP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def best(function, repeats: int = 5, calls: int = 20) -> float:
    """Return the best mean time of `calls` calls, in us."""
    function()
    times = []
    for _ in range(repeats):
        start = time.thread_time()
        for _ in range(calls):
            function()
        times.append((time.thread_time() - start) / calls)
    return min(times) * 1e6


def kernel(rod, field, support: Support, steps: float | None = None):
    """Return functions that solve for the tip's pose from cold and count the index."""
    table = rod_table(SpatialRod.from_specimen(rod), support)
    flux = field_array(field, rod.length_mm)
    n = steps or _steps(table, flux, CLAMP[:, 2])
    columns = unknowns(flux)
    y, Z, none = np.zeros(18), np.zeros((12, columns)), np.zeros((12, 0))
    work, bare, J = workspace(columns), workspace(0), np.zeros((6, 6))
    R, r = CLAMP.copy(), CLAMP[:, 2].copy()

    def run() -> None:
        R[:], r[:] = CLAMP, CLAMP[:, 2]
        newton(table, flux, 1.0, n, CLAMP, R, r, 1.0, y, Z, J, none, work, bare)

    def index() -> None:
        morse_index(table, flux, 1.0, COARSE * n, R, r)

    return run, index, r, n


def bvp(rod, tolerance: float):
    """Solve the planar case with scipy, one domain per section stacked."""
    EI = np.array([part.E_MPa for part in rod.sections]) * 1e6 * 1e-12 / 12.0
    load = 1e-6 * rod.remanence_mT * 1e-3 / MU0 * 0.05

    def slope(x, y):
        out = np.empty_like(y)
        for k in range(3):
            theta, moment = y[4 * k], y[4 * k + 1]
            out[4 * k] = 0.01 * moment / EI[k]
            out[4 * k + 1] = -0.01 * load * np.cos(theta)
            out[4 * k + 2] = 0.01 * np.cos(theta)
            out[4 * k + 3] = 0.01 * np.sin(theta)
        return out

    def ends(a, b):
        joints = [b[4 * k + i] - a[4 * k + 4 + i] for k in range(2) for i in range(4)]
        return np.array([a[0], a[2], a[3], b[9], *joints])

    x = np.linspace(0.0, 1.0, 6)
    return solve_bvp(slope, ends, x, np.zeros((12, 6)), tol=tolerance)


def elastica_us_per_step(elements: int = 60) -> float:
    """Return the time of one PyElastica step of such a rod, in us (no damping)."""
    import elastica as ea

    class Simulator(ea.BaseSystemCollection, ea.Constraints):
        pass

    simulator = Simulator()
    rod = ea.CosseratRod.straight_rod(
        elements, np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]),
        0.03, 0.0005, 2640.0, youngs_modulus=15e6, shear_modulus=5e6,
    )  # fmt: skip
    simulator.append(rod)
    simulator.constrain(rod).using(
        ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,)
    )
    simulator.finalize()
    stepper = ea.PositionVerlet()
    clock, dt, count = np.float64(0.0), np.float64(1.5e-6), 200
    for run in range(2):
        start = time.thread_time()
        for _ in range(count):
            clock = stepper.step(simulator, clock, dt)
        if run:
            return (time.thread_time() - start) / count * 1e6
    return np.nan


def main() -> None:
    """Print the table."""
    rod = replace(gmc(2), density_kg_m3=2640.0)
    exact = np.array(solve(rod, FIELD).centreline.tip_mm)
    cube = MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=60.0)
    ours = 0.0
    for name, field, support in (
        ("planar", FIELD, Support()),
        ("weight out of plane", FIELD, WEIGHT),
        ("the same, cube magnet", cube, WEIGHT),
    ):
        truth = solve_spatial(rod, field, support=support).r_mm[-1]
        for steps in (6.0, None):
            run, index, r, n = kernel(rod, field, support, steps)
            us, more = best(run), best(index)
            ours = ours or us
            error = np.abs(r * 30.0 - truth).max()
            print(
                f"{name}: {n:4.1f} steps, kernel {us:6.1f} us + index {more:5.1f} us, "
                f"tip error {error:.1e} mm"
            )
        call = best(lambda f=field, s=support: solve_spatial(rod, f, support=s))
        print(f"{name}: solve_spatial with 61 points and error bound {call:6.1f} us")
    for tolerance in (1e-3, 1e-6):
        found = bvp(rod, tolerance)
        us = best(lambda t=tolerance: bvp(rod, t), repeats=3, calls=2)
        error = np.abs(found.y[10:12, -1] * 1e3 - exact).max()
        print(
            f"solve_bvp, planar, tol {tolerance:g}: {us:8.0f} us, tip error "
            f"{error:.1e} mm: {us / ours:.0f} times ours"
        )
    step = elastica_us_per_step()
    print(
        f"PyElastica, 60 elements: {step:.0f} us a time step; at 145 000 steps to rest "
        f"{step * 0.145:.1f} s: {step * 145e3 / ours:.0f} times ours"
    )


if __name__ == "__main__":
    main()
