"""Compile the numerical kernels once, on two cores, into numba's cache.

Numba compiles a kernel when it is first called and keeps the result. A first command
would wait for that, one kernel after another; ``python -m magbend.analysis.warm_up``
(and `magbend demo`, once it has shown its report) does it beforehand.
"""

from __future__ import annotations

import multiprocessing
import subprocess
import sys
from collections.abc import Callable

import numpy as np


def is_warm() -> bool:
    """Return whether nothing is left to do beforehand.

    The largest kernels are in the cache, or no folder can be written to keep them in.
    """
    from ..sim.planar.solver import solve_rows
    from ..sim.solid.newton import solve_shape
    from ..vision.batch.cold import is_cold

    if not solve_rows.cache_folder:
        return True
    return solve_rows.is_stored and solve_shape.is_stored and not is_cold()


def warm_up() -> None:
    """Compile what photographs, solves and fits call, in two processes."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(2) as pool:
        jobs = (_photograph, _curve, _rod, _solid)
        for result in [pool.apply_async(job) for job in jobs]:
            result.get()


def warm_up_beside() -> None:
    """Compile in a process that goes on when this one has ended."""
    quiet = subprocess.DEVNULL
    subprocess.Popen(
        [sys.executable, "-m", "magbend.analysis.warm_up"],
        stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True,
    )  # fmt: skip


def _rod() -> None:
    from .. import sim
    from ..core.magnet import Magnet

    near = sim.MagnetField(magnet=Magnet.cube(55.0, 1.3), gap_mm=60.0)
    for field in (sim.UniformField(flux_mT=50.0), near):
        sim.solve(sim.gmc(2), field)
        sim.sensitivities(sim.gmc(2), field, parameters=("E_MPa[0]", "load_factor"))


def _solid() -> None:
    from .. import sim

    sim.solve(sim.gmc(2), sim.UniformField(flux_mT=50.0), model="solid")


def _curve() -> None:
    """Compile what fits a centreline: a photograph comes to it last."""
    from ..vision.curve.fit import solve
    from ..vision.curve.joints import find_joints
    from ..vision.curve.moment import weighed_fit
    from ..vision.curve.problem import SHARED, pose
    from ..vision.curve.spline import Smooth

    s = np.linspace(0.0, 200.0, 201)
    points, theta, ones = np.column_stack((s, np.zeros_like(s))), 0.0 * s, np.ones(201)
    problem = pose(s, points, ones, theta, spacing=10.0, joints=(100.0,))
    solve(problem, Smooth())
    weighed_fit(problem, (100.0,), 20.0)
    find_joints(s, theta, theta, ones, width=10.0, shared=SHARED)


def _photograph() -> None:
    from ..vision.batch.cold import compile_kernels
    from ..vision.synthetic import curve
    from .compare import metrics

    compile_kernels()
    metrics.shape_errors(curve("arc", angle_deg=29.0), curve("arc", angle_deg=30.0))


def main(tell: Callable[[str], object] = sys.stderr.write) -> None:
    """Compile what is not compiled yet."""
    if not is_warm():
        tell("compiling the numerical kernels (once, a few minutes)\n")
        warm_up()


if __name__ == "__main__":
    main()
