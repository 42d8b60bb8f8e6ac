"""The first photographs after installation: measured before the kernels are compiled.

To compile all kernels takes a minute, once. A photograph takes some seconds in plain
Python, so a few are measured that way, and of many the first ones, while another
process compiles.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np

from ...core import jit
from ...core.jit import Kernel, once
from ...core.orphan import end_with_parent
from ..curve.fit import solution
from ..curve.joints import _evidence, _model
from ..curve.likelihood import penalised
from ..curve.spline import penalty_between
from ..edge.crossings import _fit_line
from ..edge.edges import _measure_side
from ..edge.profiles import _sample
from ..edge.rough_edges import _rough_edges
from ..edge.step_line import _fit_step
from ..extraction.extract import measure
from ..extraction.setting import Setting
from ..find.rod import _half_widths
from ..find.track import resample
from ..measurement import Pose
from ..picture.photo import as_photo
from ..synthetic.parts import Block, Scene, scene_camera
from ..synthetic.scene import render_scene
from ..synthetic.square_view import curve

Task = TypeVar("Task")
Result = TypeVar("Result")

FEW = 4
"""So many photographs are done sooner in plain Python than compiled beside it."""

PATIENCE = 5_000_000
"""Calls of kernels that a photograph may take in plain Python: some ten seconds."""

_LATEST: tuple[Kernel, ...] = (
    solution, _evidence, _model, penalised, penalty_between, _measure_side, _sample,
    _rough_edges, _fit_line, _fit_step, _half_widths, resample,
)  # fmt: skip
"""Kernels of every part of a measurement, the slowest to compile among them."""


def stored() -> tuple[int, int]:
    """Return how many of the kernels that come last are compiled, and their number."""
    return sum(kernel.is_stored for kernel in _LATEST), len(_LATEST)


def is_cold() -> bool:
    """Whether kernels of a measurement are not compiled yet."""
    done, number = stored()
    return done < number


def compile_kernels() -> None:
    """Compile all kernels of a measurement, by measuring a picture that is drawn."""
    line = curve("arc", angle_deg=29.0)
    pose = Pose(x_mm=16.0, y_mm=-30.0, angle_deg=0.0, height_mm=0.9)
    scene, camera = Scene(clamp=Block(pose=pose), centreline=line), scene_camera()
    picture = render_scene(scene, camera, np.random.default_rng(0))
    photo, known = as_photo(picture), Setting(calibration=camera, rod_height_mm=0.9)
    measure(photo, known)
    measure(photo, replace(known, joints_mm=(10.0,)))


def _compile_beside() -> None:
    end_with_parent()
    compile_kernels()


def while_cold(
    work: Callable[[Task], Result], todo: Sequence[Task]
) -> Iterator[Result]:
    """Yield results in plain Python, of the first tasks, until all is compiled.

    Parameters
    ----------
    work : callable
        What to do with each task; it may be done twice.
    todo : sequence
        The tasks. Few are done to the end: they are not worth the compiling.
    """
    if not todo or not jit.PLAIN_FIRST or not is_cold():
        return
    helper = None
    if len(todo) > FEW:
        if not _sample.cache_folder:
            return  # nothing would be kept of what another process compiles
        context = multiprocessing.get_context("spawn")
        helper = context.Process(target=_compile_beside, daemon=True)
        helper.start()
    try:
        for task in todo:
            if helper is not None and not helper.is_alive():
                return
            yield once(partial(work, task), patience=PATIENCE)
    finally:
        if helper is not None:
            helper.terminate()
            helper.join()
