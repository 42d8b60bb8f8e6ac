"""Columns of designs, as both batch solvers take them: units, ranges, checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.arrays import real_array
from ...core.checks import positive, shown, within
from ...core.cross_section import ALL_SIZES, SIZES
from ...core.errors import InputError
from ...core.magnet import Magnet
from ...core.sources import FLUX_LIMIT_T
from ..fields import Field, before, kinds_of

Array = NDArray[np.float64]

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
    "remanence_y_mT": (-FLUX_LIMIT_T * 1e3, FLUX_LIMIT_T * 1e3, "mT"),
    "remanence_z_mT": (-FLUX_LIMIT_T * 1e3, FLUX_LIMIT_T * 1e3, "mT"),
    "natural_curvature_per_mm": (-1e3, 1e3, "1/mm"),
    "density_kg_m3": (1e-9, 1e9, "kg/m3"),
    "flux_mT": (-FLUX_LIMIT_T * 1e3, FLUX_LIMIT_T * 1e3, "mT"),
    "angle_deg": (-36000.0, 36000.0, "deg"),
    "elevation_deg": (-90.0, 90.0, "deg"),
}
"""Least and largest value of each column, and its unit."""

WIDE = ("length_mm", "E_MPa")
PER_SECTION = (
    *ALL_SIZES, "remanence_mT", "remanence_y_mT", "remanence_z_mT",
    "natural_curvature_per_mm",
)  # fmt: skip
"""Columns that have a value for each section, or may have."""


def column(name: str, values: ArrayLike) -> Array:
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


def at_most(few: int) -> Callable[..., bool]:
    """Return what tells whether the columns of designs hold so few numbers.

    Plain Python gets through those before compiling is done.
    """

    def fits(designs: Any, **_options: object) -> bool:
        try:
            names = designs.dtype.names if isinstance(designs, np.ndarray) else designs
            return max(np.size(designs[name]) for name in names) <= few
        except (TypeError, KeyError, IndexError, ValueError):
            return True  # the solver tells what is wrong with them

    return fits


def check_source(magnet: object) -> None:
    """Refuse what is neither a magnet nor a field.

    Raises
    ------
    InputError
        If it is neither.
    """
    if not isinstance(magnet, (Magnet, Field)):
        raise InputError(
            "magnet must be a Magnet in mm and T, or a Field of sources; instead "
            f"received {shown(magnet)}"
        )


def check_magnet(magnet: Magnet | Field) -> None:
    """Refuse what is no magnet, or none that bends rods within their plane.

    Raises
    ------
    InputError
        If it is either.
    """
    check_source(magnet)
    if isinstance(magnet, Field):
        if not magnet.in_plane:
            raise InputError(
                "magnet of batches must be a field within the plane z = 0, with "
                "elevation_deg and z in mm of 0; instead received "
                f"{kinds_of(magnet)} off it"
            )
        return
    if magnet.elevation_deg != 0.0 or magnet.offset_mm[2] != 0.0:
        raise InputError(
            "magnet elevation_deg in deg and offset_mm[2] in mm must be 0 for batches, "
            f"which are planar; instead received {magnet.elevation_deg:g} deg and "
            f"{magnet.offset_mm[2]:g} mm"
        )
    if abs(magnet.remanence_T) > FLUX_LIMIT_T:
        raise InputError(
            f"magnet remanence_T must be within {FLUX_LIMIT_T:g} T; instead received "
            f"{magnet.remanence_T:g}"
        )


def waits_for_gap(magnet: Magnet | Field | None) -> bool:
    """Tell whether designs before a magnet have a column gap_mm."""
    return magnet is not None and before(magnet).follows_gap


def columns_of(
    designs: Mapping[str, ArrayLike] | NDArray[np.void],
    magnet: Magnet | Field | None,
    more: set[str],
) -> dict[str, Array]:
    """Return the columns, checked: those of sections (n, k), the others (n,).

    `more` are those that may be there besides what all batch solvers ask for.

    Raises
    ------
    InputError
        If a column is missing or of another length, or holds a value that cannot be.
    """
    arrays = _given(designs, magnet, more)
    n = max((len(a) for k, a in arrays.items() if a.ndim > (k in WIDE)), default=1)
    if arrays["length_mm"].ndim == 0 or arrays["length_mm"].shape[-1] == 0:
        raise InputError(
            "designs: length_mm in mm must have a column for each section of the rods; "
            f"instead received shape {arrays['length_mm'].shape}"
        )
    sections = arrays["length_mm"].shape[-1]
    for name, array in arrays.items():
        full = (n, sections) if name in (*WIDE, *PER_SECTION) else (n,)
        fits = array
        if array.ndim == 1 and name in PER_SECTION:
            fits = array[:, None]
        try:
            # A copy, as what is broadcast may not be written and is another type of
            # array to kernels, which would be compiled again.
            wide = fits if fits.shape == full else np.broadcast_to(fits, full).copy()
            arrays[name] = np.ascontiguousarray(wide)
        except ValueError:
            raise InputError(
                f"designs: {name} in {COLUMNS[name][2]} must fit {n} designs of "
                f"{sections} sections; instead received shape {array.shape}"
            ) from None
    if "bore_mm" in arrays and np.any(arrays["bore_mm"] >= arrays["diameter_mm"]):
        raise InputError(
            "designs: every bore_mm in mm must be below its diameter_mm; instead "
            "received one that is not"
        )
    return arrays


def _given(
    designs: Mapping[str, ArrayLike] | NDArray[np.void],
    magnet: Magnet | Field | None,
    more: set[str],
) -> dict[str, Array]:
    """Return the columns as they are given, their names and values checked."""
    given = designs.dtype.names if isinstance(designs, np.ndarray) else designs
    known_kind = isinstance(given, (Mapping, tuple)) or hasattr(given, "columns")
    if given is None or not known_kind:
        raise InputError(
            "designs must be a mapping of columns or a structured array; instead "
            f"received {shown(designs)}"
        )
    names = [str(name) for name in given]
    sizes = {name for name in names if name in ALL_SIZES} or {"side_mm"}
    if sizes not in [set(given) for given in SIZES.values()]:
        raise InputError(
            "designs must have the sizes of one shape, in mm: side_mm, or width_mm and "
            "height_mm, or diameter_mm with or without bore_mm; instead received "
            f"{', '.join(sorted(sizes))}"
        )
    wanted = {"length_mm", "E_MPa", "remanence_mT"} | sizes
    if magnet is None:
        wanted |= {"flux_mT"}
    elif waits_for_gap(magnet):
        wanted |= {"gap_mm"}
    if not wanted <= set(names) <= wanted | more:
        may = f", and may have {', '.join(sorted(more))}" if more else ""
        raise InputError(
            f"designs must have the columns {', '.join(sorted(wanted))} in mm, MPa and "
            f"mT (flux_mT without a magnet, gap_mm if it waits for one){may}; instead "
            f"received {', '.join(sorted(names))[:200]}"
        )
    arrays = {name: column(name, designs[name]) for name in names}
    if magnet is None:
        arrays.setdefault("angle_deg", np.array(90.0))
    return arrays
