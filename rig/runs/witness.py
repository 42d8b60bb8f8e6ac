"""What the field says about where the stage is: a witness that a run may call.

The rig knows no magnets; whoever does hands a judge in
(`magbend.analysis.runs.witness`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

from ..meter.protocol import Flux

FLAG = "field_disagrees"
Reading = tuple[float, float]
"""A gap in mm, and the flux density read there in mT."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldDoubt:
    """One reading against the others and the magnet.

    Attributes
    ----------
    sentence : str
        What is wrong with it; empty if nothing is.
    predicted_mT : float or None
        What the magnet gives at that gap, if there is one.
    gap_error_mm : float or None
        The error of the gap that would explain the difference by itself.
    is_impossible : bool
        No gap and no magnet explain it: the number itself is wrong.
    """

    sentence: str = ""
    predicted_mT: float | None = None
    gap_error_mm: float | None = None
    is_impossible: bool = False

    def as_dict(self) -> dict[str, Any]:
        """Return it as a step keeps it."""
        return asdict(self)


class Witness(Protocol):
    """Who judges readings."""

    def judge(
        self,
        gap_mm: float,
        flux_mT: float,
        sd_mT: float | None,
        earlier: Sequence[Reading],
    ) -> FieldDoubt:
        """Return what a reading says, given those of the same run before it."""
        ...


class NoWitness:
    """Nobody: every reading is taken as it is."""

    def judge(
        self,
        gap_mm: float,
        flux_mT: float,
        sd_mT: float | None,
        earlier: Sequence[Reading],
    ) -> FieldDoubt:
        """Return that nothing is wrong."""
        del gap_mm, flux_mT, sd_mT, earlier
        return FieldDoubt()


def testify(
    witness: Witness, gap_mm: float, flux: Flux, earlier: Sequence[Reading]
) -> FieldDoubt:
    """Return what the flux density of a step says; nothing without a number."""
    if flux.flux_mT is None:
        return FieldDoubt()
    return witness.judge(gap_mm, flux.flux_mT, flux.sd_mT, earlier)
