"""A fit around its solution, where everything is linear and Gaussian.

Unknowns asked for have no prior (or one that was asked for), nuisances one of weight
one; data and priors are rows of one least-squares problem, whose residuals say how well
the model fits, and in which direction it would fit better (a score test).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .noise import SHAPE
from .nuisance import scope_of
from .problem import Problem

Array = NDArray[np.float64]

NO_INFORMATION = 1e-6
"""Share of a column that must be left beside all others for the data to tell of it."""

_OWN = ("photograph", "frame")
_LOAD = ("remanence_percent", "side_percent", "magnet_percent", "meter_percent")
"""Nuisances that a modulus is proportional to."""

LARGEST_BIRGE = 4.0
"""Beyond this the misfit of lines is told and not added to their errors."""

FARTHEST = 10.0
"""Deviations of their priors, or logarithms, that unknowns are never off by."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Linear:
    """The linear problem at a solution.

    Attributes
    ----------
    data : ndarray, shape (n,)
        Residuals of lines and numbers.
    jacobian : ndarray, shape (n, p + q)
    prior : ndarray, shape (p + q, 2)
        Centre and 1/sd of the priors.
    basis : ndarray, shape (n + p + q, p + q)
        Orthonormal, of all rows: what the unknowns can reach.
    left : ndarray, shape (n + p + q,)
        Residuals of all rows.
    is_noise : ndarray of bool, shape (n,)
        Rows that show the errors of lines, and not the model's.
    line_rows : int
        Of the data, those that are of lines: the first.
    noise_freedom : float
        Degrees of freedom in which the errors were measured.
    """

    data: Array
    jacobian: Array
    prior: Array
    basis: Array
    left: Array
    is_noise: NDArray[np.bool_]
    line_rows: int
    noise_freedom: float

    @property
    def chi2(self) -> float:
        """Sum of squares of all rows, priors included."""
        return float(self.left @ self.left)

    @property
    def shape_chi2(self) -> float:
        """The same without the rows that show the errors of lines."""
        return self.chi2 - float(np.sum(self.data[self.is_noise] ** 2))

    @property
    def freedom(self) -> float:
        """Degrees of freedom of `shape_chi2`."""
        free = int(np.sum(self.prior[:, 1] == 0.0))
        return max(1.0, float(np.sum(~self.is_noise)) - free)

    @property
    def unexplained(self) -> tuple[float, float]:
        """Sum of squares that no value of any unknown explains, and its freedom.

        Notes
        -----
        Of the low modes of the lines alone. Priors have no say: those that are wider
        than a bench is off make `chi2` small, and hide lines that no rod can have.
        """
        low = ~self.is_noise
        low[self.line_rows :] = False
        basis, values, _ = np.linalg.svd(self.jacobian[low], full_matrices=False)
        basis = basis[:, values > 1.0 / FARTHEST]
        left = self.data[low] - basis @ (basis.T @ self.data[low])
        return float(left @ left), float(len(left) - basis.shape[1])

    @property
    def birge(self) -> float:
        """By what the errors of lines are larger, in variance, than their modes show.

        Notes
        -----
        Birge's ratio, squared. What is beyond `LARGEST_BIRGE` is no error of lines any
        more but that of a model, which the verdict tells.
        """
        chi2, freedom = self.unexplained
        return min(max(1.0, chi2 / freedom), LARGEST_BIRGE) if freedom >= 1.0 else 1.0

    @property
    def information(self) -> Array:
        """What data and priors say of the unknowns."""
        return self.jacobian.T @ self.jacobian + np.diag(self.prior[:, 1] ** 2)

    def score(self, column: Array) -> tuple[float, float]:
        """Return the best step along a new column of the jacobian, and its sd.

        Notes
        -----
        The score test: the gain of chi2 is (step / sd)^2. For the column of a nuisance
        it is that of taking its prior away; step / sd is then its pull.
        """
        padded = np.concatenate([column, np.zeros(len(self.left) - len(column))])
        fresh = padded - self.basis @ (self.basis.T @ padded)
        information = float(fresh @ fresh)
        if information <= NO_INFORMATION * float(column @ column):
            return 0.0, float("inf")
        return -float(fresh @ self.left) / information, information**-0.5


def linear_problem(
    problem: Problem, data: Array, jacobian: Array, prior: Array, unknowns: Array
) -> Linear:
    """Return the linear problem at `unknowns`."""
    weights = prior[:, 1]
    rows = np.vstack([jacobian, np.diag(weights)])
    left = np.concatenate([data, weights * (unknowns - prior[:, 0])])
    basis, values, _ = np.linalg.svd(rows, full_matrices=False)
    basis = basis[:, values > 1e-10 * values[0]]
    is_noise = [np.arange(len(shot.modes)) >= SHAPE for shot in problem.shots]
    is_noise.append(np.zeros(len(problem.data), dtype=bool))
    flags = np.concatenate(is_noise)
    return Linear(
        data=data,
        jacobian=jacobian,
        prior=prior,
        basis=basis,
        left=left - basis @ (basis.T @ left) if len(left) else left,
        is_noise=flags,
        line_rows=sum(len(shot.modes) for shot in problem.shots),
        noise_freedom=max(3.0, float(np.sum(flags))),
    )


def marginal(information: Array, p: int) -> Array:
    """Return the information on the first p unknowns when the others are free."""
    cross = information[:p, p:]
    inner = information[p:, p:]
    if inner.size == 0:
        return information[:p, :p]
    reduced = information[:p, :p] - cross @ np.linalg.solve(inner, cross.T)
    return np.asarray(0.5 * (reduced + reduced.T))


def covariance_of(information: Array, p: int) -> Array:
    """Return the covariance of the first p unknowns."""
    return np.asarray(np.linalg.pinv(marginal(information, p), hermitian=True))


def statistical(problem: Problem, linear: Linear) -> Array:
    """Return the covariance of the asked if the same bench were photographed again.

    Only what a photograph errs in is free: its line, its clamp's place and direction.
    Lines err as their modes show; see `Linear.birge` for by what they err more.
    """
    return _with(problem, linear, lambda name: scope_of(name) in _OWN)


def of_shapes(problem: Problem, linear: Linear) -> Array:
    """Return the covariance of the asked if the load were known: by shapes alone."""
    return _with(problem, linear, lambda name: name not in _LOAD)


def _with(problem: Problem, linear: Linear, is_free: Callable[[str], bool]) -> Array:
    p = len(problem.names)
    own = [p + k for k, (name, _) in enumerate(problem.nuisances) if is_free(name)]
    keep = [*range(p), *own]
    return covariance_of(linear.information[np.ix_(keep, keep)], p)


def budget(problem: Problem, linear: Linear) -> dict[str, Array]:
    """Return what each kind of nuisance adds, as standard deviations of logarithms.

    Notes
    -----
    The root of what is saved in variance if it were known; largest first. Shares that
    nuisances have in common count for none of them.
    """
    p = len(problem.names)
    whole = np.diag(covariance_of(linear.information, p))
    kinds = dict.fromkeys(name.partition("[")[0] for name, _ in problem.nuisances)
    shares = {}
    for kind in kinds:
        keep = [
            *range(p),
            *(
                p + k
                for k, (name, _) in enumerate(problem.nuisances)
                if name.partition("[")[0] != kind
            ),
        ]
        known = np.diag(covariance_of(linear.information[np.ix_(keep, keep)], p))
        shares[kind] = np.sqrt(np.maximum(whole - known, 0.0))
    ordered = sorted(shares.items(), key=lambda item: -float(np.max(item[1])))
    return dict(ordered)
