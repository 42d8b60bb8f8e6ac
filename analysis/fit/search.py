"""Find the unknowns of a fit: Levenberg-Marquardt (scipy) on the whitened residuals.

Moduli are fitted by their logarithms; nuisance parameters have Gaussian priors and are
fitted along, so that what is not known of rod, clamp, camera and magnet widens the
intervals of the moduli.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ...core.errors import InputError, MagbendError, SolverError
from .problem import Problem
from .residuals import WALL, misfit, residuals

Array = NDArray[np.float64]

NEARBY, CLOSE = 5.0, 1e-4
"""Steps, in prior standard deviations or logarithms, beyond which a start was not
nearly right, and under which a search has ended."""

AT_BOUND = 1e-3
"""Relative distance from a bound from which on a modulus lies on it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What the moduli are held to, each None or False where nothing is asked.

    Attributes
    ----------
    bounds_MPa : tuple of float
        Hard bounds of the moduli.
    falling : bool
        Keep the moduli falling from root to tip.
    prior_MPa : tuple of float
        95 % range of a Gaussian prior of the logarithm of each modulus.
    """

    bounds_MPa: tuple[float, float] | None = None
    falling: bool = False
    prior_MPa: tuple[float, float] | None = None


def priors(problem: Problem, limits: Limits) -> Array:
    """Rows (centre, 1/sd) of the Gaussian priors of all unknowns; 1/sd 0 is none."""
    rows = np.zeros((problem.size, 2))
    rows[len(problem.names) :, 1] = 1.0
    if limits.prior_MPa is not None:
        low, high = _range(limits.prior_MPa, "prior_MPa")
        for k, name in enumerate(problem.names):
            if name.startswith("E_MPa"):
                centre = 0.5 * (math.log(low) + math.log(high))
                rows[k, 0] = centre - math.log(problem.nominal(name))
                rows[k, 1] = 2.0 * 1.96 / math.log(high / low)
    return rows


def _range(values: tuple[float, float], name: str) -> tuple[float, float]:
    low, high = values
    if not (math.isfinite(high) and 0.0 < low < high):
        raise InputError(
            f"{name} must be two rising moduli above zero in MPa; "
            f"instead received {low:g} and {high:g}"
        )
    return low, high


@dataclass(frozen=True, slots=True, kw_only=True)
class _Turn:
    """Bounded unknowns v of the search, u = matrix v + offset.

    Moduli that must fall are searched by their steps: unknown i > 0 is the (never
    positive) change of the logarithm from section to section, so that the order is a
    bound and not a penalty.
    """

    matrix: Array
    offset: Array
    lower: Array
    upper: Array


def _turn(problem: Problem, limits: Limits) -> _Turn:
    count = len(problem.specimen.sections)
    nominal = np.log([problem.nominal(f"E_MPa[{i}]") for i in range(count)])
    matrix, offset = np.eye(problem.size), np.zeros(problem.size)
    lower, upper = np.full(problem.size, -np.inf), np.full(problem.size, np.inf)
    if limits.falling:
        matrix[:count, :count] = np.tril(np.ones((count, count)))
        offset[:count] = -(nominal - nominal[0])
        upper[1:count] = 0.0
    if limits.bounds_MPa is not None:
        low, high = np.log(_range(limits.bounds_MPa, "bounds_MPa")) - nominal[0]
        lower[0], upper[0] = low, high
        if not limits.falling:
            lower[:count] = low + nominal[0] - nominal
            upper[:count] = high + nominal[0] - nominal
    return _Turn(matrix=matrix, offset=offset, lower=lower, upper=upper)


def search(problem: Problem, limits: Limits, begin: Array | None = None) -> Array:
    """Return the unknowns with the least sum of squares.

    Raises
    ------
    SolverError
        If the search does not converge.
    """
    prior = priors(problem, limits)
    turn = _turn(problem, limits)
    # Too weak to be seen, these rows keep the search from wandering off along a
    # direction in which nothing changes.
    rows = np.diag(np.maximum(prior[:, 1], 0.01))

    def evaluate(v: Array) -> tuple[Array, Array]:
        u = turn.matrix @ v + turn.offset
        data, slopes = residuals(problem, u)
        return (
            np.concatenate([data, rows @ (u - prior[:, 0])]),
            np.vstack([slopes, rows]) @ turn.matrix,
        )

    begin = np.zeros(problem.size) if begin is None else begin
    start = np.linalg.solve(turn.matrix, begin - turn.offset)
    start = np.clip(start, turn.lower + 1e-3, turn.upper - 1e-3)
    cache: dict[bytes, tuple[Array, Array]] = {}
    # What is refused at the start is wrong with the input and is told; later on it is
    # the search that went where nothing can be solved.
    cache[start.tobytes()] = first = evaluate(start)

    def both(v: Array) -> tuple[Array, Array]:
        key = v.tobytes()
        if key not in cache:
            cache.clear()
            try:
                cache[key] = evaluate(v)
            except MagbendError:
                cache[key] = np.full_like(first[0], WALL), np.zeros_like(first[1])
        return cache[key]

    bounded = bool(np.any(np.isfinite(turn.lower)) or np.any(np.isfinite(turn.upper)))

    def residual(v: Array) -> Array:
        return both(v)[0]

    def jacobian(v: Array) -> Array:
        return both(v)[1]

    found = least_squares(
        residual,
        start,
        jac=jacobian,
        bounds=(turn.lower, turn.upper),
        method="trf" if bounded else "lm",
        x_scale="jac" if bounded else 1.0,
        xtol=1e-8,
        ftol=1e-8,
        gtol=1e-8,
        max_nfev=200,
    )
    if found.status <= 0 or np.max(np.abs(found.fun)) >= WALL:
        raise SolverError(
            f"the fit does not converge in {found.nfev} evaluations ({found.message}); "
            "is it the right specimen, with the right sign of its remanence?"
        )
    return np.asarray(turn.matrix @ found.x + turn.offset)


def nearby(problem: Problem, limits: Limits, begin: Array) -> Array:
    """Return the same as `search` from a start that is nearly right, at less cost.

    Gauss-Newton steps with derivatives that are kept as long as the steps shrink.

    Raises
    ------
    SolverError
        If the search does not converge.
    """
    if limits.falling or limits.bounds_MPa is not None:
        return search(problem, limits, begin)
    prior = priors(problem, limits)
    rows = np.diag(np.maximum(prior[:, 1], 0.01))
    unknowns = np.array(begin)
    for _ in range(3):
        _, slopes = residuals(problem, unknowns)
        back = np.linalg.pinv(np.vstack([slopes, rows]))
        before = np.inf
        for _ in range(10):
            data = [misfit(problem, unknowns), rows @ (unknowns - prior[:, 0])]
            step = -back @ np.concatenate(data)
            size = float(np.max(np.abs(step)))
            if not size < min(0.7 * before, NEARBY):
                break
            unknowns, before = unknowns + step, size
            if size < CLOSE:
                return np.asarray(unknowns)
    return search(problem, limits, begin)


def on_bounds(problem: Problem, limits: Limits, unknowns: Array) -> tuple[str, ...]:
    """Return a sentence on each modulus that a bound or the order holds back."""
    count = len(problem.specimen.sections)
    E_MPa = [problem.value(i, float(unknowns[i])) for i in range(count)]
    sentences = []
    for i, value in enumerate(E_MPa):
        for bound in limits.bounds_MPa or ():
            if abs(value / bound - 1.0) < AT_BOUND:
                sentences.append(
                    f"E_MPa[{i}] lies on its bound of {bound:g} MPa: the measured "
                    "shapes ask for more, and no interval of this fit holds"
                )
        if limits.falling and i and abs(value / E_MPa[i - 1] - 1.0) < AT_BOUND:
            sentences.append(
                f"E_MPa[{i}] is held under E_MPa[{i - 1}] by --falling: the measured "
                "shapes ask for a rise, and no interval of this fit holds"
            )
    return tuple(sentences)
