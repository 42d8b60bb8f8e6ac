"""Learn from imported tables (COMSOL, finite elements) what the rod model misses.

A case of a 3D model costs minutes, the rod microseconds, and they differ little: so the
angle is corrected, theta = theta_rod (1 + c), with c a polynomial of low degree in the
share of the length s / L and in how far the rod is bent, theta_rod(L). Its coefficients
come from the positions by linear least squares; how many are worth having is decided by
leaving out one case at a time, and what is left out also gives the error bar.

A file is any that `analysis.imports` reads. Parameters are those of a specimen and a
field: length1_mm, E1_MPa, ..., side_mm, remanence_mT, flux_mT, and angle_deg (90
without); they stand in columns, in heads (``y (m) @ B0=0.05``) or in lines
``% side_mm = 1.0``, or come from a specimen file. Shapes with other parameters are
other cases.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.columns import split_unit
from ...core.errors import ConfigError, InputError, StoreError
from ...core.files import write_text
from ...core.json import parse_json
from ...core.specimen import Specimen
from ...core.units import unit_factor
from ...sim import Designs, solve_shapes
from ..imports.door import read_raw_shapes
from ..imports.judge import Reading, judged
from ..imports.shapes import RawShape

Array = NDArray[np.float64]

POINTS = 181
_UNIT = {
    "length": "mm", "E": "MPa", "side": "mm", "remanence": "mT", "flux": "mT",
    "angle": "deg",
}  # fmt: skip
"""Parameters of a specimen and a field, and the unit in which they are used."""

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


def read_tables(
    paths: Sequence[Path],
    *,
    how: Reading | None = None,
    specimen: Specimen | None = None,
    flux: str = "",
) -> list[Case]:
    """Read exported shapes of any kind (`analysis.imports`) and their parameters.

    Parameters
    ----------
    paths : sequence of Path
        Files with one or many shapes each.
    how : Reading, optional
        Unit, mirror image, frame of the files.
    specimen : Specimen, optional
        The rod, where the files do not describe it.
    flux : str
        Which of their parameters is the flux density, and its unit: ``B0=T``.

    Raises
    ------
    ConfigError, InputError
        If a file holds no shape, a parameter is missing, or a shape does not fit the
        rod (length, clamp, theta, side).
    """
    return [
        _case(raw, how, specimen, flux)
        for path in paths
        for raw in read_raw_shapes(path)
    ]


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
        data = parse_json(path.read_bytes())
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


def _case(
    raw: RawShape, how: Reading | None, specimen: Specimen | None, flux: str
) -> Case:
    values = _values(raw, specimen, flux)

    def value(name: str) -> Array:
        if name not in values:
            raise ConfigError(
                f"{raw.source}: the parameter {name} is missing: give a column or a "
                f"line '% {name} = ...', or --specimen and --flux NAME=UNIT"
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
    load = values["remanence_mT"] * values["flux_mT"]
    shape = judged(
        raw, how, length_mm=float(design.length_mm.sum()),
        side=load * math.sin(math.radians(values.get("angle_deg", 90.0))),
    )  # fmt: skip
    return Case(
        design=design, s_mm=shape.line.s_mm, points_mm=shape.line.points_mm,
        source=raw.source,
    )  # fmt: skip


def _values(raw: RawShape, specimen: Specimen | None, flux: str) -> dict[str, float]:
    """Return the parameters of a case with the names and units of ours."""
    values: dict[str, float] = {}
    if specimen is not None:
        values = {"side_mm": specimen.side_mm, "remanence_mT": specimen.remanence_mT}
        for i, section in enumerate(specimen.sections, start=1):
            values |= {f"length{i}_mm": section.length_mm, f"E{i}_MPa": section.E_MPa}
    for head, number in raw.parameters.items():
        quantity, unit = split_unit(head)
        wanted = _UNIT.get(re.sub(r"\d+$", "", quantity), "")
        factor = unit_factor(unit, wanted) if wanted else None
        if factor is not None:
            values[f"{quantity}_{wanted}"] = number * factor
    if flux:
        name, _, unit = flux.partition("=")
        factor = unit_factor(unit, "mT")
        if name not in raw.parameters or factor is None:
            raise ConfigError(
                f"{raw.source}: --flux must be NAME=UNIT with one of its parameters "
                f"({', '.join(raw.parameters) or 'it has none'}), such as B0=T; "
                f"instead received {flux!r}"
            )
        values["flux_mT"] = raw.parameters[name] * factor
    return values
