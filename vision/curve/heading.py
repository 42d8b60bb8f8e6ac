"""How surely a fit tells the direction at a root, which may lie before its first point.

Where the camera sees a clamp at an angle, the rod is not seen against the paper up to
its root: the fit's first arc is carried back, and the doubt of its curvature with it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .fit import CurveFit

Array = NDArray[np.float64]


def sigma_heading(fit: CurveFit, before: float) -> float:
    """Return the standard deviation of theta so far before the curve's start.

    Parameters
    ----------
    fit : CurveFit
        The curve.
    before : float
        How far its first arc is carried back, px.
    """
    row = _row(fit, before)
    return math.sqrt(float(row @ fit.covariance @ row))


def turned_without(fit: CurveFit, before: float, reach: float) -> float:
    """Return by how much theta changes there without the points next to the start.

    Parameters
    ----------
    fit : CurveFit
        The curve.
    before : float
        How far its first arc is carried back, px.
    reach : float
        Up to where on the curve points are left out, px.

    Returns
    -------
    float
        In rad, under the same penalty.

    Notes
    -----
    With H the part of the hat matrix that takes these points to themselves, the fit to
    the others leaves (1 - H)^-1 of the residuals there (R. D. Cook and S. Weisberg,
    Residuals and Influence in Regression, 1982).
    """
    problem = fit.problem
    near = (problem.s - problem.s[0] < reach) & (problem.weight > 0.0)
    weight = problem.weight[near] / problem.shared
    jacobian = problem.jacobian[near]
    unit = fit.noise**2 * fit.correlation / problem.shared
    lever = fit.covariance @ jacobian.T * weight / unit
    left = np.eye(len(weight)) - jacobian @ lever
    return -float(_row(fit, before) @ lever @ np.linalg.solve(left, fit.residual[near]))


def _row(fit: CurveFit, before: float) -> Array:
    """Return by how much each parameter changes theta so far before the start."""
    basis, row = fit.problem.basis, np.zeros(len(fit.covariance))
    first = basis.first[0] + 1
    row[first : first + 4] = basis.value[0] - before * basis.slope[0]
    return row
