"""Judge the readings of a run as they come: unit, order, magnet, and one another.

A reading tells where the stage is: 1 mm is 2 to 4 % of the field of a 55 mm cube. The
declared magnet is known to some percent only, so a reading is held against it with that
slack, and more closely against the earlier readings of the same run, which share the
magnet and its error.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import replace

from ...core.magnet import Magnet
from ...rig import FieldDoubt, Plan, Reading
from .field_check import FieldVerdict, check_against_magnet

STRONGEST_T = 1.5
"""Sintered NdFeB has at most this remanence."""

MAGNET_PERCENT = 5.0
RUN_PERCENT = 2.0
_SLIP = 0.15


class FieldWitness:
    """Hold readings against a magnet and against each other.

    Parameters
    ----------
    magnet : Magnet or None
        The declared one; without it only the order of the readings is judged.
    magnet_percent, run_percent : float
        How far a reading may be off the magnet, and off the run's other readings.
    """

    def __init__(
        self,
        magnet: Magnet | None,
        *,
        magnet_percent: float = MAGNET_PERCENT,
        run_percent: float = RUN_PERCENT,
    ) -> None:
        self._magnet = magnet
        self._magnet_percent = magnet_percent
        self._run_percent = run_percent

    def judge(
        self,
        gap_mm: float,
        flux_mT: float,
        sd_mT: float | None,
        earlier: Sequence[Reading],
    ) -> FieldDoubt:
        """Return what a reading says (see `magbend.rig.runs.witness.Witness`)."""
        disorder = _disorder(gap_mm, flux_mT, sd_mT or 0.0, earlier)
        magnet = self._magnet
        if magnet is None:
            return FieldDoubt(sentence=disorder, is_impossible=bool(disorder))
        reading, percent = (gap_mm, flux_mT), self._magnet_percent
        alone = _verdict(magnet, reading, sd_mT=sd_mT, percent=percent)
        others = [_verdict(magnet, other) for other in earlier]
        beside = alone
        if others:  # they share the magnet and its error
            scale = statistics.median(v.flux_mT / v.predicted_mT for v in others)
            # A reading without a scatter was typed: hand meters show whole mT.
            percent = self._magnet_percent if sd_mT is None else self._run_percent
            beside = _verdict(
                magnet, reading, sd_mT=sd_mT, scale=scale, percent=percent
            )
        sentence = _slip(alone) or disorder
        is_impossible = bool(sentence)
        for found, among in ((beside, bool(others)), (alone, False)):
            if not sentence and found.verdict != "ok":
                sentence = _beside(found, among)
        return FieldDoubt(
            sentence=sentence,
            predicted_mT=beside.predicted_mT,
            gap_error_mm=beside.gap_error_mm,
            is_impossible=is_impossible,
        )


def _verdict(
    magnet: Magnet,
    reading: Reading,
    *,
    sd_mT: float | None = None,
    scale: float = 1.0,
    percent: float = MAGNET_PERCENT,
) -> FieldVerdict:
    """Hold the size of one reading against a magnet that is `scale` times as strong."""
    gap_mm, flux_mT = reading
    scaled = replace(magnet, remanence_T=magnet.remanence_T * scale)
    return check_against_magnet(
        [gap_mm], [abs(flux_mT)], scaled, sd_mT=[sd_mT], tolerance_percent=percent
    )[0]


def _slip(found: FieldVerdict) -> str:
    """Return that the unit or the magnet cannot be, from the size alone."""
    ratio = found.flux_mT / found.predicted_mT
    said = (
        f"{found.flux_mT:g} mT at {found.gap_mm:g} mm, where the magnet of the rig "
        f"file gives {found.predicted_mT:.1f} mT"
    )
    if abs(ratio / 10.0 - 1.0) < _SLIP:
        return f"{said}: is that gauss? 10 G are 1 mT"
    if abs(ratio / 0.1 - 1.0) < _SLIP:
        return f"{said}: a tenth of it; is the unit right?"
    if abs(ratio / 1000.0 - 1.0) < _SLIP:
        return f"{said}: is that microtesla?"
    if found.remanence_T > STRONGEST_T:
        return (
            f"{said}: that needs a remanence of {found.remanence_T:.2f} T, and no "
            f"magnet has more than {STRONGEST_T:g} T"
        )
    return ""


def _disorder(
    gap_mm: float, flux_mT: float, sd_mT: float, earlier: Sequence[Reading]
) -> str:
    """Return that the field does not grow toward the magnet."""
    for before_mm, before_mT in earlier:
        nearer = gap_mm < before_mm
        more = abs(flux_mT) - abs(before_mT)
        if gap_mm != before_mm and (more if nearer else -more) < -2.0 * sd_mT:
            return (
                f"{flux_mT:g} mT at {gap_mm:g} mm after {before_mT:g} mT at "
                f"{before_mm:g} mm: the field must grow toward the magnet; were two "
                "readings exchanged?"
            )
    return ""


def _beside(found: FieldVerdict, has_others: bool) -> str:
    what = "the other readings of this run" if has_others else "the magnet"
    return (
        f"the field at {found.gap_mm:g} mm is {found.difference_percent:+.1f} % off "
        f"what {what} would give: a gap off by {found.gap_error_mm:+.2f} mm would "
        "explain it"
    )


def witness_of(plan: Plan) -> FieldWitness:
    """Return the judge of a plan's readings: the magnet of its rig file."""
    magnet, flux = plan.rig.magnet, plan.model.flux
    return FieldWitness(
        magnet.magnet() if magnet else None,
        magnet_percent=flux.magnet_percent,
        run_percent=flux.run_percent,
    )
