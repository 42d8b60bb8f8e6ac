"""What a Tesla-meter is to the runner: flux densities whose outcome is typed.

An overload is not a number and not a NaN, silence is not zero: each reading says what
it is. The flux density is that along the probe's axis, in mT, after the sign and the
zero offset of the rig file were applied; the raw replies are kept.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from ..clock import Check, go_on

Outcome = Literal[
    "ok", "overload", "silent", "torn", "garbled", "unit", "manual", "none",
]  # fmt: skip
"""torn: an answer without its end; garbled: one that is not understood; unit: the meter
was switched to another unit meanwhile."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """One reply of the meter.

    Parameters
    ----------
    outcome : str
        ``ok``, ``overload``, ``silent`` (nothing in time), ``torn`` (an answer without
        its end), ``garbled`` (not understood) or ``unit`` (in another unit).
    flux_mT : float or None
        Only with ``ok``.
    raw : str
        The reply as it came.
    """

    outcome: Outcome
    flux_mT: float | None = None
    raw: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flux:
    """The flux density of one step, from several samples.

    Parameters
    ----------
    status : str
        As of a sample, or ``manual`` (typed in) or ``none`` (no meter).
    flux_mT, sd_mT : float or None
        Mean and standard deviation of the good samples; None without any.
    samples : int
        How many good samples that is.
    raw : tuple of str
        All replies.
    """

    status: Outcome
    flux_mT: float | None = None
    sd_mT: float | None = None
    samples: int = 0
    raw: tuple[str, ...] = ()


class Meter(Protocol):
    """A Tesla-meter that is open."""

    @property
    def identity(self) -> dict[str, Any]:
        """What the manifest keeps: model, port, unit, zero offset, replies of setup."""
        ...

    def read_flux(self, samples: int, *, gap_mm: float, check: Check = go_on) -> Flux:
        """Return the flux density now, from `samples` new readings.

        `check` is called while it waits for them.

        Raises
        ------
        MeterError
            If the port is lost or the unit cannot be known; a silent or overloaded
            meter is a status, not an error.
        """
        ...

    def close(self) -> None:
        """Let the port go; harmless when done twice."""
        ...


def combine(samples: Sequence[Sample], *, zero_mT: float = 0.0, sign: int = 1) -> Flux:
    """Return the flux density of a row of samples.

    One overloaded sample overloads the row: the mean of the others would be biased.
    Otherwise at least half of the samples must be good.
    """
    raw = tuple(sample.raw for sample in samples)
    outcomes = [sample.outcome for sample in samples]
    good = [sample.flux_mT for sample in samples if sample.flux_mT is not None]
    if "overload" in outcomes:
        return Flux(status="overload", raw=raw)
    if not good or 2 * len(good) < len(samples):
        worst: tuple[Outcome, ...] = ("unit", "garbled", "torn", "silent")
        status = next(kind for kind in worst if kind in outcomes or kind == "silent")
        return Flux(status=status, raw=raw)
    flux_mT = [sign * value - zero_mT for value in good]
    sd_mT = statistics.stdev(flux_mT) if len(flux_mT) > 1 else None
    return Flux(
        status="ok", flux_mT=math.fsum(flux_mT) / len(flux_mT), sd_mT=sd_mT,
        samples=len(flux_mT), raw=raw,
    )  # fmt: skip


Ask = Callable[[float], float | None]
"""Ask the person at the bench for the reading at a gap in mm."""


class NoMeter:
    """No meter at all: every step says so."""

    @property
    def identity(self) -> dict[str, Any]:
        """Return that there is none."""
        return {"driver": "none"}

    def read_flux(self, samples: int, *, gap_mm: float, check: Check = go_on) -> Flux:
        """Return a flux density of status ``none``."""
        del samples, gap_mm
        return Flux(status="none")

    def close(self) -> None:
        """Do nothing."""


class ManualMeter:
    """Readings of a hand meter, typed in, per gap.

    Parameters
    ----------
    flux_mT : mapping of float to float
        Flux density in mT per gap in mm.
    ask : callable, optional
        Called with a gap that has none; returns what the person reads there, in mT, or
        None.
    """

    def __init__(self, flux_mT: Mapping[float, float], ask: Ask | None = None) -> None:
        self._flux_mT = dict(flux_mT)
        self._ask = ask

    @property
    def identity(self) -> dict[str, Any]:
        """Return that the readings were typed in."""
        return {"driver": "manual", "unit": "mT"}

    def read_flux(self, samples: int, *, gap_mm: float, check: Check = go_on) -> Flux:
        """Return the typed reading of this gap, else a status ``none``."""
        del samples
        flux_mT = self._flux_mT.get(gap_mm)
        if flux_mT is None and self._ask is not None:
            flux_mT = self._ask(gap_mm)
        if flux_mT is None:
            return Flux(status="none")
        return Flux(status="manual", flux_mT=flux_mT, samples=1)

    def close(self) -> None:
        """Do nothing."""
