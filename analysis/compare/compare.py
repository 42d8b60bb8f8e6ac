"""Measured against simulated centrelines, step by step, in both field models.

`uniform` is the paper's assumption: the flux read at the undeformed tip, everywhere.
`magnet` is the cuboid with one remanence fitted to all readings of the run, or any
sources, as they are given. What lies between the two is the price of the assumption.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import sim
from ...core.centreline import Centreline
from ...core.derived import note_derived
from ...core.errors import InputError, StoreError
from ...core.files import write_text
from ...core.magnet import Magnet
from ...core.notebook import Tabular, axes_or_new, plot_line
from ...core.specimen import Specimen
from ...core.text import defused
from ..runs.data import Frame, RunData, Step
from . import metrics
from .field import check_sources, field_of, fit_run_magnet

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

MODELS = ("uniform", "magnet")
IMPORTED = "imported"
"""The model of shapes that another program simulated (`analysis.imports`)."""

COLUMNS = (
    "run", "step", "gap_mm", "flux_mT", "model", "rms_mm", "max_mm", "tip_mm",
    "tip_percent", "tip_angle_deg", "radius_measured_mm", "radius_simulated_mm",
    "circularity_measured", "circularity_simulated", "status",
)  # fmt: skip
"""The fixed columns of ``comparison.csv``; `EXTRA_COLUMNS` follow them."""

EXTRA_COLUMNS = (
    "frechet_mm", "tip_angle_measured_deg", "tip_angle_simulated_deg",
    "circularity_uniform_rod", "a_measured_per_mm", "a_simulated_per_mm",
    "a_misfit_mm", "length_measured_mm", "length_simulated_mm", "specimen", "flags",
    "moduli",
)  # fmt: skip

LENGTH_TOLERANCE = 0.05
"""Relative difference of length above which the rod counts as another one."""

WIDTH_TOLERANCE = 0.08
"""Relative difference of width and side above which a flag is raised; the paper's own
remeasured sides differ by up to 7 % from the nominal ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Descriptors:
    """Numbers of one shape: radius, circularity and the paper's parabola."""

    radius_mm: float
    circularity: float
    a_per_mm: float
    a_misfit_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One step in one field model.

    Attributes
    ----------
    run : str
        Name of the run folder.
    step : Step
        The step.
    model : {"uniform", "magnet", "imported"}
        The field model, or where the simulated shape came from.
    status : str
        ``ok``, or why there is nothing to compare.
    flags : tuple of str
        Doubts of the frame and of the comparison.
    frame : Frame or None
        The measurement.
    solution : Solution or None
        The prediction.
    errors : ShapeErrors or None
        The distances, where status is ``ok``.
    measured, simulated : Descriptors or None
        Numbers of the two shapes.
    moduli : {"nominal", "refitted"}
        Whose moduli the prediction has.
    circularity_uniform_rod : float
        Circularity of a rod of one modulus with the same tip compliance, simulated in
        the same field: what grading the stiffness gains.
    """

    run: str
    specimen: Specimen
    step: Step
    model: str
    status: str
    flags: tuple[str, ...] = ()
    frame: Frame | None = None
    solution: sim.Solution | None = None
    errors: metrics.ShapeErrors | None = None
    measured: Descriptors | None = None
    simulated: Descriptors | None = None
    circularity_uniform_rod: float = math.nan
    moduli: str = "nominal"

    @property
    def ok(self) -> bool:
        """Whether there are numbers."""
        return self.status == "ok"

    def row(self) -> dict[str, Any]:
        """Return the row of ``comparison.csv``; NaN where there is nothing."""
        nan = math.nan
        e, m, p = self.errors, self.measured, self.simulated
        measured = self.frame.centreline if self.frame else None
        simulated = self.solution.centreline if self.solution else None
        return {
            "run": self.run,
            "step": self.step.index,
            "gap_mm": self.step.gap_mm,
            "flux_mT": self.step.flux_mT,
            "model": self.model,
            "rms_mm": e.rms_mm if e else nan,
            "max_mm": e.max_mm if e else nan,
            "tip_mm": e.tip_mm if e else nan,
            "tip_percent": e.tip_percent if e else nan,
            "tip_angle_deg": e.tip_angle_deg if e else nan,
            "radius_measured_mm": m.radius_mm if m else nan,
            "radius_simulated_mm": p.radius_mm if p else nan,
            "circularity_measured": m.circularity if m else nan,
            "circularity_simulated": p.circularity if p else nan,
            "status": self.status,
            "frechet_mm": e.frechet_mm if e else nan,
            "tip_angle_measured_deg": measured.tip_angle_deg if e and measured else nan,
            "tip_angle_simulated_deg": (
                simulated.tip_angle_deg if e and simulated else nan
            ),
            "circularity_uniform_rod": self.circularity_uniform_rod,
            "a_measured_per_mm": m.a_per_mm if m else nan,
            "a_simulated_per_mm": p.a_per_mm if p else nan,
            "a_misfit_mm": m.a_misfit_mm if m else nan,
            "length_measured_mm": measured.length_mm if measured else nan,
            "length_simulated_mm": self.specimen.length_mm,
            "specimen": self.specimen.name,
            "flags": " ".join(self.flags),
            "moduli": self.moduli,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class RunComparison(Tabular):
    """All comparisons of one run.

    Attributes
    ----------
    run : RunData
        What was compared.
    comparisons : tuple of Comparison
        One a step and model, steps first.
    magnet : Magnet or None
        The magnet with the fitted remanence.
    sources : Field or None
        What was taken in the place of the run's magnet.
    magnet_fit : MagnetFit or None
        How the readings fit one remanence, with a verdict on each.
    support : Support
        Clamp angle, weight and load factor of the simulation.
    """

    run: RunData
    comparisons: tuple[Comparison, ...]
    magnet: Magnet | None
    magnet_fit: sim.MagnetFit | None
    support: sim.Support
    sources: sim.Field | None = None

    @property
    def models(self) -> tuple[str, ...]:
        """The field models, and the imported one where a step has it."""
        return (*MODELS, IMPORTED) if self.of(IMPORTED) else MODELS

    def to_dataframe(self) -> pd.DataFrame:
        """Return the rows of ``comparison.csv``, a row a step and model."""
        return comparison_table([self])

    def plot(self, ax: Axes | None = None, *, model: str = "magnet") -> Axes:
        """Draw measured dots and the lines of a model into `ax`, or new axes."""
        ax = axes_or_new(ax, "x (mm)", "y (mm)")
        for number, comparison in enumerate(self.of(model)):
            colour = f"C{number}"
            solved = comparison.solution.centreline if comparison.solution else None
            seen = comparison.frame.centreline if comparison.frame else None
            name = f"{comparison.step.flux_mT:.3g} mT"
            if solved is not None:
                plot_line(ax, solved, color=colour, label=f"{name}, {model}")
            if seen is not None:
                every = max(1, len(seen.s_mm) // 30)
                plot_line(
                    ax, seen, color=colour, marker="o", linestyle="none",
                    markersize=3, markevery=every, label=f"{name}, measured",
                )  # fmt: skip
        ax.legend()
        return ax

    def of(self, model: str) -> tuple[Comparison, ...]:
        """Return the comparisons of one field model."""
        return tuple(c for c in self.comparisons if c.model == model)


def compare_run(
    run: RunData,
    *,
    specimen: Specimen | None = None,
    support: sim.Support | None = None,
    model: str = "rod",
    sources: sim.Field | None = None,
) -> RunComparison:
    """Compare every step of a run with the prediction, in both field models.

    Parameters
    ----------
    run : RunData
        From `load_run`.
    specimen : Specimen, optional
        The rod to simulate instead of the run's nominal one: a fitted one, say.
    support : Support, optional
        Clamp angle, weight, load factor; by default the weight of the run's bench.
    model : {"rod", "solid"}
        Rod theory (see `sim.solve`).
    sources : Field, optional
        In the place of the run's magnet, as strong as they are; those that wait for a
        gap stand at that of each step.

    Raises
    ------
    InputError
        If no source waits for a gap, and steps have different ones.
    """
    specimen = specimen or run.specimen
    support = support or run.support
    check_sources(run, sources)
    fit, magnet = (None, None) if sources is not None else fit_run_magnet(run)
    comparisons = [
        _compare(run, step, name, specimen, sources or magnet, support, model)
        for step in run.steps
        for name in (*MODELS, *((IMPORTED,) if step.imported else ()))
    ]
    return RunComparison(
        run=run,
        comparisons=tuple(comparisons),
        magnet=magnet,
        magnet_fit=fit,
        support=support,
        sources=sources,
    )


def describe(line: Centreline) -> Descriptors:
    """Return bending radius, circularity and parabola of a centreline."""
    a_per_mm, misfit_mm = metrics.quadratic_fit(line.points_mm)
    return Descriptors(
        radius_mm=metrics.fit_circle(line.points_mm).radius_mm,
        circularity=metrics.circularity(line.s_mm, line.kappa_per_mm),
        a_per_mm=a_per_mm,
        a_misfit_mm=misfit_mm,
    )


def uniform_rod(specimen: Specimen) -> Specimen:
    """Return a rod of one modulus with the same tip compliance under a tip load.

    Notes
    -----
    The pole reduction turns the magnet into a load at the tip, whose moment grows with
    the distance to the tip; so the modulus is the harmonic mean with the weight
    (L - s)^2.
    """
    length_mm = specimen.length_mm
    ends = np.cumsum([0.0, *(section.length_mm for section in specimen.sections)])
    weights = -np.diff((length_mm - ends) ** 3)
    moduli = np.array([section.E_MPa for section in specimen.sections])
    E_MPa = float(weights.sum() / np.sum(weights / moduli))
    sections = tuple(replace(section, E_MPa=E_MPa) for section in specimen.sections)
    return replace(specimen, sections=sections)


def _compare(
    run: RunData,
    step: Step,
    name: str,
    specimen: Specimen,
    magnet: Magnet | sim.Field | None,
    support: sim.Support,
    model: str,
) -> Comparison:
    frame = run.frame(step)
    base = Comparison(
        run=run.label,
        specimen=specimen,
        step=step,
        model=name,
        status="ok",
        frame=frame,
        flags=_flags(step, frame, specimen),
    )
    problem = frame_problem(frame, specimen)
    if step.imported is not None and name == IMPORTED:
        base = replace(base, solution=_as_solution(step.imported))
        if problem or frame is None or frame.centreline is None:
            return replace(base, status=problem or "no centreline")
        return _measured_against(base, frame.centreline, step.imported, None)
    field = field_of(step, name, magnet, specimen.length_mm)
    if isinstance(field, str):
        return replace(base, status=problem or field)
    solution = sim.solve(specimen, field, support=support, model=model)
    base = replace(base, solution=solution)
    if problem:
        return replace(base, status=problem)
    if solution.centreline is None or frame is None or frame.centreline is None:
        return replace(base, status=solution.status)
    return _measured_against(base, frame.centreline, solution.centreline, field)


def _as_solution(line: Centreline) -> sim.Solution:
    """Return an imported shape as a solution of which only the shape is known."""
    nan = math.nan
    return sim.Solution(
        centreline=line, status=IMPORTED, morse_index=-1, error_mm=nan,
        flux_tip_mT=(nan, nan), root_moment_Nm=nan,
    )  # fmt: skip


def _measured_against(
    base: Comparison,
    measured: Centreline,
    simulated: Centreline,
    field: sim.Field | None,
) -> Comparison:
    try:
        errors = metrics.shape_errors(measured, simulated)
    except InputError as error:
        return replace(base, status=f"no overlap: {error}")
    flags = base.flags
    mirrored = replace(
        simulated,
        y_mm=-simulated.y_mm,
        theta_rad=-simulated.theta_rad,
        kappa_per_mm=-simulated.kappa_per_mm,
    )
    if 2.0 * metrics.shape_errors(measured, mirrored).rms_mm < errors.rms_mm:
        flags = (*flags, "bends_the_other_way")
    uniform = sim.solve(uniform_rod(base.specimen), field).centreline if field else None
    return replace(
        base,
        flags=flags,
        errors=errors,
        measured=describe(measured),
        simulated=describe(simulated),
        circularity_uniform_rod=describe(uniform).circularity if uniform else math.nan,
    )


def frame_problem(frame: Frame | None, specimen: Specimen) -> str:
    """Return why the photograph cannot be compared; empty where it can."""
    if frame is None:
        return "not measured: the photograph has no row in frames.csv"
    if frame.status != "ok":
        why = frame.reason or ", ".join(frame.flags) or "no reason given"
        return f"failed frame: {why}"
    line = frame.centreline
    if line is None:
        return "no calibration: the centreline has no millimetres"
    if abs(line.length_mm / specimen.length_mm - 1.0) > LENGTH_TOLERANCE:
        return (
            f"length mismatch: measured {line.length_mm:.2f} mm, the specimen "
            f"{specimen.name!r} has {specimen.length_mm:.2f} mm"
        )
    return ""


def _flags(step: Step, frame: Frame | None, specimen: Specimen) -> tuple[str, ...]:
    flags = list(step.flags)
    if frame is not None:
        flags += frame.flags
        side_mm = float(np.mean(specimen.sides_mm))
        wrong = abs(frame.width_mm / side_mm - 1.0) > WIDTH_TOLERANCE
        if frame.status == "ok" and wrong:
            flags.append("width_mismatch")
    return tuple(dict.fromkeys(flags))


def models_of(runs: Iterable[RunComparison]) -> tuple[str, ...]:
    """Return the models that any of the runs has."""
    return max((run.models for run in runs), key=len, default=MODELS)


def comparison_table(runs: Iterable[RunComparison]) -> pd.DataFrame:
    """Return the rows of ``comparison.csv`` of all runs as a table."""
    import pandas as pd

    rows = [c.row() for run in runs for c in run.comparisons]
    return pd.DataFrame(rows, columns=[*COLUMNS, *EXTRA_COLUMNS])


def write_comparison(path: Path, runs: Iterable[RunComparison]) -> None:
    """Write ``comparison.csv``, whole or not at all; empty cells where no number is."""
    runs = list(runs)
    table = comparison_table(runs).map(defused)
    write_text(path, table.to_csv(index=False, lineterminator="\n"))
    used = [file for run in runs for file in run.run.files]
    note_derived([path], sources=used, command="analysis compare")


def check_any(runs: Sequence[RunComparison]) -> None:
    """Refuse to go on where not a single step could be compared.

    Raises
    ------
    StoreError
        With the first reason, and how many steps it holds for.
    """
    statuses = [c.status for run in runs for c in run.comparisons]
    if "ok" in statuses:
        return
    first = max(set(statuses), key=statuses.count)
    where = ", ".join(str(run.run.path) for run in runs)
    raise StoreError(
        f"{where}: no step could be compared; {statuses.count(first)} of "
        f"{len(statuses)}: {first}"
    )
