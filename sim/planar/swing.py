"""Whether a planar equilibrium also holds against leaving its plane.

The energy of a twist-free rod of square (or round) sections, magnetised along its axis,
depends on its tangent alone. Let the tangent lean out of the plane by a small psi, with
z the height, z' = psi. To second order the energy changes by half of

    integral of  psi'^2 / e + (N . t - e q^2) psi^2  -  sum over poles of dm Gzz z^2

with N the force across the section (the P of `planar.march`), t the planar tangent, q
the planar moment, dm the jump of magnetisation and Gzz = dBz/dz = -(dBx/dx + dBy/dy).
Its Jacobi fields march from the tip like the planar ones, with unknowns psi_L and z_L;
each zero of their determinant is one unstable direction. A straight rod is the test:
there the equation is the planar one.
"""

from __future__ import annotations

import numpy as np

from ...core.jit import njit
from ..magnet.flux import PART, field_at
from .march import STATE, H, M, add_load, begin, enter_section
from .taylor import advance, series, substeps

ORDER = 10
"""Enough for the sign of a determinant."""


@njit(cache=True, error_model="numpy")
def swing_index(rod, field, u, step):  # type: ignore[no-untyped-def]
    """Count the directions out of the plane in which an equilibrium is unstable.

    Parameters
    ----------
    rod, field : ndarray
        See `planar.march`.
    u : ndarray, shape (4,)
        The unknowns of the march at the equilibrium.
    step : float
        What one step takes (`planar.march.substeps`).

    Returns
    -------
    int
        The Morse index of these directions.
    """
    X = np.empty(STATE)
    D = np.empty((STATE, 4))
    T = np.empty((4, ORDER + 1))
    a = np.empty(ORDER)
    psi = np.zeros((2, ORDER + 1))
    r = np.zeros((2, ORDER + 1))
    psi[0, 0] = 1.0
    z = np.array([0.0, 1.0])
    lift = np.zeros(2)
    tip = u.copy()
    begin(tip, 0, X, D)
    index = 0
    positive = True
    for i in range(rod.shape[0]):
        add_load(rod, field, i, 1.0, tip, 0, X, D)
        c, s = np.cos(tip[3]), np.sin(tip[3])
        x, y = tip[1] + c * X[2] - s * X[3], tip[2] + s * X[2] + c * X[3]
        b = field_at(field, x, y)
        jump = rod[i, M] - rod[i - 1, M] if i > 0 else rod[i, M]
        for k in range(2):
            lift[k] -= jump * (b[2] + b[4]) * z[k]
        enter_section(rod, i, 1.0, tip, 0, X, D)
        count = substeps(rod[i, H], X, step)
        h = rod[i, H] / count
        for _ in range(count):
            series(h, ORDER, X, T)
            _stiffness(h, X, T, a)
            for k in range(2):
                _lean(h, h * X[6], lift[k], a, psi[k], r[k])
                for j in range(ORDER, 0, -1):
                    z[k] -= h * psi[k, j - 1] / j
                for j in range(1, ORDER + 1):
                    psi[k, 0] += psi[k, j]
                    r[k, 0] += r[k, j]
            advance(h, ORDER, X, T)
            if (psi[0, 0] * z[1] - psi[1, 0] * z[0] > 0.0) != positive:
                positive = not positive
                index += 1
    return index


@njit(**PART)
def _stiffness(h, X, T, a):  # type: ignore[no-untyped-def]
    """Expand N . t - e q^2 over a step, times h."""
    for k in range(a.shape[0]):
        a[k] = h * (X[4] * T[3, k] + X[5] * T[2, k])
        if k > 0:
            a[k] += h * h * (X[7] * T[3, k - 1] + X[8] * T[2, k - 1])
        for j in range(k + 1):
            a[k] -= h * X[6] * T[1, j] * T[1, k - j]


@njit(**PART)
def _lean(h, he, lift, a, psi, r):  # type: ignore[no-untyped-def]
    """Expand psi' = e r, r' = a psi - lift over a step."""
    for k in range(a.shape[0]):
        push = -h * lift if k == 0 else 0.0
        for j in range(k + 1):
            push += a[j] * psi[k - j]
        psi[k + 1] = he * r[k] / (k + 1)
        r[k + 1] = push / (k + 1)
