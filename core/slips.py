"""Slips of the unit: a number of a size that no lab has, unless in another unit.

A modulus of 20e6 MPa is one in Pa, a length of 0.03 mm one in m, a remanence of
16000 mT one in A/m. Ranges are wide: what lies outside is no unusual rod but another
unit, and only asked about if that unit makes it usual.
"""

from __future__ import annotations

from typing import NamedTuple

from .errors import InputError
from .units import unit_factor


class _Range(NamedTuple):
    """What can be, what is usual, and the units that people type instead."""

    low: float
    high: float
    usual: tuple[float, float]
    units: tuple[str, ...]


_LENGTH = _Range(0.1, 1e5, (1.0, 2000.0), ("m",))
_SIDE = _Range(0.02, 1e3, (0.05, 50.0), ("m",))
_BODY = _Range(0.3, 1e4, (1.0, 500.0), ("m",))

_RANGES = {
    "E_MPa": _Range(0.0, 3e5, (1e-3, 1e4), ("Pa", "kPa")),
    "remanence_mT": _Range(0.05, 1600.0, (1.0, 1500.0), ("T", "A/m", "G")),
    "remanence_T": _Range(0.0, 2.5, (0.05, 1.6), ("mT", "A/m", "kA/m", "kG", "G")),
    "flux_mT": _Range(0.0, 5000.0, (0.1, 3000.0), ("G", "A/m")),
    "length_mm": _LENGTH,
    "total_length_mm": _LENGTH,
    "side_mm": _SIDE,
    "diameter_mm": _SIDE,
    "width_mm": _SIDE,
    "height_mm": _SIDE,
    "gaps_mm": _BODY,
    "gap_mm": _BODY,
    "sides_mm": _BODY,
    "density_kg_m3": _Range(30.0, 3e4, (500.0, 2e4), ("g/cm3",)),
}
_G_PER_CM3 = 1000.0


def slip_of(name: str, value: float, *, of_magnet: bool = False) -> str:
    """Return the question to ask about a value; empty where its size is possible.

    Parameters
    ----------
    name : str
        Of the key or option, which ends in its unit: ``E_MPa``.
    value : float
        In that unit.
    of_magnet : bool
        Sides are those of a magnet, not of a rod.
    """
    known = _RANGES.get(name)
    if of_magnet and name.endswith(("side_mm", "diameter_mm", "height_mm")):
        known = _BODY
    if known is None or value == 0.0 or known.low <= abs(value) <= known.high:
        return ""
    wanted = name.rpartition("_")[2]
    for unit in known.units:
        factor = _G_PER_CM3 if unit == "g/cm3" else unit_factor(unit, wanted) or 0.0
        if known.usual[0] <= abs(value) * factor <= known.usual[1]:
            return (
                f"{value:g} {_shown(name)} cannot be; is it in {unit}? then write "
                f"{value * factor:.6g}"
            )
    return ""


def _shown(name: str) -> str:
    return "kg/m3" if name == "density_kg_m3" else name.rpartition("_")[2]


def refuse_slip(name: str, value: float | None) -> None:
    """Refuse an option's value whose size is that of another unit.

    Raises
    ------
    InputError
        With the value in the right unit.
    """
    question = "" if value is None else slip_of(name, value)
    if question:
        raise InputError(f"{name}: {question}")
