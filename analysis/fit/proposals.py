"""What to do next: by how much each possible experiment would shorten the intervals.

Around a fit everything is linear and Gaussian, so what a photograph not yet taken, or a
size not yet measured, would add is known before it is done.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import sim
from ...core.errors import MagbendError
from ...core.units import GRAVITY_M_PER_S2
from ..runs.data import RunData
from .fields import field_at
from .linear import covariance_of
from .model import rod_of, values_of
from .noise import mode_matrix
from .problem import Shot
from .residuals import line_rows
from .result import FitResult

Array = NDArray[np.float64]

SHOT_MINUTES = 2.0
"""Of a photograph at another gap: move, settle, read, expose."""

GAPS = 5
"""How many gaps within the bench's limits are tried."""

REFERENCE_MM = 1000.0
"""A gap that is as good as no field."""

MEASURE = {
    "side_percent": ("measure the side to 0.3 %", 0.3, 5.0),
    "length_mm": ("measure the length to 0.03 mm", 0.03, 5.0),
    "joint_mm": ("measure the joints to 0.05 mm under a microscope", 0.05, 15.0),
    "density_percent": ("weigh the rod to 1 %", 1.0, 10.0),
    "gap_mm": ("gauge the gap to 0.1 mm", 0.1, 10.0),
    "clamp_angle_deg": ("square the clamp to the magnet within 0.2 deg", 0.2, 15.0),
    "meter_percent": ("check the Tesla-meter's gain to 0.3 %", 0.3, 20.0),
    "meter_offset_mT": ("zero the Tesla-meter to 0.03 mT", 0.03, 5.0),
    "magnet_percent": ("have the magnet's remanence within 1 %", 1.0, 60.0),
    "remanence_percent": ("measure the rod's remanence to 2 %", 2.0, 60.0),
    "natural_curvature_per_mm": ("measure the rod's bow to 2e-5 1/mm", 2e-5, 15.0),
}
"""What can be measured apart from bending, how well, and in how many minutes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """One thing to do.

    Attributes
    ----------
    change : str
        What.
    predicted_sd_percent : float
        Standard deviation of the modulus that is known worst, once it is done.
    minutes : float
        About how long it takes.
    """

    change: str
    predicted_sd_percent: float
    minutes: float

    def as_dict(self) -> dict[str, Any]:
        """Return the words of ``analysis next --json``."""
        return {
            "change": self.change,
            "predicted_sd_percent": self.predicted_sd_percent,
            "minutes": self.minutes,
        }


def proposals(
    result: FitResult, runs: Sequence[RunData], *, minutes: float | None = None
) -> tuple[Proposal, ...]:
    """Return what could be done next, the shortest interval first.

    Parameters
    ----------
    result : FitResult
        Of `runs`.
    minutes : float, optional
        Leave out what takes longer.
    """
    found = [*_measurements(result), *_photographs(result, runs)]
    if minutes is not None:
        found = [one for one in found if one.minutes <= minutes]
    return tuple(sorted(found, key=lambda one: (one.predicted_sd_percent, one.minutes)))


def limits_of_knowledge(result: FitResult) -> tuple[str, ...]:
    """Return a sentence on what no photograph can shorten."""
    problem, p = result.problem, len(result.E_MPa)
    photographed = result.linear.jacobian.copy()
    photographed[: len(photographed) - len(problem.data)] *= 1e3
    information = photographed.T @ photographed + np.diag(result.linear.prior[:, 1])
    spread = np.sqrt(np.diag(covariance_of(information, len(problem.names)))[:p])
    sentences = [
        f"{100.0 * float(np.max(spread)):.2g} % would be left with a million times as "
        "many photographs at the same gaps"
    ]
    stuck = [
        problem.label(k)
        for k in range(len(problem.nuisances))
        if result.nuisance[k]["sd"] > 0.98 * result.nuisance[k]["prior_sd"]
    ]
    if stuck:
        sentences.append(
            "the photographs tell nothing of " + ", ".join(stuck[:6]) + ": these must "
            "be measured otherwise"
        )
    return (*sentences, *result.directions)


def _sd_percent(information: Array, result: FitResult) -> float:
    p = len(result.problem.names)
    spread = np.sqrt(np.diag(covariance_of(information, p)))
    known = np.isfinite(result.E_MPa)
    asked = spread[: len(result.E_MPa)]
    return 100.0 * float(np.max(asked[known] if np.any(known) else asked))


def _measurements(result: FitResult) -> Iterator[Proposal]:
    """Try a closer prior of one kind of nuisance at a time."""
    problem = result.problem
    for kind, (change, sd, minutes) in MEASURE.items():
        weights = result.linear.prior[:, 1].copy()
        for k, (name, _) in enumerate(problem.nuisances):
            if name.partition("[")[0] == kind and problem.nuisance_sd[k] > sd:
                weights[len(problem.names) + k] = problem.nuisance_sd[k] / sd
        if np.any(weights != result.linear.prior[:, 1]):
            data = result.linear.jacobian.T @ result.linear.jacobian
            yield Proposal(
                change=change,
                predicted_sd_percent=_sd_percent(data + np.diag(weights**2), result),
                minutes=minutes,
            )


def _photographs(result: FitResult, runs: Sequence[RunData]) -> Iterator[Proposal]:
    """Try more photographs of the first run's rod."""
    problem = result.problem
    own = [shot for shot in problem.shots if shot.owner.run == 0]
    gaps = [shot.gap_mm for shot in own if shot.field.follows_gap]
    if not gaps:
        return
    tried: list[tuple[str, list[float], sim.Support, float]] = [
        (f"one more photograph at a gap of {gap:.0f} mm", [gap], problem.support, 1.0)
        for gap in _free_gaps(runs[0], gaps)
    ]
    tried += [
        ("all photographs once more", gaps, problem.support, 1.0),
        (
            "a picture without field, the rod far from the magnet (reference = true)",
            [REFERENCE_MM], problem.support, 1.5,
        ),
    ]  # fmt: skip
    density = problem.specimen.density_kg_m3
    if density is not None and not any(problem.support.gravity_m_s2[:2]):
        turned = replace(problem.support, gravity_m_s2=(0.0, -GRAVITY_M_PER_S2, 0.0))
        change = "the run again with the bench on its side, weight in the plane"
        tried.append((change, gaps, turned, 10.0))
    for change, at, support, effort in tried:
        information = _with_photographs(result, own[0], at, support)
        if information is not None:
            yield Proposal(
                change=change,
                predicted_sd_percent=_sd_percent(information, result),
                minutes=SHOT_MINUTES * effort * len(at),
            )


def _free_gaps(run: RunData, taken: Sequence[float]) -> list[float]:
    """Return gaps within the bench's limits, not those already taken."""
    limits = (run.record.get("rig") or {}).get("limits") or {}
    nearest = float(limits.get("min_gap_mm") or 0.8 * min(taken))
    farthest = min(float(limits.get("max_gap_mm") or 1e9), 1.5 * max(taken))
    gaps = np.linspace(nearest, farthest, GAPS)
    return [float(gap) for gap in gaps if min(abs(gap - t) for t in taken) > 1.0]


def _with_photographs(
    result: FitResult, model: Shot, gaps_mm: Sequence[float], support: sim.Support
) -> Array | None:
    """Return the information with photographs at more gaps; None if the rod is lost."""
    problem, linear = result.problem, result.linear
    shots = []
    for number, gap_mm in enumerate(gaps_mm):
        shot = _imagined(result, model, gap_mm, len(problem.shots) + number, support)
        if shot is None:
            return None
        shots.append(shot)
    new = [("clamp_position_mm", shot.owner.photograph) for shot in shots]
    new += [
        ("frame_angle_deg", shot.owner.frame)
        for shot in shots
        if shot.owner.frame == shot.owner.photograph
    ]
    sds = dict(zip((name for name, _ in problem.nuisances), problem.nuisance_sd,
                   strict=True))  # fmt: skip
    new = [(name, index) for name, index in new if name in sds]
    wide = replace(
        problem,
        support=support,
        nuisances=(*problem.nuisances, *new),
        nuisance_sd=np.array([*problem.nuisance_sd, *(sds[name] for name, _ in new)]),
    )
    unknowns = np.append(result.unknowns, np.zeros(len(new)))
    rows = [line_rows(wide, shot, unknowns)[1] for shot in shots]
    known = np.pad(linear.jacobian, ((0, 0), (0, len(new))))
    jacobian = np.concatenate([known, *rows])
    weights = np.append(linear.prior[:, 1], np.ones(len(new)))
    return np.asarray(jacobian.T @ jacobian + np.diag(weights**2))


def _imagined(
    result: FitResult, model: Shot, gap_mm: float, index: int, support: sim.Support
) -> Shot | None:
    """Return the photograph of the fitted rod at another gap."""
    if not model.field.follows_gap:
        return None
    values = values_of(result.problem, model.owner, result.unknowns)
    field = field_at(model.field, gap_mm, {})
    try:
        line = sim.solve(
            rod_of(model.specimen, values), field, support=support
        ).centreline
    except MagbendError:
        return None
    if line is None:
        return None
    shared = sum(shot.owner.frame == model.owner.frame for shot in result.problem.shots)
    frame = model.owner.frame if shared > 1 else index
    count = len(line.s_mm)
    return replace(
        model,
        owner=model.owner._replace(photograph=index, frame=frame),
        gap_mm=gap_mm,
        line=line,
        normals=np.column_stack([-np.sin(line.theta_rad), np.cos(line.theta_rad)]),
        sigma_mm=np.full(count, float(np.median(model.sigma_mm))),
        modes=mode_matrix(line.s_mm),
        bow=_bow_at(model, count),
    )


def _bow_at(model: Shot, count: int) -> Array:
    """Return the effect of a natural curvature at other points of the line."""
    old = np.linspace(0.0, 1.0, model.bow.shape[1])
    new = np.linspace(0.0, 1.0, count)
    return np.stack([
        np.column_stack([np.interp(new, old, part[:, axis]) for axis in (0, 1)])
        for part in model.bow
    ])  # fmt: skip
