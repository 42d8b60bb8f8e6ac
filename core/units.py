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


def m_from_mm(length_mm: float) -> float:
    """Return a length in m."""
    return length_mm * 1e-3


def mm_from_m(length_m: float) -> float:
    """Return a length in mm."""
    return length_m * 1e3


def Pa_from_MPa(stress_MPa: float) -> float:
    """Return a modulus or stress in Pa."""
    return stress_MPa * 1e6


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
