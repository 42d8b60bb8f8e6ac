"""What a surface probe reads at the end of a magnetised rod, and what that says.

The paper gives 25.07, 20.07 and 14.59 mT as the magnetisation of three rods of the same
material (GMC 1 to 3), whose sides are 1.25, 1.0 and 0.75 mm. A remanence belongs to the
material and would be one number. The reading of a probe whose sensitive spot stays at a
distance from the end face grows with the side, as these do. The stand-off model takes
each number as such a reading: the flux density on the axis of a square bar, at the
stand-off from its end face.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ...core.checks import finite, positive
from ...core.errors import InputError
from ...core.table import read_table
from ...sim import gmc
from ..runs.data import RunData

Array = NDArray[np.float64]


def probe_factor(side_mm: float, length_mm: float, standoff_mm: float) -> float:
    """Return flux density at the probe over the remanence of the rod.

    Parameters
    ----------
    side_mm, length_mm : float
        Of the square bar, magnetised along its length.
    standoff_mm : float
        Distance from the middle of its end face, along the axis.

    Notes
    -----
    The paper's Eq. 1 on the axis: (1/pi) [atan(a^2 / (2 z sqrt(4 z^2 + 2 a^2)))] from
    z = standoff + length to z = standoff. At the face itself it is one half.

    Raises
    ------
    InputError
        If a length is not above zero, or the stand-off is below it.
    """
    a = positive(side_mm, "side_mm", "mm")
    length = positive(length_mm, "length_mm", "mm")
    near = finite(standoff_mm, "standoff_mm", "mm")
    if near < 0.0:
        raise InputError(
            f"standoff_mm must be zero or above in mm; instead received {near:g}"
        )

    def face(z: float) -> float:
        return math.atan2(a * a, 2.0 * z * math.sqrt(4.0 * z * z + 2.0 * a * a))

    return (face(near) - face(near + length)) / math.pi


def remanence_from_probe_mT(
    reading_mT: float, *, side_mm: float, length_mm: float, standoff_mm: float
) -> float:
    """Return the remanence of a rod whose end gives `reading_mT` at a stand-off."""
    factor = probe_factor(side_mm, length_mm, standoff_mm)
    return finite(reading_mT, "reading_mT", "mT") / factor


def from_probe_reading(run: RunData, standoff_mm: float) -> RunData:
    """Return the run with its specimen's remanence read as a probe reading.

    The nominal moduli are raised by the same factor, so that the predicted shapes stay:
    in a field alone only the ratio shows.
    """
    specimen = run.specimen
    length = specimen.length_mm
    factor = 1.0 / probe_factor(specimen.side_mm, length, standoff_mm)
    sections = tuple(
        replace(
            section,
            E_MPa=section.E_MPa * factor,
            remanence_mT=(
                None if section.remanence_mT is None else section.remanence_mT * factor
            ),
        )
        for section in specimen.sections
    )
    truer = replace(
        specimen, remanence_mT=specimen.remanence_mT * factor, sections=sections
    )
    return replace(run, specimen=truer)


@dataclass(frozen=True, slots=True, kw_only=True)
class StandoffFit:
    """One remanence and one stand-off for the readings of several rods.

    Attributes
    ----------
    remanence_mT, remanence_sd_mT, standoff_mm, standoff_sd_mm : float
        With standard deviations from the residuals; NaN without a spare reading.
    sides_mm, readings_mT, predicted_mT, residual_percent : ndarray, shape (n,)
        Reading by reading.
    constant_percent : float
        RMS residual in percent if the readings were one remanence.
    power : float
        Exponent of the side with which the readings grow; 0 would be a remanence.
    """

    remanence_mT: float
    remanence_sd_mT: float
    standoff_mm: float
    standoff_sd_mm: float
    sides_mm: Array
    readings_mT: Array
    predicted_mT: Array
    residual_percent: Array
    constant_percent: float
    power: float

    @property
    def rms_percent(self) -> float:
        """RMS residual of the stand-off model, in percent."""
        return float(np.sqrt(np.mean(self.residual_percent**2)))

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers for a machine."""
        return {
            "remanence_mT": self.remanence_mT,
            "remanence_sd_mT": self.remanence_sd_mT,
            "standoff_mm": self.standoff_mm,
            "standoff_sd_mm": self.standoff_sd_mm,
            "sides_mm": self.sides_mm.tolist(),
            "readings_mT": self.readings_mT.tolist(),
            "predicted_mT": self.predicted_mT.tolist(),
            "residual_percent": self.residual_percent.tolist(),
            "rms_percent": self.rms_percent,
            "constant_percent": self.constant_percent,
            "power_of_side": self.power,
        }

    def lines(self) -> list[str]:
        """Return the result as text."""
        rows = [
            f"side {side:.3g} mm: read {read:.2f} mT, stand-off model {model:.2f} mT "
            f"({percent:+.1f} %)"
            for side, read, model, percent in zip(
                self.sides_mm,
                self.readings_mT,
                self.predicted_mT,
                self.residual_percent,
                strict=True,
            )
        ]
        return [
            *rows,
            f"readings grow as side^{self.power:.2f}; a remanence would not grow",
            f"one remanence for all misses by {self.constant_percent:.1f} % (RMS)",
            f"stand-off {self.standoff_mm:.3f} mm and remanence "
            f"{self.remanence_mT:.1f} mT miss by {self.rms_percent:.1f} % (RMS)",
        ]


def fit_standoff(
    sides_mm: Sequence[float], readings_mT: Sequence[float], lengths_mm: Sequence[float]
) -> StandoffFit:
    """Fit remanence and stand-off to probe readings of rods of one material.

    Parameters
    ----------
    sides_mm, readings_mT, lengths_mm : sequence of float, length n >= 2
        Rods of at least two sides.

    Raises
    ------
    InputError
        If there are fewer than two sides or a value is not above zero.
    """
    sides = np.array([positive(a, "side_mm", "mm") for a in sides_mm])
    readings = np.array([positive(abs(b), "reading_mT", "mT") for b in readings_mT])
    if len(np.unique(sides)) < 2 or len(sides) != len(readings):
        raise InputError(
            "a stand-off needs readings of rods of at least two sides; instead "
            f"received {len(np.unique(sides))} side(s) and {len(readings)} reading(s)"
        )

    def model(unknown: Array) -> Array:
        remanence, standoff = np.exp(unknown)
        return np.array(
            [
                remanence * probe_factor(a, length, standoff)
                for a, length in zip(sides, lengths_mm, strict=True)
            ]
        )

    def relative(unknown: Array) -> Array:
        return np.asarray(model(unknown) / readings - 1.0)

    found = least_squares(
        relative,
        np.log([5.0 * readings.mean(), 0.5 * sides.mean()]),
        method="trf",
        bounds=(np.log([1e-3, 1e-4]), np.log([1e5, 1e2])),
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
    )
    remanence, standoff = np.exp(found.x)
    spare = len(sides) - 2
    sd = np.full(2, math.nan)
    if spare > 0:
        jacobian = np.asarray(found.jac)
        information = jacobian.T @ jacobian
        variance = 2.0 * found.cost / spare
        sd = np.sqrt(np.diag(np.linalg.inv(information)) * variance)
    mean = readings.mean()
    predicted = model(found.x)
    return StandoffFit(
        remanence_mT=float(remanence),
        remanence_sd_mT=float(remanence * sd[0]),
        standoff_mm=float(standoff),
        standoff_sd_mm=float(standoff * sd[1]),
        sides_mm=sides,
        readings_mT=readings,
        predicted_mT=predicted,
        residual_percent=100.0 * (readings / predicted - 1.0),
        constant_percent=float(100.0 * np.sqrt(np.mean((readings / mean - 1.0) ** 2))),
        power=float(np.polyfit(np.log(sides), np.log(readings), 1)[0]),
    )


def read_probe_csv(
    path: Path | None,
) -> tuple[list[float], list[float], list[float]]:
    """Return sides, readings and lengths of a CSV; the paper's GMC 1 to 3 without one.

    Raises
    ------
    ConfigError
        If the file is missing or has not the columns side_mm and reading_mT.
    """
    if path is None:
        rods = [gmc(number) for number in (1, 2, 3)]
        return (
            [rod.side_mm for rod in rods],
            [rod.remanence_mT for rod in rods],
            [rod.length_mm for rod in rods],
        )
    table = read_table(path)
    table.require("side_mm", "reading_mT", hint="and length_mm, if not 30 mm")
    sides_mm = table.numbers("side_mm")
    lengths_mm = np.full_like(sides_mm, 30.0)
    if table.has("length_mm"):
        given = table.numbers("length_mm", blanks=True)
        lengths_mm = np.where(np.isnan(given), lengths_mm, given)
    return sides_mm.tolist(), table.numbers("reading_mT").tolist(), lengths_mm.tolist()
