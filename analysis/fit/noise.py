"""How large the errors of measured lines are, seen in the lines themselves.

A line is smooth, and so are its errors: few of its points are independent. A line is
therefore reduced to its first `MODES` Legendre coefficients across itself, whose errors
fall with their number as `spectrum`. What a rod can do of its own lies in the
lowest `SHAPE` of them. The rest show the errors; how large these are in a photograph is
told by its own rest, by that of the other photographs, and by the deviations that its
measurement states.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.special import digamma

Array = NDArray[np.float64]

MODES = 12
SHAPE = 6
"""Modes that a wrong model may reach; those above are errors of the measurement."""

FLOOR_MM = 3e-5
"""What the spline through a line and the solver are good to, in each mode."""

STATED_FACTOR = 5.0
"""How far off, as a factor, the deviations are that a measurement states: on
photographs of the twin bench 1 to 15 times what is found (benchmarks/bench_fit.py)."""

POOLED_MODES = 6.0
"""As how many modes of its own the other photographs count for one."""


def spectrum(count: int) -> Array:
    """Return the relative size of errors by mode, shape (count,).

    Measured on photographs whose truth is known: even up to the fourth mode, then
    falling with the square (benchmarks/bench_fit.py).
    """
    return np.asarray(1.0 / (1.0 + (np.arange(count) / 4.0) ** 2))


def mode_matrix(s_mm: Array) -> Array:
    """Return what takes values at points to their modes, shape (modes, n).

    Legendre polynomials with a mean square of one, fitted by least squares: the modes
    are in the unit of the values. Lines of few points have fewer modes.
    """
    count = min(MODES, max(1, len(s_mm) // 3))
    x = 2.0 * (s_mm - s_mm[0]) / (s_mm[-1] - s_mm[0]) - 1.0
    basis = legendre.legvander(x, count - 1) * np.sqrt(2.0 * np.arange(count) + 1.0)
    return np.asarray(np.linalg.pinv(basis))


def stated_mm(sigma_mm: Array) -> float:
    """Return the size of the first mode if a line errs as much as it states."""
    power = float(np.sum(spectrum(MODES) ** 2))
    return math.sqrt(float(np.mean(sigma_mm**2)) / power)


def noise_mm(modes: Sequence[Array], stated: Sequence[float]) -> Array:
    """Return the size of the errors of each line, that of its first mode, in mm.

    Parameters
    ----------
    modes : sequence of ndarray
        Modes of what the model leaves of each line, in mm.
    stated : sequence of float
        From `stated_mm`.

    Notes
    -----
    A mean of logarithms, weighted with their variances: 2 / n for a mean square of n
    modes, `STATED_FACTOR` squared for the stated deviations. The logarithm of a mean
    square falls short of that of the variance, by log(n / 2) - digamma(n / 2).
    """
    own, weights = [], []
    for line in modes:
        rest = line[SHAPE:] / spectrum(len(line))[SHAPE:]
        weights.append(0.5 * len(rest))
        own.append(float(np.mean(rest**2)) if len(rest) else 1.0)
    weight = np.array(weights)
    short = np.log(np.maximum(weight, 0.5)) - digamma(np.maximum(weight, 0.5))
    log_own = np.log(np.maximum(own, (0.1 * FLOOR_MM) ** 2)) + short
    claimed = 2.0 * np.log(np.maximum(stated, 1e-6))
    believed = 1.0 / (2.0 * math.log(STATED_FACTOR)) ** 2
    many = float(np.sum(weight))
    pooled = float(weight @ log_own) / many if many else 0.0
    shared = min(0.5 * POOLED_MODES, many)
    total = weight * log_own + shared * pooled + believed * claimed
    return np.asarray(np.exp(0.5 * total / (weight + shared + believed)))
