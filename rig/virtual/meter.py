"""The twin's Tesla-meter: noise, overload and silence."""

from __future__ import annotations

import random
from collections.abc import Callable, Collection
from typing import Any, Literal

from ..clock import Check, go_on
from ..meter.protocol import Flux, Sample, combine

MeterFault = Literal["overload", "silent"]
FluxAt = Callable[[float], float]
"""``flux(gap_mm)`` returns the flux density in mT at the probe."""


class VirtualMeter:
    """A Tesla-meter on the computed bench.

    Parameters
    ----------
    flux : callable
        Called as ``flux(gap_mm)``; returns the true flux density in mT.
    gap : callable
        Returns the present gap in mm: the twin stage's own, true position.
    generator : random.Random
        Where the noise comes from.
    noise_mT : float
        Standard deviation of one reading.
    overload_mT : float
        From here on the meter says OL.
    silent_gaps_mm : collection of float
        Planned gaps at which it does not answer.

    Attributes
    ----------
    trouble : callable
        Returns what is wrong with it now, or None.
    """

    def __init__(
        self,
        flux: FluxAt,
        gap: Callable[[], float],
        generator: random.Random,
        *,
        noise_mT: float = 0.05,
        overload_mT: float = 300.0,
        silent_gaps_mm: Collection[float] = (),
    ) -> None:
        self._flux = flux
        self._gap = gap
        self._generator = generator
        self._noise_mT = noise_mT
        self._overload_mT = overload_mT
        self._silent_gaps_mm = frozenset(silent_gaps_mm)
        self.trouble: Callable[[], MeterFault | None] = lambda: None

    @property
    def identity(self) -> dict[str, Any]:
        """Return that it is the twin's."""
        return {"driver": "twin", "unit": "mT", "zero_mT": 0.0}

    def read_flux(self, samples: int, *, gap_mm: float, check: Check = go_on) -> Flux:
        """Return the flux density at the present gap with noise."""
        check()
        is_silent = gap_mm in self._silent_gaps_mm or self.trouble() == "silent"
        return combine([self._sample(is_silent) for _ in range(samples)])

    def close(self) -> None:
        """Do nothing."""

    def _sample(self, is_silent: bool) -> Sample:
        if is_silent:
            return Sample(outcome="silent")
        flux_mT = self._flux(self._gap()) + self._generator.gauss(0.0, self._noise_mT)
        if abs(flux_mT) >= self._overload_mT or self.trouble() == "overload":
            return Sample(outcome="overload", raw="OL")
        raw = f"{flux_mT:+.3f} mT"
        return Sample(outcome="ok", flux_mT=float(raw[:-3]), raw=raw)
