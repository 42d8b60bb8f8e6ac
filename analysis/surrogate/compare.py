"""One honest table: direct solve, the paper's network, linear formula, surrogate."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...sim import Designs, solve_shapes
from ..expansion import model as expansion
from ..shapes import descriptors
from .fit import deviations, draw
from .model import POINTS, Surrogate, predict, scale

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One way to predict a shape.

    Parameters
    ----------
    name : str
    rms_mm, worst_tip_mm : float
        Over all points of unseen designs of the surrogate's domain. For parabolas the
        distance is that of y at the solved x.
    time_us : float
        Per shape, one after the other in one process.
    size_kB : float
        Of what has to be kept; NaN where that is program only.
    """

    name: str
    rms_mm: float
    worst_tip_mm: float
    time_us: float
    size_kB: float


def compare(model: Surrogate, *, designs: int = 2000, seed: int = 1234) -> list[Row]:
    """Compare predictors on designs that none of them was fitted to."""
    unseen = draw(designs, seed)
    truth = solve_shapes(unseen, points=POINTS, by_section=True).points
    solver = solve_shapes(unseen, points=POINTS).error_mm
    rows = [
        Row(
            name="direct solve (bound)",
            rms_mm=float(np.sqrt(np.mean(solver**2))),
            worst_tip_mm=float(solver.max()),
            time_us=_time_us(lambda: solve_shapes(unseen, points=POINTS), designs),
            size_kB=float("nan"),
        )
    ]
    network = expansion.load()
    inputs = network_inputs(unseen)
    a = expansion.predict(network, inputs)
    time_us = _time_us(lambda: expansion.predict(network, inputs), designs)
    rows.append(_parabola("paper's network", a, truth, time_us, _size("expansion.npz")))
    best = descriptors.describe(truth)[:, 5]
    rows.append(_parabola("best parabola", best, truth, float("nan"), float("nan")))
    linear = linear_a_per_mm(unseen)
    time_us = _time_us(lambda: linear_a_per_mm(unseen), designs)
    rows.append(_parabola("linear formula", linear, truth, time_us, float("nan")))
    away, _ = deviations(model, unseen)
    rows.append(
        Row(
            name="surrogate",
            rms_mm=float(np.sqrt(np.mean(away**2))),
            worst_tip_mm=float(away[:, -1].max()),
            time_us=_time_us(lambda: predict(model, unseen), designs),
            size_kB=_size("surrogate.npz"),
        )
    )
    return rows


def network_inputs(designs: Designs) -> Array:
    """Return designs in a uniform field as inputs of the expansion model."""
    flux = np.zeros(len(designs)) if designs.flux_mT is None else designs.flux_mT
    return np.column_stack([flux, designs.E_MPa, designs.length_mm, designs.side_mm])


def linear_a_per_mm(designs: Designs) -> Array:
    """Return the best a of y = a x^2 of the linear beam, no training, in 1/mm.

    theta' = b (1 - s) in each section, y = integral of theta, x = s.
    """
    scaled = scale(designs)
    slope = integrate_slope(scaled.linear, scaled.stations)
    s = scaled.stations
    a = np.trapezoid(s**2 * slope, s, axis=1) / np.trapezoid(s**4, s, axis=1)
    answer: Array = scaled.sign * a / scaled.length_mm
    return answer


def integrate_slope(slope: Array, s: Array) -> Array:
    """Return the running integral of a slope over s (trapezoids)."""
    steps = 0.5 * (slope[:, 1:] + slope[:, :-1]) * np.diff(s, axis=1)
    start = np.zeros((len(s), 1))
    return np.concatenate([start, np.cumsum(steps, axis=1)], axis=1)


def _parabola(name: str, a: Array, truth: Array, time_us: float, size: float) -> Row:
    miss = a[:, None] * truth[:, :, 1] ** 2 - truth[:, :, 2]
    return Row(
        name=name,
        rms_mm=float(np.sqrt(np.mean(miss**2))),
        worst_tip_mm=float(np.abs(miss[:, -1]).max()),
        time_us=time_us,
        size_kB=size,
    )


def _size(name: str) -> float:
    return Path(str(files("magbend.analysis") / "data" / name)).stat().st_size / 1e3


def _time_us(call: Callable[[], object], count: int) -> float:
    """Return the least time a case over three calls, in us."""
    times = []
    for _ in range(3):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times) / count * 1e6
