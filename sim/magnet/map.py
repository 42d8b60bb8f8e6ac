"""A measured field as the field of charges around the box it was measured in.

Readings of all three components at points of a box are fitted, by least squares, with
point charges outside the box. Their field, the sum of q r / r^3, has neither curl nor
divergence in the box whatever the charges are: the map obeys Maxwell's equations
exactly between the readings, and readings that do not obey them cannot be fitted, which
is how they are found out. How far the map is off between the readings is measured by
fitting two thirds of them and predicting the others.

The same serves any other source: a Python function of points, sampled in the box once
(`sampled_map`), from then on costs what a map costs and works in every solver.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.arrays import real_array
from ...core.checks import within
from ...core.errors import ConfigError, InputError
from ...core.sources import FLUX_LIMIT_T
from ...core.table import read_table

Array = NDArray[np.float64]

MOST_CHARGES = 384
"""More would cost time in every solve; a box's field is smooth."""
CUTS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
"""Least singular values tried, over the largest: less noise allows a smaller one."""
COLUMNS = ("x_mm", "y_mm", "z_mm", "Bx_mT", "By_mT", "Bz_mT")
WIDEST_MM = 1e4
"""No bench, nor the scanner around one, is mapped over more than 10 m."""
EDGE = 1e-9
"""How far outside its box, in boxes, a point counts as in it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldMap:
    """Readings of a field in a box of the specimen frame, and the field between them.

    Parameters
    ----------
    points_mm : array_like, shape (n, 3)
        Where, in the specimen frame, in mm: a grid or any scatter. All at z = 0 mean
        that the field is symmetric about the plane; what Bz is read there is noise.
    flux_mT : array_like, shape (n, 3)
        Bx, By, Bz there.
    tolerance_mT : float, optional
        RMS deviation of one component up to which map and readings may differ: the
        noise of the probe. By default 2 % of the readings' RMS.

    Raises
    ------
    InputError
        If there are fewer than 12 readings, they contradict Maxwell's equations, or
        they are too coarse to tell the field between them.

    Attributes
    ----------
    residual_mT : float
        RMS of map minus readings.
    between_mT : float
        RMS of a third of the readings minus the map of the others.
    """

    kind: ClassVar[str] = "map"
    points_mm: ArrayLike
    flux_mT: ArrayLike
    tolerance_mT: float | None = None
    charges: Array = field(init=False)
    low_mm: Array = field(init=False)
    high_mm: Array = field(init=False)
    in_plane: bool = field(init=False)
    residual_mT: float = field(init=False)
    between_mT: float = field(init=False)

    def __post_init__(self) -> None:
        points, flux = _checked(self.points_mm, self.flux_mT)
        allowed = 0.02 * _rms(flux)
        if self.tolerance_mT is not None:
            allowed = within(self.tolerance_mT, 0.0, 1e6, "map tolerance_mT", "mT")
        flat = not np.any(points[:, 2])
        if flat:
            _check_upright(flux, allowed)
        places = _places(points, flat=flat)
        rows = _rows(places, points, flat=flat)
        kept = np.repeat(_kept(points), 3)
        between, cut = _best_cut(rows, flux.ravel(), kept)
        fits = _fits(rows, flux.ravel())
        apart = (rows @ fits[CUTS[-1]] - flux.ravel()).reshape(-1, 3)
        closest = _rms(apart)
        residual = _rms(rows @ fits[cut] - flux.ravel())
        charges = np.column_stack([places, fits[cut]])
        if closest > allowed:
            raise InputError(
                "flux_mT of a map must be a field without curl and divergence, to "
                f"within tolerance_mT {allowed:.3g} mT; instead received readings from "
                f"which every such field differs by {closest:.3g} mT (RMS; most at "
                f"{_farthest(points, apart)} mm): check the axes of the probe and of "
                "the points, or measure closer together"
            )
        if between > 3.0 * allowed:
            raise InputError(
                "points_mm of a map must lie close enough to tell the field between "
                f"them to within {3.0 * allowed:.3g} mT; instead two thirds of them "
                f"predict the others to {between:.3g} mT (RMS): measure more points"
            )
        if flat:  # a charge stands for two, above and below the plane
            mirrored = charges * [1.0, 1.0, -1.0, 1.0]
            charges = np.concatenate([charges, mirrored])
        charges[:, 3] *= 1e-3
        for name, value in {
            "points_mm": points, "flux_mT": flux, "charges": charges,
            "low_mm": points.min(axis=0), "high_mm": points.max(axis=0),
            "in_plane": flat, "residual_mT": residual, "between_mT": between,
        }.items():  # fmt: skip
            object.__setattr__(self, name, value)

    @property
    def follows_gap(self) -> bool:
        """No: its points are given."""
        return False

    def holds(self, points_mm: Array) -> NDArray[np.bool_]:
        """Tell of rods, shape (..., n, 3), which lie in the box (or flat box)."""
        slack = EDGE * float(np.max(self.high_mm - self.low_mm))
        low, high = self.low_mm - slack, self.high_mm + slack
        inside = (points_mm >= low) & (points_mm <= high)
        return np.asarray(np.all(inside, axis=(-2, -1)))


def sampled_map(
    function: Callable[[Array], ArrayLike],
    box_mm: ArrayLike,
    *,
    points: int = 9,
) -> FieldMap:
    """Return the map of a Python function in a box: slow once, quick in solvers.

    Parameters
    ----------
    function : callable
        Takes points, shape (n, 3), in mm, and returns Bx, By, Bz in mT there.
    box_mm : array_like, shape (2, 3)
        Two opposite corners: where rods go, and no magnet is.
    points : int
        Along each edge of the box.

    Raises
    ------
    InputError
        As `FieldMap`: the field must have neither curl nor divergence in the box.
    """
    corners = real_array(box_mm, "box_mm", "mm")
    if corners.shape != (2, 3) or np.any(corners[0] == corners[1]):
        raise InputError(
            "box_mm must be two opposite corners (x, y, z) of a box, in mm; instead "
            f"received shape {corners.shape}"
        )
    edges = [np.linspace(a, b, points) for a, b in corners.T]
    grid = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(-1, 3)
    flux = np.asarray(function(grid), dtype=np.float64)
    return FieldMap(points_mm=grid, flux_mT=flux)


def read_map(path: Path, *, tolerance_mT: float | None = None) -> FieldMap:
    """Read a map from CSV: x_mm, y_mm, z_mm, Bx_mT, By_mT, Bz_mT, a row a reading.

    Raises
    ------
    ConfigError
        If the file is missing, lacks a column, holds something else than numbers, or
        its points span more than `WIDEST_MM`.
    """
    read = read_table(path)
    read.require(*COLUMNS, hint="a map is a row a reading")
    table = np.column_stack([read.numbers(name) for name in COLUMNS])
    widest_mm = float(np.ptp(table[:, :3], axis=0).max())
    if widest_mm > WIDEST_MM:
        raise ConfigError(
            f"{path}: the points of a field map must span at most {1e-3 * WIDEST_MM:g} "
            f"m; instead received {1e-3 * widest_mm:g} m: check the unit in the heads "
            "of x, y and z"
        )
    return FieldMap(
        points_mm=table[:, :3], flux_mT=table[:, 3:], tolerance_mT=tolerance_mT
    )


def _checked(points_mm: ArrayLike, flux_mT: ArrayLike) -> tuple[Array, Array]:
    points = real_array(points_mm, "map points_mm", "mm")
    flux = real_array(flux_mT, "map flux_mT", "mT")
    if points.ndim != 2 or points.shape[1] != 3 or points.shape != flux.shape:
        raise InputError(
            "a map must have points_mm in mm and flux_mT in mT of one shape (n, 3); "
            f"instead received {points.shape} and {flux.shape}"
        )
    flat = not np.any(points[:, 2])
    spans = np.ptp(points, axis=0)[: 2 if flat else 3]
    if len(points) < 12 or np.any(spans <= 0.0):
        raise InputError(
            "a map must have at least 12 points_mm in mm that span a box, or a "
            f"rectangle at z = 0; instead received {len(points)} that span "
            f"{np.ptp(points, axis=0).round(6).tolist()} mm"
        )
    within(float(np.abs(flux).max()), 0.0, FLUX_LIMIT_T * 1e3, "map flux_mT", "mT")
    return points, flux


def _check_upright(flux: Array, allowed: float) -> None:
    """Refuse readings in the plane alone whose Bz is more than noise."""
    upright = _rms(flux[:, 2])
    if upright > allowed:
        raise InputError(
            "Bz_mT of a map with all points at z = 0 must be 0 to within tolerance_mT "
            f"{allowed:.3g} mT, as the field is taken to be symmetric about the plane; "
            f"instead received {upright:.3g} mT (RMS): add readings off the plane, or "
            "mend the probe's zero or tilt"
        )


def _farthest(points: Array, apart: Array) -> tuple[float, ...]:
    """Return where readings are farthest from a field."""
    at = int(np.argmax(np.sum(apart**2, axis=1)))
    return tuple(float(f"{value:.6g}") for value in points[at])


def _places(points: Array, *, flat: bool) -> Array:
    """Return where the charges stand: on a box around the box of the points."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = high - low
    spans = size[:2] if flat else size
    spacing = float(np.prod(spans) / len(points)) ** (1.0 / len(spans))
    away = max(1.7 * spacing, 0.2 * float(spans.max()))
    low, high = low - away, high + away
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    n = int(np.sqrt(MOST_CHARGES / 6.0))
    steps = np.linspace(-1.0, 1.0, n + 1)[:-1] + 1.0 / n
    u, v = (grid.ravel() for grid in np.meshgrid(steps, steps))
    one = np.ones_like(u)
    faces = [
        np.stack(order, axis=1)
        for sign in (one, -one)
        for order in ((sign, u, v), (u, sign, v), (u, v, sign))
    ]
    places: Array = middle + half * np.concatenate(faces)
    return places[places[:, 2] > 0.0] if flat else places


def _rows(places: Array, points: Array, *, flat: bool) -> Array:
    """Return what unit charges do at the points, shape (3 n, charges)."""
    apart = points[:, None] - places
    one = apart / np.linalg.norm(apart, axis=2, keepdims=True) ** 3
    if flat:
        apart = points[:, None] - places * [1.0, 1.0, -1.0]
        one = one + apart / np.linalg.norm(apart, axis=2, keepdims=True) ** 3
    rows: Array = one.transpose(0, 2, 1).reshape(-1, len(places))
    return rows


def _fits(rows: Array, flux: Array) -> dict[float, Array]:
    """Return the charges of least squares, by the cut of the singular values."""
    left, values, right = np.linalg.svd(rows, full_matrices=False)
    along = left.T @ flux
    found = {}
    for cut in CUTS:
        known = values > cut * values[0]
        found[cut] = right[known].T @ (along[known] / values[known])
    return found


def _kept(points: Array) -> NDArray[np.bool_]:
    """Return which points stay when a third is left out, inside the box if any is."""
    spans = np.ptp(points, axis=0)
    near, far = points - points.min(axis=0), points.max(axis=0) - points
    within = np.all((spans == 0.0) | ((near > 0.0) & (far > 0.0)), axis=1)
    left = np.random.default_rng(0).random(len(points)) < 1.0 / 3.0
    return ~(left & within) if np.any(left & within) else ~left


def _best_cut(rows: Array, flux: Array, kept: NDArray[np.bool_]) -> tuple[float, float]:
    """Return how well the kept readings predict the others at best, and the cut."""
    fits = _fits(rows[kept], flux[kept])
    left = ~kept
    return min((_rms(rows[left] @ fits[cut] - flux[left]), cut) for cut in CUTS)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
