"""Residuals of a fit and their exact derivatives.

Residuals are distances across the measured line over the standard deviation of the
point, widened so that points which share their error count once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ... import sim
from ...core.specimen import Specimen
from ..compare.metrics import position_at
from .problem import Problem, Shot

Array = NDArray[np.float64]

WALL = 1e3
"""Residual of every point where the rod has no equilibrium."""

LEAST_CORRELATION = 0.05
"""Autocorrelation below which two points count as independent."""


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
            np.full(len(shot.sigma_mm), WALL)
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
        count = len(shot.sigma_mm)
        return np.full(count, WALL), np.zeros((count, problem.size))
    names = [*(f"E_MPa[{i}]" for i in range(len(specimen.sections)))]
    names += ["clamp_angle_deg", "load_factor"]
    if isinstance(field, sim.MagnetField):
        names += ["gap_mm"]
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
        if index == shot.holder(name):
            values[name] = float(value)
    return values


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
    field = shot.field
    if isinstance(field, sim.MagnetField) and "gap_mm" in values:
        field = replace(field, gap_mm=field.gap_mm + values["gap_mm"])
        load *= 1.0 + shot.remanence_per_mm * values["gap_mm"]
    gx, gy, gz = base.gravity_m_s2
    support = replace(
        base,
        clamp_angle_deg=base.clamp_angle_deg + values.get("clamp_angle_deg", 0.0),
        load_factor=load,
        gravity_m_s2=(weight * gx, weight * gy, weight * gz),
    )
    return specimen, field, support


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
        "clamp_position_mm": lambda: np.tile([0.0, 1.0], (len(shot.sigma_mm), 1)),
        "magnet_percent": lambda: load / (100.0 + values["magnet_percent"]),
        "gap_mm": lambda: (
            seen["gap_mm"]
            + load
            * shot.remanence_per_mm
            / (1.0 + shot.remanence_per_mm * values["gap_mm"])
        ),
        "weight_percent": lambda: (
            (
                seen["gravity_m_s2[0]"] * gravity[0]
                + seen["gravity_m_s2[1]"] * gravity[1]
            )
            / 100.0
        ),
    }
    jacobian = np.zeros((len(shot.sigma_mm), problem.size))
    for k, name in enumerate(problem.names):
        slope = seen[name] * values[name] if name.startswith("E_MPa") else load
        jacobian[:, k] = -_across(shot, slope)
    for k, (name, index) in enumerate(problem.nuisances):
        if index == shot.holder(name):
            column = _across(shot, columns[name]()) * problem.nuisance_sd[k]
            jacobian[:, len(problem.names) + k] = -column
    return jacobian


def shared_length_mm(problem: Problem, residual: Array) -> float:
    """Return over which length the residuals of the lines hang together.

    Notes
    -----
    The integrated autocorrelation, 1 + 2 sum of rho_k, times the distance of the points
    (Sokal 1997, Eq. 2.16); the sum ends where rho_k is lost in its own scatter.
    """
    lines, start = [], 0
    for shot in problem.shots:
        stop = start + len(shot.sd_mm)
        lines.append(residual[start:stop] * shot.sd_mm / shot.sigma_mm)
        start = stop
    power = float(np.mean(np.concatenate(lines) ** 2))
    total = 1.0
    for lag in range(1, min(len(line) for line in lines) // 2 if power else 0):
        pairs = np.concatenate([line[lag:] * line[:-lag] for line in lines])
        rho = float(np.mean(pairs)) / power
        if rho < LEAST_CORRELATION:
            break
        total += 2.0 * rho
    return total * float(np.mean([shot.spacing_mm for shot in problem.shots]))
