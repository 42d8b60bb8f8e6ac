"""The outcome of a fit: values, the whole budget of their intervals, what is not known.

What cannot be told apart is found from the singular values of the derivatives with
respect to the unknowns that are asked for, after the nuisances are projected out: a
direction in which the data leave more than `DEGENERATE_SD` is degenerate, and every
unknown that takes part in it is named and gets no value. In a magnetic field alone,
modulus and remanence enter only as their ratio: asking for both names both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.json import write_json
from ...core.notebook import Tabular, axes_or_new
from ...core.specimen import Specimen
from .linear import Linear, budget, linear_problem, marginal, of_shapes, statistical
from .problem import Problem
from .records import Posterior, Verdict
from .residuals import distances_mm, residuals

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

DEGENERATE_SD = 0.5
"""Relative standard deviation along a direction from which on it counts as unknown."""

PRIOR_RANGE_MPA = (8.0, 50.0)
"""The paper's range for the material, from its own earlier work."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitResult(Tabular):
    """The outcome of a fit.

    Attributes
    ----------
    E_MPa, E_sd_MPa : tuple of float
        Moduli root first and their standard deviations, of the whole budget: noise of
        the photographs and everything a bench does not know; NaN where not
        identifiable.
    E_sd_statistical_MPa : tuple of float
        What they would scatter by if the same rod were photographed again on the same
        bench.
    budget : dict of str to ndarray
        What each kind of nuisance adds, as relative standard deviations of the unknowns
        asked for; largest first.
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
        Sum of squared residuals over degrees of freedom, against the errors that the
        lines themselves show.
    noise_um : tuple of float
        Size of these errors, line by line.
    nuisance : tuple of dict
        name, of (see `Problem.label`), value, sd, prior_sd, pull of each.
    residual_mm : tuple of (label, s_mm, residual_mm, sd_mm)
        What is left across the line, step by step.
    on_bounds : tuple of str
        A sentence on each modulus that a bound holds back.
    verdict : Verdict or None
        Whether the model can be believed; None if it was not asked for.
    specimen : Specimen
        The nominal specimen with the fitted moduli (nominal where unknown).
    covariance : ndarray, shape (p, p)
        Of the logarithms of the unknowns asked for.
    unknowns : ndarray, shape (p + q,)
        Where the search ended, in the dimensionless unknowns of `residuals`.
    problem : Problem
        What was fitted.
    linear : Linear
        The problem around its solution.
    """

    E_MPa: tuple[float, ...]
    E_sd_MPa: tuple[float, ...]
    E_sd_statistical_MPa: tuple[float, ...]
    budget: dict[str, Array]
    parameters: tuple[str, ...]
    values: tuple[float, ...]
    sd: tuple[float, ...]
    correlation: Array
    condition_number: float
    not_identifiable: tuple[str, ...]
    directions: tuple[str, ...]
    ratios: dict[str, tuple[float, float]]
    chi2_reduced: float
    noise_um: tuple[float, ...]
    nuisance: tuple[dict[str, Any], ...]
    residual_mm: tuple[tuple[str, Array, Array, Array], ...]
    on_bounds: tuple[str, ...]
    specimen: Specimen
    covariance: Array
    unknowns: Array
    problem: Problem
    linear: Linear
    verdict: Verdict | None = None

    @property
    def model(self) -> str:
        """The model that was fitted: magnet, uniform or solid."""
        return self.problem.model

    @property
    def steps(self) -> int:
        """Number of photographs."""
        return len(self.problem.shots)

    @property
    def skipped(self) -> tuple[str, ...]:
        """Steps that could not be used, and why."""
        return self.problem.skipped

    @property
    def rms_um(self) -> float:
        """Root mean square of what is left across the lines, over all their points."""
        left = np.concatenate([row[2] for row in self.residual_mm])
        return 1e3 * float(np.sqrt(np.mean(left**2)))

    def interval_MPa(self, index: int) -> tuple[float, float]:
        """Return the 95 % interval of one modulus."""
        value, sd = self.E_MPa[index], self.E_sd_MPa[index]
        return value - 1.96 * sd, value + 1.96 * sd

    def to_dataframe(self) -> pd.DataFrame:
        """Return parameter, value and standard deviation, a row each."""
        import pandas as pd

        return pd.DataFrame(
            {
                "parameter": self.parameters,
                "value": self.values,
                "sd": self.sd,
                "known": [
                    name not in self.not_identifiable for name in self.parameters
                ],
            }
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the moduli with 95 % intervals into `ax`, or into new axes."""
        ax = axes_or_new(ax, "section, from the root", "Young's modulus (MPa)")
        where = range(1, len(self.E_MPa) + 1)
        reach = [1.96 * sd for sd in self.E_sd_MPa]
        ax.errorbar(where, self.E_MPa, yerr=reach, fmt="o", capsize=3)
        ax.set_xticks(list(where))
        return ax

    def as_dict(self) -> dict[str, Any]:
        """Return what ``fit.json`` holds; NaN stands for not identifiable."""
        judged = self.verdict.as_dict() if self.verdict else {}
        return {
            **judged,
            "E_MPa": list(self.E_MPa),
            "E_sd_MPa": list(self.E_sd_MPa),
            "E_sd_statistical_MPa": list(self.E_sd_statistical_MPa),
            "budget_percent": {
                kind: (100.0 * share[: len(self.E_MPa)]).tolist()
                for kind, share in self.budget.items()
            },
            "correlation": self.correlation.tolist(),
            "condition_number": self.condition_number,
            "not_identifiable": list(self.not_identifiable),
            "on_bounds": list(self.on_bounds),
            "chi2_reduced": self.chi2_reduced,
            "rms_um": self.rms_um,
            "noise_um": list(self.noise_um),
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


def result_of(
    problem: Problem,
    prior: Array,
    unknowns: Array,
    on_bounds: tuple[str, ...] = (),
) -> FitResult:
    """Return what a search that ended at `unknowns` has found."""
    data, jacobian = residuals(problem, unknowns)
    linear = linear_problem(problem, data, jacobian, prior, unknowns)
    p = len(problem.names)
    values_, vectors = np.linalg.eigh(marginal(linear.information, p))
    tiny = 1e-14 * max(float(values_[-1]), 1e-300)
    spread = 1.0 / np.sqrt(np.maximum(values_, tiny))
    bad = spread > DEGENERATE_SD
    names, directions = _degenerate(problem, vectors[:, bad])
    noise = statistical(problem, linear)
    # What lines err by beyond their own modes is in no row of the linear problem.
    beyond = (linear.birge - 1.0) * noise
    covariance = (vectors * np.square(spread)) @ vectors.T + beyond
    root = np.sqrt(np.diag(covariance))
    is_modulus = np.array([name.startswith("E_MPa") for name in problem.names])
    shapes = np.diag(of_shapes(problem, linear) + beyond) * is_modulus
    known = np.array([name not in names for name in problem.names])
    known &= shapes < DEGENERATE_SD**2
    names = tuple(np.array(problem.names)[~known].tolist())
    found = [problem.value(k, float(unknowns[k])) for k in range(p)]
    value = np.where(known, found, np.nan)
    sd = value * np.sqrt(np.maximum(root**2 - shapes, 0.0) + _reach(shapes) ** 2)
    again = value * _reach(np.diag(noise + beyond) * is_modulus)
    sections = len(problem.specimen.sections)
    return FitResult(
        E_MPa=tuple(value[:sections].tolist()),
        E_sd_MPa=tuple(sd[:sections].tolist()),
        E_sd_statistical_MPa=tuple(again[:sections].tolist()),
        budget=budget(problem, linear),
        parameters=problem.names,
        values=tuple(value.tolist()),
        sd=tuple(sd.tolist()),
        correlation=covariance / np.outer(root, root),
        condition_number=float(np.sqrt(values_[-1] / max(float(values_[0]), tiny))),
        not_identifiable=names,
        directions=directions,
        ratios=_ratios(problem, unknowns, values_, vectors, bad),
        chi2_reduced=linear.shape_chi2 / linear.freedom,
        noise_um=tuple(1e3 * shot.noise_mm for shot in problem.shots),
        nuisance=_nuisance_rows(problem, unknowns, linear),
        residual_mm=_residual_rows(problem, unknowns),
        on_bounds=on_bounds,
        specimen=_fitted_specimen(problem, value),
        covariance=covariance,
        unknowns=unknowns,
        problem=problem,
        linear=linear,
    )


def _reach(variance: Array) -> Array:
    """Return the relative deviation of moduli whose compliances have this variance.

    Notes
    -----
    Shapes are linear in the compliance 1/E. Where it is known to a share r of itself, E
    reaches up to E / (1 - 1.96 r) within 95 %, and this arm is told: a rod found too
    soft would look surer than it is.
    """
    sd = np.sqrt(np.clip(variance, 0.0, DEGENERATE_SD**2))
    return np.asarray(sd / (1.0 - 1.96 * sd))


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
            variance = np.sum(in_basis[~bad] ** 2 / eigenvalues[~bad])
            ratio = problem.nominal(name) / problem.nominal(problem.names[m])
            ratio *= math.exp(unknowns[k] - unknowns[m])
            ratios[f"{name}/{problem.names[m]}"] = (
                ratio,
                ratio * math.sqrt(variance),
            )
    return ratios


def _nuisance_rows(
    problem: Problem, unknowns: Array, linear: Linear
) -> tuple[dict[str, Any], ...]:
    p = len(problem.names)
    spread = np.sqrt(np.diag(np.linalg.pinv(linear.information, hermitian=True)))
    rows = []
    for k, prior in enumerate(problem.nuisance_sd.tolist()):
        step, step_sd = linear.score(linear.jacobian[:, p + k])
        rows.append(
            {
                "name": problem.nuisances[k][0],
                "of": problem.label(k),
                "value": float(unknowns[p + k] * prior),
                "sd": float(spread[p + k] * prior),
                "prior_sd": prior,
                "pull": step / step_sd,
            }
        )
    return tuple(rows)


def _residual_rows(
    problem: Problem, unknowns: Array
) -> tuple[tuple[str, Array, Array, Array], ...]:
    return tuple(
        (shot.label, shot.line.s_mm, left, shot.sigma_mm)
        for shot, left in zip(
            problem.shots, distances_mm(problem, unknowns), strict=True
        )
        if left is not None
    )


def _fitted_specimen(problem: Problem, values: Array) -> Specimen:
    sections = tuple(
        replace(section, E_MPa=float(value)) if math.isfinite(value) else section
        for section, value in zip(problem.specimen.sections, values, strict=False)
    )
    return replace(problem.specimen, sections=sections)


def write_fit(
    path: Path, result: FitResult, posterior: Posterior | None = None
) -> None:
    """Write ``fit.json``; null stands for a number that is not known."""
    data = result.as_dict()
    if posterior is not None:
        data["posterior"] = posterior.as_dict()
    write_json(path, data)
