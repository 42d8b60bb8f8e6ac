"""Compile the numerical kernels once, on two cores, into numba's cache.

Numba compiles a kernel when it is first called and keeps the result. A first command
would wait for that, one kernel after another; ``python -m magbend.analysis.warm_up``
does it beforehand, `magbend demo` once it has shown its report, and `magbend panel`
beside its page.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from ..core.errors import SolverError
from ..core.orphan import end_with_parent


def stored() -> tuple[int, int]:
    """Return how many of the largest kernels are compiled, and how many there are."""
    from ..sim.planar.solver import solve_rows
    from ..sim.solid.newton import solve_shape
    from ..vision.batch import cold

    done, number = cold.stored()
    return done + solve_rows.is_stored + solve_shape.is_stored, number + 2


def is_warm() -> bool:
    """Return whether nothing is left to do beforehand.

    The largest kernels are in the cache, or no folder can be written to keep them in.
    """
    done, number = stored()
    return done == number or not _cache_folder()


def _cache_folder() -> str:
    from ..sim.planar.solver import solve_rows

    return solve_rows.cache_folder


def warm_up() -> None:
    """Compile what photographs, solves and fits call, in two processes.

    Of two calls at a time, in any processes, the second waits for the first.

    Raises
    ------
    SolverError
        If a process fails; it has said why.
    """
    from ..core.jit import one_process

    context = multiprocessing.get_context("spawn")
    with one_process(Path(_cache_folder(), "warm_up.lock")):
        if is_warm():
            return
        workers = [
            context.Process(target=_work, args=jobs, daemon=True)
            for jobs in ((_photograph,), (_rod, _curve, _solid))
        ]
        with _deaf():
            for worker in workers:
                worker.start()
        for worker in workers:
            worker.join()
    if any(worker.exitcode for worker in workers):
        raise SolverError("the numerical kernels could not all be compiled")


def warm_up_beside() -> subprocess.Popen[bytes]:
    """Compile in a process that goes on when this one has ended."""
    quiet = subprocess.DEVNULL
    return subprocess.Popen(
        [sys.executable, "-m", "magbend.analysis.warm_up"],
        stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True,
    )  # fmt: skip


@contextlib.contextmanager
def _deaf() -> Iterator[None]:
    """Start processes that do not hear Ctrl-C: their parent alone answers it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


def _work(*jobs: Callable[[], None]) -> None:
    end_with_parent()
    for job in jobs:
        job()


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
        try:
            warm_up()
        except KeyboardInterrupt:
            tell("stopped; what is compiled is kept\n")
            raise SystemExit(128 + signal.SIGINT) from None


if __name__ == "__main__":
    main()
