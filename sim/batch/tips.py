"""`solve_many`: the tips of many designs at once, on all cores.

Designs run in lanes (`batch.lanes`), and those that leave the lanes through the scalar
solver, in chunks that a pool of threads takes one by one (`batch.threads`). For whole
shapes instead of tips see `batch.shapes.solve_shapes`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.cross_section import ALL_SIZES
from ...core.jit import plain_first
from ...core.magnet import Magnet
from ...core.progress import Progress, silent
from ..fields import PULLED_IN, STABLE, UNSTABLE, Field, before, maps_of, outside
from ..planar.outcomes import OK_UNSTABLE, TOUCHES
from ..planar.solver import solve_planar_rows
from ..scaling import (
    direction,
    field_rows,
    many_rods,
    refuse_overlap,
    uniform_rows,
)
from .columns import at_most, check_magnet, columns_of
from .lanes import HARD, solve_lanes
from .patches import Before, before_rods
from .threads import in_threads

Array = NDArray[np.float64]

OUTCOMES = (
    STABLE, UNSTABLE, PULLED_IN, "not solved", "touches the magnet", "leaves the map"
)  # fmt: skip
"""Meaning of the codes in the column ``outcome``."""
NOT_SOLVED, TOUCHING, LEAVING = 3, 4, 5
RESULT = np.dtype(
    [
        ("tip_x_mm", np.float64),
        ("tip_y_mm", np.float64),
        ("tip_angle_deg", np.float64),
        ("error_mm", np.float64),
        ("outcome", np.int8),
        ("morse_index", np.int8),
    ]
)
CHUNK = 4096
_CORNERS = np.array([[-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, -1.0, 1.0]])
_ORDER = 12
_STEP = 0.4
FEW = 1000
"""Numbers in a column that plain Python gets through in about a second."""


@plain_first(solve_lanes, at_most(FEW))
def solve_many(
    designs: Mapping[str, ArrayLike] | NDArray[np.void],
    *,
    magnet: Magnet | Field | None = None,
    progress: Progress = silent,
    stop: Callable[[], bool] | None = None,
    threads: int | None = None,
) -> NDArray[np.void]:
    """Solve many weightless rods, clamped along +x, and return where their tips are.

    Parameters
    ----------
    designs : mapping of arrays, or structured array
        ``length_mm`` and ``E_MPa``, shape (n, sections) or (sections,), root first;
        ``remanence_mT`` and the sizes of one shape (``side_mm``; ``width_mm`` in the
        plane and ``height_mm``; ``diameter_mm``, also with ``bore_mm``), shape
        (n, sections), (n,) or scalar; and without a magnet ``flux_mT`` and
        ``angle_deg`` (90 by default), with one ``gap_mm``, shape (n,) or scalar, unless
        every source of it has its place.
    magnet : Magnet or Field, optional
        What the rods stand before, in their plane.
    progress : callable
        Called as ``progress(done, total)``, from this thread.
    stop : callable, optional
        Asked now and then; when it says True the rest stays ``not solved``.
    threads : int, optional
        How many cores to use; all that this process may, by default.

    Returns
    -------
    ndarray, shape (n,), with fields
        ``tip_x_mm``, ``tip_y_mm``, ``tip_angle_deg``, ``error_mm`` (a bound),
        ``outcome`` (index into `OUTCOMES`), ``morse_index``. Numbers are NaN, and the
        index -1, where there is no shape.

    Raises
    ------
    InputError
        If a column is missing or of another length, or holds a value that cannot be.

    Examples
    --------
    >>> import numpy as np
    >>> from magbend.sim import solve_many
    >>> tips = solve_many({"length_mm": [10, 10, 10], "E_MPa": [20, 15, 10],
    ...     "side_mm": 1.0, "remanence_mT": 20.07, "flux_mT": [38.0, 50.0]})
    >>> np.round(tips["tip_y_mm"], 3).tolist()
    [3.621, 4.71]
    """
    if magnet is not None:
        check_magnet(magnet)
    columns = columns_of(designs, magnet, {"angle_deg"} if magnet is None else set())
    n = len(columns["remanence_mT"])
    out = np.empty(n, dtype=RESULT)
    for name in RESULT.names or ():
        out[name] = np.nan if name not in ("outcome", "morse_index") else -1
    out["outcome"] = NOT_SOLVED

    stood = _before(columns, magnet)

    def work(rows: slice) -> None:
        part = {k: v[rows] for k, v in columns.items()}
        _solve_chunk(part, magnet, stood, out[rows])

    in_threads(work, n, CHUNK, threads=threads, progress=progress, stop=stop)
    return out


def _before(columns: dict[str, Array], magnet: Magnet | Field | None) -> Before | None:
    """Return what the rods stand before; None in uniform fields."""
    if magnet is None:
        return None
    length_mm = columns["length_mm"].sum(axis=1)
    gap_mm = columns.get("gap_mm", np.zeros(len(length_mm)))
    return before_rods(before(magnet), length_mm, gap_mm)


def _solve_chunk(
    columns: dict[str, Array],
    magnet: Magnet | Field | None,
    stood: Before | None,
    out: NDArray[np.void],
) -> None:
    """Solve one chunk into `out`."""
    rods, total_mm, margins = many_rods(
        columns["length_mm"], columns["E_MPa"],
        {name: columns[name] for name in ALL_SIZES if name in columns},
        columns["remanence_mT"],
    )  # fmt: skip
    n = len(rods)
    tips = np.zeros((n, 4))
    outcome = np.empty(n, dtype=np.int8)
    index = np.zeros(n, dtype=np.int8)
    none = np.empty(0)
    if magnet is None or stood is None:
        flux_T = columns["flux_mT"] * 1e-3
        loads = flux_T, *direction(columns["angle_deg"]), none, none
    else:
        gap_mm = columns.get("gap_mm", np.zeros(n))
        if stood.may_meet:
            rows = stood.rows(total_mm, gap_mm)
            refuse_overlap(before(magnet).sources, rows, np.ones(n))
        loads = none, none, none, gap_mm, stood.numbers
    solve_lanes(rods, total_mm, margins, *loads, tips, outcome)
    if isinstance(magnet, Field) and maps_of(magnet):
        outcome[_may_leave(magnet, tips, total_mm)] = HARD
    hard = np.flatnonzero(outcome == HARD)
    if len(hard):
        if magnet is None:
            fields = uniform_rows(flux_T[hard], columns["angle_deg"][hard])
        else:
            gaps = columns["gap_mm"][hard] if "gap_mm" in columns else None
            fields = field_rows(before(magnet), gaps, total_mm[hard])
        found = _solve_hard(rods[hard], fields, margins[hard], magnet, total_mm[hard])
        tips[hard], outcome[hard], index[hard] = found
    out["tip_x_mm"] = tips[:, 0] * total_mm
    out["tip_y_mm"] = tips[:, 1] * total_mm
    out["tip_angle_deg"] = np.degrees(tips[:, 2])
    out["error_mm"] = tips[:, 3] * total_mm
    out["outcome"] = outcome
    out["morse_index"] = index


def _may_leave(field: Field, tips: Array, length_mm: Array) -> NDArray[np.bool_]:
    """Tell of rods that run in lanes which might leave the box of a map.

    A rod stays within its ellipse about the line from clamp to tip (`survey.near`), and
    so between the squares of that size around both, if they are in the box.
    """
    wide = 0.5 * np.sqrt(np.maximum(0.0, 1.0 - tips[:, 0] ** 2 - tips[:, 1] ** 2))
    corners = wide[:, None, None] * _CORNERS
    at_clamp = np.broadcast_to(corners, (len(tips), 2, 4))
    both = np.concatenate([at_clamp, tips[:, :2, None] + corners], axis=2)
    return outside(field, both, length_mm)


def _solve_hard(
    rods: Array,
    fields: Array,
    margins: Array,
    magnet: Magnet | Field | None,
    total_mm: Array,
) -> tuple[Array, Array, Array]:
    """Solve the designs that left the lanes: tips and errors, outcomes, indices."""
    stations = np.linspace(0.0, 1.0, 41)[None]
    found, curves, _ = solve_planar_rows(
        rods, fields, 0.0, margins, stations, _ORDER, _STEP
    )
    outcome, index = found[:, 0], found[:, 1]
    tips = np.column_stack([curves[:, :3, -1], found[:, 2]])
    touching, gone = outcome == TOUCHES, outcome > OK_UNSTABLE
    outcome = np.where(touching, TOUCHING, np.minimum(outcome, NOT_SOLVED))
    if isinstance(magnet, Field):
        left = ~gone & outside(magnet, curves[:, :2], total_mm)
        outcome[left] = LEAVING
        gone |= left
    tips[gone] = np.nan
    index[gone] = -1
    return tips, outcome, index
