"""Cubic B-splines: knots with joints, their matrices, and the penalty on bending."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.jit import njit

Array = NDArray[np.float64]

_DEGREE = 3
_TIED = 1e3
"""Weight of a kink of the moment at a joint against one smeared over a piece."""


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


class Basis(NamedTuple):
    """The four cubic B-splines that are not zero at each of n points.

    Parameters
    ----------
    first : ndarray of int, shape (n,)
        Number of the first of them.
    value, slope : ndarray, shape (n, 4)
        Their values and derivatives.
    """

    first: NDArray[np.int64]
    value: Array
    slope: Array

    def values(self, coefficients: Array) -> Array:
        """Return the spline of these coefficients, shape (n,)."""
        return np.asarray(combined(self.first, self.value, coefficients))

    def slopes(self, coefficients: Array) -> Array:
        """Return its derivative, shape (n,)."""
        return np.asarray(combined(self.first, self.slope, coefficients))


def design(knots: Array, s: Array) -> Basis:
    """Return the B-splines at s, which must not fall."""
    basis = Basis(
        np.empty(len(s), np.int64), np.empty((len(s), 4)), np.empty((len(s), 4))
    )
    _fill_basis(knots, s, *basis)
    return basis


@njit(cache=True)
def combined(first: NDArray[np.int64], value: Array, coefficients: Array) -> Array:
    """Return sums of four coefficients each, from `first` on, times their values."""
    out = np.zeros(first.size)
    for i in range(first.size):
        for j in range(4):
            out[i] += value[i, j] * coefficients[first[i] + j]
    return out


@njit(cache=True)
def _fill_basis(
    knots: Array, s: Array, first: NDArray[np.int64], values: Array, slopes: Array
) -> None:
    """Cox and de Boor's recurrence."""
    count = knots.size - 4
    lower = np.zeros(4)
    k = 3
    for i in range(s.size):
        x = s[i]
        while k < count - 1 and x >= knots[k + 1]:
            k += 1
        first[i] = k - 3
        value = values[i]
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
            rate = 0.0
            span = knots[left + 3] - knots[left]
            if j > 0 and span > 0.0:
                rate += lower[j] / span
            span = knots[left + 4] - knots[left + 1]
            if j < 3 and span > 0.0:
                rate -= lower[j + 1] / span
            slopes[i, j] = 3.0 * rate


class Smooth(NamedTuple):
    """What a rod's bending moment, over its stiffness at the clamp, is taken to be.

    Parameters
    ----------
    order : int
        The derivative that is small: 2 if M is nearly straight. 1 if M' is nearly that
        of a force which is the same all along the rod, of whatever size and direction:
        F . n, n the rod's normal (Love 1927, art. 262); a magnetic field that is the
        same all along does as much.
    ratios : tuple of float, optional
        Curvature beyond over curvature before each joint. M and its slope pass through
        a joint unchanged, so theta'' changes by this factor too. Without ratios nothing
        is known of M at the joints.
    """

    order: int = 2
    ratios: tuple[float, ...] | None = None


def penalty_on_moment(
    knots: Array, smooth: Smooth, s: Array, theta: Array
) -> tuple[Array, int]:
    """Return P with c^T P c the integral of M''^2 or (M' - F . n)^2, and its nullity.

    M is a parabola between knots. The force F is the one that makes the integral least;
    the normals are those of a curve with angles theta at s.
    """
    first, length, bend, slope_at_start, slope_at_end = _pieces(knots)
    joined = np.diff(first) > 1
    joints, tied = int(joined.sum()), smooth.ratios is not None
    compliance = np.cumprod(np.concatenate([[1.0], smooth.ratios or np.ones(joints)]))
    stiffness = 1.0 / compliance[np.concatenate([[0], np.cumsum(joined)])][:, None]
    apart = 0.5 * (length[1:] + length[:-1])
    penalty = np.zeros((len(knots) - 4, len(knots) - 4))
    slope_at_start, slope_at_end = slope_at_start * stiffness, slope_at_end * stiffness
    if smooth.order == 2:
        add_squares(first, bend * stiffness, length, penalty)
    else:
        # M' runs straight over a piece: the trapezoidal rule, on both its ends.
        ends = np.interp(np.unique(knots), s, theta)
        angles = np.concatenate([ends[:-1], ends[1:]])
        _add_unforced(
            np.concatenate([first, first]),
            np.concatenate([slope_at_start, slope_at_end]),
            np.column_stack([-np.sin(angles), np.cos(angles)]),
            0.5 * np.concatenate([length, length]), penalty,
        )  # fmt: skip
    if tied:
        tie = _TIED * joined * apart ** (3.0 - 2.0 * smooth.order)
        _add_jumps(first, slope_at_end, slope_at_start, tie, penalty)
    free = 3 if smooth.order == 2 else 4
    return penalty, free + joints * (1 if tied else 2)


@njit(cache=True)
def _add_unforced(
    first: NDArray[np.int64], rows: Array, normals: Array, weight: Array, penalty: Array
) -> None:
    """Add the weighted squares of rows of M', less what a constant force explains."""
    add_squares(first, rows, weight, penalty)
    total = np.sum(weight)
    for k in range(2):
        load = normals[:, k].copy()
        for j in range(k):
            load -= normals[:, j] * np.sum(weight * load * normals[:, j])
        power = np.sum(weight * load**2)
        if power < 1e-9 * total:  # a straight rod: forces along it do not bend it
            normals[:, k] = 0.0
            continue
        load /= np.sqrt(power)
        normals[:, k] = load
        part = np.zeros(len(penalty))
        for i in range(first.size):
            for j in range(4):
                part[first[i] + j] += weight[i] * load[i] * rows[i, j]
        for i in range(part.size):
            for j in range(part.size):
                penalty[i, j] -= part[i] * part[j]


@njit(cache=True)
def _add_jumps(
    first: NDArray[np.int64], before: Array, after: Array, weight: Array, normal: Array
) -> None:
    """Add the weighted squares of `after` of a piece less `before` of the one ahead."""
    row = np.zeros(7)
    for i in range(weight.size):
        row[:] = 0.0
        shift = first[i + 1] - first[i]
        for j in range(4):
            row[j] -= before[i, j]
            row[shift + j] += after[i + 1, j]
        for j in range(shift + 4):
            for k in range(shift + 4):
                normal[first[i] + j, first[i] + k] += weight[i] * row[j] * row[k]


def _pieces(knots: Array) -> tuple[NDArray[np.int64], Array, Array, Array, Array]:
    """Return of each piece: first spline, length, theta''', theta'' at both ends.

    The last three are rows of the four splines' own, shape (pieces, 4) each.
    """
    low, high = knots[_DEGREE:-_DEGREE - 1], knots[_DEGREE + 1:-_DEGREE]  # fmt: skip
    real = high > low
    low, length = low[real], (high - low)[real]
    # Second differences of theta' at points well inside, where no knot is in doubt.
    inner = low[:, None] + length[:, None] * np.array([0.1, 0.5, 0.9])
    basis = design(knots, inner.ravel())
    a, b, c = basis.slope.reshape(len(low), 3, 4).transpose(1, 0, 2)
    step, half = 0.4 * length[:, None], 0.5 * length[:, None]
    bend, middle = (a - 2.0 * b + c) / step**2, (c - a) / (2.0 * step)
    return basis.first[::3], length, bend, middle - half * bend, middle + half * bend


@njit(cache=True)
def add_squares(
    first: NDArray[np.int64], rows: Array, weight: Array, normal: Array
) -> None:
    """Add R^T W R; a row of R holds `rows` from column `first` on, else zeros."""
    for i in range(first.size):
        for j in range(rows.shape[1]):
            share = weight[i] * rows[i, j]
            for k in range(rows.shape[1]):
                normal[first[i] + j, first[i] + k] += share * rows[i, k]
