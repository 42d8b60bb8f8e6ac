"""Compile the numerical kernels once, on two cores, into numba's cache.

Numba compiles a kernel when it is first called and keeps the result. A first command
would wait for that, one kernel after another; ``python -m magbend.analysis.warm_up``
(and `make demo`) does it beforehand.
"""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Callable

import numpy as np


def is_warm() -> bool:
    """Return whether nothing is left to do beforehand.

    The largest kernels are in the cache, or no folder can be written to keep them in.
    """
    from ..sim.planar.solver import solve_rows
    from ..sim.solid.newton import solve_shape
    from ..vision.edge.profiles import _sample

    kernels = (solve_rows, solve_shape, _sample)
    return all(kernel.is_stored or not kernel.cache_folder for kernel in kernels)


def warm_up() -> None:
    """Compile everything that `magbend demo` calls, in two processes."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(2) as pool:
        jobs = (_photograph, _curve, _rod, _solid)
        for result in [pool.apply_async(job) for job in jobs]:
            result.get()


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
    from ..core.centreline import Centreline
    from ..vision import as_photo, extract
    from ..vision.measurement import Pose
    from ..vision.synthetic import Block, Scene, render_scene, scene_camera
    from .compare import metrics

    s = np.linspace(0.0, 30.0, 121)
    arc = Centreline(
        s_mm=s, x_mm=60.0 * np.sin(s / 60.0), y_mm=60.0 * (1.0 - np.cos(s / 60.0)),
        theta_rad=s / 60.0, kappa_per_mm=np.full_like(s, 1.0 / 60.0),
    )  # fmt: skip
    camera = scene_camera()
    clamp = Block(pose=Pose(x_mm=16.0, y_mm=-30.0, angle_deg=0.0, height_mm=0.9))
    scene = Scene(clamp=clamp, centreline=arc)
    picture = render_scene(scene, camera, np.random.default_rng(0))
    measured = extract(as_photo(picture), camera, rod_height_mm=0.9, joints_mm=(10.0,))
    metrics.shape_errors(measured.centreline() or arc, arc)


def main(tell: Callable[[str], object] = sys.stderr.write) -> None:
    """Compile what is not compiled yet."""
    if not is_warm():
        tell("compiling the numerical kernels (once, a few minutes)\n")
        warm_up()


if __name__ == "__main__":
    main()
