"""Does the Tesla-meter fit the magnet? Each reading against the field of the magnet.

A wrong step, a wrong unit or a misprint shows as a reading that the stated remanence
cannot give at that gap. The field is that of a cuboid on its axis (the paper's Eqs.
1-4; `magbend.sim`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...core.checks import finite, positive
from ...core.errors import InputError
from ...core.magnet import Magnet
from ...core.units import mT_from_T
from ...sim import axis_share

Sides = tuple[float, float, float]

_UNIT_SLIPS = (
    (10.0, "it is ten times that: is the unit G, not mT?"),
    (0.1, "it is a tenth of that: is the unit mT, not G?"),
    (-1.0, "it has the other sign: is the probe or the magnet turned round?"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldVerdict:
    """One reading against what the stated remanence gives there.

    Parameters
    ----------
    gap_mm, flux_mT : float
        The reading.
    stated_T : float
        The remanence it is held against.
    predicted_mT : float
        What that remanence gives at this gap.
    difference_percent : float
        Measured minus predicted, in percent of the predicted.
    gap_error_mm : float
        The error of the gap that would explain the difference by itself.
    remanence_T : float
        The remanence that this reading alone gives.
    verdict : str
        ``ok``, or a sentence.
    """

    gap_mm: float
    flux_mT: float
    stated_T: float
    predicted_mT: float
    difference_percent: float
    gap_error_mm: float
    remanence_T: float
    verdict: str


def check_readings(
    gaps_mm: Sequence[float],
    flux_mT: Sequence[float],
    remanence_T: float | Sequence[float],
    *,
    sides_mm: Sides = (55.0, 55.0, 55.0),
    sd_mT: Sequence[float | None] | None = None,
    tolerance_percent: float = 1.0,
) -> tuple[FieldVerdict, ...]:
    """Hold every reading against the field of the magnet.

    Parameters
    ----------
    gaps_mm, flux_mT : sequence of float
        Readings on the axis.
    remanence_T : float or sequence of float
        The remanence stated for the magnet, or beside each reading.
    sides_mm : tuple of float
        Sides of the magnet, the last along the polarisation, in mm.
    sd_mT : sequence of float, optional
        Standard deviations; two of them are allowed where that is more.
    tolerance_percent : float
        How far a reading may be off, in percent.

    Returns
    -------
    tuple of FieldVerdict
        In the order given.

    Raises
    ------
    InputError
        If the lists differ in length or a number cannot be.
    """
    count = len(gaps_mm)
    stated = (
        [float(remanence_T)] * count
        if isinstance(remanence_T, (int, float))
        else [float(value) for value in remanence_T]
    )
    deviations = list(sd_mT) if sd_mT is not None else [None] * count
    if not count == len(flux_mT) == len(stated) == len(deviations):
        raise InputError(
            f"gaps_mm, flux_mT, remanence_T and sd_mT must be of one length; instead "
            f"received {count}, {len(flux_mT)}, {len(stated)} and {len(deviations)}"
        )
    positive(tolerance_percent, "tolerance_percent", "percent")
    return tuple(
        _judge(gap, flux, remanence, sides_mm, sd, tolerance_percent)
        for gap, flux, remanence, sd in zip(
            gaps_mm, flux_mT, stated, deviations, strict=True
        )
    )


def check_against_magnet(
    gaps_mm: Sequence[float],
    flux_mT: Sequence[float],
    magnet: Magnet,
    *,
    sd_mT: Sequence[float | None] | None = None,
    tolerance_percent: float = 1.0,
) -> tuple[FieldVerdict, ...]:
    """Hold every reading against one magnet (see `check_readings`)."""
    return check_readings(
        gaps_mm, flux_mT, magnet.remanence_T, sides_mm=magnet.sides_mm, sd_mT=sd_mT,
        tolerance_percent=tolerance_percent,
    )  # fmt: skip


def _judge(
    gap_mm: float,
    flux_mT: float,
    remanence_T: float,
    sides_mm: Sides,
    sd_mT: float | None,
    tolerance_percent: float,
) -> FieldVerdict:
    positive(gap_mm, "gap_mm", "mm")
    finite(flux_mT, "flux_mT", "mT")
    share = float(axis_share(gap_mm, sides_mm))
    predicted_mT = mT_from_T(remanence_T * share)
    step_mm = 1e-4 * sides_mm[2]
    slope = mT_from_T(
        remanence_T
        * (
            float(axis_share(gap_mm + step_mm, sides_mm))
            - float(axis_share(gap_mm - step_mm, sides_mm))
        )
    ) / (2.0 * step_mm)
    difference_mT = flux_mT - predicted_mT
    percent = 100.0 * difference_mT / predicted_mT
    gap_error_mm = difference_mT / slope
    allowed_mT = max(
        abs(predicted_mT) * tolerance_percent / 100.0, 2.0 * (sd_mT or 0.0)
    )
    verdict = "ok"
    if abs(difference_mT) > allowed_mT:
        verdict = (
            f"at {gap_mm:g} mm a remanence of {remanence_T:.4f} T gives "
            f"{predicted_mT:.2f} mT, the reading is {flux_mT:.2f} mT ({percent:+.1f} "
            f"%): {_hint(flux_mT / predicted_mT, gap_error_mm)}"
        )
    return FieldVerdict(
        gap_mm=gap_mm, flux_mT=flux_mT, stated_T=remanence_T,
        predicted_mT=predicted_mT, difference_percent=percent,
        gap_error_mm=gap_error_mm, remanence_T=flux_mT * 1e-3 / share, verdict=verdict,
    )  # fmt: skip


def _hint(ratio: float, gap_error_mm: float) -> str:
    for slip, sentence in _UNIT_SLIPS:
        if abs(ratio / slip - 1.0) < 0.15:
            return sentence
    return (
        f"a gap off by {gap_error_mm:+.2f} mm would explain it; check step, probe and "
        f"reading"
    )
