"""How a rod's bending moment runs: the likeliest of a few physical priors.

A photograph leaves the direction at the clamp to a fit's extrapolation, which is the
better the fewer numbers it has to find. Elasticity leaves few: the curvature is M / EI,
the moment M(s) is smooth, and at a joint of two stiffnesses the curvature changes by a
factor while M and its slope go through. Not so if the load changes there as well (a
section magnetised otherwise). Which holds, and whether M is rather straight or rather
what one force makes of it on a rod so bent (the elastica), the Bayesian information
criterion weighs (Schwarz 1978). The force matters at the root of a strong bend: there a
magnet at the tip pulls along the rod, M hardly falls, and carried on straight it would
come out too large.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from .fit import CurveFit, Solved, fit_of, solution
from .problem import Problem, moved

Array = NDArray[np.float64]

_STRONG = 6.0
"""Gain for which a kink of the moment is believed (Kass and Raftery 1995)."""
_MOST = 8.0
"""Factor of curvatures beyond which a joint is no change of stiffness."""


def weighed_fit(problem: Problem, joints: Sequence[float], count: float) -> CurveFit:
    """Return the mean of the fits with each prior, weighed by their likelihood.

    Parameters
    ----------
    problem : Problem
        The measured points, linearised.
    joints : sequence of float
        Arc lengths of the joints.
    count : float
        Number of independent measurements.

    Returns
    -------
    CurveFit
        Its covariance holds the doubt which prior is right (Hoeting et al. 1999).
    """
    places = np.asarray(joints, dtype=np.float64)
    return fit_of(problem, _weighed(problem, places, float(count)))


@njit(cache=True)
def _weighed(problem: Problem, joints: Array, count: float) -> Solved:
    # Of Python's own constants each would have a version of all that it is passed to.
    straight, unforced, last = np.int64(2), np.int64(1), np.bool_(True)
    none = np.empty(0)
    free: Solved = solution(problem, straight, none, np.nan, last)
    fits, ratios = [free], none
    if joints.size > 0:
        ratios = _ratios(free.kappa, problem.s, joints)
        if not np.all((ratios > 1.0 / _MOST) & (ratios < _MOST)):
            return free
        nearest = solution(problem, straight, ratios, np.nan, last)
        ratios = _ratios(nearest.kappa, problem.s, joints)
        fits.append(solution(problem, straight, ratios, np.nan, last))
    fits.append(solution(problem, unforced, ratios, np.nan, last))
    loss = np.array([_criterion(fit, count) for fit in fits])
    if joints.size > 0:
        loss[0] += _STRONG
    weights = np.exp(-0.5 * (loss - np.min(loss)))
    mean: Solved = _mean(problem, fits, weights / np.sum(weights))
    return mean


@njit(cache=True)
def _mean(problem: Problem, fits: list[Solved], weights: Array) -> Solved:
    """Return the mean of fits to one problem, with their scatter in its covariance."""
    best, change = fits[np.argmax(weights)], np.zeros_like(fits[0].change)
    covariance, lever = np.zeros_like(best.covariance), np.zeros_like(best.lever)
    for k in range(weights.size):
        change += weights[k] * fits[k].change
        lever += weights[k] * fits[k].lever
    for k in range(weights.size):
        apart = fits[k].change - change
        covariance += weights[k] * (np.outer(apart, apart) + fits[k].covariance)
    points, theta, kappa, residual = moved(problem, change)
    return Solved(
        points, theta, kappa, residual, best.noise, best.correlation, best.freedom,
        change, covariance, lever,
    )  # fmt: skip


@njit(cache=True)
def _criterion(fit: Solved, count: float) -> float:
    """Return the information criterion: misfit, and freedom by which it was bought."""
    return float(count * 2.0 * np.log(fit.noise) + np.log(count) * fit.freedom)


@njit(cache=True)
def _ratios(kappa: Array, s: Array, joints: Array) -> Array:
    """Return curvature beyond over curvature before each joint."""
    step = s[1] - s[0]
    beyond = np.interp(joints + step, s, kappa)
    return np.asarray(beyond / np.interp(joints - step, s, kappa))
