"""Kernels: a rod in a uniform field, marched from the free tip by Taylor steps.

Dimensionless throughout: arc length sigma from the tip over the rod's length, angle
``w = theta - phi`` from the direction in which the field pulls the tip. With
``c = m B L^2 / EI`` of the section, the rod obeys ``w'' = c sin w``, free tip
``w' = 0``, and ``EI w'`` continuous at joints: a pendulum whose swing starts at the
tip. Columns of the state:

====  ======================  =================================
w, k  angle, curvature        ``w'' = c sin w``
q, r  derivative by tip angle ``q'' = c cos(w) q``
p, t  derivative by load      ``p'' = c sin(w) + c cos(w) p``
====  ======================  =================================

The load derivative is by the logarithm of the load. `w` is measured from the nearest
saddle, so that tips exponentially close to the field's direction keep their digits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit

ORDER = 22
STEP = 0.35
"""Longest step times sqrt(c): the nearest pole of the swing is at pi/2, so a series of
22 terms ends at (0.35 / 1.57)^22 = 5e-15."""


@njit(cache=True)
def _step(
    state: NDArray[np.float64],
    c: float,
    h: float,
    a: NDArray[np.float64],
) -> None:
    """Advance (w, k, q, r, p, t, X, Y) by h; X, Y integrate cos w and sin w."""
    w, q, p, s, g = a[0], a[1], a[2], a[3], a[4]
    w[0], w[1] = state[0], state[1]
    q[0], q[1] = state[2], state[3]
    p[0], p[1] = state[4], state[5]
    s[0], g[0] = np.sin(w[0]), np.cos(w[0])
    for n in range(ORDER - 1):
        gq = gp = 0.0
        for i in range(n + 1):
            gq += g[i] * q[n - i]
            gp += g[i] * p[n - i]
        scale = 1.0 / ((n + 1) * (n + 2))
        w[n + 2] = c * s[n] * scale
        q[n + 2] = c * gq * scale
        p[n + 2] = c * (s[n] + gp) * scale
        sn = gn = 0.0
        for i in range(n + 1):
            sn += (i + 1) * w[i + 1] * g[n - i]
            gn -= (i + 1) * w[i + 1] * s[n - i]
        s[n + 1] = sn / (n + 1)
        g[n + 1] = gn / (n + 1)
    for row in range(3):
        value = slope = 0.0
        for n in range(ORDER, 0, -1):
            value = (value + a[row, n]) * h
            slope = slope * h + n * a[row, n]
        state[2 * row] = value + a[row, 0]
        state[2 * row + 1] = slope
    x = y = 0.0
    for n in range(ORDER - 1, -1, -1):
        x = x * h + g[n] / (n + 1)
        y = y * h + s[n] / (n + 1)
    state[6] += x * h
    state[7] += y * h


@njit(cache=True)
def march(
    w_tip: float,
    load: float,
    lengths: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    moment: NDArray[np.float64],
    at: NDArray[np.float64],
    path: NDArray[np.float64],
    work: NDArray[np.float64],
    out: NDArray[np.float64],
) -> int:
    """March from the tip to the root; return the number of zeros of q on the way.

    Parameters
    ----------
    w_tip : float
        Tip angle from the pull of the field.
    load : float
        Factor on `moment`.
    lengths, stiffness, moment : ndarray, shape (sections,)
        Tip first, dimensionless: length, EI and m B of each section.
    at : ndarray, shape (n,)
        Rising sigma in [0, 1] where `path` is wanted.
    path : ndarray, shape (n, 4)
        Receives w, k, X, Y there (k of the section nearer the tip at joints).
    work : ndarray, shape (5, ORDER + 2)
    out : ndarray, shape (8,)
        Receives the state at the root.
    """
    out[:] = 0.0
    out[0], out[2] = w_tip, 1.0
    zeros = row = 0
    start = 0.0
    for j in range(len(lengths)):
        c = load * moment[j] / stiffness[j]
        if j > 0:
            ratio = stiffness[j - 1] / stiffness[j]
            out[1] *= ratio
            out[3] *= ratio
            out[5] *= ratio
        sigma = start
        end = start + lengths[j] if j + 1 < len(lengths) else 1.0
        longest = STEP / np.sqrt(abs(c)) if c != 0.0 else 1.0
        while True:
            while row < len(at) and at[row] <= sigma:
                path[row, 0], path[row, 1] = out[0], out[1]
                path[row, 2], path[row, 3] = out[6], out[7]
                row += 1
            if sigma >= end:
                break
            goal = at[row] if row < len(at) and at[row] < end else end
            steps = int(np.ceil((goal - sigma) / longest))
            h = (goal - sigma) / steps
            for _ in range(steps):
                before = out[2]
                _step(out, c, h, work)
                if before * out[2] < 0.0:
                    zeros += 1
            sigma = goal
        start = end
    return zeros


@njit(cache=True)
def scan(
    v: NDArray[np.float64],
    load: float,
    lengths: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    moment: NDArray[np.float64],
    table: NDArray[np.float64],
) -> None:
    """Fill table (n, 4): root angle, its derivative by v, by ln(load), Morse index.

    `v` covers the open window (-2 pi, 0) of the tip angle w: ``eps = 2 pi / (1 +
    exp(2 |v|))`` is the distance from its upper end (v > 0) or lower end (v < 0).
    """
    work = np.zeros((5, ORDER + 2))
    out = np.zeros(8)
    nowhere = np.zeros(0)
    nothing = np.zeros((0, 4))
    for i in range(len(v)):
        fold = np.exp(-2.0 * abs(v[i]))
        eps = 2.0 * np.pi * fold / (1.0 + fold)
        slope = 2.0 * eps / (1.0 + fold)
        if v[i] >= 0.0:
            w_tip, base = -eps, 0.0
        else:
            w_tip, base = eps, -2.0 * np.pi
        zeros = march(
            w_tip, load, lengths, stiffness, moment, nowhere, nothing, work, out
        )
        table[i, 0] = out[0] + base
        table[i, 1] = out[2] * slope
        table[i, 2] = out[4]
        table[i, 3] = zeros
