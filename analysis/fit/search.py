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

NEARBY, FRESH, CLOSE = 30.0, 3e-2, 1e-8
"""Steps, in prior standard deviations or logarithms: beyond the first a start was not
nearly right, under the second derivatives are those of the end, under the third a
search has ended."""

ROUGH = 1e-3
"""Relative change of the sum of squares, or of the unknowns, that is near enough."""

ROUNDS = 6
"""How many times Gauss-Newton may take derivatives anew."""

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

    Gauss-Newton where the start is nearly right; else Levenberg-Marquardt comes near.

    Raises
    ------
    SolverError
        If the search does not converge.
    """
    begin = np.zeros(problem.size) if begin is None else begin
    if limits.falling or limits.bounds_MPa is not None:
        return _levenberg(problem, limits, begin, CLOSE)
    found = _gauss_newton(problem, limits, begin)
    if found is None:
        near = _levenberg(problem, limits, begin, ROUGH)
        found = _gauss_newton(problem, limits, near)
    return _levenberg(problem, limits, near, CLOSE) if found is None else found


def _weak(prior: Array) -> Array:
    """Return the rows of the priors, and weak ones where there is none.

    Too weak to be seen, these keep a search from wandering off along a direction in
    which nothing changes.
    """
    return np.diag(np.maximum(prior[:, 1], 0.01))


def _gauss_newton(problem: Problem, limits: Limits, begin: Array) -> Array | None:
    """Search by steps with derivatives that are kept while the steps shrink.

    Old ones lead to where they would be right: they end a search only where the first
    step with them was small. None where the steps do not shrink.
    """
    prior = priors(problem, limits)
    rows = _weak(prior)
    unknowns = np.array(begin)
    try:
        for _ in range(ROUNDS):
            data, slopes = residuals(problem, unknowns)
            back = np.linalg.pinv(np.vstack([slopes, rows]))
            sizes: list[float] = []
            while np.max(np.abs(data)) < WALL:
                step = -back @ np.concatenate([data, rows @ (unknowns - prior[:, 0])])
                size = float(np.max(np.abs(step)))
                if not size < (0.5 * sizes[-1] if sizes else NEARBY):
                    break
                unknowns = unknowns + step
                sizes.append(size)
                if size < (CLOSE if sizes[0] < FRESH else FRESH):
                    break
                data = misfit(problem, unknowns)
            if not sizes:
                return None
            if sizes[-1] < CLOSE:
                return unknowns
    except MagbendError:
        return None
    return None


def _levenberg(
    problem: Problem, limits: Limits, begin: Array, tolerance: float
) -> Array:
    """Search within the limits by Levenberg-Marquardt.

    Raises
    ------
    SolverError
        If it does not converge.
    """
    prior = priors(problem, limits)
    turn = _turn(problem, limits)
    rows = _weak(prior)

    def evaluate(v: Array) -> tuple[Array, Array]:
        u = turn.matrix @ v + turn.offset
        data, slopes = residuals(problem, u)
        return (
            np.concatenate([data, rows @ (u - prior[:, 0])]),
            np.vstack([slopes, rows]) @ turn.matrix,
        )

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
        xtol=tolerance,
        ftol=tolerance,
        gtol=tolerance,
        max_nfev=200,
    )
    if found.status <= 0 or np.max(np.abs(found.fun)) >= WALL:
        raise SolverError(
            f"the fit does not converge in {found.nfev} evaluations ({found.message}); "
            "is it the right specimen, with the right sign of its remanence?"
        )
    return np.asarray(turn.matrix @ found.x + turn.offset)


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
