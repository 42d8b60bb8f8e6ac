"""Fit moduli to the runs of a rod, and judge the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ... import sim
from ...core.errors import MagbendError, SolverError
from ..runs.data import RunData
from .model import shape_of, values_of, with_bow
from .noise import noise_mm, stated_mm
from .nuisance import Nuisance
from .problem import Problem, build_problem, with_noise
from .residuals import left_over
from .result import FitResult, result_of
from .search import Limits, on_bounds, priors, search

CLEARLY_BENT = 0.02
"""Deflection of the tip over the length from which on its side is beyond doubt."""


def fit_runs(
    runs: Sequence[RunData],
    *,
    model: str = "magnet",
    free: Sequence[str] = (),
    nuisance: Nuisance | None = None,
    support: sim.Support | None = None,
    bounds_MPa: tuple[float, float] | None = None,
    falling: bool = False,
    prior_MPa: tuple[float, float] | None = None,
    judged: bool = True,
    sources: sim.Field | None = None,
) -> FitResult:
    """Fit one set of moduli to all steps of one or several runs.

    Parameters
    ----------
    runs, model, free, nuisance, support, sources
        See `build_problem`.
    bounds_MPa : tuple of float, optional
        Hard bounds of the moduli.
    falling : bool
        Keep the moduli falling from root to tip.
    prior_MPa : tuple of float, optional
        A Gaussian prior of the logarithm of each modulus, centred in this range with
        the range as its 95 % interval: `PRIOR_RANGE_MPA` is the paper's.
    judged : bool
        Also say whether the model can be believed, and what would explain the misfit.

    Raises
    ------
    InputError
        If a name or a range cannot be.
    SolverError
        If the search does not converge.
    """
    problem = build_problem(
        runs, model=model, free=free, nuisance=nuisance, support=support,
        sources=sources,
    )  # fmt: skip
    _check_sign(problem)
    limits = Limits(bounds_MPa=bounds_MPa, falling=falling, prior_MPa=prior_MPa)
    result = fit_problem(problem, limits)
    if not judged:
        return result
    from .verdict import judge

    return replace(result, verdict=judge(result, limits))


def fit_problem(problem: Problem, limits: Limits) -> FitResult:
    """Fit a problem twice: what the first search leaves shows the errors of lines."""
    unknowns = search(with_bow(problem, np.zeros(problem.size)), limits)
    problem = with_bow(problem, unknowns)
    stated = [stated_mm(shot.sigma_mm) for shot in problem.shots]
    problem = with_noise(problem, noise_mm(left_over(problem, unknowns), stated))
    unknowns = search(problem, limits, unknowns)
    return result_of(
        problem,
        priors(problem, limits),
        unknowns,
        on_bounds(problem, limits, unknowns),
    )


def _check_sign(problem: Problem) -> None:
    """Refuse a rod that bends the other way in every photograph.

    No modulus above zero turns a deflection round, so a fit would only find a rod that
    does not bend at all.
    """
    nominal = np.zeros(problem.size)
    for shot in problem.shots:
        values = values_of(problem, shot.owner, nominal)
        xy_mm = shape_of(problem, shot, values)
        least_mm = CLEARLY_BENT * shot.line.length_mm
        seen_mm = shot.line.y_mm[-1]
        wanted_mm = 0.0 if xy_mm is None else xy_mm[-1, 1]
        if min(abs(seen_mm), abs(wanted_mm)) < least_mm or seen_mm * wanted_mm > 0.0:
            return
    remanence_mT = problem.specimen.remanence_mT
    kinds = {source.kind for shot in problem.shots for source in shot.field.sources}
    mirrored = ", or an axis of the map is mirrored" if "map" in kinds else ""
    raise SolverError(
        f"{problem.specimen.name!r} bends the other way in every photograph: the sign "
        f"of its remanence ({remanence_mT:g} mT in the specimen file, + from root to "
        f"tip) or of the magnet's is wrong{mirrored}"
    )


def try_fit(
    run: RunData,
    support: sim.Support | None = None,
    sources: sim.Field | None = None,
) -> FitResult | str:
    """Fit one run by itself, or return the sentence that says why not."""
    try:
        return fit_runs([run], support=support, sources=sources)
    except MagbendError as error:
        return str(error)
