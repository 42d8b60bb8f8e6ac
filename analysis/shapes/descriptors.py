"""Descriptors of many shapes at once: what `metrics` says of one, in a compiled kernel.

Arrays in mm and rad; shapes have equally spaced points from clamp to tip. The circle is
the least-squares one through all points of the centreline (`metrics.fit_circle`), so
that *bending radius* means the same everywhere.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.jit import njit
from ...core.plugins import load_plugin
from ...sim import ROWS_PER_CALL, in_threads

Array = NDArray[np.float64]

COLUMNS: Final = (
    "tip_x_mm", "tip_y_mm", "tip_angle_deg", "radius_mm", "circularity",
    "a_per_mm", "a_misfit_mm",
)  # fmt: skip
"""Descriptors, in the order of the columns of `describe`."""

_FLAT = 1e-9


def describe(shapes: Array) -> Array:
    """Return the descriptors of shapes.

    Parameters
    ----------
    shapes : ndarray, shape (n, points, 5)
        s, x, y in mm, theta in rad, kappa in 1/mm; NaN where a design has no shape.

    Returns
    -------
    ndarray, shape (n, 7)
        In the order of `COLUMNS`; NaN where there is no shape. The radius is infinite
        and circularity NaN for a straight rod.
    """
    out = np.empty((len(shapes), len(COLUMNS)))
    shapes = np.ascontiguousarray(shapes, dtype=np.float64)
    in_threads(
        lambda rows: _describe(shapes[rows], out[rows]), len(shapes), ROWS_PER_CALL
    )
    return out


def describe_by(name: str, shapes: Array) -> Array:
    """Return a descriptor that another package offers (``magbend.descriptors``).

    Parameters
    ----------
    name : str
        The entry point's; it is a function of shapes that returns one number each.
    shapes : ndarray, shape (n, points, 5)
        As of `describe`.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    ConfigError
        If nobody offers it or it cannot be loaded.
    InputError
        If it fails, or returns anything but n numbers.
    """
    function = load_plugin("magbend.descriptors", name, own=COLUMNS)
    try:
        values = np.asarray(function(shapes), dtype=np.float64)
    except Exception as error:  # whatever a stranger's function does
        raise InputError(
            f"the descriptor {name!r} fails: {type(error).__name__}: {error}"
        ) from None
    if values.shape != (len(shapes),):
        raise InputError(
            f"the descriptor {name!r} must return {len(shapes)} numbers, one a shape; "
            f"instead it returned shape {values.shape}"
        )
    return values


@njit(cache=True, nogil=True)
def _describe(shapes, out):  # type: ignore[no-untyped-def]
    for i in range(shapes.shape[0]):
        shape = shapes[i]
        last = shape.shape[0] - 1
        if math.isnan(shape[last, 1]):
            out[i, :] = np.nan
            continue
        out[i, 0] = shape[last, 1]
        out[i, 1] = shape[last, 2]
        out[i, 2] = shape[last, 3] * 180.0 / math.pi
        out[i, 3] = circle_radius(shape)
        turned = 0.0
        square = 0.0
        x4 = 0.0
        x2y = 0.0
        for j in range(last + 1):
            x = shape[j, 1]
            x4 += x**4
            x2y += x * x * shape[j, 2]
            if j > 0:
                h = shape[j, 0] - shape[j - 1, 0]
                k0 = shape[j - 1, 4]
                k1 = shape[j, 4]
                turned += 0.5 * h * (k0 + k1)
                square += 0.5 * h * (k0 * k0 + k1 * k1)
        length = shape[last, 0] - shape[0, 0]
        out[i, 4] = turned * turned / (length * square) if square > 0.0 else np.nan
        a = x2y / x4 if x4 > 0.0 else np.nan
        misfit = 0.0
        for j in range(last + 1):
            misfit += (shape[j, 2] - a * shape[j, 1] ** 2) ** 2
        out[i, 5] = a
        out[i, 6] = math.sqrt(misfit / (last + 1))


@njit(cache=True)
def circle_radius(shape):  # type: ignore[no-untyped-def]
    """Return the radius of the least-squares circle of one shape (s, x, y, ...).

    Gauss-Newton on the distances, in curvature, direction and offset (well posed for
    flat arcs), from the circle through root, middle and tip.
    """
    n = shape.shape[0]
    x0 = 0.0
    y0 = 0.0
    for j in range(n):
        x0 += shape[j, 1] / n
        y0 += shape[j, 2] / n
    size2 = 0.0
    for j in range(n):
        size2 += ((shape[j, 1] - x0) ** 2 + (shape[j, 2] - y0) ** 2) / n
    size = math.sqrt(size2)
    curvature, angle, gap = _three_points(shape, x0, y0)
    if abs(curvature) * size < _FLAT:
        return math.inf
    for _ in range(50):
        step, curvature, angle, gap = _circle_step(
            shape, x0, y0, curvature, angle, gap, size
        )
        if step < 1e-13:
            break
    if abs(curvature) * size < _FLAT:
        return math.inf
    return abs(1.0 / curvature)


@njit(cache=True)
def _three_points(shape, x0, y0):  # type: ignore[no-untyped-def]
    """Curvature, direction of the centre and offset of a first circle."""
    n = shape.shape[0]
    m = n // 2
    ax = shape[m, 1] - shape[0, 1]
    ay = shape[m, 2] - shape[0, 2]
    bx = shape[n - 1, 1] - shape[0, 1]
    by = shape[n - 1, 2] - shape[0, 2]
    cross = ax * by - ay * bx
    a2 = ax * ax + ay * ay
    b2 = bx * bx + by * by
    c2 = (bx - ax) ** 2 + (by - ay) ** 2
    curvature = 2.0 * abs(cross) / math.sqrt(a2 * b2 * c2)
    if curvature == 0.0:
        return 0.0, 0.0, 0.0
    cx = shape[0, 1] - x0 + (by * a2 - ay * b2) / (2.0 * cross)
    cy = shape[0, 2] - y0 + (ax * b2 - bx * a2) / (2.0 * cross)
    return curvature, math.atan2(cy, cx), math.hypot(cx, cy) - 1.0 / curvature


@njit(cache=True)
def _circle_step(shape, x0, y0, curvature, angle, gap, size):  # type: ignore[no-untyped-def]
    """Return the scaled size of one Gauss-Newton step and the new circle."""
    radius = 1.0 / curvature
    nx = math.cos(angle)
    ny = math.sin(angle)
    cx = (radius + gap) * nx
    cy = (radius + gap) * ny
    a00 = a01 = a02 = a11 = a12 = a22 = g0 = g1 = g2 = 0.0
    # Unknowns scaled to one size: curvature * size, angle, gap / size.
    for j in range(shape.shape[0]):
        dx = shape[j, 1] - x0 - cx
        dy = shape[j, 2] - y0 - cy
        r = math.sqrt(dx * dx + dy * dy)
        along = (dx * nx + dy * ny) / r
        across = (dy * nx - dx * ny) / r
        f = (r - radius) / size
        j0 = radius * radius * (along + 1.0) / (size * size)
        j1 = -(radius + gap) * across / size
        j2 = -along
        a00 += j0 * j0
        a01 += j0 * j1
        a02 += j0 * j2
        a11 += j1 * j1
        a12 += j1 * j2
        a22 += j2 * j2
        g0 += j0 * f
        g1 += j1 * f
        g2 += j2 * f
    det = (
        a00 * (a11 * a22 - a12 * a12)
        - a01 * (a01 * a22 - a12 * a02)
        + a02 * (a01 * a12 - a11 * a02)
    )
    if det == 0.0:
        return 0.0, curvature, angle, gap
    d0 = (
        g0 * (a11 * a22 - a12 * a12)
        - a01 * (g1 * a22 - a12 * g2)
        + a02 * (g1 * a12 - a11 * g2)
    ) / det
    d1 = (
        a00 * (g1 * a22 - a12 * g2)
        - g0 * (a01 * a22 - a12 * a02)
        + a02 * (a01 * g2 - g1 * a02)
    ) / det
    d2 = (
        a00 * (a11 * g2 - g1 * a12)
        - a01 * (a01 * g2 - g1 * a02)
        + g0 * (a01 * a12 - a11 * a02)
    ) / det
    step = max(abs(d0), abs(d1), abs(d2))
    return step, curvature - d0 / size, angle - d1, gap - d2 * size
