"""`solve_spatial_many`: the tips of many rods in space, on all cores.

Weight, clamp and sources in any direction, rods curved and magnetised across their
axis. Stable ones in a uniform field or before a cuboid go side by side
(`batch.space_lanes`), the rest one by one (`spatial.rows`). Rods that stay in the plane
are quicker with `batch.tips.solve_many`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import shown, within
from ...core.cross_section import ALL_SIZES, torsion_constant_mm4
from ...core.errors import InputError
from ...core.jit import plain_first
from ...core.magnet import Magnet
from ...core.progress import Progress, silent
from ...core.units import MU0
from ..fields import Field, Support, before
from ..magnet.map import FieldMap
from ..scaling import direction, field_rows, uniform_rows
from ..spatial.march import AXIAL, C1, C2, C3, K2, MU1, MU2, WIDTH, WX, WZ, H
from ..spatial.rod import clamp_of
from ..spatial.rows import BEYOND, solve_rods
from .columns import at_most, check_source, columns_of
from .lanes import HARD
from .space_lanes import solve_space_lanes
from .threads import in_threads

Array = NDArray[np.float64]

TIPS = ("tip_x_mm", "tip_y_mm", "tip_z_mm", "tangent_x", "tangent_y", "tangent_z")
RESULT = np.dtype(
    [
        *((name, np.float64) for name in (*TIPS, "error_mm")),
        ("outcome", np.int8),
        ("morse_index", np.int8),
    ]
)
MORE = {
    "remanence_y_mT", "remanence_z_mT", "natural_curvature_per_mm", "density_kg_m3"
}  # fmt: skip
CHUNK = 1024
FEW = 10
"""Designs that plain Python gets through in about a second."""


@plain_first(solve_rods, at_most(FEW))
def solve_spatial_many(
    designs: Mapping[str, ArrayLike] | NDArray[np.void],
    *,
    magnet: Magnet | Field | None = None,
    support: Support | None = None,
    poisson_ratio: float = 0.49,
    progress: Progress = silent,
    stop: Callable[[], bool] | None = None,
    threads: int | None = None,
) -> NDArray[np.void]:
    """Solve many rods in space and return where their tips are.

    Parameters
    ----------
    designs : mapping of arrays, or structured array
        As for `solve_many`; besides, where a rod has them, ``remanence_y_mT``,
        ``remanence_z_mT`` and ``natural_curvature_per_mm``, shape (n, sections), (n,)
        or scalar, ``density_kg_m3``, shape (n,) or scalar, and with ``flux_mT`` also
        ``elevation_deg``.
    magnet : Magnet or Field, optional
        What the rods stand before.
    support : Support, optional
        Clamp angle, weight, load factor of all rods.
    poisson_ratio : float
        For the torsion of all rods.
    progress, stop, threads
        As for `solve_many`.

    Returns
    -------
    ndarray, shape (n,), with fields
        ``tip_x_mm``, ``tip_y_mm``, ``tip_z_mm``, ``tangent_x``, ``tangent_y``,
        ``tangent_z``, ``error_mm`` (a bound), ``outcome`` (index into `OUTCOMES`),
        ``morse_index`` (unstable directions in space). Numbers are NaN, and the index
        -1, where there is no shape.

    Raises
    ------
    InputError
        If a column is missing or of another length, or holds a value that cannot be.

    Examples
    --------
    >>> import numpy as np
    >>> from magbend.sim import Support, solve_spatial_many
    >>> tips = solve_spatial_many({"length_mm": [10, 10, 10], "E_MPa": [20, 15, 10],
    ...     "side_mm": 1.0, "remanence_mT": 20.07, "density_kg_m3": 2640.0,
    ...     "flux_mT": [38.0, 50.0]}, support=Support(gravity_m_s2=(0, 0, -9.80665)))
    >>> np.round(tips["tip_z_mm"], 3).tolist()
    [-1.661, -1.644]
    """
    support = support or Support()
    if not isinstance(support, Support):
        raise InputError(
            f"support must be a Support; instead received {shown(support)}"
        )
    ratio = within(poisson_ratio, -0.99, 0.5, "poisson_ratio", "")
    columns = _columns(designs, magnet, support)
    field = None if magnet is None else before(magnet)
    n = len(columns["remanence_mT"])
    out = np.empty(n, dtype=RESULT)
    for name in (*TIPS, "error_mm"):
        out[name] = np.nan
    out["outcome"], out["morse_index"] = BEYOND, -1
    clamp, box_mm = clamp_of(support), _box_mm(field)

    def work(rows: slice) -> None:
        part = {name: values[rows] for name, values in columns.items()}
        rods, total_mm, margins = _rods(part, support, ratio)
        fields = _fields(part, field, total_mm)
        boxes = np.tile(box_mm, (len(rods), 1)) / total_mm[:, None]
        tips, into = np.empty((len(rods), 7)), out[rows]
        outcome, index = np.full(len(rods), HARD, np.int8), np.zeros(len(rods), np.int8)
        if len(rods) > FEW:
            solve_space_lanes(rods, fields, clamp, margins, tips, outcome)
        hard = np.flatnonzero(outcome == HARD)
        if len(hard):
            rest = np.empty((len(hard), 7)), outcome[hard], index[hard]
            solve_rods(
                rods[hard], fields[hard], clamp, margins[hard], boxes[hard], *rest
            )
            tips[hard], outcome[hard], index[hard] = rest
        into["outcome"], into["morse_index"] = outcome, index
        for k, name in enumerate(TIPS):
            into[name] = tips[:, k] * (total_mm if k < 3 else 1.0)
        into["error_mm"] = tips[:, 6] * total_mm

    in_threads(work, n, CHUNK, threads=threads, progress=progress, stop=stop)
    return out


def _columns(
    designs: Mapping[str, ArrayLike] | NDArray[np.void],
    magnet: Magnet | Field | None,
    support: Support,
) -> dict[str, Array]:
    if magnet is not None:
        check_source(magnet)
    turns = {"angle_deg", "elevation_deg"} if magnet is None else set()
    columns = columns_of(designs, magnet, MORE | turns)
    if any(support.gravity_m_s2) and "density_kg_m3" not in columns:
        raise InputError(
            "designs must have a column density_kg_m3 in kg/m3 for their weight to be "
            "taken into account; instead received none"
        )
    return columns


def _box_mm(field: Field | None) -> Array:
    """Return the least and largest (x, y, z) at which all maps of a field are known."""
    box = np.repeat([-np.inf, np.inf], 3)
    for source in field.sources if field else ():
        if isinstance(source, FieldMap):
            box[:3] = np.maximum(box[:3], source.low_mm)
            box[3:] = np.minimum(box[3:], source.high_mm)
    return box


def _fields(columns: dict[str, Array], field: Field | None, total_mm: Array) -> Array:
    """Return the fields as the kernels take them, shape (n, width)."""
    if field is not None:
        return field_rows(field, columns.get("gap_mm"), total_mm)
    flux_T = columns["flux_mT"] * 1e-3
    rows = uniform_rows(flux_T, columns["angle_deg"])
    if "elevation_deg" in columns:
        along, up = direction(columns["elevation_deg"])
        rows[:, 1:3] *= along[:, None]
        rows[:, 3] = flux_T * up
    return rows


def _rods(
    columns: dict[str, Array], support: Support, poisson_ratio: float
) -> tuple[Array, Array, Array]:
    """Return the rods as `spatial.rod.rod_table`, lengths, and half sides over them."""
    length, E = columns["length_mm"], columns["E_MPa"]
    total = length.sum(axis=1)
    area, about_d1, about_d2, torsion, thin = _sections(columns)
    unit = E[:, :1] * about_d2[:, :1]
    L = total[:, None]
    per_N = L**2 / unit
    shear = 2.0 * (1.0 + poisson_ratio)
    magnetic = support.load_factor * area * 1e-9 / MU0 * per_N
    zero = np.zeros_like(length)
    rods = np.zeros((*length.shape, WIDTH))
    rods[..., H] = length / L
    rods[..., C1] = unit / (E * about_d1)
    rods[..., C2] = unit / (E * about_d2)
    rods[..., C3] = unit / (E / shear * torsion)
    rods[..., AXIAL] = magnetic * columns["remanence_mT"]
    rods[..., MU1] = magnetic * columns.get("remanence_y_mT", zero)
    rods[..., MU2] = magnetic * columns.get("remanence_z_mT", zero)
    rods[..., K2] = columns.get("natural_curvature_per_mm", zero) * L
    if any(support.gravity_m_s2):
        weight = columns["density_kg_m3"][:, None] * area * L * 1e-9 * per_N
        rods[..., WX : WZ + 1] = weight[..., None] * np.array(support.gravity_m_s2)
    if not np.all(np.isfinite(rods)):
        raise InputError(
            "designs: sizes in mm and E_MPa in MPa must be of comparable size; instead "
            "received a design whose loads overflow"
        )
    return np.ascontiguousarray(rods[:, ::-1]), total, 0.5 * thin.max(axis=1) / total


def _sections(columns: dict[str, Array]) -> tuple[Array, Array, Array, Array, Array]:
    """Return area, second moments about d1 and d2, torsion constant, lesser extent."""
    sizes = {name: columns[name] for name in ALL_SIZES if name in columns}
    if "diameter_mm" in sizes:
        d, bore = sizes["diameter_mm"], sizes.get("bore_mm", 0.0)
        second = math.pi / 64.0 * (d**4 - bore**4)
        return math.pi / 4.0 * (d**2 - bore**2), second, second, 2.0 * second, d
    if "side_mm" in sizes:
        a = sizes["side_mm"]
        square = torsion_constant_mm4(1.0, 1.0)
        return a**2, a**4 / 12.0, a**4 / 12.0, square * a**4, a
    w, h = sizes["width_mm"], sizes["height_mm"]
    thin = np.minimum(w, h)
    torsion = np.vectorize(torsion_constant_mm4, otypes=[float])(w, h)
    return w * h, w * h**3 / 12.0, h * w**3 / 12.0, torsion, thin
