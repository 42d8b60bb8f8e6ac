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

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .curve import Curve
from .fit import CurveFit, solve
from .problem import Problem, moved
from .spline import Smooth

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
    free = solve(problem, Smooth())
    fits, nearest = [free], free
    if joints:
        ratios = _ratios(free.curve, joints)
        if any(not 1.0 / _MOST < ratio < _MOST for ratio in ratios):
            return free
        nearest = solve(problem, Smooth(2, ratios))
        fits.append(solve(problem, Smooth(2, _ratios(nearest.curve, joints))))
    fits.append(solve(problem, Smooth(1, _ratios(nearest.curve, joints))))
    loss = np.array([_criterion(item, count) for item in fits])
    loss[0] += _STRONG if joints else 0.0
    weights = np.exp(-0.5 * (loss - loss.min()))
    return _mean(fits, weights / weights.sum())


def _mean(fits: Sequence[CurveFit], weights: Array) -> CurveFit:
    """Return the mean of fits to one problem, with their scatter in its covariance."""
    changes = np.array([fit.change for fit in fits])
    change = weights @ changes
    apart = changes - change
    covariance = (weights * apart.T) @ apart
    for fit, weight in zip(fits, weights, strict=True):
        covariance += weight * fit.covariance
    best = fits[int(np.argmax(weights))]
    points, theta, kappa, residual = moved(best.problem, change)
    return replace(
        best,
        curve=Curve(s=best.curve.s, points=points, theta=theta, kappa=kappa),
        residual=residual,
        change=change,
        covariance=covariance,
        lever=weights @ np.array([fit.lever for fit in fits]),
    )


def _criterion(fit: CurveFit, count: float) -> float:
    """Return the information criterion: misfit, and freedom by which it was bought."""
    return count * 2.0 * math.log(fit.noise) + math.log(count) * fit.freedom


def _ratios(curve: Curve, joints: Sequence[float]) -> tuple[float, ...]:
    """Return curvature beyond over curvature before each joint."""
    step = curve.s[1] - curve.s[0]
    places = np.asarray(joints, dtype=np.float64)
    before = np.interp(places - step, curve.s, curve.kappa)
    beyond = np.interp(places + step, curve.s, curve.kappa)
    with np.errstate(divide="ignore", invalid="ignore"):
        return tuple(float(ratio) for ratio in beyond / before)
