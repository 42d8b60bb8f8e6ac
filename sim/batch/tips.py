"""`solve_many`: the tips of many designs at once, on all cores.

Designs run in lanes (`batch.lanes`), and those that leave the lanes through the scalar
solver, in chunks that a pool of threads takes one by one. Threads rather than numba's
parallel layer: its fallback aborts when two callers meet and does not survive a fork,
while kernels that release the interpreter run on all cores, let progress be told and a
stop be asked between chunks, and load from the cache like any other. For whole shapes
instead of tips see `batch.shapes.solve_shapes`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import shown, whole
from ...core.errors import InputError
from ...core.jit import njit
from ...core.magnet import Magnet
from ...core.progress import Progress, silent
from ...core.units import MU0
from ..fields import PULLED_IN, STABLE, UNSTABLE
from ..magnet.field import magnet_block
from ..planar.march import WX, WY, E, H, M
from ..planar.solver import OK_UNSTABLE, TOUCHES, solve_planar_rows
from .columns import COLUMNS, check_magnet, column
from .lanes import HARD, solve_lanes

Array = NDArray[np.float64]

OUTCOMES = (STABLE, UNSTABLE, PULLED_IN, "not solved", "touches the magnet")
"""Meaning of the codes in the column ``outcome``."""
NOT_SOLVED = 3
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
_ORDER = 12
_STEP = 0.4
_WIDE = ("length_mm", "E_MPa")
_MOST_THREADS = 1024


def solve_many(
    designs: Mapping[str, ArrayLike] | NDArray[np.void],
    *,
    magnet: Magnet | None = None,
    progress: Progress = silent,
    stop: Callable[[], bool] | None = None,
    threads: int | None = None,
) -> NDArray[np.void]:
    """Solve many weightless rods, clamped along +x, and return where their tips are.

    Parameters
    ----------
    designs : mapping of arrays, or structured array
        ``length_mm`` and ``E_MPa``, shape (n, sections) or (sections,), root first;
        ``side_mm`` and ``remanence_mT``, shape (n, sections), (n,) or scalar; and
        either ``flux_mT`` and ``angle_deg`` (90 by default), or ``gap_mm``, shape (n,)
        or scalar.
    magnet : Magnet, optional
        The magnet to which ``gap_mm`` refers; in the plane of the rods.
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
    columns = _columns(designs, magnet)
    n = len(columns["side_mm"])
    out = np.empty(n, dtype=RESULT)
    for name in RESULT.names or ():
        out[name] = np.nan if name not in ("outcome", "morse_index") else -1
    out["outcome"] = NOT_SOLVED
    workers = _cores()
    if threads is not None:
        workers = whole(threads, 1, _MOST_THREADS, "threads")
    starts = list(range(0, n, CHUNK))

    def work(start: int) -> int:
        if stop is not None and stop():
            return 0
        rows = slice(start, min(start + CHUNK, n))
        _solve_chunk({k: v[rows] for k, v in columns.items()}, magnet, out[rows])
        return rows.stop - start

    done = 0
    if len(starts) == 1 or workers == 1:
        for start in starts:
            done += work(start)
            progress(done, n)
        return out
    with ThreadPoolExecutor(workers) as pool:
        for future in as_completed([pool.submit(work, start) for start in starts]):
            done += future.result()
            progress(done, n)
    return out


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _columns(
    designs: Mapping[str, ArrayLike] | NDArray[np.void], magnet: Magnet | None
) -> dict[str, Array]:
    """Return the columns, checked: those of sections (n, k), the others (n,)."""
    if magnet is not None:
        check_magnet(magnet)
    arrays = _given(designs, before_magnet=magnet is not None)
    n = max((len(a) for k, a in arrays.items() if a.ndim > (k in _WIDE)), default=1)
    if arrays["length_mm"].ndim == 0 or arrays["length_mm"].shape[-1] == 0:
        raise InputError(
            "designs: length_mm in mm must have a column for each section of the rods; "
            f"instead received shape {arrays['length_mm'].shape}"
        )
    sections = arrays["length_mm"].shape[-1]
    for name, array in arrays.items():
        full = (n, sections) if name in (*_WIDE, "side_mm", "remanence_mT") else (n,)
        fits = array
        if array.ndim == 1 and name in ("side_mm", "remanence_mT"):
            fits = array[:, None]
        try:
            arrays[name] = np.ascontiguousarray(np.broadcast_to(fits, full))
        except ValueError:
            raise InputError(
                f"designs: {name} in {COLUMNS[name][2]} must fit {n} designs of "
                f"{sections} sections; instead received shape {array.shape}"
            ) from None
    return arrays


def _given(
    designs: Mapping[str, ArrayLike] | NDArray[np.void], *, before_magnet: bool
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
    wanted = {"length_mm", "E_MPa", "side_mm", "remanence_mT"}
    wanted |= {"gap_mm"} if before_magnet else {"flux_mT"}
    known = wanted if before_magnet else wanted | {"angle_deg"}
    if not wanted <= set(names) <= known:
        raise InputError(
            f"designs must have the columns {', '.join(sorted(wanted))} in mm, MPa and "
            f"mT (gap_mm with a magnet, flux_mT without); instead received "
            f"{', '.join(sorted(names))[:200]}"
        )
    arrays = {name: column(name, designs[name]) for name in names}
    if not before_magnet:
        arrays.setdefault("angle_deg", np.array(90.0))
    return arrays


def _solve_chunk(
    columns: dict[str, Array], magnet: Magnet | None, out: NDArray[np.void]
) -> None:
    """Solve one chunk into `out`."""
    rods, total_mm, margins = _rods(columns)
    n = len(rods)
    none = np.empty(0)
    if magnet is None:
        flux_T, angle = columns["flux_mT"] * 1e-3, np.radians(columns["angle_deg"])
        field = flux_T, np.cos(angle), np.sin(angle), none, none
    else:
        field = (
            none,
            none,
            none,
            magnet_block(magnet, length_mm=0.0, gap_mm=0.0),
            columns["gap_mm"],
        )
    tips = np.empty((n, 4))
    outcome = np.empty(n, dtype=np.int8)
    index = np.zeros(n, dtype=np.int8)
    solve_lanes(rods, total_mm, margins, *field, tips, outcome)
    hard = np.flatnonzero(outcome == HARD)
    if len(hard):
        if magnet is None:
            fields = _uniform_fields(flux_T[hard], columns["angle_deg"][hard])
        else:
            fields = _magnet_fields(magnet, columns["gap_mm"][hard], total_mm[hard])
        found = _solve_hard(rods[hard], fields, margins[hard])
        tips[hard], outcome[hard], index[hard] = found
    out["tip_x_mm"] = tips[:, 0] * total_mm
    out["tip_y_mm"] = tips[:, 1] * total_mm
    out["tip_angle_deg"] = np.degrees(tips[:, 2])
    out["error_mm"] = tips[:, 3] * total_mm
    out["outcome"] = outcome
    out["morse_index"] = index


def _rods(columns: dict[str, Array]) -> tuple[Array, Array, Array]:
    """Return rods as `planar.march` takes them (n, k, 5), lengths, and margins."""
    length = columns["length_mm"]
    rods = np.empty((*length.shape, 5))
    total = np.empty(len(length))
    margins = np.empty(len(length))
    given = length, columns["E_MPa"], columns["side_mm"], columns["remanence_mT"]
    if not _pack(*given, 1e-9 / MU0, rods, total, margins):
        raise InputError(
            "designs: length_mm, side_mm in mm and E_MPa in MPa must be of comparable "
            "size; instead received a design whose loads overflow"
        )
    return rods, total, margins


@njit(cache=True, nogil=True, error_model="numpy")
def _pack(length, modulus, side, remanence, moment, rods, total, margin):  # type: ignore[no-untyped-def]
    """Fill `rods` from columns of shape (n, sections), root first.

    `moment` is that of 1 mm2 and 1 mT, in A m. Return whether all is finite.
    """
    n, sections = length.shape
    nothing = 0.0
    for i in range(n):
        total[i] = 0.0
        widest = 0.0
        for k in range(sections):
            total[i] += length[i, k]
            widest = max(widest, side[i, k])
        margin[i] = widest / (2.0 * total[i])
        EI = modulus[i, 0] * side[i, 0] ** 4 / 12.0
        per_N = total[i] * total[i] / EI
        for k in range(sections):
            row = rods[i, sections - 1 - k]
            area = side[i, k] * side[i, k]
            row[H] = length[i, k] / total[i]
            row[E] = EI / (modulus[i, k] * area * area / 12.0)
            row[M] = area * remanence[i, k] * moment * per_N
            row[WX] = row[WY] = 0.0
            nothing += 0.0 * (row[H] + row[E] + row[M])
    return nothing == 0.0


def _uniform_fields(flux_T: Array, angle_deg: Array) -> Array:
    angle = np.radians(angle_deg)
    fields = np.zeros((len(flux_T), 17))
    fields[:, 1] = flux_T * np.where(angle_deg % 180.0 == 90.0, 0.0, np.cos(angle))
    fields[:, 2] = flux_T * np.where(angle_deg % 180.0 == 0.0, 0.0, np.sin(angle))
    return fields


def _magnet_fields(magnet: Magnet, gap_mm: Array, total_mm: Array) -> Array:
    fields = np.empty((len(gap_mm), 17))
    fields[:, 0] = 1.0
    fields[:, 1:] = magnet_block(magnet, length_mm=0.0, gap_mm=0.0)
    fields[:, 4:7] -= gap_mm[:, None] * np.array(magnet.axes()[2])
    fields[:, 4] += total_mm
    fields[:, 1:7] /= total_mm[:, None]
    return fields


def _solve_hard(
    rods: Array, fields: Array, margins: Array
) -> tuple[Array, Array, Array]:
    """Solve the designs that left the lanes: tips and errors, outcomes, indices."""
    stations = np.linspace(0.0, 1.0, 41)[None]
    found, curves, _ = solve_planar_rows(
        rods, fields, 0.0, margins, stations, _ORDER, _STEP
    )
    outcome, index = found[:, 0], found[:, 1]
    tips = np.column_stack([curves[:, :3, -1], found[:, 2]])
    gone = outcome > OK_UNSTABLE
    touching = outcome == TOUCHES
    outcome = np.where(touching, 4, np.minimum(outcome, NOT_SOLVED))
    tips[gone] = np.nan
    index[gone] = -1
    return tips, outcome, index
