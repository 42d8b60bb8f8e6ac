"""What a named parameter changes in the input of the planar kernels.

It is given as the derivative of the rod array (n, 5), of the field and of the clamp
angle. The field's is (bx, by, scale, cx, cy, omega) of each source: at a fixed point

    dB = (bx, by) + scale B - G c + omega (J B - G J (r - centre))

for a change of its value, a factor, a shift c of the source and a turn omega of it
about its own centre, where G is the gradient and J turns by 90 degrees.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.cross_section import ALL_SIZES, SIZES
from ...core.errors import InputError
from ...core.sources import Posed, Source, Uniform
from ...core.specimen import Specimen
from ...core.units import cos_deg, rad_from_deg
from ..fields import Field, Support
from ..planar.march import WX, WY, E, H, M
from ..scaling import checked_density, loads_per_unit

Array = NDArray[np.float64]


STRENGTHS = ("remanence_T", "moment_A_m2", "current_A")
"""Numbers to which the field of a source is proportional."""


@dataclass(slots=True, kw_only=True)
class Change:
    """Derivative of the kernel's input with respect to one parameter."""

    rod: Array
    field: Array
    clamp: float = 0.0


def change_of(
    name: str, rod: Array, specimen: Specimen, field: Field, support: Support
) -> Change:
    """Return the change of the kernels' input, `rod` of it, per unit of a parameter.

    Raises
    ------
    InputError
        If the parameter is unknown or has no meaning for this case.
    """
    change = Change(
        rod=np.zeros(rod.shape),
        field=np.zeros((len(field.sources), 6)),
    )
    match = re.fullmatch(r"([\w.]+?)(?:\[(\d+)\])?", name)
    key = match.group(1) if match else name
    index = int(match.group(2)) if match and match.group(2) is not None else None
    sizes = {"side_mm", *SIZES[specimen.shape]}
    if (key in _OF_SECTIONS or key in sizes) and (index is not None or key in _OF_ALL):
        chosen = range(len(specimen.sections)) if index is None else [index]
        if index is not None and index >= len(specimen.sections):
            raise InputError(
                f"parameter {name} must name one of {len(specimen.sections)} sections, "
                f"counted from 0 at the root; instead received {index}"
            )
        for i in chosen:
            if key in sizes:
                _of_size(change, i, rod, specimen, key)
            else:
                _OF_SECTIONS[key](change, i, rod, specimen, field, support)
    elif key == "clamp_angle_deg" and index is None:
        change.clamp = rad_from_deg(1.0)
    elif key in ("load_factor", "density_kg_m3", "gravity_m_s2"):
        _of_loads(change, key, index, name, specimen, support)
    else:
        _of_field(change, key, index, name, specimen, field)
    return change


def _of_E(
    change: Change,
    i: int,
    rod: Array,
    specimen: Specimen,
    field: Field,
    support: Support,
) -> None:
    change.rod[-1 - i, E] -= rod[-1 - i, E] / specimen.sections[i].E_MPa


def _of_size(change: Change, i: int, rod: Array, specimen: Specimen, name: str) -> None:
    across = specimen.cross_sections[i]
    area, second = across.change(name)
    a, b = area / across.area_mm2, second / across.in_plane_mm4
    change.rod[-1 - i] += (0.0, -b, a, a, a) * rod[-1 - i]


def _of_remanence(
    change: Change,
    i: int,
    rod: Array,
    specimen: Specimen,
    field: Field,
    support: Support,
) -> None:
    per_mT, _ = loads_per_unit(specimen)
    change.rod[-1 - i, M] += support.load_factor * per_mT[-1 - i]


def _of_length(
    change: Change,
    i: int,
    rod: Array,
    specimen: Specimen,
    field: Field,
    support: Support,
) -> None:
    change.rod[-1 - i, H] += 1.0 / specimen.length_mm
    for which, source in enumerate(field.sources):
        if isinstance(source, Posed) and source.centre_mm is None:
            change.field[which, 3] += 1.0 / specimen.length_mm


_OF_ALL = (*ALL_SIZES, "remanence_mT")
_OF_SECTIONS: dict[str, Callable[..., None]] = {
    "E_MPa": _of_E,
    "remanence_mT": _of_remanence,
    "length_mm": _of_length,
}


def _of_loads(
    change: Change,
    key: str,
    index: int | None,
    name: str,
    specimen: Specimen,
    support: Support,
) -> None:
    per_mT, per_weight = loads_per_unit(specimen)
    if key == "load_factor" and index is None:
        change.rod[:, M] = per_mT * np.array(specimen.remanences_mT)[::-1]
    elif key == "density_kg_m3" and index is None:
        gx, gy, _ = support.gravity_m_s2
        change.rod[:, WX] = per_weight * gx
        change.rod[:, WY] = per_weight * gy
    elif key == "gravity_m_s2" and index in (0, 1):
        density = specimen.density_kg_m3 or checked_density(
            specimen, Support(gravity_m_s2=(1.0, 0.0, 0.0))
        )
        change.rod[:, WX if index == 0 else WY] = per_weight * density
    else:
        raise _unknown(name)


def _of_field(
    change: Change,
    key: str,
    index: int | None,
    name: str,
    specimen: Specimen,
    field: Field,
) -> None:
    sources = field.sources
    if key == "gap_mm" and index is None:
        moved = [i for i, one in enumerate(sources) if getattr(one, "gap_mm", None)]
        for i in moved:
            _of_source(change, i, key, None, specimen, sources[i])
        if not moved:
            raise _unknown(name)
        return
    match = re.fullmatch(r"source\[(\d+)\]\.(\w+)(?:\[(\d)\])?", name)
    if match and int(match.group(1)) < len(sources):
        which, key = int(match.group(1)), match.group(2)
        index = int(match.group(3)) if match.group(3) else None
    elif len(sources) == 1 and (key.startswith("magnet.") or index is None):
        which, key = 0, key.removeprefix("magnet.")
    else:
        raise _unknown(name)
    if not _of_source(change, which, key, index, specimen, sources[which]):
        raise _unknown(name)


def _of_source(
    change: Change,
    which: int,
    key: str,
    index: int | None,
    specimen: Specimen,
    source: Source,
) -> bool:
    """Set the change by one number of a source; return whether it has this number."""
    row = change.field[which]
    scale = 1.0 / specimen.length_mm
    if isinstance(source, Uniform):
        return index is None and _of_uniform(row, key, source)
    if index is None and key in STRENGTHS and getattr(source, key, None) is not None:
        value = float(getattr(source, key))
        if value == 0.0:
            raise InputError(
                f"{key} of a {source.kind} must not be 0 where its derivative is asked "
                "for; instead received 0"
            )
        row[2] = 1.0 / value
        return True
    if not isinstance(source, Posed):
        return False
    axis = np.array(source.axes()[2][:2])
    place = "offset_mm" if source.centre_mm is None else "centre_mm"
    if key == "gap_mm" and index is None and source.gap_mm is not None:
        row[3:5] = -axis * scale
    elif key == "axis_angle_deg" and index is None:
        row[5] = rad_from_deg(1.0)
        if source.gap_mm is not None:
            distance = (source.gap_mm + source.half_mm) * scale
            row[3:5] = distance * row[5] * np.array([axis[1], -axis[0]])
    elif key == place and index in (0, 1, 2):
        # Across the plane the field is symmetric: the planar shape does not change.
        if index < 2:
            row[3 + index] = scale
    else:
        return False
    return True


def _of_uniform(row: Array, key: str, source: Uniform) -> bool:
    angle_deg = source.angle_deg
    along = np.array([cos_deg(angle_deg), cos_deg(angle_deg - 90.0)])
    if key == "flux_mT":
        row[:2] = along * 1e-3
    elif key == "angle_deg":
        turn = source.flux_mT * 1e-3 * rad_from_deg(1.0)
        row[:2] = -along[1] * turn, along[0] * turn
    else:
        return False
    return True


def _unknown(name: str) -> InputError:
    return InputError(
        f"parameter must be one that this case has, such as E_MPa[0], side_mm, "
        f"clamp_angle_deg, flux_mT (uniform field), gap_mm (magnet), or, of a source, "
        f"its strength, angle or place, not its size (source[0].axis_angle_deg); "
        f"instead received {name!r}"
    )
