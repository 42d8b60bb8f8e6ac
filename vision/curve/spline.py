"""Cubic B-splines: knots with joints, their matrices, and the penalty on bending."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit

Array = NDArray[np.float64]

_DEGREE = 3
_TIED = 1e3
"""Weight of a kink of the moment at a joint against one smeared over a piece."""


@njit(cache=True)
def knots_between(first: float, last: float, spacing: float, joints: Array) -> Array:
    """Return evenly spread knots, four at the ends and three at each joint."""
    inside = (joints > first + spacing) & (joints < last - spacing)
    ends = np.concatenate(
        (np.array([first]), np.sort(joints[inside]), np.array([last]))
    )
    knots = np.full(_DEGREE, first)
    for i in range(ends.size - 1):
        count = max(int(np.round((ends[i + 1] - ends[i]) / spacing)), 2)
        piece = np.linspace(ends[i], ends[i + 1], count + 1)[:-1]
        more = _DEGREE - 1 if i + 2 < ends.size else _DEGREE + 1
        knots = np.concatenate((knots, piece, np.full(more, ends[i + 1])))
    return knots


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


@njit(cache=True)
def design(knots: Array, s: Array) -> Basis:
    """Return the B-splines at s, which must not fall."""
    first = np.empty(s.size, np.int64)
    value, slope = np.empty((s.size, 4)), np.empty((s.size, 4))
    _fill_basis(knots, s, first, value, slope)
    return Basis(first, value, slope)


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


@njit(cache=True)
def penalty_between(
    knots: Array, order: int, ratios: Array, s: Array, theta: Array
) -> tuple[Array, int]:
    """Return P with c^T P c the integral of M''^2 or (M' - F . n)^2, and its nullity.

    M is a parabola between knots, and tied at joints that have ratios (see `Smooth`).
    The force F is the one that makes the integral least; the normals are those of a
    curve with angles theta at s.
    """
    first, length, bend, slope_at_start, slope_at_end = _pieces(knots)
    count = first.size
    tie = np.zeros(count - 1)
    joints, stiffness = 0, 1.0
    for i in range(count):
        if i > 0 and first[i] - first[i - 1] > 1:
            joints += 1
            if ratios.size > 0:
                apart = 0.5 * (length[i] + length[i - 1])
                tie[i - 1] = _TIED * apart ** (3.0 - 2.0 * order)
                stiffness /= ratios[joints - 1]
        bend[i] *= stiffness
        slope_at_start[i] *= stiffness
        slope_at_end[i] *= stiffness
    penalty = np.zeros((knots.size - 4, knots.size - 4))
    if order == 2:
        add_squares(first, bend, length, penalty)
    else:
        # M' runs straight over a piece: the trapezoidal rule, on both its ends.
        ends = np.interp(np.append(knots[3], knots[3] + np.cumsum(length)), s, theta)
        angles = np.concatenate((ends[:-1], ends[1:]))
        _add_unforced(
            np.concatenate((first, first)),
            np.concatenate((slope_at_start, slope_at_end)),
            np.column_stack((-np.sin(angles), np.cos(angles))),
            0.5 * np.concatenate((length, length)), penalty,
        )  # fmt: skip
    _add_jumps(first, slope_at_end, slope_at_start, tie, penalty)
    free = 3 if order == 2 else 4
    return penalty, free + joints * (1 if ratios.size > 0 else 2)


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


@njit(cache=True)
def _pieces(knots: Array) -> tuple[NDArray[np.int64], Array, Array, Array, Array]:
    """Return of each piece: first spline, length, theta''', theta'' at both ends.

    The last three are rows of the four splines' own, shape (pieces, 4) each.
    """
    low, high = knots[3:-4], knots[4:-3]
    real = high > low
    low, length = low[real], (high - low)[real]
    # Second differences of theta' at points well inside, where no knot is in doubt.
    inner = np.empty(3 * low.size)
    for k in range(3):
        inner[k::3] = low + (0.1 + 0.4 * k) * length
    first, _, slope = design(knots, inner)
    bend, start, end = np.empty((3, low.size, 4))
    for i in range(low.size):
        a, b, c = slope[3 * i], slope[3 * i + 1], slope[3 * i + 2]
        bend[i] = (a - 2.0 * b + c) / (0.4 * length[i]) ** 2
        middle, half = (c - a) / (0.8 * length[i]), 0.5 * length[i] * bend[i]
        start[i], end[i] = middle - half, middle + half
    return first[::3].copy(), length, bend, start, end


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
