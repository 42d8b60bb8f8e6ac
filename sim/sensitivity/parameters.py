"""What a named parameter changes in the input of the planar kernels.

It is given as the derivative of the rod array (n, 5), of the field and of the clamp
angle. The field's is (bx, by, scale, cx, cy, omega): at a fixed point

    dB = (bx, by) + scale B - G c + omega (J B - G J (r - centre))

for a change of its value, a factor, a shift c of the magnet and a turn omega of it
about its own centre, where G is the gradient and J turns by 90 degrees.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.checks import finite
from ...core.cross_section import ALL_SIZES, SIZES
from ...core.errors import InputError
from ...core.specimen import Specimen
from ...core.units import rad_from_deg
from ..fields import Field, MagnetField, Support, UniformField
from ..planar.march import WX, WY, E, H, M
from ..scaling import checked_density, field_array, loads_per_unit, rod_array

Array = NDArray[np.float64]


@dataclass(slots=True, kw_only=True)
class Change:
    """Derivative of the kernel's input with respect to one parameter."""

    rod: Array
    field: Array
    clamp: float = 0.0


def change_of(name: str, specimen: Specimen, field: Field, support: Support) -> Change:
    """Return the change of the kernels' input per unit of a parameter.

    Raises
    ------
    InputError
        If the parameter is unknown or has no meaning for this case.
    """
    change = Change(rod=np.zeros((len(specimen.sections), 5)), field=np.zeros(6))
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
                _of_size(change, i, specimen, support, key)
            else:
                _OF_SECTIONS[key](change, i, specimen, field, support)
    elif key == "clamp_angle_deg" and index is None:
        change.clamp = rad_from_deg(1.0)
    elif key in ("load_factor", "density_kg_m3", "gravity_m_s2"):
        _of_loads(change, key, index, name, specimen, support)
    else:
        _of_field(change, key, index, name, specimen, field)
    return change


def _of_E(
    change: Change, i: int, specimen: Specimen, field: Field, support: Support
) -> None:
    rod = rod_array(specimen, support)
    change.rod[-1 - i, E] -= rod[-1 - i, E] / specimen.sections[i].E_MPa


def _of_size(
    change: Change, i: int, specimen: Specimen, support: Support, name: str
) -> None:
    row = rod_array(specimen, support)[-1 - i]
    across = specimen.cross_sections[i]
    area, second = across.change(name)
    a, b = area / across.area_mm2, second / across.in_plane_mm4
    change.rod[-1 - i] += np.array([0.0, -b, a, a, a]) * row


def _of_remanence(
    change: Change, i: int, specimen: Specimen, field: Field, support: Support
) -> None:
    per_mT, _ = loads_per_unit(specimen)
    change.rod[-1 - i, M] += support.load_factor * per_mT[-1 - i]


def _of_length(
    change: Change, i: int, specimen: Specimen, field: Field, support: Support
) -> None:
    change.rod[-1 - i, H] += 1.0 / specimen.length_mm
    if isinstance(field, MagnetField):
        change.field[3] += 1.0 / specimen.length_mm


_OF_ALL = (*ALL_SIZES, "remanence_mT")
_OF_SECTIONS: dict[str, Callable[[Change, int, Specimen, Field, Support], None]] = {
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
    scale = 1.0 / specimen.length_mm
    if isinstance(field, UniformField) and index is None:
        unit = field_array(
            UniformField(flux_mT=1.0, angle_deg=field.angle_deg), specimen.length_mm
        )
        if key == "flux_mT":
            change.field[:2] = unit[1:3]
            return
        if key == "angle_deg":
            turn = finite(field.flux_mT, "flux_mT", "mT") * rad_from_deg(1.0)
            change.field[:2] = -unit[2] * turn, unit[1] * turn
            return
    if isinstance(field, MagnetField):
        magnet = field.magnet
        axis = np.array(magnet.axes()[2][:2])
        if key == "gap_mm" and index is None:
            change.field[3:5] = -axis * scale
            return
        if key == "magnet.remanence_T" and index is None:
            if magnet.remanence_T == 0.0:
                raise InputError(
                    "magnet remanence_T must not be 0 T where its derivative is asked "
                    "for; instead received 0"
                )
            change.field[2] = 1.0 / magnet.remanence_T
            return
        if key == "magnet.axis_angle_deg" and index is None:
            turn = rad_from_deg(1.0)
            distance = (field.gap_mm + magnet.sides_mm[2] / 2.0) * scale
            change.field[3] = distance * axis[1] * turn
            change.field[4] = -distance * axis[0] * turn
            change.field[5] = turn
            return
        if key == "magnet.offset_mm" and index in (0, 1, 2):
            # Across the plane the field is symmetric: the planar shape does not change.
            if index < 2:
                change.field[3 + index] = scale
            return
    raise _unknown(name)


def _unknown(name: str) -> InputError:
    return InputError(
        f"parameter must be one that this case has, such as E_MPa[0], side_mm, "
        f"clamp_angle_deg, flux_mT (uniform field) or gap_mm (magnet); instead "
        f"received {name!r}"
    )
