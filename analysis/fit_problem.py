"""What a fit minimises: residuals and their exact derivatives over steps and runs.

Residuals are distances across the measured line, in units of their standard deviation.
Unknowns are dimensionless: moduli, remanences and the load factor by their logarithm
(relative to the nominal value), nuisance parameters in units of their prior standard
deviation, so that a prior is one more residual of weight one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .. import sim
from ..core.centreline import Centreline
from ..core.errors import InputError, StoreError
from ..core.magnet import Magnet
from ..core.specimen import Specimen
from .compare import field_of, fit_run_magnet, frame_problem
from .load import RunData, Step
from .metrics import position_at

Array = NDArray[np.float64]

SIGMA_FLOOR_MM = {"magnet": 0.002, "uniform": 0.1}
"""Least standard deviation of a measured point, by field model. Before the magnet's
field the camera's pixels, the paper and the lens decide, which no centreline knows of;
a uniform field is itself wrong by tenths of a millimetre."""

WALL = 1e3
"""Residual of every point where the rod has no equilibrium."""

UNKNOWN_SIGMA_MM = 0.05
"""Standard deviation taken where the centreline has none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Nuisance:
    """A parameter nobody asks for, known to `sd` (0: held) around its nominal value.

    Attributes
    ----------
    sd : float
        Standard deviation of the prior, in the unit of the name it is filed under.
    """

    clamp_angle_deg: float = 1.0
    clamp_position_mm: float = 0.05
    frame_angle_deg: float = 0.3
    scale_percent: float = 0.2
    magnet_percent: float = 0.5
    weight_percent: float = 0.0

    def __post_init__(self) -> None:
        for name in NUISANCE_NAMES:
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(
                    f"prior of {name} must be zero (held) or above; "
                    f"instead received {value!r}"
                )


NUISANCE_NAMES = (
    "clamp_angle_deg", "clamp_position_mm", "frame_angle_deg", "scale_percent",
    "magnet_percent", "weight_percent",
)  # fmt: skip

FREE_NAMES = ("remanence_mT", "load_factor", "magnet_remanence_T")
"""What may be fitted besides the moduli, without a prior."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """One measured line and the field it was taken in.

    Attributes
    ----------
    run, step : int
        Index of the run and of the shot in the problem.
    normals : ndarray, shape (n, 2)
        Unit normals of the measured line, to its left.
    sd_mm : ndarray, shape (n,)
        Standard deviation of each point, correlation included: with it the points
        count as independent.
    """

    run: int
    step: int
    label: str
    specimen: Specimen
    field: sim.UniformField | sim.MagnetField
    line: Centreline
    normals: Array
    sd_mm: Array


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
    """

    specimen: Specimen
    shots: tuple[Shot, ...]
    support: sim.Support
    names: tuple[str, ...]
    nuisances: tuple[tuple[str, int], ...]
    nuisance_sd: Array
    correlation_points: float
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
        return field.magnet.remanence_T if isinstance(field, sim.MagnetField) else 1.0


def build_problem(
    runs: Sequence[RunData],
    *,
    model: str = "magnet",
    free: Sequence[str] = (),
    nuisance: Nuisance | None = None,
    support: sim.Support | None = None,
    independent_every_mm: float = 2.0,
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
    independent_every_mm : float
        Length over which neighbouring points of a measured line share their error (the
        spline and the edge profiles smooth over about this much).

    Raises
    ------
    InputError
        If a name is unknown, or the weight is asked for and there is none.
    StoreError
        If the runs are of different materials or no step can be used.
    """
    nuisance = nuisance or Nuisance()
    support = support or sim.Support()
    _check(runs, free, nuisance, support)
    shots: list[Shot] = []
    skipped: list[str] = []
    magnet_sd: list[float] = []
    for index, run in enumerate(runs):
        fit, magnet = fit_run_magnet(run)
        relative = fit.remanence_sd_T / fit.remanence_T if fit else 0.0
        magnet_sd.append(math.hypot(100.0 * relative, nuisance.magnet_percent))
        for step in run.steps:
            shot = _shot(run, step, index, len(shots), model, magnet)
            if isinstance(shot, str):
                skipped.append(f"{run.label}, step {step.index}: {shot}")
            else:
                shots.append(_weighted(shot, independent_every_mm))
    if not shots:
        raise StoreError(f"no step can be fitted; the first: {skipped[0]}")
    if "magnet_remanence_T" in free:
        nuisance = replace(nuisance, magnet_percent=0.0)
    nuisances, sds = _nuisances(runs, shots, nuisance, magnet_sd)
    sections = range(len(runs[0].specimen.sections))
    points = sum(len(shot.line.s_mm) for shot in shots)
    length_mm = sum(shot.line.length_mm for shot in shots)
    return Problem(
        specimen=runs[0].specimen,
        shots=tuple(shots),
        support=support,
        names=(*(f"E_MPa[{i}]" for i in sections), *free),
        nuisances=tuple(nuisances),
        nuisance_sd=np.array(sds),
        correlation_points=max(1.0, independent_every_mm * points / length_mm),
        skipped=tuple(skipped),
    )


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


def _shot(
    run: RunData, step: Step, run_index: int, index: int, model: str,
    magnet: Magnet | None,
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
    sigma = np.where(np.isfinite(frame.sigma_mm), frame.sigma_mm, UNKNOWN_SIGMA_MM)
    theta = line.theta_rad[inside]
    return Shot(
        run=run_index,
        step=index,
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
        sd_mm=np.hypot(sigma[inside], SIGMA_FLOOR_MM[model]),
    )


def _weighted(shot: Shot, every_mm: float) -> Shot:
    """Widen the standard deviations so that correlated points count once."""
    spacing_mm = shot.line.length_mm / (len(shot.line.s_mm) - 1)
    return replace(shot, sd_mm=shot.sd_mm * math.sqrt(max(1.0, every_mm / spacing_mm)))


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

    for index in range(len(runs)):
        add("clamp_angle_deg", index, nuisance.clamp_angle_deg)
        add("scale_percent", index, nuisance.scale_percent)
        add("weight_percent", index, nuisance.weight_percent)
        if nuisance.magnet_percent:
            add("magnet_percent", index, magnet_sd[index])
    for shot in shots:
        add("clamp_position_mm", shot.step, nuisance.clamp_position_mm)
        add("frame_angle_deg", shot.step, nuisance.frame_angle_deg)
    return nuisances, sds


def residuals(problem: Problem, unknowns: Array) -> tuple[Array, Array]:
    """Return residuals of the data and their derivatives.

    Parameters
    ----------
    unknowns : ndarray, shape (p + q,)
        Logarithms of value over nominal value for `names`, then nuisances in units of
        their prior standard deviation.

    Returns
    -------
    residual : ndarray, shape (n,)
        Measured minus predicted, across the line, over its standard deviation.
    jacobian : ndarray, shape (n, p + q)
        Derivatives of the residuals.
    """
    parts = [_shot_residuals(problem, shot, unknowns) for shot in problem.shots]
    return (
        np.concatenate([residual for residual, _ in parts]),
        np.concatenate([jacobian for _, jacobian in parts]),
    )


def misfit(problem: Problem, unknowns: Array) -> Array:
    """Return the residuals alone, as `residuals` does, at a fifth of its cost."""
    parts = []
    for shot in problem.shots:
        values = _values(problem, shot, unknowns)
        xy_mm = _shape(shot, *_model(problem, shot, values))
        parts.append(
            np.full(len(shot.sd_mm), WALL)
            if xy_mm is None
            else _seen(shot, values, xy_mm)[0]
        )
    return np.concatenate(parts)


def _shape(
    shot: Shot,
    specimen: Specimen,
    field: sim.UniformField | sim.MagnetField,
    support: sim.Support,
) -> Array | None:
    """Return the predicted points, shape (n, 2), None where there is no equilibrium."""
    shape = sim.solve(specimen, field, support=support, points=241).centreline
    if shape is None:
        return None
    return np.column_stack(position_at(shape, _stations(shot)))


def _stations(shot: Shot) -> Array:
    # A measured line may be a little longer than the rod, never asked beyond its tip.
    return np.minimum(shot.line.s_mm, shot.specimen.length_mm)


def _shot_residuals(
    problem: Problem, shot: Shot, unknowns: Array
) -> tuple[Array, Array]:
    values = _values(problem, shot, unknowns)
    specimen, field, support = _model(problem, shot, values)
    xy_mm = _shape(shot, specimen, field, support)
    if xy_mm is None:
        # No equilibrium at these values: a wall that sends the search back.
        count = len(shot.sd_mm)
        return np.full(count, WALL), np.zeros((count, problem.size))
    names = [*(f"E_MPa[{i}]" for i in range(len(specimen.sections)))]
    names += ["clamp_angle_deg", "load_factor"]
    if any(support.gravity_m_s2):
        names += ["gravity_m_s2[0]", "gravity_m_s2[1]"]
    result = sim.sensitivities(
        specimen, field, parameters=names, support=support, s_mm=_stations(shot)
    )
    slopes = {
        name: np.column_stack([result.dx_mm[:, k], result.dy_mm[:, k]])
        for k, name in enumerate(names)
    }
    residual, seen = _seen(shot, values, xy_mm)
    return residual, _derivatives(problem, shot, values, seen, slopes)


def _values(problem: Problem, shot: Shot, unknowns: Array) -> dict[str, float]:
    """Return what the unknowns mean for one shot, by name, in their own units."""
    values = {
        name: problem.nominal(name) * math.exp(unknowns[k])
        for k, name in enumerate(problem.names)
    }
    scaled = unknowns[len(problem.names) :] * problem.nuisance_sd
    for (name, index), value in zip(problem.nuisances, scaled, strict=True):
        if index == (shot.step if name in PER_SHOT else shot.run):
            values[name] = float(value)
    return values


PER_SHOT = ("clamp_position_mm", "frame_angle_deg")


def _model(
    problem: Problem, shot: Shot, values: dict[str, float]
) -> tuple[Specimen, sim.UniformField | sim.MagnetField, sim.Support]:
    sections = tuple(
        replace(section, E_MPa=values[f"E_MPa[{i}]"])
        for i, section in enumerate(shot.specimen.sections)
    )
    specimen = replace(shot.specimen, sections=sections)
    base = problem.support
    weight = 1.0 + values.get("weight_percent", 0.0) / 100.0
    # Remanences of rod and magnet enter, like the load factor, as factors on the load.
    load = values.get("load_factor", base.load_factor)
    load *= 1.0 + values.get("magnet_percent", 0.0) / 100.0
    for name in ("remanence_mT", "magnet_remanence_T"):
        if name in values:
            load *= values[name] / problem.nominal(name)
    gx, gy, gz = base.gravity_m_s2
    support = replace(
        base,
        clamp_angle_deg=base.clamp_angle_deg + values.get("clamp_angle_deg", 0.0),
        load_factor=load,
        gravity_m_s2=(weight * gx, weight * gy, weight * gz),
    )
    return specimen, shot.field, support


@dataclass(frozen=True, slots=True, kw_only=True)
class _View:
    """How the predicted points of one shot are seen: rotation, scale, turned points."""

    rotation: Array
    scale: float
    turned: Array


def _seen(shot: Shot, values: dict[str, float], xy_mm: Array) -> tuple[Array, _View]:
    """Turn the prediction into the measured frame; return the residuals across it.

    The measured frame leaves the clamp along the rod: it is turned back by the clamp's
    angle, then by the error of the frame, shifted across, and scaled.
    """
    turn = math.radians(
        values.get("frame_angle_deg", 0.0) - values.get("clamp_angle_deg", 0.0)
    )
    scale = 1.0 + values.get("scale_percent", 0.0) / 100.0
    c, s = math.cos(turn), math.sin(turn)
    rotation = np.array([[c, -s], [s, c]])
    turned = xy_mm @ rotation.T
    shift = np.array([0.0, values.get("clamp_position_mm", 0.0)])
    measured = np.column_stack([shot.line.x_mm, shot.line.y_mm])
    residual = _across(shot, measured - scale * turned - shift)
    return residual, _View(rotation=rotation, scale=scale, turned=turned)


def _across(shot: Shot, vectors: Array) -> Array:
    """Return the parts of vectors across the line, in standard deviations."""
    return np.asarray(np.sum(vectors * shot.normals, axis=1) / shot.sd_mm)


def _derivatives(
    problem: Problem,
    shot: Shot,
    values: dict[str, float],
    view: _View,
    slopes: dict[str, Array],
) -> Array:
    """Return the derivatives of the residuals, shape (n, p + q)."""
    seen = {
        name: view.scale * slope @ view.rotation.T for name, slope in slopes.items()
    }
    load = seen["load_factor"] * _model(problem, shot, values)[2].load_factor
    around = view.scale * np.column_stack([-view.turned[:, 1], view.turned[:, 0]])
    degree = math.pi / 180.0
    gravity = problem.support.gravity_m_s2
    columns: dict[str, Callable[[], Array]] = {
        "clamp_angle_deg": lambda: seen["clamp_angle_deg"] - degree * around,
        "frame_angle_deg": lambda: degree * around,
        "scale_percent": lambda: view.turned / 100.0,
        "clamp_position_mm": lambda: np.tile([0.0, 1.0], (len(shot.sd_mm), 1)),
        "magnet_percent": lambda: load / (100.0 + values["magnet_percent"]),
        "weight_percent": lambda: (
            (
                seen["gravity_m_s2[0]"] * gravity[0]
                + seen["gravity_m_s2[1]"] * gravity[1]
            )
            / 100.0
        ),
    }
    jacobian = np.zeros((len(shot.sd_mm), problem.size))
    for k, name in enumerate(problem.names):
        slope = seen[name] * values[name] if name.startswith("E_MPa") else load
        jacobian[:, k] = -_across(shot, slope)
    for k, (name, index) in enumerate(problem.nuisances):
        if index == (shot.step if name in PER_SHOT else shot.run):
            column = _across(shot, columns[name]()) * problem.nuisance_sd[k]
            jacobian[:, len(problem.names) + k] = -column
    return jacobian
