"""A penalised least squares problem with the most likely weight of its penalty (REML).

Restricted maximum likelihood as of Wood (2011), in kernels for some forty unknowns.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..core.jit import njit
from .cholesky import factor, solved_half

Array = NDArray[np.float64]

_FAIR = 0.1
"""Weight of the penalty before the last step, in units of the data's."""


@njit(cache=True)
def weighed_equations(
    jacobian: Array, residual: Array, weight: Array, penalty: Array,
    coefficients: Array, strength: float, shared: float, within: float, free: int,
    last: bool,
) -> tuple[float, Array, Array, Array]:  # fmt: skip
    """Return the weight of the penalty (if NaN: the most likely one) and the equations.

    They are normal x = right - weight pull, with `free` unknowns that cost no penalty.
    Neighbouring residuals share pixels, so `shared` of them count as one. Before the
    last step any fair weight does: it moves only the point where the next one starts.
    """
    size = jacobian.shape[1]
    normal, right, pull = np.zeros((size, size)), np.zeros(size), np.zeros(size)
    _add_equations(jacobian, weight / shared, residual, normal, right)
    # The median, because ties at joints are far stiffer than the rest.
    data, stored = np.trace(normal), 0.0
    bend = (size - 1) * np.median(np.diag(penalty))
    for j in range(size - 1):
        for k in range(size - 1):
            pull[j + 1] += penalty[j, k] * coefficients[k]
        stored += coefficients[j] * pull[j + 1]
    scale = data / bend
    # Parts of the rod without data must not make the matrix singular.
    for j in range(size):
        normal[j, j] += 1e-11 * data / size
    normal[1:, 1:] += 1e-9 * scale * penalty
    if np.isnan(strength):
        strength = _FAIR * scale
        if last:
            total = (np.sum(weight * residual**2) + within) / shared
            count = max(np.sum(weight) / shared - free, 1.0)
            strength = _most_likely(
                scale, normal, penalty, right, pull, total, stored, count, size - free
            )
    normal[1:, 1:] += strength * penalty
    return strength, normal, right, pull


@njit(cache=True)
def _add_equations(
    jacobian: Array, weight: Array, residual: Array, normal: Array, right: Array
) -> None:
    """Add J^T W J and J^T W r; a row of J ends in zeros."""
    for i in range(weight.size):
        end = right.size
        while end > 0 and jacobian[i, end - 1] == 0.0:
            end -= 1
        for j in range(end):
            share = weight[i] * jacobian[i, j]
            right[j] += share * residual[i]
            for k in range(j + 1):
                normal[j, k] += share * jacobian[i, k]
    for j in range(right.size):
        for k in range(j):
            normal[k, j] = normal[j, k]


@njit(cache=True)
def _most_likely(
    scale: float, normal: Array, penalty: Array, right: Array, pull: Array,
    total: float, stored: float, count: float, rank: int,
) -> float:  # fmt: skip
    """Return the penalty weight of greatest restricted likelihood.

    It is looked for over 14 decades, and then in quarters of a decade about the best.
    """
    best, least = 0, np.inf
    for turn in range(2):
        centre = best
        for k in range(14) if turn == 0 else range(-3, 4):
            power = 4 * k - 36 if turn == 0 else centre + k
            weight = scale * 10.0 ** (0.25 * power)
            matrix = normal.copy()
            matrix[1:, 1:] += weight * penalty
            half = factor(matrix)
            gain = np.sum(solved_half(half, right - weight * pull) ** 2)
            logs = 2.0 * np.sum(np.log(np.diag(half)))
            left = max(total + weight * stored - gain, 1e-12 * total + 1e-30)
            score = count * np.log(left) + logs - rank * np.log(weight)
            if score < least:
                best, least = power, score
    return float(scale * 10.0 ** (0.25 * best))


@njit(cache=True)
def freedom_of(root: Array, penalty: Array, strength: float) -> float:
    """Trace of what maps the data onto the fit: the parameters less those held."""
    held = 0.0
    for j in range(len(penalty)):
        for k in range(len(penalty)):
            if penalty[j, k] != 0.0:
                held += penalty[j, k] * np.sum(root[j + 1] * root[k + 1])
    return len(root) - strength * held
