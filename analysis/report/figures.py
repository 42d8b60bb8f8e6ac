"""The figures of a report, drawn with matplotlib's object interface."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...sim import magnet_flux_mT
from ..compare.compare import Comparison, RunComparison, models_of
from ..compare.metrics import position_at
from ..fit.result import FitResult
from .style import (
    BAD,
    FAINT,
    GOOD,
    INK,
    MAGNET,
    MODEL_COLOUR,
    MODEL_DASH,
    MODEL_LABEL,
    UNIFORM,
    drawing,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def shapes_figure(run: RunComparison) -> Figure:
    """Return measured points and both simulated lines of every step, in mm."""
    with drawing():
        figure = new_figure(85.0)
        axes = figure.subplots()
        for comparison in run.comparisons:
            _draw_simulated(axes, comparison, label=_first(run, comparison))
        for comparison in run.of("magnet"):
            line = comparison.frame.centreline if comparison.frame else None
            if line is None or comparison.status.startswith("length"):
                continue
            every = max(1, len(line.s_mm) // 40)
            axes.plot(
                line.x_mm[::every], line.y_mm[::every], "o", color=INK,
                markerfacecolor="none", markeredgewidth=0.7,
                label="measured" if comparison is _first_ok(run) else None,
            )  # fmt: skip
            axes.annotate(
                step_label(comparison), line.tip_mm, xytext=(5, 0),
                textcoords="offset points", va="center", fontsize=7, color=INK,
            )  # fmt: skip
        length = run.run.specimen.length_mm
        axes.plot([0, length], [0, 0], color=FAINT, linewidth=0.8, dashes=(1, 2))
        axes.set_xlabel("x along the undeformed rod (mm)")
        axes.set_ylabel("y (mm)")
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(x=0.12, y=0.1)
        axes.legend(loc="upper left" if _bends_up(run) else "lower left")
    return figure


def _bends_up(run: RunComparison) -> bool:
    tips = [c.frame.centreline.tip_mm[1] for c in run.of("magnet")
            if c.frame and c.frame.centreline]  # fmt: skip
    return sum(tips) >= 0.0


def _first_ok(run: RunComparison) -> Comparison | None:
    return next((c for c in run.of("magnet") if c.frame and c.frame.centreline), None)


def _first(run: RunComparison, comparison: Comparison) -> str | None:
    solved = [c for c in run.of(comparison.model) if c.solution]
    return MODEL_LABEL[comparison.model] if solved[:1] == [comparison] else None


def _draw_simulated(axes: Axes, comparison: Comparison, label: str | None) -> None:
    line = comparison.solution.centreline if comparison.solution else None
    if line is not None:
        axes.plot(
            line.x_mm, line.y_mm, color=MODEL_COLOUR[comparison.model],
            dashes=MODEL_DASH[comparison.model], label=label,
        )  # fmt: skip


def step_label(comparison: Comparison) -> str:
    """Return what tells a step from the others: its flux, or its gap."""
    step = comparison.step
    if math.isfinite(step.flux_mT):
        return f"{step.flux_mT:.3g} mT"
    return f"{step.gap_mm:g} mm gap"


def residual_figure(run: RunComparison) -> Figure:
    """Return distance measured - simulated along s, and curvature along s."""
    with drawing():
        figure = new_figure(68.0)
        left, right = figure.subplots(1, 2)
        markers = "os^Dv<>"
        for comparison in run.comparisons:
            if comparison.errors is None or comparison.frame is None:
                continue
            errors = comparison.errors
            k = [c.step for c in run.of(comparison.model)].index(comparison.step)
            across = _across(comparison)
            left.plot(
                errors.s_mm, across, color=MODEL_COLOUR[comparison.model],
                dashes=MODEL_DASH[comparison.model], marker=markers[k % 7],
                markevery=max(1, len(across) // 8),
                label=f"{step_label(comparison)}, {comparison.model}",
            )  # fmt: skip
            _draw_curvature(right, comparison, k)
        left.axhline(0.0, color=FAINT, linewidth=0.8)
        left.set_title("a  measured minus simulated, across the rod")
        left.set_xlabel("s from the clamp (mm)")
        left.set_ylabel("distance (mm)")
        left.legend(ncols=1, fontsize=6.5)
        for joint in run.run.specimen.joints_mm:
            for axes in (left, right):
                axes.axvline(joint, color=FAINT, linewidth=0.6, dashes=(1, 2))
        right.set_title("b  curvature: measured (points), magnet (line)")
        right.set_xlabel("s from the clamp (mm)")
        right.set_ylabel("curvature (1/mm)")
    return figure


def _across(comparison: Comparison) -> Any:
    """Distance across the simulated line, positive to its left."""
    errors, solution = comparison.errors, comparison.solution
    if errors is None or solution is None or solution.centreline is None:
        return np.array([])
    line = solution.centreline
    theta = np.interp(errors.s_mm, line.s_mm, line.theta_rad)
    return -np.sin(theta) * errors.dx_mm + np.cos(theta) * errors.dy_mm


def _draw_curvature(axes: Axes, comparison: Comparison, k: int) -> None:
    frame, solution = comparison.frame, comparison.solution
    if comparison.model != "magnet" or frame is None or frame.centreline is None:
        return
    line = frame.centreline
    every = max(1, len(line.s_mm) // 40)
    axes.plot(
        line.s_mm[::every], line.kappa_per_mm[::every], "os^Dv<>"[k % 7], color=INK,
        markerfacecolor="none", markeredgewidth=0.6,
    )  # fmt: skip
    if solution is not None and solution.centreline is not None:
        shape = solution.centreline
        axes.plot(shape.s_mm, shape.kappa_per_mm, color=MAGNET)


def field_figure(run: RunComparison) -> Figure | None:
    """Return readings against gap with the fitted cube, None without a fit."""
    fit, magnet = run.magnet_fit, run.magnet
    if fit is None or magnet is None:
        return None
    gaps = np.array([reading.gap_mm for reading in fit.readings])
    span = np.linspace(max(1.0, 0.9 * gaps.min()), 1.05 * gaps.max(), 60)
    length = run.run.specimen.length_mm
    tip = np.array([[length, 0.0, 0.0]])
    curve = [
        np.linalg.norm(magnet_flux_mT(magnet, tip, length_mm=length, gap_mm=gap))
        for gap in span
    ]
    with drawing():
        figure = new_figure(60.0)
        left, right = figure.subplots(1, 2)
        left.plot(span, curve, color=MAGNET, label=f"cube, {magnet.remanence_T:.4f} T")
        for reading in fit.readings:
            good = reading.verdict == "ok"
            style = {"color": GOOD if good else BAD, "marker": "o" if good else "X"}
            left.plot(reading.gap_mm, reading.flux_mT, markersize=5, **style)
            right.plot(reading.gap_mm, reading.residual_percent, markersize=5, **style)
        left.set_title("a  flux density at the undeformed tip")
        left.set_xlabel("gap from the N face (mm)")
        left.set_ylabel("flux density (mT)")
        left.legend()
        right.axhline(0.0, color=FAINT, linewidth=0.8)
        right.set_title("b  cube minus reading")
        right.set_xlabel("gap from the N face (mm)")
        right.set_ylabel("difference (%)")
    return figure


def fit_figure(fit: FitResult) -> Figure:
    """Return the residuals of the fit along s, and the moduli with their intervals."""
    with drawing():
        figure = new_figure(60.0)
        left, right = figure.subplots(1, 2, width_ratios=(3, 2))
        for k, (label, s_mm, residual_mm, _) in enumerate(fit.residual_mm[:12]):
            left.plot(
                s_mm, 1e3 * residual_mm, linewidth=0.8, marker="os^Dv<>"[k % 7],
                markevery=max(1, len(s_mm) // 8), label=label,
                color=(INK, MAGNET, UNIFORM, GOOD)[k % 4],
            )  # fmt: skip
        left.axhline(0.0, color=FAINT, linewidth=0.8)
        left.set_title("a  what the fit leaves, across the rod")
        left.set_xlabel("s from the clamp (mm)")
        left.set_ylabel("residual (um)")
        if len(fit.residual_mm) <= 6:
            left.legend(fontsize=6.5)
        where = np.arange(len(fit.E_MPa))
        right.errorbar(
            where, fit.E_MPa, yerr=1.96 * np.array(fit.E_sd_MPa), fmt="o",
            color=MAGNET, capsize=3, label="fitted, 95 %",
        )  # fmt: skip
        right.set_xticks(where, [f"section {i + 1}" for i in where])
        right.set_xlim(-0.5, len(where) - 0.5)
        right.set_title("b  moduli, root to tip")
        right.set_ylabel("Young's modulus (MPa)")
        right.legend()
    return figure


def summary_figure(runs: Sequence[RunComparison]) -> Figure:
    """Return RMS and tip distance of every comparison, uniform beside magnet."""
    with drawing():
        figure = new_figure(72.0)
        left, right = figure.subplots(1, 2)
        for model in models_of(runs):
            done = [c for run in runs for c in run.of(model) if c.errors]
            rms = np.sort([c.errors.rms_mm for c in done if c.errors])
            tip = [c.errors.tip_percent for c in done if c.errors]
            flux = [c.step.flux_mT for c in done]
            share = (np.arange(len(rms)) + 1.0) / max(1, len(rms))
            left.step(
                rms, 100.0 * share, where="post", color=MODEL_COLOUR[model],
                dashes=MODEL_DASH[model], label=MODEL_LABEL[model],
            )  # fmt: skip
            right.plot(
                flux, tip, "o" if model == "magnet" else "s",
                color=MODEL_COLOUR[model], markerfacecolor="none", markersize=4,
            )  # fmt: skip
        left.set_title("a  share of comparisons below an RMS distance")
        left.set_xlabel("RMS distance (mm)")
        left.set_ylabel("share (%)")
        left.set_ylim(0.0, 100.0)
        left.legend(loc="lower right")
        right.set_title("b  tip distance")
        right.set_xlabel("flux density read (mT)")
        right.set_ylabel("tip distance (% of length)")
    return figure


PANELS = (
    ("a  NdFeB ratio", (2, 4, 5), ("200 %", "150 %", "100 %")),
    ("b  side", (1, 2, 3), ("1.25 mm", "1.0 mm", "0.75 mm")),
    ("c  unit length", (2, 6, 7), ("10-10-10 mm", "20-5-5 mm", "5-5-20 mm")),
)
"""The paper's comparison figure: panel, GMC numbers, what tells them apart."""


def gmc_numbers(runs: Sequence[RunComparison]) -> dict[int, RunComparison]:
    """Return the runs by GMC number, empty unless a panel of the paper is complete."""
    by_number: dict[int, RunComparison] = {}
    for run in runs:
        match = re.match(r"\s*GMC\s*([1-7])\b", run.run.specimen.name)
        if match:
            by_number.setdefault(int(match.group(1)), run)
    complete = any(all(n in by_number for n in numbers) for _, numbers, _ in PANELS)
    return by_number if complete else {}


def paper_figure(by_number: dict[int, RunComparison]) -> Figure:
    """Return the paper's comparison figure: three panels, field as colour.

    Parameters
    ----------
    by_number : dict of int to RunComparison
        The runs of GMC 1 to 7; a missing one leaves its lines out.
    """
    import matplotlib as mpl

    colours = mpl.colormaps["viridis"]
    dashes: tuple[Any, ...] = ((None, None), (5, 2), (1.5, 1.5))
    done = [c for run in by_number.values() for c in run.of("magnet") if c.errors]
    fluxes = [c.step.flux_mT for c in done if math.isfinite(c.step.flux_mT)] or [0, 1]
    norm = mpl.colors.Normalize(min(fluxes) * 0.85, max(fluxes) * 1.15)
    with drawing():
        figure = new_figure(78.0, gap=0.06)
        panels = figure.subplots(1, 3, sharex=True, sharey=True)
        for axes, (title, numbers, names) in zip(panels, PANELS, strict=True):
            for number, name, dash in zip(numbers, names, dashes, strict=True):
                axes.plot([], [], color=INK, dashes=dash, label=name)
                run = by_number.get(number)
                for comparison in run.of("magnet") if run else ():
                    colour = colours(norm(comparison.step.flux_mT))
                    _draw_pair(axes, comparison, colour, dash)
            axes.set_title(title)
            axes.set_xlabel("x (mm)")
            axes.legend(loc="upper left", fontsize=7)
        panels[0].set_ylabel("y (mm)")
        scale = mpl.cm.ScalarMappable(norm=norm, cmap=colours)
        bar = figure.colorbar(scale, ax=panels, shrink=0.9, pad=0.015, aspect=28)
        bar.set_label("flux density read (mT)")
    return figure


def _draw_pair(axes: Axes, comparison: Comparison, colour: Any, dash: Any) -> None:
    if comparison.errors is None or comparison.solution is None:
        return
    shape = comparison.solution.centreline
    line = comparison.frame.centreline if comparison.frame else None
    if shape is None or line is None:
        return
    axes.plot(shape.x_mm, shape.y_mm, color=colour, dashes=dash, linewidth=1.0)
    x_mm, y_mm = position_at(line, np.linspace(0.0, line.s_mm[-1], 13))
    axes.plot(x_mm, y_mm, "o", color=colour, markersize=2.4, markeredgewidth=0)
