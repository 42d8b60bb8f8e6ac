"""Columns of designs, as both batch solvers take them: units, ranges, checks."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.arrays import real_array
from ...core.checks import positive, shown, within
from ...core.errors import InputError
from ...core.magnet import Magnet
from ...core.sources import FLUX_LIMIT_T
from ..fields import Field, before

COLUMNS = {
    "side_mm": (1e-9, 1e9, "mm"),
    "width_mm": (1e-9, 1e9, "mm"),
    "height_mm": (1e-9, 1e9, "mm"),
    "diameter_mm": (1e-9, 1e9, "mm"),
    "bore_mm": (1e-9, 1e9, "mm"),
    "length_mm": (1e-9, 1e9, "mm"),
    "E_MPa": (1e-9, 1e9, "MPa"),
    "gap_mm": (1e-9, 1e9, "mm"),
    "remanence_mT": (-FLUX_LIMIT_T * 1e3, FLUX_LIMIT_T * 1e3, "mT"),
    "flux_mT": (-FLUX_LIMIT_T * 1e3, FLUX_LIMIT_T * 1e3, "mT"),
    "angle_deg": (-36000.0, 36000.0, "deg"),
}
"""Least and largest value of each column, and its unit."""


def column(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return a column as an array of floats.

    Raises
    ------
    InputError
        If it is no array of real numbers, or one is not finite or out of range.
    """
    low, high, unit = COLUMNS[name]
    array = real_array(values, f"designs: {name}", unit)
    bad = (array < low) | (array > high)
    if np.any(bad):
        worst, what = float(array[bad].flat[0]), f"designs: every {name}"
        if low > 0.0:
            positive(worst, what, unit)
        within(worst, low, high, what, unit)
    return array


def check_magnet(magnet: object) -> None:
    """Refuse what is no magnet, or none that bends rods within their plane.

    Raises
    ------
    InputError
        If it is either.
    """
    if isinstance(magnet, Field):
        if not magnet.in_plane:
            raise InputError(
                "magnet of batches must be a field within the plane z = 0, with "
                f"elevation_deg and z in mm of 0; instead received {shown(magnet)}"
            )
        return
    if not isinstance(magnet, Magnet):
        raise InputError(
            "magnet must be a Magnet in mm and T, or a Field of sources; instead "
            f"received {shown(magnet)}"
        )
    if magnet.elevation_deg != 0.0 or magnet.offset_mm[2] != 0.0:
        raise InputError(
            "magnet elevation_deg in deg and offset_mm[2] in mm must be 0 for batches, "
            f"which are planar; instead received {magnet.elevation_deg!r} deg and "
            f"{magnet.offset_mm[2]!r} mm"
        )
    if abs(magnet.remanence_T) > FLUX_LIMIT_T:
        raise InputError(
            f"magnet remanence_T must be within {FLUX_LIMIT_T:g} T; instead received "
            f"{magnet.remanence_T!r}"
        )


def waits_for_gap(magnet: Magnet | Field | None) -> bool:
    """Tell whether designs before a magnet have a column gap_mm."""
    return magnet is not None and before(magnet).follows_gap
