"""What is fitted: measured lines and numbers of runs, the unknowns and their priors.

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
from ...core.errors import InputError, SolverError, StoreError
from ...core.specimen import Specimen
from ..compare.compare import frame_problem
from ..compare.field import check_sources, usable_flux
from ..runs.data import RunData, Step
from .fields import field_in, is_read, remanence_T
from .noise import FLOOR_MM, mode_matrix, spectrum, stated_mm
from .nuisance import Nuisance, Owner, scope_of

Array = NDArray[np.float64]

MODELS = ("magnet", "uniform", "solid")
"""The cube's field, the flux at the tip everywhere, and the cube's with a solid rod."""

UNKNOWN_SIGMA_MM = 0.05
"""Standard deviation taken where the centreline has none."""

WIDTH_PERCENT = 0.7
"""How sure a measured width is: light and shade at its edges err alike in all frames of
a run; 0.4 % on photographs of the twin bench."""

LENGTH_MM = 0.05
"""How sure a measured length is."""

READING_PERCENT = 0.2
"""What a reading scatters by besides its samples: the probe is put back by hand."""

MOST_LOG = 700.0
"""Logarithm of the greatest factor that a float can hold."""

FREE_NAMES = ("remanence_mT", "load_factor", "magnet_remanence_T")
"""What may be fitted besides the moduli, without a prior."""

_FREED = {
    "remanence_mT": "remanence_percent",
    "magnet_remanence_T": "magnet_percent",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """One measured line and the field it was taken in.

    Attributes
    ----------
    normals : ndarray, shape (n, 2)
        Unit normals of the measured line, to its left.
    sigma_mm : ndarray, shape (n,)
        Stated standard deviation of each point across the line.
    modes : ndarray, shape (m, n)
        From points across the line to modes (`noise.mode_matrix`).
    noise_mm : float
        Size of the errors of the first mode.
    bow : ndarray, shape (2, n, 2)
        What the rod's natural curvature adds to its shape: of the nominal one in mm,
        and per (1/mm) of another (`bow.with_bow`).
    frame_sd_deg : float
        How sure the photograph is of its clamp direction; NaN if it does not say.
    flags : tuple of str
        Doubts of its measurement.
    """

    owner: Owner
    label: str
    specimen: Specimen
    field: sim.Field
    gap_mm: float
    line: Centreline
    normals: Array
    sigma_mm: Array
    modes: Array
    noise_mm: float
    bow: Array
    frame_sd_deg: float
    flags: tuple[str, ...]

    @property
    def row_sd_mm(self) -> Array:
        """Standard deviation of each mode, shape (m,)."""
        return np.hypot(self.noise_mm * spectrum(len(self.modes)), FLOOR_MM)


@dataclass(frozen=True, slots=True, kw_only=True)
class Datum:
    """A number that a run states besides its lines.

    Attributes
    ----------
    kind : {"flux_mT", "width_mm", "length_mm"}
    value, sd : float
        In the unit of the kind.
    shot : Shot
        One of the run, for its rod; a reading has the field of its own step.
    """

    kind: str
    owner: Owner
    value: float
    sd: float
    specimen: Specimen
    field: sim.Field | None = None
    gap_mm: float = math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """All lines and numbers of a fit, its unknowns and their order.

    Attributes
    ----------
    names : tuple of str
        Unknowns asked for: ``E_MPa[i]`` root first, then those of `FREE_NAMES`.
    nuisances : tuple of (str, int)
        Unknowns with a prior, and the run, rod, ... (`nuisance.scope_of`) each is of.
    nuisance_sd : ndarray, shape (q,)
        Standard deviations of their priors, in their own units.
    """

    specimen: Specimen
    shots: tuple[Shot, ...]
    data: tuple[Datum, ...]
    support: sim.Support
    model: str
    names: tuple[str, ...]
    nuisances: tuple[tuple[str, int], ...]
    nuisance_sd: Array
    skipped: tuple[str, ...]

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.names) + len(self.nuisances)

    def nominal(self, name: str) -> float:
        """Return the nominal value of an unknown that is asked for."""
        if name.startswith("E_MPa"):
            return self.specimen.sections[int(name[6:-1])].E_MPa
        if name == "remanence_mT":
            return self.specimen.remanence_mT
        if name == "load_factor":
            return self.support.load_factor
        field = self.shots[0].field
        return 1.0 if is_read(field) else remanence_T(field)

    def held_by(self, owner: Owner) -> list[tuple[int, str]]:
        """Return index and name of the unknowns that something of `owner` feels."""
        p = len(self.names)
        return [
            *enumerate(self.names),
            *(
                (p + k, name)
                for k, (name, index) in enumerate(self.nuisances)
                if getattr(owner, scope_of(name)) == index
            ),
        ]

    def value(self, k: int, unknown: float) -> float:
        """Return what unknown `k` is in its own unit."""
        p = len(self.names)
        if k < p:
            if unknown > MOST_LOG:
                raise SolverError(
                    f"the data do not hold {self.names[k]}: the search drove it beyond "
                    "all numbers; free fewer parameters, or give the moduli bounds"
                )
            return self.nominal(self.names[k]) * math.exp(unknown)
        return unknown * float(self.nuisance_sd[k - p])

    def label(self, k: int) -> str:
        """Return the name of nuisance `k`, with the photograph or run it is of."""
        name, index = self.nuisances[k]
        if scope_of(name) in ("photograph", "frame"):
            return f"{name} ({self.shots[index].label})"
        many = sum(other == name for other, _ in self.nuisances) > 1
        return f"{name} ({scope_of(name)} {index + 1})" if many else name


def build_problem(
    runs: Sequence[RunData],
    *,
    model: str = "magnet",
    free: Sequence[str] = (),
    nuisance: Nuisance | None = None,
    support: sim.Support | None = None,
    sources: sim.Field | None = None,
) -> Problem:
    """Collect the shots of one or several runs of the same material.

    Parameters
    ----------
    runs : sequence of RunData
        Specimens may differ in side and unit lengths, not in their nominal moduli: one
        set of moduli is fitted to all.
    model : {"magnet", "uniform", "solid"}
        Of `MODELS`.
    free : sequence of str
        Of `FREE_NAMES`: fitted besides the moduli, without a prior.
    nuisance : Nuisance, optional
        Priors of the nuisance parameters.
    support : Support, optional
        Nominal clamp angle, weight and load factor.
    sources : Field, optional
        What the rods stood before, instead of the magnets of the runs; those that wait
        for a gap stand at that of the step.

    Raises
    ------
    InputError
        If a name is unknown.
    StoreError
        If the runs are of different materials or no step can be used.
    """
    nuisance = nuisance or Nuisance()
    support = support or common_support(runs)
    _check(runs, model, free, support)
    shots, data, skipped = _collect(runs, model, sources)
    if not shots:
        read = any(usable_flux(step) for run in runs for step in run.steps)
        lone = model != "uniform" and read and not any(run.magnet for run in runs)
        way = "; --field uniform fits the readings alone" if lone else ""
        raise StoreError(f"no step can be fitted; the first: {skipped[0]}{way}")
    held = {_FREED[name]: 0.0 for name in free if name in _FREED}
    if not any(support.gravity_m_s2):
        held["density_percent"] = 0.0
    priors = _priors(runs, shots, replace(nuisance, **held), sources)
    sections = range(len(runs[0].specimen.sections))
    return Problem(
        specimen=runs[0].specimen,
        shots=tuple(shots),
        data=tuple(data),
        support=support,
        model=model,
        names=(*(f"E_MPa[{i}]" for i in sections), *free),
        nuisances=tuple(priors),
        nuisance_sd=np.array(list(priors.values())),
        skipped=tuple(skipped),
    )


def with_noise(problem: Problem, noise_mm: Array) -> Problem:
    """Return the problem with lines that err by `noise_mm` in their first mode."""
    shots = tuple(
        replace(shot, noise_mm=float(size))
        for shot, size in zip(problem.shots, noise_mm, strict=True)
    )
    return replace(problem, shots=shots)


def with_prior(problem: Problem, name: str, index: int, sd: float) -> Problem:
    """Return the problem with another prior of one nuisance, which may be new."""
    priors = dict(zip(problem.nuisances, problem.nuisance_sd.tolist(), strict=True))
    priors[(name, index)] = sd
    return replace(
        problem,
        nuisances=tuple(priors),
        nuisance_sd=np.array(list(priors.values())),
    )


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
    runs: Sequence[RunData], model: str, free: Sequence[str], support: sim.Support
) -> None:
    unknown = [name for name in free if name not in FREE_NAMES]
    if unknown:
        raise InputError(
            f"free parameter must be one of {', '.join(FREE_NAMES)}; "
            f"instead received {unknown[0]!r}"
        )
    if support.load_factor == 0.0:
        raise InputError(
            "load_factor must be above zero for a fit: without magnetism no modulus "
            "shows; instead received 0"
        )
    if model not in MODELS:
        raise InputError(
            f"model must be one of {', '.join(MODELS)}; instead received {model!r}"
        )
    moduli = [tuple(section.E_MPa for section in run.specimen.sections) for run in runs]
    for run, other in zip(runs, moduli, strict=True):
        if other != moduli[0]:
            raise StoreError(
                f"{run.path}: its specimen {run.specimen.name!r} has other nominal "
                f"moduli than {runs[0].specimen.name!r}: fit the two separately"
            )
    for run in runs:
        if any(support.gravity_m_s2) and run.specimen.density_kg_m3 is None:
            raise StoreError(
                f"{run.path}: the specimen has no density_kg_m3, which its weight needs"
            )


def _collect(
    runs: Sequence[RunData], model: str, sources: sim.Field | None
) -> tuple[list[Shot], list[Datum], list[str]]:
    shots: list[Shot] = []
    data: list[Datum] = []
    skipped: list[str] = []
    rods = _firsts([run.specimen for run in runs])
    benches = _firsts([sources or run.magnet for run in runs])
    for index, run in enumerate(runs):
        check_sources(run, sources)
        nobody = Owner(-1, -1, index, rods[index], benches[index])
        first = len(shots)
        frames: dict[str, int] = {}
        for step in run.steps:
            field = field_in(run, step, model, sources)
            found = _shot(run, step, field, nobody._replace(photograph=len(shots)))
            if isinstance(found, str):
                skipped.append(f"{run.label}, step {step.index + 1}: {found}")
                continue
            seen = run.frame(step)
            clamp = seen.shared_clamp if seen else ""
            frame = frames.setdefault(clamp, len(shots)) if clamp else len(shots)
            shots.append(replace(found, owner=found.owner._replace(frame=frame)))
        data += _readings(run, model, sources, nobody)
        if len(shots) > first:
            data += _sizes(run, nobody)
    return shots, data, skipped


def _firsts(things: Sequence[object]) -> list[int]:
    """Return for each the index of the first that is equal to it."""
    return [list(things).index(thing) for thing in things]


def _shot(run: RunData, step: Step, field: sim.Field | str, owner: Owner) -> Shot | str:
    frame = run.frame(step)
    problem = frame_problem(frame, run.specimen)
    if problem or isinstance(field, str):
        return problem or str(field)
    if frame is None or frame.centreline is None:
        return "no centreline"
    line = frame.centreline
    stated = np.where(np.isfinite(frame.sigma_mm), frame.sigma_mm, UNKNOWN_SIGMA_MM)
    return Shot(
        owner=owner,
        label=f"{run.label}, step {step.index + 1}",
        specimen=run.specimen,
        field=field,
        gap_mm=step.gap_mm,
        line=line,
        normals=np.column_stack([-np.sin(line.theta_rad), np.cos(line.theta_rad)]),
        sigma_mm=stated,
        modes=mode_matrix(line.s_mm),
        noise_mm=stated_mm(stated),
        bow=np.zeros((2, len(line.s_mm), 2)),
        frame_sd_deg=frame.clamp_angle_sd_deg,
        flags=frame.flags,
    )


def _readings(
    run: RunData, model: str, sources: sim.Field | None, owner: Owner
) -> list[Datum]:
    data = []
    for step in run.steps:
        field = field_in(run, step, model, sources)
        if usable_flux(step) and not isinstance(field, str) and not is_read(field):
            own = step.flux_sd_mT if math.isfinite(step.flux_sd_mT) else 0.0
            sd = math.hypot(own, READING_PERCENT / 100.0 * step.flux_mT)
            data.append(
                Datum(kind="flux_mT", owner=owner, value=step.flux_mT, sd=sd,
                      specimen=run.specimen, field=field, gap_mm=step.gap_mm)
            )  # fmt: skip
    return data


def _sizes(run: RunData, owner: Owner) -> list[Datum]:
    """Width and length of the rod as its photographs show them, one value a run."""
    frames = [f for f in map(run.frame, run.steps) if f is not None and f.centreline]
    lengths = [f.centreline.length_mm for f in frames if f.centreline]
    widths = [f.width_mm for f in frames if math.isfinite(f.width_mm)]
    values = [("length_mm", float(np.mean(lengths)), LENGTH_MM)]
    if widths:
        width_mm = float(np.median(widths))
        values.append(("width_mm", width_mm, WIDTH_PERCENT / 100.0 * width_mm))
    return [
        Datum(kind=kind, owner=owner, value=value, sd=sd, specimen=run.specimen)
        for kind, value, sd in values
    ]


def _priors(
    runs: Sequence[RunData],
    shots: Sequence[Shot],
    nuisance: Nuisance,
    sources: sim.Field | None,
) -> dict[tuple[str, int], float]:
    """Return the standard deviation of every nuisance that is not held."""
    priors: dict[tuple[str, int], float] = {}
    for shot in shots:
        run, owner = runs[shot.owner.run], shot.owner
        sds = {
            name: getattr(nuisance, name)
            for name in ("clamp_angle_deg", "scale_percent", "clamp_position_mm")
        }
        sds |= nuisance.of_rod(shot.specimen)
        if owner.frame == owner.photograph:
            sds["frame_angle_deg"] = nuisance.frame_sd_deg(shot.frame_sd_deg)
        if not is_read(shot.field):
            magnet = None if sources else run.magnet
            sds["magnet_percent"] = nuisance.magnet_sd_percent(magnet)
        for name in ("meter_percent", "meter_offset_mT", "gap_mm"):
            sds[name] = getattr(nuisance, name)
        if shot.field.follows_gap:
            sds["magnet_offset_mm"] = nuisance.magnet_offset_mm
        for name, sd in sds.items():
            if sd > 0.0:
                priors[(name, getattr(owner, scope_of(name)))] = sd
    return priors
