"""Learn from imported tables (COMSOL, finite elements) what the rod model misses.

A case of a 3D model costs minutes, the rod microseconds, and they differ little: so the
angle is corrected, theta = theta_rod (1 + c), with c a polynomial of low degree in the
share of the length s / L and in how far the rod is bent, theta_rod(L). Its coefficients
come from the positions by linear least squares; how many are worth having is decided by
leaving out one case at a time, and what is left out also gives the error bar.

A table is the text export of such programs: lines of numbers, and ``%`` lines before
them. The last ``%`` line names the columns (``s_mm x_mm y_mm``, or with units in
brackets, ``x (mm)``); a ``% key = value`` line gives a parameter of the whole file.
Parameters are those of a specimen and a field: length1_mm, E1_MPa, ..., side_mm,
remanence_mT, flux_mT, and angle_deg (90 without). Rows with the same parameters are one
case.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.columns import parse_number
from ...core.errors import ConfigError, InputError, StoreError
from ...core.files import write_text
from ...core.table import Table, read_table
from ...sim.batch.shapes import Designs, solve_shapes

Array = NDArray[np.float64]

POINTS = 181
_PARAMETER = re.compile(r"length\d+_mm|E\d+_MPa|side_mm|remanence_mT|flux_mT|angle_deg")
DEGREES = ((0, 0), (1, 0), (0, 1), (1, 1), (2, 1))
"""Degrees in s / L and in the bend that are tried; (0, 0) is one constant."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One imported shape.

    Parameters
    ----------
    design : Designs
        A single row.
    s_mm : ndarray, shape (n,)
    points_mm : ndarray, shape (n, 2)
    source : str
    """

    design: Designs
    s_mm: Array
    points_mm: Array
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """What is added to the rod.

    Parameters
    ----------
    degree : tuple of int
        In s / L and in the bend.
    coefficients : ndarray
    bend_rad : tuple of float
        Range of |theta_rod(L)| of the cases: the trust region.
    error_mm : float
        Largest deviation of any point of a case that was left out, over all cases.
    rod_error_mm : float
        The same of the rod alone.
    cases : int
    """

    degree: tuple[int, int]
    coefficients: Array
    bend_rad: tuple[float, float]
    error_mm: float
    rod_error_mm: float
    cases: int


def read_tables(paths: Sequence[Path]) -> list[Case]:
    """Read exported tables.

    Raises
    ------
    ConfigError
        If a file is no such table, or a parameter is missing: file and line.
    """
    return [case for path in paths for case in _read_table(path)]


def fit_correction(cases: Sequence[Case]) -> Correction:
    """Fit the correction; its degree is the one that predicts left-out cases best.

    Raises
    ------
    InputError
        If there are fewer than three cases, or a case has no rod solution.
    """
    if len(cases) < 3:
        raise InputError(
            "a correction must be fitted to at least three cases, one of which is left "
            f"out in turn; instead received {len(cases)}"
        )
    bends = np.array([abs(_rod(case.design)[-1, 3]) for case in cases])
    best: Correction | None = None
    for degree in DEGREES:
        systems = [_system(case, degree) for case in cases]
        if (degree[0] + 1) * (degree[1] + 1) >= len(cases):
            continue
        left_out = [
            _deviation(case, degree, _solve(systems[:i] + systems[i + 1 :]))
            for i, case in enumerate(cases)
        ]
        trial = Correction(
            degree=degree,
            coefficients=_solve(systems),
            bend_rad=(float(bends.min()), float(bends.max())),
            error_mm=max(left_out),
            rod_error_mm=max(_deviation(case, (0, 0), np.zeros(1)) for case in cases),
            cases=len(cases),
        )
        if best is None or trial.error_mm < 0.8 * best.error_mm:
            best = trial
    if best is None:
        raise InputError("a correction must be fitted to at least three cases")
    return best


def corrected(correction: Correction, designs: Designs) -> tuple[Array, NDArray]:
    """Return corrected shapes and which are inside the trust region.

    Parameters
    ----------
    correction : Correction
    designs : Designs

    Returns
    -------
    points : ndarray, shape (n, 181, 5)
        As `solve_shapes` gives them by section.
    inside : ndarray, shape (n,), bool
        Bend within the range of the imported cases, 5 % to spare.
    """
    shapes = solve_shapes(designs, points=_points(designs), by_section=True).points
    out = np.stack(
        [_bent(shape, correction.degree, correction.coefficients) for shape in shapes]
    )
    bend = np.abs(shapes[:, -1, 3])
    low, high = correction.bend_rad
    return out, (bend >= 0.95 * low) & (bend <= 1.05 * high)


def save_correction(correction: Correction, path: Path) -> None:
    """Write a correction as JSON."""
    data = {
        "what": "correction of the rod's angle fitted to imported tables",
        "degree": list(correction.degree),
        "coefficients": correction.coefficients.tolist(),
        "bend_rad": list(correction.bend_rad),
        "error_mm": correction.error_mm,
        "rod_error_mm": correction.rod_error_mm,
        "cases": correction.cases,
    }
    write_text(path, json.dumps(data, indent=2) + "\n")


def load_correction(path: Path) -> Correction:
    """Read a correction.

    Raises
    ------
    StoreError
        If the file is missing, damaged, or no correction.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        low, high = data["bend_rad"]
        a, b = data["degree"]
        coefficients = np.array(data["coefficients"], dtype=np.float64)
        if coefficients.shape != ((a + 1) * (b + 1),):
            raise ValueError("coefficients do not fit the degree")
        return Correction(
            degree=(int(a), int(b)),
            coefficients=coefficients,
            bend_rad=(float(low), float(high)),
            error_mm=float(data["error_mm"]),
            rod_error_mm=float(data["rod_error_mm"]),
            cases=int(data["cases"]),
        )
    except FileNotFoundError:
        raise StoreError(f"{path}: there is no such correction") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StoreError(f"{path}: is damaged or no correction ({error})") from None


def _points(designs: Designs) -> int:
    k = int(designs.length_mm.shape[1])
    return 2 * k * ((POINTS - 1) // (2 * k)) + 1


def _rod(design: Designs) -> Array:
    solved = solve_shapes(design, points=_points(design), by_section=True)
    shape: Array = solved.points[0]
    if not np.isfinite(shape[-1, 1]):
        raise InputError("an imported case has no equilibrium of the rod")
    return shape


def _terms(shape: Array, degree: tuple[int, int]) -> Array:
    s = shape[:, 0] / shape[-1, 0]
    bend = shape[-1, 3] ** 2  # the correction does not care for the side it bends to
    columns = [
        s**i * bend**j for i in range(degree[0] + 1) for j in range(degree[1] + 1)
    ]
    return np.stack(columns, axis=1)


def _running(values: Array, s: Array) -> Array:
    from scipy.integrate import cumulative_simpson

    total: Array = cumulative_simpson(values, x=s, axis=0, initial=0.0)
    return total


def _bent(shape: Array, degree: tuple[int, int], coefficients: Array) -> Array:
    out = shape.copy()
    out[:, 3] *= 1.0 + _terms(shape, degree) @ coefficients
    out[:, 1] = _running(np.cos(out[:, 3]), shape[:, 0])
    out[:, 2] = _running(np.sin(out[:, 3]), shape[:, 0])
    out[:, 4] = np.gradient(out[:, 3], shape[:, 0])
    return out


def _at(curve: Array, s: Array, wanted: Array) -> Array:
    from scipy.interpolate import CubicSpline

    values: Array = CubicSpline(s, curve, axis=0)(wanted)
    return values


def _system(case: Case, degree: tuple[int, int]) -> tuple[Array, Array]:
    """Return matrix and right side of the positions' linear least squares."""
    shape = _rod(case.design)
    s, theta = shape[:, 0], shape[:, 3]
    turned = theta[:, None] * _terms(shape, degree)
    dx = _running(-np.sin(theta)[:, None] * turned, s)
    dy = _running(np.cos(theta)[:, None] * turned, s)
    matrix = np.concatenate([_at(dx, s, case.s_mm), _at(dy, s, case.s_mm)])
    away = case.points_mm - _at(shape[:, 1:3], s, case.s_mm)
    return matrix, away.T.ravel()


def _solve(systems: Sequence[tuple[Array, Array]]) -> Array:
    matrix = np.concatenate([system[0] for system in systems])
    right = np.concatenate([system[1] for system in systems])
    coefficients: Array = np.linalg.lstsq(matrix, right, rcond=None)[0]
    return coefficients


def _deviation(case: Case, degree: tuple[int, int], coefficients: Array) -> float:
    shape = _bent(_rod(case.design), degree, coefficients)
    away = _at(shape[:, 1:3], shape[:, 0], case.s_mm) - case.points_mm
    return float(np.hypot(*away.T).max())


def _read_table(path: Path) -> list[Case]:
    table = read_table(path)
    table.require("x_mm", "y_mm")
    constants: dict[str, float] = {}
    for comment in table.comments:
        key, _, value = (part.strip() for part in comment.partition("="))
        number = parse_number(value)
        if _PARAMETER.fullmatch(key) and number is not None:
            constants[key] = number
    varied = [name for name in _parameters(table) if table.has(name)]
    columns = {name: table.numbers(name) for name in ("x_mm", "y_mm", *varied)}
    if table.has("s_mm"):
        columns["s_mm"] = table.numbers("s_mm")
    values = np.column_stack(
        [np.zeros(len(table.rows)), *(columns[name] for name in varied)]
    )
    group = np.unique(values, axis=0, return_inverse=True)[1].ravel()
    return [
        _case(path, {n: c[group == g] for n, c in columns.items()}, constants)
        for g in range(int(group.max()) + 1)
    ]


def _parameters(table: Table) -> list[str]:
    """Names of the parameters that a table may have as columns."""
    count = 1
    while table.has(f"length{count + 1}_mm"):
        count += 1
    sections = [f"{key}{i + 1}{unit}" for i in range(count)
                for key, unit in (("length", "_mm"), ("E", "_MPa"))]  # fmt: skip
    return [*sections, "side_mm", "remanence_mT", "flux_mT", "angle_deg"]


def _case(path: Path, columns: dict[str, Array], constants: dict[str, float]) -> Case:
    values = constants | {
        name: float(column[0])
        for name, column in columns.items()
        if name not in ("s_mm", "x_mm", "y_mm")
    }

    def value(name: str) -> Array:
        if name not in values:
            raise ConfigError(
                f"{path}: the parameter {name} is missing: give a column or a line "
                f"'% {name} = ...'"
            )
        return np.array([values[name]])

    k = 1
    while f"length{k + 1}_mm" in values:
        k += 1
    design = Designs(
        length_mm=np.stack([value(f"length{i + 1}_mm") for i in range(k)], axis=1),
        E_MPa=np.stack([value(f"E{i + 1}_MPa") for i in range(k)], axis=1),
        side_mm=value("side_mm"),
        remanence_mT=value("remanence_mT"),
        flux_mT=value("flux_mT"),
        angle_deg=np.array([values.get("angle_deg", 90.0)]),
    )
    points = np.stack([columns["x_mm"], columns["y_mm"]], axis=1)
    s_mm = columns.get("s_mm")
    if s_mm is None:
        steps = np.hypot(*np.diff(points, axis=0).T)
        s_mm = np.concatenate([[0.0], np.cumsum(steps)])
    order = np.argsort(s_mm, kind="stable")
    case = Case(design=design, s_mm=s_mm, points_mm=points, source=path.name)
    length_mm = float(design.length_mm.sum())
    if len(order) < 3 or s_mm.max() > 1.01 * length_mm or s_mm.min() < -1e-9:
        raise ConfigError(
            f"{path}: a case must have at least three points with s_mm from 0 to "
            f"{length_mm:g} mm; instead received {len(order)} up to {s_mm.max():g} mm"
        )
    return replace(case, s_mm=s_mm[order], points_mm=points[order])
