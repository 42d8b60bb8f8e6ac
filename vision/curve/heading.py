"""How surely a fit tells the direction at a root, which may lie before its first point.

Where the camera sees a clamp at an angle, the rod is not seen against the paper up to
its root: the fit's first arc is carried back, and the doubt of its curvature with it.
"""

from __future__ import annotations

import math

import numpy as np

from .fit import CurveFit


def sigma_heading(fit: CurveFit, before: float) -> float:
    """Return the standard deviation of theta so far before the curve's start.

    Parameters
    ----------
    fit : CurveFit
        The curve.
    before : float
        How far its first arc is carried back, px.
    """
    basis, row = fit.problem.basis, np.zeros(len(fit.covariance))
    first = basis.first[0] + 1
    row[first : first + 4] = basis.value[0] - before * basis.slope[0]
    return math.sqrt(float(row @ fit.covariance @ row))
