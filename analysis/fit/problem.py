"""What is fitted: the measured lines of steps and runs, the unknowns and their priors.

Unknowns are dimensionless: moduli, remanences and the load factor by their logarithm
(relative to the nominal value), nuisance parameters in units of their prior standard
deviation, so that a prior is one more residual of weight one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ... import sim
from ...core.centreline import Centreline
from ...core.errors import InputError, StoreError
from ...core.magnet import Magnet
from ...core.specimen import Specimen
from ..compare.compare import field_of, fit_run_magnet, frame_problem, remanence_sd_T
from ..runs.load import RunData, Step
from .nuisance import Nuisance

Array = NDArray[np.float64]

MODEL_SD_MM = {"magnet": 1e-4, "uniform": 0.1}
"""What a shape is off by in the field model alone, besides the measured line's own
standard deviation. A uniform field is wrong by tenths of a millimetre."""

UNKNOWN_SIGMA_MM = 0.05
"""Standard deviation taken where the centreline has none."""

START_SHARED_MM = 8.0
"""Over which a line's points share their error, to start with: long, so that the priors
hold the nuisances and what they cannot explain stays in the residuals to be seen."""

FREE_NAMES = ("remanence_mT", "load_factor", "magnet_remanence_T")
"""What may be fitted besides the moduli, without a prior."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """One measured line and the field it was taken in.

    Attributes
    ----------
    run, step, frame : int
        Index in the problem of the run, of the shot, and of the first shot whose
        photograph has the same clamp direction, and so the same error of it.
    normals : ndarray, shape (n, 2)
        Unit normals of the measured line, to its left.
    sigma_mm : ndarray, shape (n,)
        Standard deviation of each point across the line.
    sd_mm : ndarray, shape (n,)
        The same, widened so that the points count as independent.
    frame_sd_deg : float
        How sure the photograph is of its clamp direction; NaN if it does not say.
    remanence_per_mm : float
        Relative change of the magnet's remanence that keeps the run's readings if the
        magnet stands one mm farther.
    """

    run: int
    step: int
    frame: int
    label: str
    specimen: Specimen
    field: sim.UniformField | sim.MagnetField
    line: Centreline
    normals: Array
    sigma_mm: Array
    sd_mm: Array
    frame_sd_deg: float
    remanence_per_mm: float

    def holder(self, nuisance: str) -> int:
        """Return the index of what a nuisance of this shot belongs to."""
        own = {"clamp_position_mm": self.step, "frame_angle_deg": self.frame}
        return own.get(nuisance, self.run)

    @property
    def spacing_mm(self) -> float:
        """Distance of neighbouring points."""
        return self.line.length_mm / (len(self.line.s_mm) - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """All shots of a fit, its unknowns and their order.

    Attributes
    ----------
    names : tuple of str
        Unknowns asked for: ``E_MPa[i]`` root first, then those of `FREE_NAMES`.
    nuisances : tuple of str
        Unknowns with a prior: a name of `NUISANCE_NAMES`, and the run or shot it is of.
    nuisance_sd : ndarray, shape (q,)
        Standard deviations of their priors, in their own units.
    shared_mm : float
        Over which neighbouring points of a line share their error.
    """

    specimen: Specimen
    shots: tuple[Shot, ...]
    support: sim.Support
    names: tuple[str, ...]
    nuisances: tuple[tuple[str, int], ...]
    nuisance_sd: Array
    shared_mm: float
    skipped: tuple[str, ...]

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.names) + len(self.nuisances)

    @property
    def independent_points(self) -> float:
        """How many points count, those that share their error once."""
        return sum(
            len(shot.sd_mm) * float(np.mean((shot.sigma_mm / shot.sd_mm) ** 2))
            for shot in self.shots
        )

    def nominal(self, name: str) -> float:
        """Return the nominal value of an unknown that is asked for."""
        if name.startswith("E_MPa"):
            return self.specimen.sections[int(name[6:-1])].E_MPa
        if name == "remanence_mT":
            return self.specimen.remanence_mT
        if name == "load_factor":
            return self.support.load_factor
        field = self.shots[0].field
        return field.magnet.remanence_T if isinstance(field, sim.MagnetField) else 1.0


def build_problem(
    runs: Sequence[RunData],
    *,
    model: str = "magnet",
    free: Sequence[str] = (),
    nuisance: Nuisance | None = None,
    support: sim.Support | None = None,
    shared_mm: float = START_SHARED_MM,
) -> Problem:
    """Collect the shots of one or several runs of the same material.

    Parameters
    ----------
    runs : sequence of RunData
        Specimens may differ in side and unit lengths, not in their nominal moduli: one
        set of moduli is fitted to all.
    model : {"magnet", "uniform"}
        Field model.
    free : sequence of str
        Of `FREE_NAMES`: fitted besides the moduli, without a prior.
    nuisance : Nuisance, optional
        Priors of the nuisance parameters.
    support : Support, optional
        Nominal clamp angle, weight and load factor.
    shared_mm : float
        Over which neighbouring points of a measured line share their error.

    Raises
    ------
    InputError
        If a name is unknown, or the weight is asked for and there is none.
    StoreError
        If the runs are of different materials or no step can be used.
    """
    nuisance = nuisance or Nuisance()
    support = support or common_support(runs)
    _check(runs, free, nuisance, support)
    shots: list[Shot] = []
    frames: dict[tuple[int, str], int] = {}
    skipped: list[str] = []
    magnet_sd: list[float] = []
    for index, run in enumerate(runs):
        fit, magnet = fit_run_magnet(run)
        relative = remanence_sd_T(fit) / fit.remanence_T if fit else 0.0
        magnet_sd.append(math.hypot(100.0 * relative, nuisance.magnet_percent))
        slope = _remanence_per_mm(run)
        for step in run.steps:
            seen = run.frame(step)
            clamp = (index, seen.shared_clamp if seen else "")
            first = frames.get(clamp, len(shots))
            shot = _shot(run, step, (index, len(shots), first), model, magnet, slope)
            if isinstance(shot, str):
                skipped.append(f"{run.label}, step {step.index}: {shot}")
            else:
                shots.append(shot)
                if clamp[1]:
                    frames[clamp] = first
    if not shots:
        raise StoreError(f"no step can be fitted; the first: {skipped[0]}")
    if "magnet_remanence_T" in free:
        nuisance = replace(nuisance, magnet_percent=0.0)
    nuisances, sds = _nuisances(runs, shots, nuisance, magnet_sd)
    sections = range(len(runs[0].specimen.sections))
    problem = Problem(
        specimen=runs[0].specimen,
        shots=tuple(shots),
        support=support,
        names=(*(f"E_MPa[{i}]" for i in sections), *free),
        nuisances=tuple(nuisances),
        nuisance_sd=np.array(sds),
        shared_mm=shared_mm,
        skipped=tuple(skipped),
    )
    return with_shared(problem, shared_mm)


def with_shared(problem: Problem, shared_mm: float) -> Problem:
    """Return the problem with lines whose points within `shared_mm` count once."""
    shots = tuple(
        replace(
            shot,
            sd_mm=shot.sigma_mm * math.sqrt(max(1.0, shared_mm / shot.spacing_mm)),
        )
        for shot in problem.shots
    )
    return replace(problem, shots=shots, shared_mm=shared_mm)


def common_support(runs: Sequence[RunData]) -> sim.Support:
    """Return the weight that the rig files of all runs tell.

    Raises
    ------
    StoreError
        If the bench of one of them stood otherwise.
    """
    support = runs[0].support
    for run in runs:
        if run.support != support:
            raise StoreError(
                f"{run.path}: weight acts along {run.support.gravity_m_s2} m/s2 on it, "
                f"but along {support.gravity_m_s2} m/s2 on {runs[0].path} ([bench] up, "
                "density_kg_m3): fit the two separately, or give --gravity-m-s2"
            )
    return support


def _check(
    runs: Sequence[RunData],
    free: Sequence[str],
    nuisance: Nuisance,
    support: sim.Support,
) -> None:
    unknown = [name for name in free if name not in FREE_NAMES]
    if unknown:
        raise InputError(
            f"free parameter must be one of {', '.join(FREE_NAMES)}; "
            f"instead received {unknown[0]!r}"
        )
    moduli = [tuple(section.E_MPa for section in run.specimen.sections) for run in runs]
    for run, other in zip(runs, moduli, strict=True):
        if other != moduli[0]:
            raise StoreError(
                f"{run.path}: its specimen {run.specimen.name!r} has other nominal "
                f"moduli than {runs[0].specimen.name!r}: fit the two separately"
            )
    heavy = any(support.gravity_m_s2)
    if nuisance.weight_percent and not heavy:
        raise InputError(
            "the weight can only be a nuisance where there is weight; give "
            "gravity_m_s2 and a specimen with density_kg_m3"
        )
    for run in runs:
        if heavy and run.specimen.density_kg_m3 is None:
            raise StoreError(
                f"{run.path}: the specimen has no density_kg_m3, which its weight needs"
            )


def _remanence_per_mm(run: RunData) -> float:
    """Return how much stronger, per mm, the magnet is if it stands farther away."""
    near, far = (fit_run_magnet(run, farther_mm=shift)[0] for shift in (-0.1, 0.1))
    if near is None or far is None:
        return 0.0
    return math.log(far.remanence_T / near.remanence_T) / 0.2


def _shot(
    run: RunData, step: Step, indices: tuple[int, int, int], model: str,
    magnet: Magnet | None, remanence_per_mm: float,
) -> Shot | str:  # fmt: skip
    frame = run.frame(step)
    problem = frame_problem(frame, run.specimen)
    field = field_of(step, model, magnet)
    if problem or isinstance(field, str):
        return problem or str(field)
    if frame is None or frame.centreline is None:
        return "no centreline"
    line = frame.centreline
    inside = line.s_mm <= run.specimen.length_mm * (1.0 + 1e-9)
    stated = np.where(np.isfinite(frame.sigma_mm), frame.sigma_mm, UNKNOWN_SIGMA_MM)
    sigma = np.hypot(stated[inside], MODEL_SD_MM[model])
    theta = line.theta_rad[inside]
    return Shot(
        run=indices[0],
        step=indices[1],
        frame=indices[2],
        label=f"{run.label}, step {step.index}",
        specimen=run.specimen,
        field=field,
        line=Centreline(
            **{
                name: getattr(line, name)[inside]
                for name in ("s_mm", "x_mm", "y_mm", "theta_rad", "kappa_per_mm")
            }
        ),
        normals=np.column_stack([-np.sin(theta), np.cos(theta)]),
        sigma_mm=sigma,
        sd_mm=sigma,
        frame_sd_deg=frame.clamp_angle_sd_deg,
        remanence_per_mm=remanence_per_mm,
    )


def _nuisances(
    runs: Sequence[RunData],
    shots: Sequence[Shot],
    nuisance: Nuisance,
    magnet_sd: Sequence[float],
) -> tuple[list[tuple[str, int]], list[float]]:
    nuisances: list[tuple[str, int]] = []
    sds: list[float] = []

    def add(name: str, index: int, sd: float) -> None:
        if sd > 0.0:
            nuisances.append((name, index))
            sds.append(sd)

    magnets = {s.run for s in shots if isinstance(s.field, sim.MagnetField)}
    for index in range(len(runs)):
        add("clamp_angle_deg", index, nuisance.clamp_angle_deg)
        add("scale_percent", index, nuisance.scale_percent)
        add("weight_percent", index, nuisance.weight_percent)
        if nuisance.magnet_percent:
            add("magnet_percent", index, magnet_sd[index])
        if index in magnets:
            add("gap_mm", index, nuisance.gap_mm)
    for shot in shots:
        add("clamp_position_mm", shot.step, nuisance.clamp_position_mm)
        if shot.frame == shot.step:
            add("frame_angle_deg", shot.frame, nuisance.frame_sd_deg(shot.frame_sd_deg))
    return nuisances, sds
