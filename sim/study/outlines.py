"""Outlines of the bodies of a field in the plane of the rod."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..fields import Field
from ..magnet.flux import COIL, CUBOID, CYLINDER, DIPOLE, FIRST, SUM, WIDTH
from ..scaling import field_array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_TURN = np.linspace(0.0, 2.0 * np.pi, 49)
_CIRCLE = np.column_stack([np.cos(_TURN), np.sin(_TURN)])
THIN_MM = 1.0
"""Thickness of a winding, and diameter of a dipole, that have none of their own."""


def outlines_mm(field: Field, length_mm: float) -> list[Array]:
    """Return the outlines of a field's magnets and windings in the rod's plane.

    Parameters
    ----------
    field : Field
        In the plane, at its place.
    length_mm : float
        Of the rod, to whose undeformed tip gaps count.

    Returns
    -------
    list of ndarray, shape (n, 2)
        Closed polygons in mm: one a magnet, two a coil. What has no body has none.
    """
    array = field_array(field, length_mm)
    rows = array[None, :WIDTH]
    if array[0] == SUM:
        rows = array[FIRST : FIRST + WIDTH * int(array[1])].reshape(-1, WIDTH)
    found = []
    for row in rows:
        axes = row[7:16].reshape(3, 3)[[0, 2], :2]
        for own in _own(row, THIN_MM / length_mm):
            found.append((row[4:6] + own @ axes) * length_mm)
    return found


def _own(row: Array, thin: float) -> list[Array]:
    """Return the outlines of a body over its own x and z."""
    a, b, c = row[1:4]
    if row[0] in (CUBOID, CYLINDER):
        return [_CORNERS * (a, c)]
    if row[0] == DIPOLE:
        return [_CIRCLE * max(a, 0.5 * thin)]
    if row[0] == COIL:
        half = max(b, 0.5 * thin)
        return [_CORNERS * (half, c + half) + (side * a, 0.0) for side in (-1.0, 1.0)]
    return []


def draw_sources(axes: Axes, field: Field, length_mm: float) -> None:
    """Draw the bodies of a field into axes in mm."""
    from matplotlib.patches import Polygon

    for points in outlines_mm(field, length_mm):
        axes.add_patch(
            Polygon(points, facecolor="0.85", edgecolor="0.4", linewidth=0.8, zorder=0)
        )
    axes.autoscale_view()
