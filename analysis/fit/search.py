"""Fit the moduli to the measured lines, and say what the data cannot tell.

Levenberg-Marquardt (scipy) with the simulator's exact sensitivities. Moduli are fitted
by their logarithms; nuisance parameters have Gaussian priors and are fitted along, so
that what is not known of clamp, scale and magnet widens the intervals of the moduli.

What cannot be told apart is found from the singular values of the derivatives with
respect to the unknowns that are asked for, after the nuisances are projected out: a
direction in which the data leave more than `DEGENERATE_SD` is degenerate, and every
unknown that takes part in it is named and gets no value. In a magnetic field alone,
modulus and remanence enter only as their ratio: asking for both names both.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ... import sim
from ...core.errors import InputError, MagbendError, SolverError
from ...core.files import write_text
from ...core.specimen import Specimen
from ..runs.load import RunData
from .nuisance import Nuisance
from .problem import Problem, build_problem, with_shared
from .residuals import WALL, misfit, residuals, shared_length_mm

if TYPE_CHECKING:
    from .posterior import Posterior

Array = NDArray[np.float64]

DEGENERATE_SD = 0.5
"""Relative standard deviation along a direction from which on it counts as unknown."""

BEYOND_BELIEF = 8.0
"""Prior standard deviations of a nuisance beyond which it must be another rod."""

WRONG_ROD = "; is it the right specimen, with the right sign of its remanence?"

PRIOR_RANGE_MPA = (8.0, 50.0)
"""The paper's range for the material, from its own earlier work."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitResult:
    """The outcome of a fit.

    Attributes
    ----------
    E_MPa, E_sd_MPa : tuple of float
        Moduli root first and their standard deviations; NaN where not identifiable.
    parameters : tuple of str
        The unknowns asked for; rows and columns of `correlation`.
    values, sd : tuple of float
        Their values and standard deviations, NaN where not identifiable.
    correlation : ndarray, shape (p, p)
    condition_number : float
        Ratio of largest to smallest singular value of the scaled derivatives.
    not_identifiable : tuple of str
        Names of the unknowns that take part in a degenerate direction.
    directions : tuple of str
        Each degenerate direction in words.
    ratios : dict of str to (float, float)
        Modulus over remanence and its standard deviation, where only that is known.
    chi2_reduced : float
        Sum of squared residuals over degrees of freedom; above 1, the standard
        deviations are widened by its root.
    nuisance : tuple of dict
        name, of (run or step; the first of those that share a clamp), value, sd,
        prior_sd of each nuisance parameter.
    residual_mm : tuple of (label, s_mm, residual_mm, sd_mm)
        What is left across the line, step by step.
    specimen : Specimen
        The nominal specimen with the fitted moduli (nominal where unknown).
    covariance : ndarray, shape (p, p)
        Of the logarithms of the unknowns asked for.
    unknowns : ndarray, shape (p + q,)
        Where the search ended, in the dimensionless unknowns of `residuals`.
    problem : Problem
        What was fitted.
    skipped : tuple of str
        Steps that could not be used, and why.
    """

    E_MPa: tuple[float, ...]
    E_sd_MPa: tuple[float, ...]
    parameters: tuple[str, ...]
    values: tuple[float, ...]
    sd: tuple[float, ...]
    correlation: Array
    condition_number: float
    not_identifiable: tuple[str, ...]
    directions: tuple[str, ...]
    ratios: dict[str, tuple[float, float]]
    chi2_reduced: float
    nuisance: tuple[dict[str, Any], ...]
    residual_mm: tuple[tuple[str, Array, Array, Array], ...]
    specimen: Specimen
    covariance: Array
    unknowns: Array
    problem: Problem
    model: str
    steps: int
    skipped: tuple[str, ...]

    def interval_MPa(self, index: int) -> tuple[float, float]:
        """Return the 95 % interval of one modulus."""
        value, sd = self.E_MPa[index], self.E_sd_MPa[index]
        return value - 1.96 * sd, value + 1.96 * sd

    def as_dict(self) -> dict[str, Any]:
        """Return what ``fit.json`` holds; NaN stands for not identifiable."""
        return {
            "E_MPa": list(self.E_MPa),
            "E_sd_MPa": list(self.E_sd_MPa),
            "correlation": self.correlation.tolist(),
            "condition_number": self.condition_number,
            "not_identifiable": list(self.not_identifiable),
            "chi2_reduced": self.chi2_reduced,
            "shared_error_mm": self.problem.shared_mm,
            "parameters": list(self.parameters),
            "values": list(self.values),
            "sd": list(self.sd),
            "degenerate_directions": list(self.directions),
            "ratios": {
                name: {"value": value, "sd": sd}
                for name, (value, sd) in self.ratios.items()
            },
            "nuisance": list(self.nuisance),
            "model": self.model,
            "steps": self.steps,
            "skipped": list(self.skipped),
            "specimen": self.specimen.name,
        }


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
    shared_mm: float | None = None,
) -> FitResult:
    """Fit one set of moduli to all steps of one or several runs.

    Parameters
    ----------
    runs, model, free, nuisance, support
        See `build_problem`.
    bounds_MPa : tuple of float, optional
        Hard bounds of the moduli.
    falling : bool
        Keep the moduli falling from root to tip.
    prior_MPa : tuple of float, optional
        A Gaussian prior of the logarithm of each modulus, centred in this range with
        the range as its 95 % interval: `PRIOR_RANGE_MPA` is the paper's.
    shared_mm : float, optional
        Over which neighbouring points of a measured line share their error; as the
        residuals show it if not given.

    Raises
    ------
    InputError
        If a name or a range cannot be.
    SolverError
        If the search does not converge.
    """
    problem = build_problem(
        runs,
        model=model,
        free=free,
        nuisance=nuisance,
        support=support,
    )
    prior = _prior(problem, prior_MPa)
    unknowns = _search(problem, prior, bounds_MPa, falling)
    # What the first search leaves over shows how far the errors of a line reach.
    if shared_mm is None:
        shared_mm = shared_length_mm(problem, misfit(problem, unknowns))
    problem = with_shared(problem, shared_mm)
    unknowns = _search(problem, prior, bounds_MPa, falling, unknowns)
    return _result(problem, prior, unknowns, model)


def _prior(problem: Problem, prior_MPa: tuple[float, float] | None) -> Array:
    """Rows (centre, 1/sd) of the Gaussian priors of all unknowns; 1/sd 0 is none."""
    rows = np.zeros((problem.size, 2))
    rows[len(problem.names) :, 1] = 1.0
    if prior_MPa is not None:
        low, high = _range(prior_MPa, "prior_MPa")
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


def _search(
    problem: Problem,
    prior: Array,
    bounds_MPa: tuple[float, float] | None,
    falling: bool,
    begin: Array | None = None,
) -> Array:
    """Find the least sum of squares; moduli that must fall are fitted by their steps.

    With `falling`, unknown i > 0 is the (never positive) change of the logarithm from
    section to section, so that the order is a bound and not a penalty.
    """
    sections = sum(name.startswith("E_MPa") for name in problem.names)
    nominal = np.log([problem.nominal(f"E_MPa[{i}]") for i in range(sections)])
    # Too weak to be seen, these rows keep the search from wandering off along a
    # direction in which nothing changes.
    rows = np.diag(np.maximum(prior[:, 1], 0.01))
    turn = np.eye(problem.size)
    offset = np.zeros(problem.size)
    lower, upper = np.full(problem.size, -np.inf), np.full(problem.size, np.inf)
    if falling:
        turn[:sections, :sections] = np.tril(np.ones((sections, sections)))
        offset[:sections] = -(nominal - nominal[0])
        upper[1:sections] = 0.0
    if bounds_MPa is not None:
        low, high = np.log(_range(bounds_MPa, "bounds_MPa")) - nominal[0]
        lower[0], upper[0] = low, high
        if not falling:
            lower[:sections] = low + nominal[0] - nominal
            upper[:sections] = high + nominal[0] - nominal

    def evaluate(v: Array) -> tuple[Array, Array]:
        u = turn @ v + offset
        data, slopes = residuals(problem, u)
        return (
            np.concatenate([data, rows @ (u - prior[:, 0])]),
            np.vstack([slopes, rows]) @ turn,
        )

    begin = np.zeros(problem.size) if begin is None else begin
    start = np.linalg.solve(turn, begin - offset)
    start = np.clip(start, lower + 1e-3, upper - 1e-3)
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

    bounded = bool(np.any(np.isfinite(lower)) or np.any(np.isfinite(upper)))

    def residual(v: Array) -> Array:
        return both(v)[0]

    def jacobian(v: Array) -> Array:
        return both(v)[1]

    found = least_squares(
        residual,
        start,
        jac=jacobian,
        bounds=(lower, upper),
        method="trf" if bounded else "lm",
        x_scale="jac" if bounded else 1.0,
        xtol=1e-10,
        ftol=1e-10,
        gtol=1e-10,
        max_nfev=200,
    )
    unknowns = np.asarray(turn @ found.x + offset)
    if found.status <= 0 or np.max(np.abs(found.fun)) >= WALL:
        raise SolverError(
            f"the fit does not converge in {found.nfev} evaluations ({found.message})"
            f"{WRONG_ROD}"
        )
    p = len(problem.names)
    if len(unknowns) > p and np.max(np.abs(unknowns[p:])) > BEYOND_BELIEF:
        k = int(np.argmax(np.abs(unknowns[p:])))
        value, sd = unknowns[p + k] * problem.nuisance_sd[k], problem.nuisance_sd[k]
        raise SolverError(
            f"the measured shapes do not fit this rod: {problem.nuisances[k][0]} would "
            f"have to be {value:.3g}, which is known to be 0 +- {sd:.2g}{WRONG_ROD}"
        )
    return unknowns


def _result(problem: Problem, prior: Array, unknowns: Array, model: str) -> FitResult:
    data, jacobian = residuals(problem, unknowns)
    p = len(problem.names)
    information = jacobian.T @ jacobian
    with_prior = information + np.diag(prior[:, 1] ** 2)
    asked = _marginal(with_prior, p)
    values_, vectors = np.linalg.eigh(asked)
    tiny = 1e-14 * max(float(values_[-1]), 1e-300)
    spread = 1.0 / np.sqrt(np.maximum(values_, tiny))
    bad = spread > DEGENERATE_SD
    names, directions = _degenerate(problem, vectors[:, bad])
    fitted = float(np.trace(np.linalg.pinv(with_prior) @ information))
    spare = max(problem.independent_points - fitted, 1.0)
    chi2 = float(data @ data) / spare
    covariance = (vectors * np.square(spread)) @ vectors.T * max(1.0, chi2)
    root = np.sqrt(np.diag(covariance))
    nominal = np.array([problem.nominal(name) for name in problem.names])
    known = np.array([name not in names for name in problem.names])
    value = np.where(known, nominal * np.exp(unknowns[:p]), np.nan)
    sd = value * root
    sections = len(problem.specimen.sections)
    return FitResult(
        E_MPa=tuple(value[:sections].tolist()),
        E_sd_MPa=tuple(sd[:sections].tolist()),
        parameters=problem.names,
        values=tuple(value.tolist()),
        sd=tuple(sd.tolist()),
        correlation=covariance / np.outer(root, root),
        condition_number=float(np.sqrt(values_[-1] / max(float(values_[0]), tiny))),
        not_identifiable=names,
        directions=directions,
        ratios=_ratios(problem, unknowns, values_, vectors, bad, chi2),
        chi2_reduced=chi2,
        nuisance=_nuisance_rows(problem, unknowns, with_prior),
        residual_mm=_residual_rows(problem, data),
        specimen=_fitted_specimen(problem, value),
        covariance=covariance,
        unknowns=unknowns,
        problem=problem,
        model=model,
        steps=len(problem.shots),
        skipped=problem.skipped,
    )


def _marginal(information: Array, p: int) -> Array:
    """Return the information on the first p unknowns when the others are free."""
    cross = information[:p, p:]
    inner = information[p:, p:]
    if inner.size == 0:
        return information[:p, :p]
    reduced = information[:p, :p] - cross @ np.linalg.solve(inner, cross.T)
    return 0.5 * (reduced + reduced.T)


def _degenerate(
    problem: Problem, vectors: Array
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Name the unknowns in the degenerate directions, and say each direction."""
    named: list[str] = []
    directions = []
    for vector in vectors.T:
        top = np.max(np.abs(vector))
        part = np.abs(vector) > 0.2 * top
        vector = vector * np.sign(vector[np.argmax(part)])
        members = [
            name for name, inside in zip(problem.names, part, strict=True) if inside
        ]
        named += [name for name in members if name not in named]
        terms = " and ".join(
            f"{'raising' if v > 0.0 else 'lowering'} {name}"
            for name, v in zip(members, vector[part], strict=True)
        )
        directions.append(f"{terms} together hardly changes the shapes")
    return tuple(n for n in problem.names if n in named), tuple(directions)


def _ratios(
    problem: Problem,
    unknowns: Array,
    eigenvalues: Array,
    vectors: Array,
    bad: NDArray[np.bool_],
    chi2: float,
) -> dict[str, tuple[float, float]]:
    """Modulus over load, where the two are degenerate and their ratio is not."""
    ratios = {}
    loads = [k for k, name in enumerate(problem.names) if not name.startswith("E_MPa")]
    for k, name in enumerate(problem.names):
        for m in loads if name.startswith("E_MPa") else []:
            contrast = np.zeros(len(problem.names))
            contrast[k], contrast[m] = 1.0, -1.0
            in_basis = vectors.T @ contrast
            if not np.any(bad) or np.max(np.abs(in_basis[bad])) > 1e-3:
                continue
            variance = np.sum(in_basis[~bad] ** 2 / eigenvalues[~bad]) * max(1.0, chi2)
            ratio = problem.nominal(name) / problem.nominal(problem.names[m])
            ratio *= math.exp(unknowns[k] - unknowns[m])
            ratios[f"{name}/{problem.names[m]}"] = (
                ratio,
                ratio * math.sqrt(variance),
            )
    return ratios


def _nuisance_rows(
    problem: Problem, unknowns: Array, information: Array
) -> tuple[dict[str, Any], ...]:
    p = len(problem.names)
    spread = np.sqrt(np.diag(np.linalg.pinv(information)))[p:]
    rows = []
    for (name, index), u, sd, prior in zip(
        problem.nuisances, unknowns[p:], spread, problem.nuisance_sd, strict=True
    ):
        rows.append(
            {
                "name": name,
                "of": index,
                "value": float(u * prior),
                "sd": float(sd * prior),
                "prior_sd": float(prior),
            }
        )
    return tuple(rows)


def _residual_rows(
    problem: Problem, data: Array
) -> tuple[tuple[str, Array, Array, Array], ...]:
    rows = []
    start = 0
    for shot in problem.shots:
        stop = start + len(shot.sigma_mm)
        left_mm = data[start:stop] * shot.sd_mm
        rows.append((shot.label, shot.line.s_mm, left_mm, shot.sigma_mm))
        start = stop
    return tuple(rows)


def _fitted_specimen(problem: Problem, values: Array) -> Specimen:
    sections = tuple(
        replace(section, E_MPa=float(value)) if math.isfinite(value) else section
        for section, value in zip(problem.specimen.sections, values, strict=False)
    )
    return replace(problem.specimen, sections=sections)


def try_fit(run: RunData, support: sim.Support | None = None) -> FitResult | str:
    """Fit one run by itself, or return the sentence that says why not."""
    try:
        return fit_runs([run], support=support)
    except MagbendError as error:
        return str(error)


def write_fit(
    path: Path, result: FitResult, posterior: Posterior | None = None
) -> None:
    """Write ``fit.json``; null stands for a number that is not known."""
    data = result.as_dict()
    if posterior is not None:
        data["posterior"] = posterior.as_dict()
    write_text(path, json.dumps(_plain(data), indent=2, allow_nan=False) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
