"""Moduli from how a rod rings, beside those of a fit to its shapes in a field.

A rod that rings without a field tells E by its mass alone; a fit in a magnet's field
tells E over its remanence. Where they agree, the remanence is right. One frequency
tells one number: by which factor all moduli of the specimen are to be multiplied.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..core.checks import positive
from ..core.errors import ConfigError, InputError
from ..core.json import read_json
from ..core.specimen import Specimen
from ..sim import first_mode

AGREE = 2.0
"""Deviations within which two factors agree."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Factor:
    """By what all moduli of a specimen are to be multiplied.

    Parameters
    ----------
    value, relative_sd : float
        The factor, and its standard deviation over it.
    E_MPa : tuple of float
        The moduli that it makes, root first.
    not_stated : tuple of str
        Deviations that the specimen does not state, and that are not in it.
    """

    value: float
    relative_sd: float
    E_MPa: tuple[float, ...]
    not_stated: tuple[str, ...] = ()


def ring_factor(
    specimen: Specimen, frequency_Hz: float, *, frequency_sd_Hz: float = 0.0,
    damping_ratio: float = 0.0,
) -> Factor:  # fmt: skip
    """Return the moduli that let a specimen ring at a frequency.

    Parameters
    ----------
    specimen : Specimen
        Its density, sizes, and how the moduli stand to one another.
    frequency_Hz, frequency_sd_Hz : float
        Of the damped vibration, and its standard deviation.
    damping_ratio : float
        Of the critical damping.

    Raises
    ------
    InputError
        If the density is missing or a number cannot be.

    Notes
    -----
    f goes with a / L^2 (E / rho)^(1/2), so E with f^2 rho L^4 / a^2.
    """
    measured = positive(frequency_Hz, "frequency", "Hz")
    if not 0.0 <= damping_ratio < 1.0:
        raise InputError(
            "a rod that rings is damped by a ratio from 0 to 1; instead received "
            f"{damping_ratio:g}"
        )
    measured /= math.sqrt(1.0 - damping_ratio**2)
    value = (measured / first_mode(specimen).frequency_Hz) ** 2
    parts = {
        "density_sd_kg_m3": (specimen.density_sd_kg_m3, specimen.density_kg_m3, 1.0),
        "side_sd_mm": (specimen.side_sd_mm, specimen.side_mm, 2.0),
        "length_sd_mm": (specimen.length_sd_mm, specimen.length_mm, 4.0),
    }
    stated = [power * sd / size for sd, size, power in parts.values() if sd and size]
    return Factor(
        value=value,
        relative_sd=math.hypot(2.0 * frequency_sd_Hz / frequency_Hz, *stated),
        E_MPa=tuple(value * section.E_MPa for section in specimen.sections),
        not_stated=tuple(name for name, part in parts.items() if part[0] is None),
    )


def fit_factor(specimen: Specimen, path: Path) -> Factor:
    """Return by what a fit multiplies the square of a specimen's frequency.

    Parameters
    ----------
    specimen : Specimen
        The one that was fitted.
    path : Path
        ``fit.json`` of `magbend analysis fit`.

    Raises
    ------
    ConfigError
        If it is no such file, of a rod with other sections, or tells no moduli.
    """
    data = read_json(path)
    sections = specimen.sections
    try:
        E = np.array(data["E_MPa"], dtype=np.float64)
        sd = np.array(data["E_sd_MPa"], dtype=np.float64)
        alike = np.array(data["correlation"], dtype=np.float64)[: len(E), : len(E)]
    except (KeyError, TypeError, ValueError, IndexError):
        raise ConfigError(f"{path}: is no fit.json of `magbend analysis fit`") from None
    if len(E) != len(sections):
        raise ConfigError(
            f"{path}: is of a rod of {len(E)} sections; specimen {specimen.name!r} has "
            f"{len(sections)}"
        )
    if alike.shape != (len(E), len(E)) or not np.all(np.isfinite([*E, *sd])):
        raise ConfigError(f"{path}: the fit does not tell all moduli; see its verdict")
    fitted = replace(
        specimen,
        sections=tuple(
            replace(section, E_MPa=float(value))
            for section, value in zip(sections, E, strict=True)
        ),
    )
    mode = first_mode(fitted)
    pull = np.array(mode.shares) * sd / E
    return Factor(
        value=(mode.frequency_Hz / first_mode(specimen).frequency_Hz) ** 2,
        relative_sd=math.sqrt(max(float(pull @ alike @ pull), 0.0)),
        E_MPa=tuple(float(value) for value in E),
    )


def apart(first: Factor, second: Factor) -> float:
    """Return how far two factors are apart, in deviations."""
    sd = math.hypot(first.relative_sd, second.relative_sd)
    off = abs(math.log(first.value / second.value))
    return off / sd if sd > 0.0 else (math.inf if off else 0.0)
