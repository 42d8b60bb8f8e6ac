"""A case with one named number moved: for derivatives that are taken as differences."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

from ...core.cross_section import SIZES
from ...core.errors import InputError
from ...core.specimen import SIGNED, Specimen
from ..fields import Field, Support

Case = tuple[Specimen, Field, Support]

_SCALES = {
    "remanence": 10.0, "natural": 0.01, "gravity": 9.8, "angle": 20.0, "axis": 20.0,
    "elevation": 20.0, "clamp": 20.0, "offset": 10.0, "centre": 10.0, "flux": 10.0,
    "poisson": 0.05, "current": 1.0, "moment": 0.1,
}  # fmt: skip
"""By how much numbers that may be zero change things, by the word they begin with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """How a case changes with a parameter.

    Parameters
    ----------
    scale : float
        Change of the parameter that changes much.
    moved : callable
        Gives the case with the parameter changed by so much.
    grows : int or None
        The section whose length it is.
    """

    scale: float
    moved: Callable[[float], Case]
    grows: int | None = None


def move_of(name: str, case: Case) -> Move:
    """Return how a case changes with a named parameter.

    Raises
    ------
    InputError
        If the parameter is unknown or has no meaning for this case.
    """
    specimen, field, support = case
    match = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", name)
    key, index = (match[1], match[2]) if match else ("", None)
    i = None if index is None else int(index)
    whole = {*SIGNED, *SIZES[specimen.shape]}
    if key in whole or (key in ("E_MPa", "length_mm") and i is not None):
        return _of_sections(name, key, i, case)
    if key in ("density_kg_m3", "poisson_ratio") and i is None:
        return _number(
            key, None, specimen, lambda changed: (changed, field, support), name
        )
    if key in ("clamp_angle_deg", "load_factor", "gravity_m_s2"):
        return _number(
            key, i, support, lambda changed: (specimen, field, changed), name
        )
    if key == "gap_mm" and i is None:
        return _of_gaps(name, case)
    return _of_source(name, case)


def _unknown(name: str) -> InputError:
    return InputError(
        "parameter must be one that this case has, such as E_MPa[0], remanence_y_mT, "
        "clamp_angle_deg, gravity_m_s2[2], gap_mm or source[0].axis_angle_deg; instead "
        f"received {name!r}"
    )


def _scale(key: str, value: float) -> float:
    return max(abs(value), _SCALES.get(key.split("_")[0], 0.0))


def _number(
    key: str, index: int | None, owner: Any, put: Callable[[Any], Case], name: str
) -> Move:
    """Return the move of a number, or of element `index` of a vector, of a record."""
    known = {one.name: one.type for one in fields(owner)}
    value: Any = getattr(owner, key) if key in known else None
    if value is not None and known[key] in (int, "int"):
        raise InputError(
            f"{name} must be a number that can change by a little; instead it is a "
            "count, which has no derivative"
        )
    if isinstance(value, tuple) and index is not None and index < len(value):
        start = value[index]
    elif isinstance(value, (int, float)) and index is None:
        start = value
    else:
        raise _unknown(name)

    def moved(step: float) -> Case:
        new = start + step
        if index is not None:
            new = (*value[:index], new, *value[index + 1 :])
        return put(replace(owner, **{key: new}))

    scale = _scale(key, start)
    if key == "poisson_ratio":
        scale = min(scale, 20.0 * (0.5 - start))
    if scale <= 0.0 or isinstance(start, bool):
        raise InputError(
            f"{name} must not be {start:g} where its derivative is asked for: from "
            "there it cannot change both ways"
        )
    return Move(scale=scale, moved=moved)


def _of_sections(name: str, key: str, index: int | None, case: Case) -> Move:
    """Return the move of a number of one section, or of all together."""
    specimen, field, support = case
    count = len(specimen.sections)
    if index is not None and index >= count:
        raise InputError(
            f"parameter {name} must name one of {count} sections, counted from 0 at "
            f"the root; instead received {index}"
        )
    chosen = range(count) if index is None else [index]
    values = [_of_section(key, i, specimen) for i in range(count)]

    def moved(step: float) -> Case:
        sections = list(specimen.sections)
        for i in chosen:
            sections[i] = replace(sections[i], **{key: values[i] + step})
        return replace(specimen, sections=tuple(sections)), field, support

    scale = min(_scale(key, values[i]) for i in chosen)
    grows = index if key == "length_mm" else None
    return Move(scale=scale, moved=moved, grows=grows)


def _of_section(key: str, i: int, specimen: Specimen) -> float:
    if key in ("E_MPa", "length_mm"):
        return float(getattr(specimen.sections[i], key))
    if key in SIGNED:
        return specimen._of_sections(key)[i]
    across = specimen.cross_sections[i]
    part = {"height_mm": across.height_mm, "bore_mm": across.bore_mm}
    return part.get(key, across.width_mm)


def _of_gaps(name: str, case: Case) -> Move:
    """Return the move of all gaps together."""
    specimen, field, support = case
    gaps = [getattr(one, "gap_mm", None) for one in field.sources]
    if not any(gaps):
        raise _unknown(name)

    def moved(step: float) -> Case:
        sources = (
            replace(one, gap_mm=gap + step) if gap else one  # type: ignore[type-var, call-arg]
            for one, gap in zip(field.sources, gaps, strict=True)
        )
        return specimen, Field(*sources), support

    return Move(scale=min(gap for gap in gaps if gap), moved=moved)


def _of_source(name: str, case: Case) -> Move:
    """Return the move of a number of a source."""
    specimen, field, support = case
    sources = field.sources
    match = re.fullmatch(r"(?:source\[(\d+)\]\.|magnet\.)?(\w+?)(?:\[(\d)\])?", name)
    if match is None or (match[1] is None and len(sources) > 1):
        raise _unknown(name)
    which = int(match[1] or 0)
    if which >= len(sources):
        raise _unknown(name)

    def put(changed: Any) -> Case:
        return (
            specimen, Field(*sources[:which], changed, *sources[which + 1 :]), support
        )  # fmt: skip

    index = None if match[3] is None else int(match[3])
    return _number(match[2], index, sources[which], put, name)
