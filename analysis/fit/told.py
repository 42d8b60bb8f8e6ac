"""What the moduli rest on: told numbers that the data of a fit cannot test.

In a magnetic field a rod shows its modulus over its remanence and its size alone. What
was told of these is believed, and a fit looks as good whatever was told: so it says of
what the data tell nothing, and by how much the moduli would be off.
"""

from __future__ import annotations

import numpy as np

from ...core.cross_section import SIZES
from .linear import Linear
from .nuisance import scope_of, unit_of
from .problem import Problem, Shot
from .records import Told

UNTOLD = 0.9
"""Share of its prior's deviation from which on the data say nothing of a number."""

MATTERS = 0.005
"""Least change of a modulus that is worth a word."""


def rests_on(problem: Problem, linear: Linear, known: list[int]) -> tuple[Told, ...]:
    """Return the numbers that the data leave as told, those of most effect first.

    Parameters
    ----------
    known : list of int
        The moduli that were identified.

    Notes
    -----
    Where a nuisance u (in deviations of its prior) is off by one, the logarithms of the
    moduli are off by C_Eu / C_uu, of the covariance C of all.
    """
    covariance = np.linalg.pinv(linear.information, hermitian=True)
    found = []
    for k, (name, index) in enumerate(problem.nuisances):
        at = len(problem.names) + k
        variance = float(covariance[at, at])
        change = covariance[known, at] / variance
        if variance**0.5 < UNTOLD or not np.any(np.abs(change) > MATTERS):
            continue
        shots = (s for s in problem.shots if getattr(s.owner, scope_of(name)) == index)
        number = _number(name, next(shots))
        if not number:
            continue
        found.append(
            Told(
                name=problem.label(k),
                number=number,
                sd=float(problem.nuisance_sd[k]),
                unit=unit_of(name),
                moduli_percent=tuple((100.0 * change).tolist()),
            )
        )
    return tuple(sorted(found, key=lambda told: -max(map(abs, told.moduli_percent))))


def _number(name: str, shot: Shot) -> str:
    """Return what the files say of a nuisance; empty where that is nothing."""
    rod = shot.specimen
    if name == "remanence_percent":
        return f"remanence_mT = {rod.remanence_mT:g}"
    if name == "side_percent":
        sizes = [f"{size} = {getattr(rod, size):g}" for size in SIZES[rod.shape]]
        return f"{', '.join(sizes)} of a {rod.shape} rod"
    if name == "density_percent" and rod.density_kg_m3 is not None:
        return f"density_kg_m3 = {rod.density_kg_m3:g}"
    return {
        "length_mm": f"a length of {rod.length_mm:g} mm",
        "magnet_percent": "the magnet's strength",
        "meter_percent": "the readings of the field",
        "gap_mm": "the gaps",
    }.get(name, "")
