"""What a fit is said to be worth: plain records, in the words of ``fit.json``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LONG_ENOUGH = 50.0
"""Autocorrelation times that a chain must last (emcee's own advice)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Suspect:
    """A change, and what it gains.

    Attributes
    ----------
    name : str
        A nuisance, or another change (module docstring).
    value, sd : float
        Best value and its standard deviation; NaN where the change is a choice.
    unit : str
    delta_chi2 : float
        How far the sum of squares falls.
    key : (str, int)
        The nuisance and what it is of (`Problem.nuisances`); empty for a choice.
    """

    name: str
    value: float
    sd: float
    unit: str
    delta_chi2: float
    key: tuple[str, int] = ("", -1)

    def as_dict(self) -> dict[str, Any]:
        """Return the words of ``fit.json``."""
        return {
            "name": self.name,
            "value": self.value,
            "sd": self.sd,
            "unit": self.unit,
            "delta_chi2": self.delta_chi2,
        }

    def sentence(self) -> str:
        """Return the change in words."""
        if math.isnan(self.value):
            return f"{self.name} (chi2 falls by {self.delta_chi2:.3g})"
        return (
            f"{self.name} = {self.value:+.3g} +- {self.sd:.2g} {self.unit} "
            f"(chi2 falls by {self.delta_chi2:.3g})"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelFit:
    """One theory, fitted.

    Attributes
    ----------
    model : str
        Of `problem.MODELS`.
    aic : float
        Akaike's criterion, chi2 + 2 p: lower is better.
    rms_um : float
        What is left along the lines.
    E_MPa : tuple of float
        The moduli that this theory finds.
    """

    model: str
    aic: float
    rms_um: float
    E_MPa: tuple[float, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the words of ``fit.json``."""
        return {
            "model": self.model,
            "aic": self.aic,
            "rms_um": self.rms_um,
            "E_MPa": list(self.E_MPa),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """A number that was told, and that the data of a fit cannot test.

    Attributes
    ----------
    name : str
        Its nuisance.
    number : str
        What the files say, in words.
    sd : float
        How well it is taken to be known: the prior's standard deviation.
    unit : str
    moduli_percent : tuple of float
        Change of each modulus that is known if the number is larger by `sd`.
    """

    name: str
    number: str
    sd: float
    unit: str
    moduli_percent: tuple[float, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the words of ``fit.json``."""
        return {
            "name": self.name,
            "number": self.number,
            "sd": self.sd,
            "unit": self.unit,
            "moduli_percent": list(self.moduli_percent),
            "sentence": self.sentence(),
        }

    def sentence(self) -> str:
        """Return it in words."""
        low, high = min(self.moduli_percent), max(self.moduli_percent)
        ends = list(dict.fromkeys(f"{end:+.2g}" for end in (low, high)))
        return (
            f"{self.number} (+- {self.sd:.2g} {self.unit}; "
            f"so much more: moduli {' to '.join(ends)} %)"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Whether a fit can be believed.

    Attributes
    ----------
    verdict : {"supported", "doubtful", "contradicted"}
    p_value : float
        How often a right model would look as bad.
    reasons : tuple of str
        Why it is not supported, a sentence each.
    suspects : tuple of Suspect
        Single changes that would explain the misfit, best first.
    models : tuple of ModelFit
        Theories of field and rod, each with its own moduli, best first.
    flags : dict of str to int
        Doubts of the measurement, and of how many photographs.
    pulls : dict of str to float
        How far each nuisance was pulled from its prior, in standard deviations.
    rests_on : tuple of Told
        What was told, moves the moduli, and cannot be tested by the data.
    """

    verdict: str
    p_value: float
    reasons: tuple[str, ...]
    suspects: tuple[Suspect, ...]
    models: tuple[ModelFit, ...]
    flags: dict[str, int]
    pulls: dict[str, float]
    rests_on: tuple[Told, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the words of ``fit.json``."""
        return {
            "verdict": self.verdict,
            "p_value": self.p_value,
            "reasons": list(self.reasons),
            "pulls": self.pulls,
            "suspects": [suspect.as_dict() for suspect in self.suspects],
            "models": [model.as_dict() for model in self.models],
            "flags": self.flags,
            "rests_on": [told.as_dict() for told in self.rests_on],
        }

    def told_sentence(self) -> str:
        """Return on what the moduli rest, in words; empty where on nothing."""
        if not self.rests_on:
            return ""
        told = ", ".join(told.sentence() for told in self.rests_on)
        return f"no photograph tests what the moduli rest on: {told}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior:
    """Samples of the moduli.

    Attributes
    ----------
    parameters : tuple of str
        Columns of `samples`.
    samples : ndarray, shape (n, p)
        In MPa, after burn-in.
    acceptance : float
        Mean accepted share; 0.2 to 0.5 is healthy.
    autocorrelation : float
        Longest integrated autocorrelation time in steps, NaN if the chain is too short
        to tell.
    steps : int
        Of each walker.
    """

    parameters: tuple[str, ...]
    samples: Array
    acceptance: float
    autocorrelation: float
    steps: int

    @property
    def doubt(self) -> str:
        """A sentence on chains that are too short to be believed, else empty."""
        needed = LONG_ENOUGH * self.autocorrelation
        if self.steps >= needed:
            return ""
        if not math.isfinite(needed):
            return (
                f"{self.steps} steps are too few even to tell how long the chains must "
                "be: the quantiles are not to be believed; ask for ten times as many"
            )
        return (
            f"{self.steps} steps are too few: neighbouring samples agree over "
            f"{self.autocorrelation:.0f} steps; ask for {math.ceil(needed)} or more"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return quantiles for a machine."""
        low, middle, high = np.quantile(self.samples, [0.025, 0.5, 0.975], axis=0)
        return {
            "parameters": list(self.parameters),
            "q2_5": low.tolist(),
            "median": middle.tolist(),
            "q97_5": high.tolist(),
            "acceptance": self.acceptance,
            "autocorrelation_steps": self.autocorrelation,
            "samples": len(self.samples),
            "doubt": self.doubt,
        }
