"""Whether a fit can be believed, and which single change would explain its misfit.

The p-value is that of three tests together: the misfit as a whole and that of the lines
alone, which no unknown explains, against the errors that the lines show (F tests), and
the best of all single changes (score tests). If the model is right it is even between 0
and 1.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from .linear import Linear
from .models import better_models, compare_models
from .records import Verdict
from .result import FitResult
from .search import Limits
from .suspects import refitted, scored
from .told import rests_on

Array = NDArray[np.float64]

DOUBTFUL, CONTRADICTED = 0.05, 0.001
"""p-values below which a fit is doubtful, and contradicted."""

FAR = 5.0
"""Factor from what the specimen's file says, of all moduli alike, that is no surprise
of the material any more but that of a unit."""

SERIOUS_FLAGS = (
    "length_mismatch", "direction_doubtful", "joints_doubtful", "width_mismatch",
    "colour_mismatch",
)  # fmt: skip
"""Doubts of a photograph's measurement that a fit shares."""


def judge(result: FitResult, limits: Limits) -> Verdict:
    """Return the verdict on a fit."""
    changes = scored(result)
    linear = result.linear
    tests = (
        _p_of_misfit(linear, linear.shape_chi2, linear.freedom),
        _p_of_misfit(linear, *linear.unexplained),
        _p_of_best(result, [change.delta_chi2 for change in changes]),
    )
    p_value = min(1.0, len(tests) * min(tests))
    flags: dict[str, int] = {}
    for shot in result.problem.shots:
        for flag in shot.flags:
            flags[flag] = flags.get(flag, 0) + 1
    serious = {name: count for name, count in flags.items() if name in SERIOUS_FLAGS}
    words = "supported"
    far = _far_from_told(result)
    if p_value < DOUBTFUL or serious or result.on_bounds or far:
        words = "doubtful"
    if p_value < CONTRADICTED:
        words = "contradicted"
    models = compare_models(result, limits)
    suspects = [
        *refitted(result, limits, changes, thorough=words != "supported"),
        *better_models(result, models),
    ]
    return Verdict(
        verdict=words,
        p_value=p_value,
        reasons=(*far, *_reasons(result, p_value, serious)),
        suspects=tuple(sorted(suspects, key=lambda suspect: -suspect.delta_chi2)),
        models=models,
        flags=flags,
        pulls={row["of"]: row["pull"] for row in result.nuisance},
        rests_on=rests_on(
            result.problem,
            result.linear,
            [i for i, value in enumerate(result.E_MPa) if math.isfinite(value)],
        ),
    )


def _p_of_misfit(linear: Linear, chi2: float, freedom: float) -> float:
    if freedom < 1.0:
        return 1.0
    return float(stats.f.sf(chi2 / freedom, freedom, linear.noise_freedom))


def _p_of_best(result: FitResult, gains: list[float]) -> float:
    """p-value of the largest of several gains (Sidak), each of one freedom."""
    if not gains:
        return 1.0
    one = float(stats.f.sf(max(gains), 1.0, result.linear.noise_freedom))
    return float(-np.expm1(len(gains) * np.log1p(-min(one, 1.0 - 1e-12))))


def _far_from_told(result: FitResult) -> tuple[str, ...]:
    """Say that all moduli are many times larger, or smaller, than was told."""
    told = [section.E_MPa for section in result.problem.specimen.sections]
    logs = np.log(np.array(result.E_MPa) / told)
    logs = logs[np.isfinite(logs)]
    if not len(logs) or abs(np.sum(np.sign(logs))) < len(logs):
        return ()
    if float(np.min(np.abs(logs))) < math.log(FAR):
        return ()
    low, high = np.exp(logs.min()), np.exp(logs.max())
    return (
        f"all moduli are {low:.2g} to {high:.2g} times those of the specimen's file: "
        "if these are no guess, a unit is wrong (gauss for mT, a side, a remanence)",
    )


def _share(p_value: float) -> str:
    """Return a probability in words; no noise is known well enough for tinier ones."""
    if p_value < 1e-6:
        return "less than one in a million"
    return f"{100.0 * p_value:.2g} %"


def _reasons(
    result: FitResult, p_value: float, serious: dict[str, int]
) -> tuple[str, ...]:
    reasons = list(result.on_bounds)
    if p_value < DOUBTFUL:
        reasons.append(
            f"a right model would look as bad in {_share(p_value)} of all runs: "
            f"{result.rms_um:.2g} µm RMS are left along the lines, whose own errors "
            f"are about {np.median(result.noise_um):.2g} µm"
        )
    shots = len(result.problem.shots)
    reasons += [
        f"{count} of {shots} photographs are flagged {name}"
        for name, count in serious.items()
    ]
    return tuple(reasons)
