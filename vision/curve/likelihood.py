"""A penalised least squares problem with the most likely weight of its penalty (REML).

Restricted maximum likelihood as of Wood (2011), in kernels for some forty unknowns.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from .cholesky import factor, solved_half

Array = NDArray[np.float64]

_FAIR = 0.1
"""Weight of the penalty before the last step, in units of the data's."""


@njit(cache=True)
def equations(jacobian: Array, weight: Array, residual: Array) -> tuple[Array, Array]:
    """Return J^T W J and J^T W r; a row of J ends in zeros."""
    size = jacobian.shape[1]
    normal, right = np.zeros((size, size)), np.zeros(size)
    for i in range(weight.size):
        end = size
        while end > 0 and jacobian[i, end - 1] == 0.0:
            end -= 1
        for j in range(end):
            share = weight[i] * jacobian[i, j]
            right[j] += share * residual[i]
            for k in range(j + 1):
                normal[j, k] += share * jacobian[i, k]
    for j in range(size):
        for k in range(j):
            normal[k, j] = normal[j, k]
    return normal, right


@njit(cache=True)
def penalised(
    normal: Array, right: Array, penalty: Array, coefficients: Array, strength: float,
    total: float, count: float, free: int, last: bool,
) -> tuple[float, Array, Array]:  # fmt: skip
    """Return the weight of the penalty (if NaN: the most likely one) and the equations.

    The penalty is on the `coefficients` with what they change by, all unknowns but the
    first; `free` unknowns cost none. `total` and `count` are the sum of squares of the
    data and how many they are. Before the last step any fair weight does: it moves only
    the point where the next one starts.
    """
    size = right.size
    # The median, because ties at joints are far stiffer than the rest.
    data = np.trace(normal)
    scale = data / ((size - 1) * np.median(np.diag(penalty)))
    stiff, pull = np.zeros((size, size)), np.zeros(size)
    stiff[1:, 1:], pull[1:] = penalty, penalty @ coefficients
    stored = np.sum(coefficients * pull[1:])
    # Parts of the rod without data must not make the matrix singular.
    normal = normal + 1e-9 * scale * stiff
    for j in range(size):
        normal[j, j] += 1e-11 * data / size
    if np.isnan(strength):
        strength = _FAIR * scale
        if last:
            strength = _most_likely(
                scale, normal, stiff, right, pull, total, stored,
                max(count - free, 1.0), size - free,
            )  # fmt: skip
    return strength, normal + strength * stiff, right - strength * pull


@njit(cache=True)
def _most_likely(
    scale: float, normal: Array, stiff: Array, right: Array, pull: Array,
    total: float, stored: float, count: float, rank: int,
) -> float:  # fmt: skip
    """Return the penalty weight of greatest restricted likelihood.

    It is looked for over 14 decades by twos, then beside the best, ever closer, down to
    a quarter of a decade.
    """
    best, least, step = -12, np.inf, 8
    while step > 0:
        centre = best
        for k in range(-3, 4) if step == 8 else range(-1, 2, 2):
            power = centre + k * step
            weight = scale * 10.0 ** (0.25 * power)
            half = factor(normal + weight * stiff)
            gain = np.sum(solved_half(half, right - weight * pull) ** 2)
            logs = 2.0 * np.sum(np.log(np.diag(half)))
            left = max(total + weight * stored - gain, 1e-12 * total + 1e-30)
            score = count * np.log(left) + logs - rank * np.log(weight)
            if score < least:
                best, least = power, score
        step //= 2
    return float(scale * 10.0 ** (0.25 * best))
