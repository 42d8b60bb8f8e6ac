"""Residuals of a fit and their derivatives.

Rows are the modes of each line across itself, then the numbers that runs state, each
over its standard deviation. Derivatives are differences: the solver repeats itself to
1e-12 mm, steps move a tip by nanometres, and a difference holds for every theory of the
rod, in the plane and out of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .fields import is_read
from .model import VIEW, across_mm, shape_of, stated, values_of
from .problem import Datum, Problem, Shot

Array = NDArray[np.float64]

WALL = 1e3
"""Residual of every row of a line where the rod has no equilibrium."""

STEP = 3e-5
"""Of a difference: in prior standard deviations, or of a logarithm."""


def residuals(problem: Problem, unknowns: Array) -> tuple[Array, Array]:
    """Return residuals of the data and their derivatives.

    Parameters
    ----------
    unknowns : ndarray, shape (p + q,)
        Logarithms of value over nominal value for `names`, then nuisances in units of
        their prior standard deviation.

    Returns
    -------
    residual : ndarray, shape (n,)
        Measured minus predicted, over its standard deviation.
    jacobian : ndarray, shape (n, p + q)
        Derivatives of the residuals.
    """
    parts = [line_rows(problem, shot, unknowns) for shot in problem.shots]
    parts += [_number_rows(problem, datum, unknowns) for datum in problem.data]
    return (
        np.concatenate([residual for residual, _ in parts]),
        np.concatenate([jacobian for _, jacobian in parts]),
    )


def misfit(problem: Problem, unknowns: Array) -> Array:
    """Return the residuals alone, as `residuals` does."""
    lines = [line / shot.row_sd_mm for line, shot in zip(
        left_over(problem, unknowns), problem.shots, strict=True)]  # fmt: skip
    numbers = [
        (datum.value - stated(datum, values_of(problem, datum.owner, unknowns)))
        / datum.sd
        for datum in problem.data
    ]
    return np.concatenate([*lines, numbers])


def left_over(problem: Problem, unknowns: Array) -> list[Array]:
    """Return the modes of what the model leaves of each line, in mm."""
    return [
        shot.modes @ line if line is not None else WALL * shot.row_sd_mm
        for shot, line in zip(
            problem.shots, distances_mm(problem, unknowns), strict=True
        )
    ]


def distances_mm(problem: Problem, unknowns: Array) -> list[Array | None]:
    """Return what the model leaves across each line, None without an equilibrium."""
    out = []
    for shot in problem.shots:
        values = values_of(problem, shot.owner, unknowns)
        xy_mm = shape_of(problem, shot, values)
        out.append(None if xy_mm is None else across_mm(shot, values, xy_mm))
    return out


def line_rows(problem: Problem, shot: Shot, unknowns: Array) -> tuple[Array, Array]:
    """Return the rows of one line, and their derivatives."""
    values = values_of(problem, shot.owner, unknowns)
    middle = shape_of(problem, shot, values)
    count = len(shot.modes)
    jacobian = np.zeros((count, problem.size))
    if middle is None:
        # No equilibrium at these values: a wall that sends the search back.
        return np.full(count, WALL), jacobian
    here = across_mm(shot, values, middle)
    to_rows = shot.modes / shot.row_sd_mm[:, None]
    for k, name in problem.held_by(shot.owner):
        if name in METER and not is_read(shot.field):
            continue
        moved = values | {name: problem.value(k, float(unknowns[k]) + STEP)}
        seen = middle if name in VIEW else shape_of(problem, shot, moved)
        if seen is not None:
            jacobian[:, k] = to_rows @ (across_mm(shot, moved, seen) - here) / STEP
    return to_rows @ here, jacobian


def _number_rows(
    problem: Problem, datum: Datum, unknowns: Array
) -> tuple[Array, Array]:
    values = values_of(problem, datum.owner, unknowns)
    here = stated(datum, values)
    jacobian = np.zeros((1, problem.size))
    for k, name in problem.held_by(datum.owner):
        if name in _FELT[datum.kind]:
            moved = values | {name: problem.value(k, float(unknowns[k]) + STEP)}
            jacobian[0, k] = -(stated(datum, moved) - here) / (STEP * datum.sd)
    return np.array([(datum.value - here) / datum.sd]), jacobian


METER = ("meter_percent", "meter_offset_mT")
"""What changes readings, and no shape where the magnet is known."""

_FELT = {
    "length_mm": ("length_mm", "scale_percent"),
    "width_mm": ("side_percent", "scale_percent"),
    "flux_mT": (
        "magnet_percent", "magnet_remanence_T", "gap_mm", "magnet_offset_mm", *METER,
    ),
}  # fmt: skip
"""What the numbers of a run depend on."""
