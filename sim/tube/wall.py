"""How near a point is to the wall of a tube: by the foot on its centre curve.

A point x with foot C(p), where (x - C) . C' = 0, is rho = |x - C| from the curve and
R(p) - rho from the wall. By implicit differentiation, with y = x - C and
D = C' . C' - y . C'',

    grad p = C' / D        grad rho = y / rho        hess(rho^2 / 2) = I - C' C'^T / D

Lengths are over the rod's. Curve and radius are cubics on spans of the parameter p,
which is arc length but for the interpolation. Beyond its ends the tube goes on
straight, as wide as it is there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..magnet.flux import PART

Array = NDArray[np.float64]

FEET = 30
"""Steps toward a foot."""


class Bore(NamedTuple):
    """A tube in the kernels' lengths.

    Parameters
    ----------
    knots : ndarray, shape (m + 1,)
        Parameters at which the spans begin and end, equally spaced.
    spans : ndarray, shape (m, 4, 4)
        Coefficients of x, y, z and the radius by powers 0 to 3 from a span's begin.
    """

    knots: Array
    spans: Array


@njit(**PART)
def curve(tube, p, C):  # type: ignore[no-untyped-def]
    """Fill C, shape (4, 4): x, y, z, R by rows; value and derivatives by columns."""
    m = tube.spans.shape[0]
    low = tube.knots[0]
    high = tube.knots[m]
    k = max(0, min(int((p - low) / (high - low) * m), m - 1))
    inside = max(low, min(p, high))
    z = inside - tube.knots[k]
    for i in range(4):
        a = tube.spans[k, i]
        C[i, 0] = a[0] + z * (a[1] + z * (a[2] + z * a[3]))
        C[i, 1] = a[1] + z * (2.0 * a[2] + 3.0 * z * a[3])
        C[i, 2] = 2.0 * a[2] + 6.0 * z * a[3]
        C[i, 3] = 6.0 * a[3]
        if p != inside:
            C[i, 2] = C[i, 3] = 0.0
            if i < 3:
                C[i, 0] += (p - inside) * C[i, 1]
            else:
                C[i, 1] = 0.0


@njit(**PART)
def foot(tube, x, p, C):  # type: ignore[no-untyped-def]
    """Return the parameter of the foot of x near p; leave the curve there in C."""
    for _ in range(FEET):
        curve(tube, p, C)
        along = square = bend = 0.0
        for i in range(3):
            y = x[i] - C[i, 0]
            along += y * C[i, 1]
            square += C[i, 1] * C[i, 1]
            bend += y * C[i, 2]
        step = along / max(square - bend, 0.1 * square)
        longest = max(C[3, 0], 1e-3)
        p += max(-longest, min(step, longest))
        if abs(step) < 1e-14:
            break
    curve(tube, p, C)
    return p


@njit(**PART)
def gap_at(tube, x, half, p, C):  # type: ignore[no-untyped-def]
    """Return the gap between wall and rod at x, and the foot; only the value."""
    p = foot(tube, x, p, C)
    rho = 0.0
    for i in range(3):
        rho += (x[i] - C[i, 0]) ** 2
    return C[3, 0] - half - math.sqrt(rho), p


@njit(**PART)
def wall_at(tube, x, half, p, C, grad, hess):  # type: ignore[no-untyped-def]
    """Return gap and foot as `gap_at`, and fill gradient (3,) and Hessian (3, 3)."""
    gap, p = gap_at(tube, x, half, p, C)
    rho = max(C[3, 0] - half - gap, 1e-12)
    square = bend = cross = third = 0.0
    for i in range(3):
        y = x[i] - C[i, 0]
        square += C[i, 1] * C[i, 1]
        bend += y * C[i, 2]
        cross += C[i, 1] * C[i, 2]
        third += y * C[i, 3]
    D = square - bend
    slope = C[3, 1]
    for i in range(3):
        yi = (x[i] - C[i, 0]) / rho
        pi = C[i, 1] / D
        grad[i] = slope * pi - yi
        for j in range(3):
            yj = (x[j] - C[j, 0]) / rho
            pj = C[j, 1] / D
            same = 1.0 if i == j else 0.0
            hess[i, j] = (yi * yj + pi * pj * D - same) / rho + C[3, 2] * pi * pj
            hess[i, j] += slope * (
                (C[i, 2] * pj + C[j, 2] * pi) / D - (3.0 * cross - third) * pi * pj / D
            )
    return gap, p


@njit(cache=True, nogil=True, error_model="numpy")
def gaps(tube, points, half, p):  # type: ignore[no-untyped-def]
    """Return gaps and feet of points, shape (2, n), the first foot sought near p."""
    C = np.empty((4, 4))
    out = np.empty((2, points.shape[0]))
    for i in range(points.shape[0]):
        out[0, i], p = gap_at(tube, points[i], half, p, C)
        out[1, i] = p
    return out
