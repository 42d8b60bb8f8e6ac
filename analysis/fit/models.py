"""Theories of field and rod set side by side, each with its own moduli."""

from __future__ import annotations

import math
from dataclasses import replace

from .fields import is_read
from .problem import MODELS
from .records import ModelFit, Suspect
from .result import FitResult
from .search import Limits
from .suspects import alternative

ALIKE = 2.0
"""Lead in Akaike's criterion up to which a theory is as good as the best."""


def compare_models(result: FitResult, limits: Limits) -> tuple[ModelFit, ...]:
    """Return all theories that can be fitted to the same lines, best first.

    All are set against the same errors: those that the lines show in the fit judged.
    """
    found = [_of(result)]
    shots = result.problem.shots
    if not any(is_read(shot.field) for shot in shots):
        for model in MODELS:
            if model != result.model:
                other = replace(result.problem, model=model)
                again = alternative(other, limits, result.unknowns)
                if again is not None:
                    found.append(_of(again))
    return tuple(sorted(found, key=lambda model: model.aic))


def better_models(result: FitResult, models: tuple[ModelFit, ...]) -> list[Suspect]:
    """Return the theories that leave less than the one fitted, as suspects."""
    (own,) = (model for model in models if model.model == result.model)
    return [
        Suspect(
            name=_NAMES[model.model], value=math.nan, sd=math.nan, unit="",
            delta_chi2=own.aic - model.aic,
        )
        for model in models
        if model.aic < own.aic
    ]  # fmt: skip


def _of(result: FitResult) -> ModelFit:
    free = int((result.linear.prior[:, 1] == 0.0).sum())
    return ModelFit(
        model=result.model,
        aic=result.linear.chi2 + 2.0 * free,
        rms_um=result.rms_um,
        E_MPa=result.E_MPa,
    )


_NAMES = {
    "magnet": "the magnet's field",
    "uniform": "a uniform field",
    "solid": "the magnet's field on a solid rod",
}


def model_sentence(models: tuple[ModelFit, ...]) -> str:
    """Return which theory the lines prefer, and by how much; empty for one alone."""
    if len(models) < 2:
        return ""
    best, others = models[0], models[1:]
    parts = []
    for other in others:
        lead = other.aic - best.aic
        change = [
            100.0 * (a / b - 1.0)
            for a, b in zip(other.E_MPa, best.E_MPa, strict=True)
            if math.isfinite(a) and math.isfinite(b)
        ]
        moved = f", moduli {min(change):+.1f} to {max(change):+.1f} %" if change else ""
        parts.append(
            f"{_NAMES[other.model]} leaves {other.rms_um:.2g} µm "
            f"(AIC +{lead:.3g}{moved})"
        )
    level = [_NAMES[o.model] for o in others if o.aic - best.aic < ALIKE]
    judged = f"is as good as {' and '.join(level)}" if level else "is preferred"
    return (
        f"{_NAMES[best.model]} leaves {best.rms_um:.2g} µm RMS and {judged}: "
        f"{'; '.join(parts)}"
    )
