"""What may go and return along a path, and the case at one value of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.sources import Posed, Uniform
from ...core.specimen import Specimen
from ..fields import Field, Support, kinds_of

Case = tuple[Specimen, Field, Support]


@dataclass(frozen=True, slots=True)
class Quantity:
    """Something that changes along a path: its unit, and the case at a value."""

    unit: str
    at: Callable[[Specimen, Field, Support, float], Case]


def _gap(rod: Specimen, field: Field, support: Support, value: float) -> Case:
    if field.follows_gap:
        return rod, field.at_gap(value), support
    moved = [getattr(one, "gap_mm", None) is not None for one in field.sources]
    return rod, _changed(field, moved, "gap_mm", value), support


def _of_posed(key: str) -> Callable[[Specimen, Field, Support, float], Case]:
    def at(rod: Specimen, field: Field, support: Support, value: float) -> Case:
        moved = [isinstance(one, Posed) for one in field.sources]
        return rod, _changed(field, moved, key, value), support

    return at


def _of_uniform(key: str) -> Callable[[Specimen, Field, Support, float], Case]:
    def at(rod: Specimen, field: Field, support: Support, value: float) -> Case:
        moved = [isinstance(one, Uniform) for one in field.sources]
        return rod, _changed(field, moved, key, value), support

    return at


def _offset(axis: int) -> Callable[[Specimen, Field, Support, float], Case]:
    def at(rod: Specimen, field: Field, support: Support, value: float) -> Case:
        sources: list[Any] = list(field.sources)
        moved = [
            i
            for i, one in enumerate(sources)
            if isinstance(one, Posed) and one.centre_mm is None
        ]
        for i in moved:
            shift = np.array(sources[i].offset_mm)
            shift[axis] = value
            sources[i] = replace(sources[i], offset_mm=tuple(shift.tolist()))
        if not moved:
            raise _no_such(field, "offset_mm")
        return rod, Field(sources), support

    return at


def _clamp(rod: Specimen, field: Field, support: Support, value: float) -> Case:
    return rod, field, replace(support, clamp_angle_deg=value)


def _load(rod: Specimen, field: Field, support: Support, value: float) -> Case:
    return rod, field, replace(support, load_factor=value)


def _insertion(rod: Specimen, field: Field, support: Support, value: float) -> Case:
    if not value > 0.0:
        raise InputError(
            f"insertion_mm must be above 0: it is the length in mm of the section at "
            f"the root; instead received {value:g}"
        )
    first = replace(rod.sections[0], length_mm=value)
    return replace(rod, sections=(first, *rod.sections[1:])), field, support


QUANTITIES = {
    "gap_mm": Quantity("mm", _gap),
    "flux_mT": Quantity("mT", _of_uniform("flux_mT")),
    "angle_deg": Quantity("deg", _of_uniform("angle_deg")),
    "axis_angle_deg": Quantity("deg", _of_posed("axis_angle_deg")),
    "offset_x_mm": Quantity("mm", _offset(0)),
    "offset_y_mm": Quantity("mm", _offset(1)),
    "clamp_angle_deg": Quantity("deg", _clamp),
    "load_factor": Quantity("", _load),
    "insertion_mm": Quantity("mm", _insertion),
}
"""By the name of what changes; `insertion_mm` is the length of the root's section."""


def _changed(field: Field, moved: list[bool], key: str, value: float) -> Field:
    if not any(moved):
        raise _no_such(field, key)
    return Field(
        replace(source, **{key: value}) if moves else source  # type: ignore[type-var]
        for source, moves in zip(field.sources, moved, strict=True)
    )


def _no_such(field: Field, key: str) -> InputError:
    return InputError(
        f"{key} must belong to a source of the field for a path, and not to one that "
        f"stands where centre_mm says: follow another quantity, or leave out centre_mm "
        f"of what shall move; instead the field has the sources {kinds_of(field)}"
    )
