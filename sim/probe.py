"""What a field is at points: for people, figures and checks."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.arrays import real_array
from ..core.checks import size
from ..core.errors import InputError
from ..core.jit import njit
from .fields import Field, as_field
from .magnet.flux import blocked, flux_at
from .scaling import field_array

Array = NDArray[np.float64]


def flux_mT(field: Field, points_mm: ArrayLike, *, length_mm: float) -> Array:
    """Return the flux density of a field at points of the specimen frame.

    Parameters
    ----------
    field : Field
        Or a single source.
    points_mm : array_like, shape (n, 3) or (3,)
        In mm.
    length_mm : float
        Length of the rod whose undeformed tip gaps count from, in mm.

    Returns
    -------
    ndarray, shape (n, 3) or (3,)
        In mT.

    Raises
    ------
    InputError
        If a point is not finite, or inside a source or on its surface.
    """
    return field_table(field, points_mm, length_mm=length_mm)[..., :3] * 1e3


def field_table(field: Field, points_mm: ArrayLike, *, length_mm: float) -> Array:
    """Return B in T and dB_i/dx_j in T/mm, 12 numbers a point (see `flux_mT`)."""
    length_mm = size(length_mm, "length_mm", "mm")
    points = real_array(points_mm, "points_mm", "mm")
    if points.shape[-1:] != (3,) or np.any(np.abs(points) > 1e9):
        raise InputError(
            "points_mm must be positions (x, y, z) within 1e+09 mm; instead received "
            f"an array of shape {points.shape}"
        )
    flat = np.ascontiguousarray(points.reshape(-1, 3))
    out = np.empty((len(flat), 12))
    array = field_array(as_field(field), length_mm)
    bad = _table(array, flat / length_mm, out)
    if bad >= 0:
        x, y, z = flat[bad]
        raise InputError(
            f"points_mm must lie outside the sources; instead received ({x:g}, {y:g}, "
            f"{z:g}) mm, which is inside one or on its surface"
        )
    out[:, 3:] /= length_mm
    return out.reshape(*points.shape[:-1], 12)


@njit(cache=True)
def _table(field, points, out):  # type: ignore[no-untyped-def]
    """Fill `out` (n, 12) for `points` (n, 3); return the first point inside, or -1."""
    for n in range(points.shape[0]):
        if blocked(field, points[n, 0], points[n, 1], points[n, 2], 0.0):
            return n
        flux_at(field, points[n, 0], points[n, 1], points[n, 2], out[n])
    return -1
