"""From fields to the arrays of the kernels (`magnet.flux`), for one rod or many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import shown
from ...core.errors import InputError
from ...core.sources import (
    Coil,
    Cuboid,
    Cylinder,
    Dipole,
    Gradient,
    Posed,
    Source,
    Uniform,
)
from ...core.units import MU0, T_from_mT
from ..fields import Field
from ..magnet import flux
from ..magnet.flux import FIRST, WIDTH
from ..magnet.map import FieldMap
from .overlap import refuse_overlap
from .rods import array_cache

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Template:
    """The numbers of a field in mm and T, for an undeformed tip at the origin.

    `tip` and `gap` say how they change with the rod's length and with the gap of the
    case, `power` by which power of the length the kernels' units shrink them.
    """

    numbers: Array
    tip: Array
    gap: Array
    power: Array
    waits: bool


def direction(angle_deg: Array) -> tuple[Array, Array]:
    """Return cosine and sine of angles in degrees, with exact zeros at right angles.

    Rounding would make a straight rod bend there.
    """
    angle = np.radians(angle_deg)
    cosine, sine = np.cos(angle), np.sin(angle)
    right = np.mod(angle_deg, 90.0) == 0.0
    if np.any(right):
        cosine = np.where(right, np.rint(cosine), cosine)
        sine = np.where(right, np.rint(sine), sine)
    return cosine, sine


@array_cache(maxsize=1024)
def field_array(field: Field, length_mm: float) -> Array:
    """Return the field as the kernels take it.

    Raises
    ------
    InputError
        If this is no field, a gap is missing, or two sources overlap.
    """
    if not isinstance(field, Field):
        raise InputError(
            "field must be a UniformField in mT, a MagnetField in mm or a Field of "
            f"sources; instead received {shown(field)}"
        )
    row: Array = field_rows(field, None, np.array([length_mm]))[0]
    return row


def uniform_rows(flux_T: Array, angle_deg: Array) -> Array:
    """Return uniform fields as the kernels take them, shape (n, 17)."""
    rows = np.zeros((len(flux_T), WIDTH))
    cosine, sine = direction(angle_deg)
    rows[:, 1] = flux_T * cosine
    rows[:, 2] = flux_T * sine
    return rows


def field_rows(field: Field, gap_mm: Array | None, length_mm: Array) -> Array:
    """Return one field before many rods as the kernels take it, shape (n, width).

    Parameters
    ----------
    field : Field
        Its sources that wait for a gap stand at `gap_mm`.
    gap_mm, length_mm : ndarray, shape (n,)
        The gap may be None where none waits.

    Raises
    ------
    InputError
        If a source waits for a gap and none is given, or two sources overlap.
    """
    of = template(field)
    if of.waits and gap_mm is None:
        raise InputError(
            "gap_mm must be given in mm for sources that have neither centre_mm nor "
            "gap_mm; instead received none"
        )
    L = length_mm[:, None]
    rows = of.numbers + L * of.tip
    if gap_mm is not None:
        rows = rows + gap_mm[:, None] * of.gap
    moved = of.power != 0.0
    rows[:, moved] /= L ** of.power[moved]
    rows = np.ascontiguousarray(rows)
    refuse_overlap(field.sources, rows, length_mm)
    return rows


@lru_cache(maxsize=256)
def template(field: Field) -> Template:
    """Return the numbers of a field, and how they change from rod to rod."""
    sources = field.sources
    records = [_record(source) for source in sources]
    kinds = [row[0] for row, *_ in records]
    if all(kind == flux.UNIFORM for kind in kinds):
        total: Array = np.sum([row for row, *_ in records], axis=0)
        return _joined([(total, *records[0][1:])], [], waits=False)
    waits = any(source.follows_gap for source in sources)
    if kinds == [flux.CUBOID]:
        return _joined(records, [], waits=waits)
    head = np.zeros(FIRST)
    head[:] = flux.SUM, len(sources)
    none = np.zeros(FIRST)
    charges = []
    at = FIRST + WIDTH * len(sources)
    for (row, *_), source in zip(records, sources, strict=True):
        if isinstance(source, FieldMap):
            row[1:3] = at, len(source.charges)
            charges.append(source.charges.ravel())
            at += source.charges.size
    return _joined([(head, none, none, none), *records], charges, waits=waits)


def _joined(
    parts: list[tuple[Array, Array, Array, Array]], charges: list[Array], *, waits: bool
) -> Template:
    numbers, tip, gap, power = (np.concatenate(one) for one in zip(*parts, strict=True))
    if charges:
        tail = np.concatenate(charges)
        none = np.zeros(len(tail))
        by = np.tile([1.0, 1.0, 1.0, 2.0], len(tail) // 4)
        numbers = np.concatenate([numbers, tail])
        tip, gap = np.concatenate([tip, none]), np.concatenate([gap, none])
        power = np.concatenate([power, by])
    return Template(numbers=numbers, tip=tip, gap=gap, power=power, waits=waits)


def _record(source: Source) -> tuple[Array, Array, Array, Array]:
    """Return numbers, changes with the tip and the gap, and powers of one source."""
    row, tip, gap, power = (np.zeros(WIDTH) for _ in range(4))
    row[0], fill = _KINDS[type(source)]
    fill(source, row, power)
    if isinstance(source, Posed):
        axes = np.array(source.axes())
        row[7:16] = axes.ravel()
        power[1:7] = 1.0
        if source.centre_mm is not None:
            row[4:7] = source.centre_mm
        else:
            row[4:7] = np.array(source.offset_mm)
            row[4:7] -= (source.half_mm + (source.gap_mm or 0.0)) * axes[2]
            tip[4] = 1.0
            if source.gap_mm is None:
                gap[4:7] = -axes[2]
    return row, tip, gap, power


def _cuboid(source: Cuboid, row: Array, power: Array) -> None:
    row[1:4] = np.array(source.sides_mm) / 2.0
    row[16] = source.remanence_T


def _cylinder(source: Cylinder, row: Array, power: Array) -> None:
    radius = source.diameter_mm / 2.0
    row[1:4] = radius, radius, source.length_mm / 2.0
    row[16] = source.remanence_T


def _dipole(source: Dipole, row: Array, power: Array) -> None:
    row[1] = source.diameter_mm / 2.0
    row[16] = source.strength_A_m2 * MU0 / (4.0 * np.pi) * 1e9
    power[16] = 3.0


def _coil(source: Coil, row: Array, power: Array) -> None:
    row[1:4] = source.diameter_mm / 2.0, source.wire_mm / 2.0, source.length_mm / 2.0
    turns_A = source.current_A * source.turns
    if source.length_mm > 0.0:
        row[16] = MU0 * turns_A / (source.length_mm * 1e-3)
    else:
        row[16] = MU0 / (4.0 * np.pi) * turns_A * 1e3
        power[16] = 1.0


def _uniform(source: Uniform, row: Array, power: Array) -> None:
    angles = np.array([source.angle_deg, source.elevation_deg])
    (c, up), (s, rise) = direction(angles)
    row[1:4] = np.array([c * up, s * up, rise]) * T_from_mT(source.flux_mT)


def _gradient(source: Gradient, row: Array, power: Array) -> None:
    row[4:7] = source.centre_mm
    row[7:16] = np.array(source.gradient_mT_per_mm).ravel() * 1e-3
    power[4:7] = 1.0
    power[7:16] = -1.0


def _map(source: FieldMap, row: Array, power: Array) -> None:
    """Leave all to `template`, which knows where the charges go."""


_KINDS: dict[type, tuple[float, Callable[[Any, Array, Array], None]]] = {
    Cuboid: (flux.CUBOID, _cuboid),
    Cylinder: (flux.CYLINDER, _cylinder),
    Dipole: (flux.DIPOLE, _dipole),
    Coil: (flux.COIL, _coil),
    Uniform: (flux.UNIFORM, _uniform),
    Gradient: (flux.GRADIENT, _gradient),
    FieldMap: (flux.CHARGES, _map),
}
