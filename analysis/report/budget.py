"""What the error at the tip is made of, in micrometres, largest first.

Each line is the move of the tip for one standard deviation of one input, by the
simulator's exact sensitivities, or the difference of two models. Standard deviations
that come from the run say where from; those nobody measured are assumed, and say so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import sim
from ...core.errors import InputError, MagbendError
from ...core.specimen import Specimen
from ..compare.compare import Comparison, RunComparison
from ..compare.field import field_of, flux_angle_deg, remanence_sd_T, usable_flux
from ..fit.nuisance import FRAME_ANGLE_SD_DEG, Nuisance
from ..fit.result import FitResult

ASSUMED = {
    "side_percent": 1.0,
    "length_mm": 0.1,
    "remanence_percent": 5.0,
    "E_percent": 10.0,
    "clamp_angle_deg": 0.5,
    "axis_angle_deg": 0.5,
    "gap_mm": Nuisance().gap_mm,
    "scale_percent": Nuisance().scale_percent,
}
"""Standard deviations taken where the run tells none: those of the fit's priors. The
fit's direction of the clamp against the field is that of clamp and axis together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetLine:
    """One cause of error at the tip.

    Attributes
    ----------
    cause : str
        What is uncertain.
    tip_um : float
        How far it moves the tip, in micrometres.
    taken : str
        The standard deviation taken, and where it comes from.
    kind : {"uncertainty", "model", "measurement"}
        An input that is not known, a choice of theory, or the photograph.
    """

    cause: str
    tip_um: float
    taken: str
    kind: str


def tip_budget(
    run: RunComparison, *, fit: FitResult | None = None
) -> tuple[BudgetLine, ...]:
    """Return the error budget at the tip, at the last step that was compared.

    Parameters
    ----------
    run : RunComparison
        The last good step of the magnet model decides (the strongest field).
    fit : FitResult, optional
        Brings the standard deviations of the moduli.

    Returns
    -------
    tuple of BudgetLine
        Largest first; empty if no step was compared.
    """
    done = [c for c in run.of("magnet") if c.ok] or [
        c for c in run.of("uniform") if c.ok
    ]
    if not done:
        return ()
    last = done[-1]
    lines = [
        *_inputs(run, last, fit),
        *_models(run, last),
        *_measurement(last),
    ]
    return tuple(sorted(lines, key=lambda line: -line.tip_um))


def _inputs(
    run: RunComparison, last: Comparison, fit: FitResult | None
) -> list[BudgetLine]:
    specimen = last.specimen
    field = _field(run, last)
    causes = _causes(run, last, field, fit)
    names = list(dict.fromkeys(name for names, _, _, _ in causes for name in names))
    result = sim.sensitivities(
        specimen,
        field,
        parameters=names,
        support=run.support,
        s_mm=np.array([specimen.length_mm]),
    )
    tips = {
        name: np.array([result.dx_mm[-1, k], result.dy_mm[-1, k]])
        for k, name in enumerate(names)
    }
    if "clamp_angle_deg" in tips and last.solution and last.solution.centreline:
        # The measured frame leaves the clamp along the rod and turns with it: what is
        # left is the field seen from another direction.
        x_mm, y_mm = last.solution.centreline.tip_mm
        tips["clamp_angle_deg"] -= math.radians(1.0) * np.array([-y_mm, x_mm])
    lines = []
    for parameters, sds, cause, taken in causes:
        moves = [tips[n] * sd for n, sd in zip(parameters, sds, strict=True)]
        if cause.startswith("moduli") and fit is not None and len(moves) > 1:
            um = _correlated(moves, fit)
        else:
            um = math.sqrt(sum(float(move @ move) for move in moves))
        lines.append(
            BudgetLine(cause=cause, tip_um=1e3 * um, taken=taken, kind="uncertainty")
        )
    return lines


def _correlated(moves: Sequence[np.ndarray], fit: FitResult) -> float:
    """Move of the tip by moduli whose errors go together, as the fit found them."""
    stack = np.array(moves)
    correlation = fit.correlation[: len(stack), : len(stack)]
    return math.sqrt(max(0.0, float(np.sum(stack * (correlation @ stack)))))


def _field(run: RunComparison, last: Comparison) -> sim.Field:
    known = run.sources or run.magnet
    name = "uniform" if known is None else "magnet"
    field = field_of(last.step, name, known, last.specimen.length_mm)
    if isinstance(field, str):
        raise InputError(f"{run.run.label}: {field}")
    return field


Cause = tuple[list[str], list[float], str, str]


def _causes(
    run: RunComparison,
    last: Comparison,
    field: sim.Field,
    fit: FitResult | None,
) -> list[Cause]:
    specimen, a = last.specimen, ASSUMED
    moduli = [f"E_MPa[{i}]" for i in range(len(specimen.sections))]
    lengths = [f"length_mm[{i}]" for i in range(len(specimen.sections))]
    known = fit is not None and all(math.isfinite(sd) for sd in fit.E_sd_MPa)
    if fit is not None and known:
        E_sd, E_from = list(fit.E_sd_MPa), "standard deviations of the fit"
    else:
        E_sd = [a["E_percent"] / 100.0 * section.E_MPa for section in specimen.sections]
        E_from = f"{a['E_percent']:g} % each, assumed"
    side_mm = float(np.mean(specimen.sides_mm))
    causes: list[Cause] = [
        (moduli, E_sd, "moduli of the sections", E_from),
        (["side_mm"], [a["side_percent"] / 100.0 * side_mm], "side of the rod",
         f"{a['side_percent']:g} %, assumed"),
        (lengths, [a["length_mm"]] * len(lengths), "unit lengths",
         f"{a['length_mm']:g} mm each, assumed"),
        (["remanence_mT"],
         [a["remanence_percent"] / 100.0 * abs(specimen.remanence_mT)],
         "remanence of the rod", f"{a['remanence_percent']:g} %, assumed"),
        (["clamp_angle_deg"], [a["clamp_angle_deg"]], "direction of the clamp",
         f"{a['clamp_angle_deg']:g} deg, assumed"),
    ]  # fmt: skip
    if isinstance(field, sim.MagnetField):
        remanence_sd = remanence_sd_T(run.magnet_fit) if run.magnet_fit else 0.01
        source = "fit to the readings" if run.magnet_fit else "assumed"
        causes += [
            (["magnet.remanence_T"], [remanence_sd], "remanence of the magnet",
             f"{remanence_sd:.2g} T, {source}"),
            (["magnet.axis_angle_deg"], [a["axis_angle_deg"]],
             "direction of the magnet", f"{a['axis_angle_deg']:g} deg, assumed"),
            (["gap_mm"], [a["gap_mm"]], "gap", f"{a['gap_mm']:g} mm, assumed"),
        ]  # fmt: skip
    elif run.sources is not None:
        if run.sources.follows_gap:
            causes.append(
                (["gap_mm"], [a["gap_mm"]], "gap", f"{a['gap_mm']:g} mm, assumed")
            )
    elif usable_flux(last.step):
        sd = last.step.flux_sd_mT if math.isfinite(last.step.flux_sd_mT) else 0.5
        causes.append((["flux_mT"], [sd], "flux density", f"{sd:.2g} mT, readings"))
    return causes


def _models(run: RunComparison, last: Comparison) -> list[BudgetLine]:
    """Differences of tip between the model used and others that could be."""
    field = _field(run, last)
    shape = sim.solve(last.specimen, field, support=run.support)
    if shape.centreline is None:
        return []
    tip = shape.centreline.tip_mm
    lines = [
        BudgetLine(
            cause="numerical error of the solver",
            tip_um=1e3 * shape.error_mm,
            taken="order p against p + 4",
            kind="model",
        )
    ]
    angle = flux_angle_deg(
        last.step, run.sources or run.magnet, last.specimen.length_mm
    )
    others: list[tuple[str, str, sim.Solution | None]] = []
    if usable_flux(last.step) and field.uniform is None:
        uniform = sim.UniformField(flux_mT=last.step.flux_mT, angle_deg=angle)
        others.append(
            ("uniform instead of true field", "the paper's assumption",
             _try(last.specimen, uniform, run.support, "rod"))
        )  # fmt: skip
    others.append(
        ("rod theory instead of a solid", "Poisson's ratio 0.49",
         _try(last.specimen, field, run.support, "solid"))
    )  # fmt: skip
    if last.specimen.density_kg_m3 is not None and not any(run.support.gravity_m_s2):
        down = replace(run.support, gravity_m_s2=(0.0, 0.0, -9.80665))
        others.append(
            ("weight left out", "bench seen from above: gravity along the view",
             _try(last.specimen, field, down, "rod"))
        )  # fmt: skip
    for cause, taken, solution in others:
        if solution is None or solution.centreline is None:
            continue
        lines.append(
            BudgetLine(
                cause=cause,
                tip_um=1e3 * math.dist(tip, solution.centreline.tip_mm),
                taken=taken,
                kind="model",
            )
        )
    return lines


def _try(
    specimen: Specimen,
    field: sim.Field,
    support: sim.Support,
    model: str,
) -> sim.Solution | None:
    """Solve with another model; None where it has no answer for this case."""
    try:
        return sim.solve(specimen, field, support=support, model=model)
    except MagbendError:
        return None


def _measurement(last: Comparison) -> list[BudgetLine]:
    frame = last.frame
    if frame is None or frame.centreline is None:
        return []
    tip_mm = math.hypot(*frame.centreline.tip_mm)
    scale = ASSUMED["scale_percent"]
    frame_deg, source = frame.clamp_angle_sd_deg, "stated by the photograph"
    if not math.isfinite(frame_deg):
        frame_deg, source = FRAME_ANGLE_SD_DEG, "assumed"
    lines = [
        BudgetLine(
            cause="scale of the camera",
            tip_um=10.0 * scale * tip_mm,
            taken=f"{scale:g} %, assumed",
            kind="measurement",
        ),
        BudgetLine(
            cause="frame at the clamp",
            tip_um=1e3 * math.radians(frame_deg) * tip_mm,
            taken=f"{frame_deg:.2g} deg, {source}",
            kind="measurement",
        ),
    ]
    sigma = float(frame.sigma_mm[-1]) if len(frame.sigma_mm) else math.nan
    if math.isfinite(sigma):
        lines.append(
            BudgetLine(
                cause="centreline at the tip",
                tip_um=1e3 * sigma,
                taken="the extraction's own standard deviation",
                kind="measurement",
            )
        )
    return lines
