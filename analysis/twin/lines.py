"""What the twin's photographs would give, without painting and measuring them.

Hundreds of runs in seconds, for questions of statistics. Errors of the lines are like
those of lines measured from painted photographs (benchmarks/bench_fit.py): smooth, a
third of a micrometre, besides place, direction and scale of the frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.errors import SolverError
from ...core.magnet import Vector
from ..runs.data import Frame, RunData, Step
from .bench import TwinBench

Array = NDArray[np.float64]


class LineErrors(NamedTuple):
    """Standard deviations of what a measured line is off by.

    Attributes
    ----------
    shape_um : float
        Of its lowest shapes; higher ones err less.
    frame_angle_deg : float
        Of the clamp's direction, one for all photographs of a run; stated by them.
    clamp_position_mm : float
        Of the clamp's place, in each photograph.
    scale_percent, width_percent, length_mm : float
        Of the camera's scale, and of width and length, of a run.
    flux_percent : float
        Of each reading.
    """

    shape_um: float = 0.3
    frame_angle_deg: float = 0.03
    clamp_position_mm: float = 0.05
    scale_percent: float = 0.2
    width_percent: float = 0.7
    length_mm: float = 0.05
    flux_percent: float = 0.2


def lines_run(
    bench: TwinBench,
    gaps_mm: Sequence[float],
    rng: np.random.Generator,
    errors: LineErrors = LineErrors(),
    *,
    name: str = "twin",
    up: Vector = (0.0, 0.0, 1.0),
) -> RunData:
    """Return a run of the bench with lines that err as measured ones do.

    Raises
    ------
    SolverError
        If the true rod has no equilibrium at a gap.
    """
    turn_deg, scale, width, longer = rng.standard_normal(4) * (
        errors.frame_angle_deg, errors.scale_percent / 100.0,
        errors.width_percent / 100.0, errors.length_mm,
    )  # fmt: skip
    steps, frames = [], {}
    for index, gap_mm in enumerate(gaps_mm):
        truth = bench.solution(gap_mm).centreline
        if truth is None:
            raise SolverError(f"the twin's rod has no equilibrium at {gap_mm:g} mm")
        reading = bench.flux_mT(gap_mm)
        sd_mT = errors.flux_percent / 100.0 * reading
        image = f"step_{index:03d}.png"
        steps.append(
            Step(
                index=index, gap_mm=gap_mm, image=image, flux_status="ok",
                flux_mT=reading + sd_mT * float(rng.standard_normal()), flux_sd_mT=0.0,
            )
        )  # fmt: skip
        line, sigma_mm = _measured(
            truth, math.radians(turn_deg - bench.truth.clamp_angle_deg), 1.0 + scale,
            errors, rng,
        )  # fmt: skip
        frames[image] = Frame(
            image=image, status="ok", flags=(), reason="", points={},
            centreline=_stretched(line, longer), sigma_mm=sigma_mm,
            width_mm=bench.truth.specimen.side_mm * (1.0 + scale) * (1.0 + width),
            clamp_angle_sd_deg=errors.frame_angle_deg, pose=None, shared_clamp=name,
        )  # fmt: skip
    return RunData(
        path=Path(name), id=name, name=name, specimen=bench.specimen,
        magnet=bench.magnet, steps=tuple(steps), frames=frames, calibration=None,
        record={"rig": {"bench": {"up": list(up)}}}, end={}, warnings=(),
    )  # fmt: skip


def _measured(
    truth: Centreline,
    turn_rad: float,
    scale: float,
    errors: LineErrors,
    rng: np.random.Generator,
) -> tuple[Centreline, Array]:
    """Return a line as its photograph shows it, and the deviations it states."""
    s = truth.s_mm[::2]
    theta = truth.theta_rad[::2] + turn_rad
    c, sine = math.cos(turn_rad), math.sin(turn_rad)
    xy = scale * truth.points_mm[::2] @ np.array([[c, sine], [-sine, c]])
    xy[:, 1] += errors.clamp_position_mm * rng.standard_normal()
    count = 12
    size_mm = 1e-3 * errors.shape_um * rng.standard_normal(count)
    size_mm /= 1.0 + (np.arange(count) / 4.0) ** 2
    basis = legendre.legvander(2.0 * s / s[-1] - 1.0, count - 1)
    off = basis @ (size_mm * np.sqrt(2.0 * np.arange(count) + 1.0))
    xy += off[:, None] * np.column_stack([-np.sin(theta), np.cos(theta)])
    line = Centreline(
        s_mm=s * scale, x_mm=xy[:, 0], y_mm=xy[:, 1], theta_rad=theta,
        kappa_per_mm=truth.kappa_per_mm[::2] / scale,
    )  # fmt: skip
    return line, np.full(len(s), 1.3e-3 * errors.shape_um)


def _stretched(line: Centreline, longer_mm: float) -> Centreline:
    """Return the line with its free end seen too far out, or too near."""
    s = line.s_mm * (1.0 + longer_mm / line.length_mm)
    slope = longer_mm / line.length_mm * line.s_mm
    return Centreline(
        s_mm=s,
        x_mm=line.x_mm + slope * np.cos(line.theta_rad),
        y_mm=line.y_mm + slope * np.sin(line.theta_rad),
        theta_rad=line.theta_rad,
        kappa_per_mm=line.kappa_per_mm,
    )
