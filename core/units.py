"""The one place where units are converted, and the constants of the field.

People read and type mm, MPa, mT and degrees; the kernels compute in SI.
"""

from __future__ import annotations

import math

MU0 = 4e-7 * math.pi
"""Magnetic constant in T m/A; the paper and the reference numbers use 4 pi 1e-7."""

GRAVITY_M_PER_S2 = 9.80665
"""Standard gravity (CGPM 1901)."""

_TESLA_PER = {
    "t": 1.0,
    "mt": 1e-3,
    "ut": 1e-6,
    "µt": 1e-6,
    "μt": 1e-6,
    "nt": 1e-9,
    "kg": 1e-1,
    "g": 1e-4,
    "mg": 1e-7,
    "oe": 1e-4,
    "koe": 1e-1,
    "a/m": MU0,
    "ka/m": MU0 * 1e3,
}


def cos_deg(angle_deg: float) -> float:
    """Return the cosine of an angle in degrees, exactly zero at right angles."""
    return 0.0 if angle_deg % 180.0 == 90.0 else math.cos(math.radians(angle_deg))


def T_from_mT(flux_mT: float) -> float:
    """Return a flux density in T."""
    return flux_mT * 1e-3


def mT_from_T(flux_T: float) -> float:
    """Return a flux density in mT."""
    return flux_T * 1e3


def rad_from_deg(angle_deg: float) -> float:
    """Return an angle in rad."""
    return math.radians(angle_deg)


def deg_from_rad(angle_rad: float) -> float:
    """Return an angle in degrees."""
    return math.degrees(angle_rad)


def tesla_per_unit(unit: str) -> float:
    """Return how many tesla one `unit` of a Tesla-meter is.

    Parameters
    ----------
    unit : str
        ``T``, ``mT``, ``uT``, ``nT``, ``G``, ``mG``, ``kG``, ``Oe``, ``kOe``, ``A/m``
        or ``kA/m`` in any case; Oe and A/m are read as flux density in air.

    Raises
    ------
    ValueError
        If the unit is none of these: a reading without a known unit is no reading.
    """
    factor = _TESLA_PER.get(unit.strip().lower())
    if factor is None:
        raise ValueError(
            f"unit of flux density must be one of T, mT, uT, nT, G, mG, kG, Oe, kOe, "
            f"A/m, kA/m; instead received {unit!r}"
        )
    return factor


_UNITS: dict[str, tuple[str, float]] = {
    **{u: ("length", f) for u, f in {
        "m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6,
        "μm": 1e-6, "micron": 1e-6, "microns": 1e-6, "nm": 1e-9, "in": 0.0254,
        "inch": 0.0254, "meter": 1.0, "metre": 1.0, "millimeter": 1e-3,
        "millimetre": 1e-3,
    }.items()},
    **{u: ("angle", f) for u, f in {
        "rad": 1.0, "mrad": 1e-3, "radian": 1.0, "radians": 1.0,
        "deg": math.pi / 180.0, "°": math.pi / 180.0, "degree": math.pi / 180.0,
        "degrees": math.pi / 180.0,
    }.items()},
    **{u: ("stress", f) for u, f in {
        "Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/m^2": 1.0, "N/m²": 1.0,
        "N/mm^2": 1e6, "N/mm²": 1e6,
    }.items()},
    **{u: ("curvature", f) for u, f in {
        "per_m": 1.0, "1/m": 1.0, "m^-1": 1.0, "m⁻¹": 1.0, "per_mm": 1e3,
        "1/mm": 1e3, "mm^-1": 1e3, "mm⁻¹": 1e3, "per_cm": 100.0, "1/cm": 100.0,
    }.items()},
    **{u: ("flux", _TESLA_PER[u.lower()]) for u in (
        "T", "mT", "uT", "µT", "μT", "nT", "kG", "G", "mG", "Oe", "kOe", "A/m", "kA/m",
    )},
    "tesla": ("flux", 1.0), "gauss": ("flux", 1e-4),
    "kg/m^3": ("density", 1.0), "kg/m³": ("density", 1.0), "kg_m3": ("density", 1.0),
    "g/cm^3": ("density", 1e3), "g/cm³": ("density", 1e3), "g_cm3": ("density", 1e3),
    "s": ("time", 1.0), "ms": ("time", 1e-3), "min": ("time", 60.0),
    "px": ("pixel", 1.0), "pixel": ("pixel", 1.0), "pixels": ("pixel", 1.0),
}  # fmt: skip
"""What a column's head or an option may name: dimension and factor to SI."""


def known_unit(text: str) -> bool:
    """Return whether `text` is a unit that columns may have."""
    return text.strip() in _UNITS


def unit_factor(unit: str, wanted: str) -> float | None:
    """Return what a number in `unit` is multiplied by to be in `wanted`.

    Oe, A/m and kA/m are read as flux density in air, or as the remanence they make.
    None if one of them is unknown or they measure different things. The case counts:
    mT is no MT.
    """
    if unit == wanted:
        return 1.0
    one, other = _UNITS.get(unit), _UNITS.get(wanted)
    if one is None or other is None or one[0] != other[0]:
        return None
    return one[1] / other[1]
