"""The paper's parameter studies on simulations: one quantity varies, the rest stays."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ...core.checks import listed, positive, shown
from ...core.errors import InputError
from ...core.progress import Progress, silent
from ...core.specimen import Specimen
from ..fields import MagnetField, Support, UniformField, check_case
from ..one_rod import NO_SUPPORT, solve
from ..solution import Solution

Case = tuple[Specimen, UniformField | MagnetField]


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """What a study varies.

    Parameters
    ----------
    name : str
        As typed.
    title : str
        For the figure.
    unit : str
        Of the values.
    values : tuple of str
        The default values, as typed.
    """

    name: str
    title: str
    unit: str
    values: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """One shape of a study: the value as typed, and the solution."""

    value: str
    solution: Solution


HEADER = (
    "study",
    "value",
    "unit",
    "status",
    "morse_index",
    "error_mm",
    "s_mm",
    "x_mm",
    "y_mm",
    "theta_rad",
    "kappa_per_mm",
)
STUDIES = {
    "field": Study(
        name="field",
        title="field strength",
        unit="mT",
        values=("10", "20", "38", "50", "66", "90", "120"),
    ),
    "angle": Study(
        name="angle",
        title="field angle",
        unit="deg",
        values=("30", "60", "90", "120", "150"),
    ),
    "stiffness": Study(
        name="stiffness",
        title="stiffness",
        unit="times E",
        values=("2", "1.5", "1", "0.75", "0.5"),
    ),
    "length": Study(
        name="length",
        title="unit length",
        unit="mm",
        values=("20-5-5", "10-10-10", "5-5-20"),
    ),
    "side": Study(name="side", title="side", unit="mm", values=("1.25", "1.0", "0.75")),
}


def sweep(
    name: str,
    specimen: Specimen,
    field: UniformField | MagnetField,
    *,
    values: Sequence[str | float] = (),
    support: Support = NO_SUPPORT,
    model: str = "rod",
    points: int = 61,
    progress: Progress = silent,
) -> tuple[Shape, ...]:
    """Solve a study.

    Parameters
    ----------
    name : {"field", "angle", "stiffness", "length", "side"}
        What varies: flux (mT), its angle (deg), a factor on all moduli, the lengths of
        the sections ("20-5-5", mm) or the side (mm; the remanence stays).
    specimen, field
        The case around which it varies.
    values : sequence of str or float, optional
        Values as a person types them, or numbers; those of the paper's figure by
        default.
    support, model, points
        As for `solve`.
    progress : callable
        Called as ``progress(done, total)``.

    Returns
    -------
    tuple of Shape

    Raises
    ------
    InputError
        If the study is unknown, or a value has no meaning for the case.
    """
    if not isinstance(name, str) or name not in STUDIES:
        raise InputError(
            f"study must be one of {', '.join(STUDIES)}; instead received {shown(name)}"
        )
    check_case(specimen, field, support)
    chosen = _typed(values, STUDIES[name]) or STUDIES[name].values
    shapes = []
    for done, value in enumerate(chosen, start=1):
        rod, acting = _VARY[name](specimen, field, value)
        solution = solve(rod, acting, support=support, model=model, points=points)
        shapes.append(Shape(value=value, solution=solution))
        progress(done, len(chosen))
    return tuple(shapes)


def sweep_csv(name: str, shapes: Sequence[Shape]) -> str:
    """Return a study as CSV: a row a point; a value without a shape has one row."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(HEADER)
    unit = STUDIES[name].unit
    for shape in shapes:
        solution = shape.solution
        head = [name, shape.value, unit, solution.status, solution.morse_index]
        line = solution.centreline
        if line is None:
            writer.writerow([*head, "", "", "", "", "", ""])
            continue
        table = zip(
            line.s_mm, line.x_mm, line.y_mm, line.theta_rad, line.kappa_per_mm,
            strict=True,
        )  # fmt: skip
        for row in table:
            numbers = [f"{value:.15g}" for value in row]
            writer.writerow([*head, f"{solution.error_mm:.2g}", *numbers])
    return buffer.getvalue()


def _typed(values: Sequence[str | float], study: Study) -> tuple[str, ...]:
    """Return the values as text; a text by itself is no sequence of values."""
    given = listed(values)
    if given is None:
        raise InputError(
            f"values of the study {study.name!r} must be a sequence in {study.unit}, "
            f"such as {list(study.values[:2])}; instead received {shown(values)}"
        )
    return tuple(str(value) for value in given)


def _number(value: str, study: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise InputError(
            f"values of the study {study!r} must be numbers in {STUDIES[study].unit}; "
            f"instead received {shown(value)}"
        ) from None


def _uniform(field: UniformField | MagnetField, study: str) -> UniformField:
    if (uniform := field.uniform) is None:
        raise InputError(
            f"the study {study!r} must have a uniform field in mT; instead received a "
            "magnet: vary its gap_mm with the command shape"
        )
    return uniform


def _field(specimen: Specimen, field: UniformField | MagnetField, value: str) -> Case:
    flux_mT = _number(value, "field")
    return specimen, replace(_uniform(field, "field"), flux_mT=flux_mT)


def _angle(specimen: Specimen, field: UniformField | MagnetField, value: str) -> Case:
    angle_deg = _number(value, "angle")
    return specimen, replace(_uniform(field, "angle"), angle_deg=angle_deg)


def _stiffness(
    specimen: Specimen, field: UniformField | MagnetField, value: str
) -> Case:
    factor = positive(_number(value, "stiffness"), "stiffness factor")
    sections = tuple(
        replace(section, E_MPa=section.E_MPa * factor) for section in specimen.sections
    )
    return replace(specimen, sections=sections), field


def _length(specimen: Specimen, field: UniformField | MagnetField, value: str) -> Case:
    lengths = [_number(part, "length") for part in value.split("-")]
    if len(lengths) != len(specimen.sections):
        raise InputError(
            f"values of the study 'length' must be {len(specimen.sections)} lengths in "
            f"mm, such as 20-5-5; instead received {shown(value)}"
        )
    sections = tuple(
        replace(section, length_mm=length)
        for section, length in zip(specimen.sections, lengths, strict=True)
    )
    return replace(specimen, sections=sections), field


def _side(specimen: Specimen, field: UniformField | MagnetField, value: str) -> Case:
    side_mm = positive(_number(value, "side"), "side_mm", "mm")
    sections = tuple(replace(section, side_mm=None) for section in specimen.sections)
    return replace(specimen, side_mm=side_mm, sections=sections), field


_VARY: dict[str, Callable[[Specimen, UniformField | MagnetField, str], Case]] = {
    "field": _field,
    "angle": _angle,
    "stiffness": _stiffness,
    "length": _length,
    "side": _side,
}
