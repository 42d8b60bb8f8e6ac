"""Cubic B-splines: knots with joints, their matrices, and the penalty on bending."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..core.jit import njit

Array = NDArray[np.float64]

_DEGREE = 3


def knots_between(
    first: float, last: float, spacing: float, joints: Sequence[float]
) -> Array:
    """Return evenly spread knots, four at the ends and three at each joint."""
    inner = [joint for joint in joints if first + spacing < joint < last - spacing]
    ends = [first, *sorted(inner), last]
    pieces: list[Array] = [np.full(_DEGREE, first)]
    for low, high in pairwise(ends):
        count = max(round((high - low) / spacing), 2)
        pieces.append(np.linspace(low, high, count + 1)[:-1])
        if high != last:
            pieces.append(np.full(_DEGREE - 1, high))
    pieces.append(np.full(_DEGREE + 1, last))
    return np.concatenate(pieces)


def design(knots: Array, s: Array) -> tuple[Array, Array]:
    """Return the cubic B-splines and their derivatives at s, each (n, count)."""
    basis = np.zeros((len(s), len(knots) - _DEGREE - 1))
    slopes = np.zeros_like(basis)
    _fill_basis(knots, s, basis, slopes)
    return basis, slopes


@njit(cache=True)
def _fill_basis(knots: Array, s: Array, basis: Array, slopes: Array) -> None:
    """Cox and de Boor's recurrence; s must not fall."""
    count = basis.shape[1]
    value = np.zeros(4)
    lower = np.zeros(4)
    k = 3
    for i in range(s.size):
        x = s[i]
        while k < count - 1 and x >= knots[k + 1]:
            k += 1
        value[:] = 0.0
        value[3] = 1.0
        for degree in range(1, 4):
            if degree == 3:
                lower[:] = value
            for j in range(3 - degree, 4):
                left = k - 3 + j
                total = 0.0
                span = knots[left + degree] - knots[left]
                if j > 3 - degree and span > 0.0:
                    total += (x - knots[left]) / span * value[j]
                span = knots[left + degree + 1] - knots[left + 1]
                if j < 3 and span > 0.0:
                    total += (knots[left + degree + 1] - x) / span * value[j + 1]
                value[j] = total
        for j in range(4):
            left = k - 3 + j
            basis[i, left] = value[j]
            rate = 0.0
            span = knots[left + 3] - knots[left]
            if j > 0 and span > 0.0:
                rate += lower[j] / span
            span = knots[left + 4] - knots[left + 1]
            if j < 3 and span > 0.0:
                rate -= lower[j + 1] / span
            slopes[i, left] = 3.0 * rate


def bends(knots: Array) -> Array:
    """Return B with |B c|^2 the integral of theta'''^2, constant between knots."""
    low, high = knots[_DEGREE:-_DEGREE - 1], knots[_DEGREE + 1:-_DEGREE]  # fmt: skip
    real = high > low
    low, length = low[real], (high - low)[real]
    # Second differences of theta' at points well inside, where no knot is in doubt.
    inner = low[:, None] + length[:, None] * np.array([0.1, 0.5, 0.9])
    _, slopes = design(knots, inner.ravel())
    first, middle, last = slopes.reshape(len(low), 3, -1).transpose(1, 0, 2)
    bend = (first - 2.0 * middle + last) / (0.4 * length[:, None]) ** 2
    return np.asarray(bend * np.sqrt(length)[:, None])
