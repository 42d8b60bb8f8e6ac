"""Whole shapes of many designs at once: the planar kernels in parallel, on all cores.

Designs are columns of arrays, in mm, MPa, mT and degrees; the kernel is dimensionless
as `planar.march`. No weight and no clamp angle: this is for searching designs, not for
comparing with one bench.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.checks import finite, shown, store, whole
from ...core.errors import InputError
from ...core.magnet import Magnet
from ...core.specimen import Specimen
from ..fields import Field, before, outside
from ..planar.outcomes import GONE, OK_UNSTABLE, TOUCHES
from ..planar.solver import solve_planar_rows
from ..scaling import (
    MOST_POINTS,
    field_rows,
    many_rods,
    uniform_rows,
)
from .columns import COLUMNS, check_magnet, column, waits_for_gap
from .threads import in_threads

Array = NDArray[np.float64]

STATUS = (
    "stable", "unstable", "pulled in: no equilibrium", "not solved", "leaves the map"
)  # fmt: skip
"""Meaning of the codes in `Shapes.status`."""

ORDER = 10
STEP = 0.6
_OWN = (
    "side_mm", "length_mm", "E_MPa", "gap_mm", "remanence_mT", "flux_mT", "angle_deg"
)  # fmt: skip
ROWS_PER_CALL = 512
"""Designs that one thread solves at a time; their shapes fit its cache."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Designs:
    """Rods and fields, one a row: square sections, one remanence and side a rod.

    Parameters
    ----------
    length_mm, E_MPa : ndarray, shape (n, sections)
        Root first.
    side_mm, remanence_mT : ndarray, shape (n,)
    flux_mT : ndarray, shape (n,), or None
        Uniform field; None before a magnet.
    angle_deg : ndarray, shape (n,)
        Direction of the uniform field; not used before a magnet.
    magnet : Magnet, Field or None
    gap_mm : ndarray, shape (n,), or None
        Gap of the magnet; None before sources that all have their place.

    Raises
    ------
    InputError
        If shapes disagree, a value is not finite or out of range (`COLUMNS`), or the
        magnet is off the plane.
    """

    length_mm: Array
    E_MPa: Array
    side_mm: Array
    remanence_mT: Array
    flux_mT: Array | None = None
    angle_deg: Array
    magnet: Magnet | Field | None = None
    gap_mm: Array | None = None

    def __post_init__(self) -> None:
        if self.magnet is not None:
            check_magnet(self.magnet)
        if (self.flux_mT is None) == (self.magnet is None):
            raise InputError(
                "designs must have either flux_mT in mT, or a magnet and gap_mm in mm; "
                f"instead received {'both' if self.flux_mT is not None else 'neither'}"
            )
        if waits_for_gap(self.magnet) != (self.gap_mm is not None):
            raise InputError(
                "designs must have gap_mm in mm exactly where a source of their magnet "
                f"waits for it; instead received {shown(self.gap_mm)}"
            )
        columns = {
            name: column(name, values)
            for name in _OWN
            if (values := getattr(self, name)) is not None
            or name not in ("flux_mT", "gap_mm")
        }
        n, sections = columns["side_mm"].size, columns["length_mm"].shape[-1:]
        if sections in ((), (0,)):
            raise InputError(
                "designs: length_mm in mm must have a column for each section; instead "
                f"received shape {columns['length_mm'].shape}"
            )
        for name, values in columns.items():
            shape = (n, *sections) if name in ("length_mm", "E_MPa") else (n,)
            if values.shape != shape:
                raise InputError(
                    f"designs: {name} in {COLUMNS[name][2]} must have {n} rows, shape "
                    f"{shape}; instead received shape {values.shape}"
                )
        store(self, **columns)

    def __len__(self) -> int:
        return len(self.side_mm)


def designs_of(
    specimen: Specimen, flux_mT: float, *, angle_deg: float = 90.0
) -> Designs:
    """Return one specimen in a uniform field as a single design.

    Raises
    ------
    InputError
        If its sections differ in side or remanence.
    """
    if not isinstance(specimen, Specimen):
        raise InputError(
            f"specimen must be a Specimen; instead received {shown(specimen)}"
        )
    if specimen.shape != "square" or not specimen.is_plain:
        raise InputError(
            f"specimen {specimen.name!r} must be straight, square and magnetised along "
            "its axis to be a design; solve it with `magbend sim shape`"
        )
    if len(set(specimen.sides_mm)) > 1 or len(set(specimen.remanences_mT)) > 1:
        raise InputError(
            f"specimen {specimen.name!r} must have one side_mm and one remanence_mT "
            "for all sections to be a design; solve it with `magbend sim shape`"
        )
    sections = specimen.sections
    return Designs(
        length_mm=np.array([[section.length_mm for section in sections]]),
        E_MPa=np.array([[section.E_MPa for section in sections]]),
        side_mm=np.array([specimen.sides_mm[0]]),
        remanence_mT=np.array([specimen.remanences_mT[0]]),
        flux_mT=np.array([finite(flux_mT, "flux_mT", "mT")]),
        angle_deg=np.array([finite(angle_deg, "angle_deg", "deg")]),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Shapes:
    """What `solve_shapes` found.

    Parameters
    ----------
    points : ndarray, shape (n, points, 5)
        s, x, y in mm, theta in rad, kappa in 1/mm; NaN where there is no shape.
    status : ndarray, shape (n,), int8
        Index into `STATUS`.
    error_mm : ndarray, shape (n,)
        Bound of the numerical error of any point; NaN where there is no shape.
    """

    points: Array
    status: NDArray[np.int8]
    error_mm: Array


def solve_shapes(
    designs: Designs, *, points: int = 61, by_section: bool = False
) -> Shapes:
    """Solve every design and return its whole shape.

    Parameters
    ----------
    designs : Designs
    points : int
        Points from clamp to tip.
    by_section : bool
        Instead of equal spacing over the rod, space the points equally within each
        section, as many in each, so that every joint is one of them; `points` - 1 must
        be a multiple of the number of sections.

    Raises
    ------
    InputError
        If these are no designs, or the number of points cannot be.

    Notes
    -----
    Taylor order 10, corrected and bounded by order 14 (`planar`), on all cores.
    """
    if not isinstance(designs, Designs):
        raise InputError(f"designs must be Designs; instead received {shown(designs)}")
    points = whole(points, 2, MOST_POINTS, "points")
    n, k = designs.length_mm.shape
    rods, total_mm, margins = many_rods(
        designs.length_mm,
        designs.E_MPa,
        {"side_mm": np.repeat(designs.side_mm[:, None], k, axis=1)},
        np.repeat(designs.remanence_mT[:, None], k, axis=1),
    )
    out = np.empty((n, points, 5))
    status = np.empty(n, dtype=np.int8)
    error = np.empty(n)
    stations = np.linspace(0.0, 1.0, points)[None]
    if by_section:
        stations = _section_stations(rods[:, ::-1, 0], points)
    if designs.magnet is not None:
        fields = field_rows(before(designs.magnet), designs.gap_mm, total_mm)
    elif designs.flux_mT is not None:
        fields = uniform_rows(designs.flux_mT * 1e-3, designs.angle_deg)

    def work(rows: slice) -> None:
        here = stations if len(stations) == 1 else stations[rows]
        _solve(
            here, rods[rows], fields[rows], total_mm[rows], margins[rows],
            out[rows], status[rows], error[rows],
        )  # fmt: skip

    in_threads(work, n, ROWS_PER_CALL)
    if isinstance(designs.magnet, Field):
        curves = out[:, :, 1:3].transpose(0, 2, 1)
        left = (status <= OK_UNSTABLE) & outside(designs.magnet, curves, np.ones(n))
        out[left] = error[left] = np.nan
        status[left] = STATUS.index("leaves the map")
    return Shapes(points=out, status=status, error_mm=error)


def _section_stations(share: Array, points: int) -> Array:
    n, k = share.shape
    each = (points - 1) // k
    if each * k != points - 1 or each < 1:
        raise InputError(
            f"points - 1 must be a multiple of {k}, the number of sections; instead "
            f"received {points}"
        )
    ends = np.cumsum(share, axis=1)
    starts = ends - share
    inside = np.arange(1, each + 1) / each
    s = starts[:, :, None] + share[:, :, None] * inside
    stations = np.concatenate([np.zeros((n, 1)), s.reshape(n, -1)], axis=1)
    stations[:, -1] = 1.0
    return stations


def _solve(
    stations: Array,
    rods: Array,
    fields: Array,
    total: Array,
    margins: Array,
    out: Array,
    status: NDArray[np.int8],
    error: Array,
) -> None:
    found, curves, _ = solve_planar_rows(
        rods, fields, 0.0, margins, stations, ORDER, STEP
    )
    outcome = found[:, 0].astype(np.int64)
    good = outcome <= OK_UNSTABLE
    gone = (outcome == GONE) | (outcome == TOUCHES)
    status[:] = np.where(good, outcome, np.where(gone, 2, 3))
    error[:] = np.where(good, found[:, 2] * total, np.nan)
    out[:, :, 0] = stations * total[:, None]
    out[:, :, 1] = curves[:, 0] * total[:, None]
    out[:, :, 2] = curves[:, 1] * total[:, None]
    out[:, :, 3] = curves[:, 2]
    out[:, :, 4] = curves[:, 3] / total[:, None]
    out[~good] = np.nan
