"""The figures of one run: shapes, distances, curvature, field; each takes axes."""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...sim import magnet_flux_mT
from ..compare.compare import Comparison, RunComparison
from ..runs.data import Frame
from .style import (
    BAD,
    FAINT,
    GOOD,
    INK,
    MAGNET,
    MARKERS,
    MODEL_COLOUR,
    MODEL_DASH,
    MODEL_LABEL,
    SERIES,
    WIDTH_MM,
    drawing,
    new_panels,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation

Array = NDArray[np.float64]

_95 = 1.96
"""Half width of a 95 % interval in standard deviations."""


def shapes_figure(run: RunComparison, *, width_mm: float = WIDTH_MM) -> Figure:
    """Return measured points and the simulated lines of every step, in mm."""
    with drawing():
        height_mm = max(66.0, 0.47 * width_mm)
        figure, (axes,) = new_panels(1, height_mm=height_mm, width_mm=width_mm)
        draw_shapes(axes, run)
    return figure


def draw_shapes(axes: Axes, run: RunComparison) -> None:
    """Draw measured points with their 95 % intervals, and simulated lines."""
    for comparison in run.comparisons:
        _draw_simulated(axes, comparison, label=_first(run, comparison))
    seen = _measured(run)
    names = []
    for comparison in seen:
        frame = comparison.frame
        if frame is None or frame.centreline is None:
            continue
        label = "measured" if comparison is seen[0] else None
        _draw_points(axes, frame, label).set_gid(f"measured, {step_label(comparison)}")
        name = axes.annotate(
            step_label(comparison), frame.centreline.tip_mm, xytext=(5, 0),
            textcoords="offset points", va="center", fontsize=7, color=INK,
            arrowprops={"arrowstyle": "-", "color": FAINT, "linewidth": 0.5,
                        "relpos": (0.0, 0.5), "shrinkA": 0.0, "shrinkB": 2.0},
        )  # fmt: skip
        names.append(name)
    length = run.run.specimen.length_mm
    axes.plot([0, length], [0, 0], color=FAINT, linewidth=0.8, dashes=(1, 2))
    axes.set_xlabel("x along the undeformed rod (mm)")
    axes.set_ylabel("y (mm)")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(x=0.24, y=0.1)
    axes.legend(loc="upper left" if _bends_up(seen) else "lower left")
    _part(axes, names)


def _part(axes: Axes, names: list[Annotation]) -> None:
    """Move names at tips that lie close to each other apart, up and down."""
    from matplotlib.text import Text

    figure = axes.get_figure(root=True)
    if figure is None:
        return
    figure.draw_without_rendering()  # only then is known where the tips come to lie
    boxes = [Text.get_window_extent(name) for name in names]  # without the lines
    middles = np.array([0.5 * (box.y0 + box.y1) for box in boxes])
    shifts = np.zeros(len(names))
    order = [int(k) for k in np.argsort(middles, kind="stable")]
    for _ in range(100):
        for below, above in combinations(order, 2):
            a, b = boxes[below], boxes[above]
            if a.x1 < b.x0 or b.x1 < a.x0:
                continue
            lies = middles[above] + shifts[above] - middles[below] - shifts[below]
            push = 0.5 * max(0.0, 0.5 * (a.height + b.height) - lies)
            shifts[below] -= push
            shifts[above] += push
    for name, shift in zip(names, shifts, strict=True):
        shift_pt = float(shift) * 72.0 / figure.dpi
        is_far = abs(shift_pt) > 4.0
        name.set_position((9.0 if is_far else 5.0, shift_pt))
        if name.arrow_patch is not None:
            name.arrow_patch.set_visible(is_far)


def _draw_points(axes: Axes, frame: Frame, label: str | None) -> Artist:
    line = frame.centreline
    if line is None:
        raise InputError("a frame must have a centreline to be drawn")
    every = max(1, len(line.s_mm) // 30)
    sigma = np.where(np.isfinite(frame.sigma_mm), frame.sigma_mm, 0.0)
    reach = _95 * sigma
    bars = axes.errorbar(
        line.x_mm[::every], line.y_mm[::every],
        xerr=np.abs(reach * np.sin(line.theta_rad))[::every],
        yerr=np.abs(reach * np.cos(line.theta_rad))[::every],
        fmt="o", color=INK, markerfacecolor="none", markeredgewidth=0.7,
        elinewidth=0.6, label=label,
    )  # fmt: skip
    line_of_points: Artist = bars[0]
    return line_of_points


def _measured(run: RunComparison) -> list[Comparison]:
    """One comparison a step that was measured, whatever the model."""
    by_step = {c.step.index: c for c in reversed(run.comparisons)}
    return [
        c
        for _, c in sorted(by_step.items())
        if c.frame and c.frame.centreline and not c.status.startswith("length")
    ]


def _bends_up(seen: list[Comparison]) -> bool:
    lines = [c.frame.centreline for c in seen if c.frame]
    return sum(line.tip_mm[1] for line in lines if line) >= 0.0


def _first(run: RunComparison, comparison: Comparison) -> str | None:
    solved = [c for c in run.of(comparison.model) if c.solution]
    return MODEL_LABEL[comparison.model] if solved[:1] == [comparison] else None


def _draw_simulated(axes: Axes, comparison: Comparison, label: str | None) -> None:
    line = comparison.solution.centreline if comparison.solution else None
    if line is not None:
        axes.plot(
            line.x_mm, line.y_mm, color=MODEL_COLOUR[comparison.model],
            dashes=MODEL_DASH[comparison.model], label=label,
            gid=f"{comparison.model}, {step_label(comparison)}",
        )  # fmt: skip


def step_label(comparison: Comparison) -> str:
    """Return what tells a step from the others: its flux, or its gap."""
    step = comparison.step
    if math.isfinite(step.flux_mT):
        return f"{step.flux_mT:.3g} mT"
    return f"{step.gap_mm:g} mm gap"


def residual_figure(run: RunComparison, *, width_mm: float = WIDTH_MM) -> Figure:
    """Return distance measured - simulated along s, and curvature along s."""
    with drawing():
        figure, (left, right) = new_panels(2, height_mm=68.0, width_mm=width_mm)
        draw_residuals(left, run)
        left.set_title("a  measured minus simulated, across the rod")
        draw_curvature(right, run)
        right.set_title("b  curvature: measured (points), simulated")
    return figure


def draw_residuals(axes: Axes, run: RunComparison) -> None:
    """Draw the distance across the rod along it, with the 95 % band of a point."""
    compared = [c for c in run.comparisons if c.errors is not None and c.frame]
    steps = list(dict.fromkeys(c.step.index for c in compared))
    labelled: set[str] = set()
    for comparison in compared:
        errors = comparison.errors
        if errors is None:
            continue
        k = steps.index(comparison.step.index)
        across = _across(comparison)
        name = f"{step_label(comparison)}, {comparison.model}"
        axes.plot(
            errors.s_mm, across, color=MODEL_COLOUR[comparison.model],
            dashes=MODEL_DASH[comparison.model], marker=MARKERS[k % 7],
            markevery=max(1, len(across) // 8), gid=name,
            label=name if len(compared) <= 9 else None,
        )  # fmt: skip
        labelled.add(name)
    _draw_band(axes, compared)
    axes.axhline(0.0, color=FAINT, linewidth=0.8)
    _draw_joints(axes, run)
    axes.set_xlabel("s from the clamp (mm)")
    axes.set_ylabel("distance (mm)")
    if compared:
        axes.legend(ncols=1, fontsize=6.5)


def _draw_band(axes: Axes, compared: list[Comparison]) -> None:
    """Draw where the photograph's own noise puts a point."""
    frames = [c.frame for c in compared if c.frame and c.frame.centreline]
    frames = [frame for frame in frames if np.all(np.isfinite(frame.sigma_mm))]
    if not frames:
        return
    worst = max(frames, key=lambda frame: float(np.median(frame.sigma_mm)))
    if worst.centreline is None:
        return
    reach = _95 * worst.sigma_mm
    axes.fill_between(
        worst.centreline.s_mm, -reach, reach, color=FAINT, alpha=0.35, linewidth=0.0,
        label="95 % of a point",
    )  # fmt: skip


def _draw_joints(axes: Axes, run: RunComparison) -> None:
    for joint in run.run.specimen.joints_mm:
        axes.axvline(joint, color=FAINT, linewidth=0.6, dashes=(1, 2))


def _across(comparison: Comparison) -> Array:
    """Distance across the simulated line, positive to its left."""
    errors, solution = comparison.errors, comparison.solution
    if errors is None or solution is None or solution.centreline is None:
        return np.array([])
    line = solution.centreline
    theta = np.interp(errors.s_mm, line.s_mm, line.theta_rad)
    return np.asarray(-np.sin(theta) * errors.dx_mm + np.cos(theta) * errors.dy_mm)


def draw_curvature(axes: Axes, run: RunComparison) -> None:
    """Draw measured curvature with its 95 % intervals, and simulated curvature."""
    for k, comparison in enumerate(_measured(run)):
        frame = comparison.frame
        if frame is None or frame.centreline is None:
            continue
        colour = SERIES[k % len(SERIES)]
        line = frame.centreline
        every = max(1, len(line.s_mm) // 25)
        axes.errorbar(
            line.s_mm[::every], line.kappa_per_mm[::every],
            yerr=(_95 * _kappa_sd(frame))[::every], fmt=MARKERS[k % 7], color=colour,
            markerfacecolor="none", markeredgewidth=0.6, elinewidth=0.5,
            label=step_label(comparison),
        )  # fmt: skip
        for model in ("magnet", "imported", "uniform"):
            shape = _simulated(run, comparison, model)
            if shape is not None:
                axes.plot(
                    shape[0], shape[1], color=colour,
                    gid=f"{model}, {step_label(comparison)}",
                )  # fmt: skip
                break
    _draw_joints(axes, run)
    axes.set_xlabel("s from the clamp (mm)")
    axes.set_ylabel("curvature (1/mm)")
    axes.legend(fontsize=6.5)


def _kappa_sd(frame: Frame) -> Array:
    count = len(frame.centreline.s_mm) if frame.centreline else 0
    sd = frame.points.get("sigma_kappa_per_mm")
    if sd is None or len(sd) != count:
        return np.zeros(count)
    return np.where(np.isfinite(sd), sd, 0.0)


def _simulated(
    run: RunComparison, comparison: Comparison, model: str
) -> tuple[Array, Array] | None:
    for other in run.of(model):
        line = other.solution.centreline if other.solution else None
        if other.step is comparison.step and line is not None:
            return line.s_mm, line.kappa_per_mm
    return None


def field_figure(run: RunComparison, *, width_mm: float = WIDTH_MM) -> Figure | None:
    """Return readings against gap with the fitted cube, None without a fit."""
    if run.magnet_fit is None or run.magnet is None:
        return None
    with drawing():
        figure, (left, right) = new_panels(2, height_mm=60.0, width_mm=width_mm)
        draw_field(left, run)
        left.set_title("a  flux density at the undeformed tip")
        draw_field_residuals(right, run)
        right.set_title("b  magnet minus reading")
    return figure


def draw_field(axes: Axes, run: RunComparison) -> None:
    """Draw readings against gap, with error bars, and the fitted magnet."""
    fit, magnet = run.magnet_fit, run.magnet
    if fit is None or magnet is None:
        return
    gaps = np.array([reading.gap_mm for reading in fit.readings])
    span = np.linspace(max(1.0, 0.9 * gaps.min()), 1.05 * gaps.max(), 60)
    length = run.run.specimen.length_mm
    tip = np.array([[length, 0.0, 0.0]])
    curve = [
        np.linalg.norm(magnet_flux_mT(magnet, tip, length_mm=length, gap_mm=gap))
        for gap in span
    ]
    label = f"magnet, {magnet.remanence_T:.4f} T"
    axes.plot(span, curve, color=MAGNET, label=label)
    sd = {step.gap_mm: step.flux_sd_mT for step in run.run.steps}
    for reading in fit.readings:
        good = reading.verdict == "ok"
        error = sd.get(reading.gap_mm, math.nan)
        axes.errorbar(
            reading.gap_mm, reading.flux_mT,
            yerr=_95 * error if math.isfinite(error) else None,
            fmt="o" if good else "X", color=GOOD if good else BAD, markersize=4,
            gid="reading",
        )  # fmt: skip
    axes.set_xlabel("gap from the N face (mm)")
    axes.set_ylabel("flux density (mT)")
    axes.legend()


def draw_field_residuals(axes: Axes, run: RunComparison) -> None:
    """Draw how far the fitted magnet is off each reading, in percent."""
    readings = run.magnet_fit.readings if run.magnet_fit else ()
    for reading in readings:
        good = reading.verdict == "ok"
        axes.plot(
            reading.gap_mm, reading.residual_percent, "o" if good else "X",
            color=GOOD if good else BAD, markersize=5, gid="difference",
        )  # fmt: skip
    axes.axhline(0.0, color=FAINT, linewidth=0.8)
    axes.set_xlabel("gap from the N face (mm)")
    axes.set_ylabel("difference (%)")
