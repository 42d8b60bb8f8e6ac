"""The figures of several runs: all distances, and the paper's comparison."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..compare.compare import IMPORTED, Comparison, RunComparison, models_of
from ..compare.metrics import position_at
from .style import (
    FAINT,
    MARKERS,
    MODEL_COLOUR,
    MODEL_DASH,
    MODEL_LABEL,
    NARROW_MM,
    SERIES,
    WIDTH_MM,
    drawing,
    new_grid,
    new_panels,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def summary_figure(
    runs: Sequence[RunComparison], *, width_mm: float = WIDTH_MM
) -> Figure:
    """Return RMS and tip distance of every comparison, a line a model."""
    with drawing():
        figure, (left, right) = new_panels(2, height_mm=72.0, width_mm=width_mm)
        draw_distances(left, runs)
        left.set_title("a  comparisons below an RMS distance")
        draw_tips(right, runs)
        right.set_title("b  tip distance")
    return figure


def draw_distances(axes: Axes, runs: Sequence[RunComparison]) -> None:
    """Draw the share of comparisons below each RMS distance."""
    for model in models_of(runs):
        done = [c.errors for run in runs for c in run.of(model) if c.errors]
        rms = np.sort([errors.rms_mm for errors in done])
        share = (np.arange(len(rms)) + 1.0) / max(1, len(rms))
        axes.step(
            rms, 100.0 * share, where="post", color=MODEL_COLOUR[model],
            dashes=MODEL_DASH[model], label=MODEL_LABEL[model],
        )  # fmt: skip
    axes.set_xlabel("RMS distance (mm)")
    axes.set_ylabel("share (%)")
    axes.set_xlim(left=0.0)
    axes.set_ylim(0.0, 104.0)
    axes.legend(loc="lower right")


def draw_tips(axes: Axes, runs: Sequence[RunComparison]) -> None:
    """Draw the tip's distance against the flux density of each step."""
    for k, model in enumerate(models_of(runs)):
        done = [c for run in runs for c in run.of(model) if c.errors]
        axes.plot(
            [c.step.flux_mT for c in done],
            [c.errors.tip_percent for c in done if c.errors],
            MARKERS[k], color=MODEL_COLOUR[model], markerfacecolor="none",
            markersize=4, label=MODEL_LABEL[model],
        )  # fmt: skip
    axes.set_xlabel("flux density read (mT)")
    axes.set_ylabel("tip distance (% of length)")
    axes.set_ylim(bottom=0.0)


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


def paper_figure(
    by_number: dict[int, RunComparison], *, width_mm: float = WIDTH_MM
) -> Figure:
    """Return the paper's comparison figure: three panels, a column a field.

    A rod keeps its colour and its marker along a panel: dots are measured, the line of
    their colour is what was simulated for them (by another program where the runs were
    imported with its shapes, else with the magnet).

    Parameters
    ----------
    by_number : dict of int to RunComparison
        The runs of GMC 1 to 7; a missing one leaves its lines out.
    width_mm : float
        Of the figure.
    """
    model = IMPORTED if all(r.of(IMPORTED) for r in by_number.values()) else "magnet"
    columns = max(len(_by_field(run, model)) for run in by_number.values())
    with drawing():
        figure, cells = new_grid(
            len(PANELS), columns, height_mm=0.3 * width_mm, width_mm=width_mm
        )
        for row, (title, numbers, names) in enumerate(PANELS):
            for column in range(columns):
                axes = cells[row][column]
                for k, (number, name) in enumerate(zip(numbers, names, strict=True)):
                    run = by_number.get(number)
                    steps = _by_field(run, model) if run else []
                    if column < len(steps):
                        _draw_pair(axes, steps[column], k, name)
                _frame(axes, row, column, len(PANELS), title)
                if row == 0:
                    is_wide = width_mm >= NARROW_MM
                    _title_field(axes, by_number, model, column, with_gap=is_wide)
            cells[row][0].legend(
                loc="upper left", fontsize=6.0, handlelength=1.4, borderaxespad=0.1
            )
    return figure


def _by_field(run: RunComparison, model: str) -> list[Comparison]:
    """Return the comparisons of a model, the weakest field first."""
    return sorted(run.of(model), key=lambda c: (c.step.flux_mT, -c.step.gap_mm))


def _frame(axes: Axes, row: int, column: int, rows: int, title: str) -> None:
    if column == 0:
        axes.set_ylabel(f"{title}\ny (mm)", fontsize=7.0)
    if row == rows - 1:
        axes.set_xlabel("x (mm)", fontsize=7.0)
    axes.tick_params(labelsize=6.5)
    axes.axhline(0.0, color=FAINT, linewidth=0.6)


def _title_field(
    axes: Axes, by_number: dict[int, RunComparison], model: str, column: int, *,
    with_gap: bool,
) -> None:  # fmt: skip
    steps = [
        found[column].step
        for run in by_number.values()
        if column < len(found := _by_field(run, model))
    ]
    flux = np.array([step.flux_mT for step in steps])
    gaps = {step.gap_mm for step in steps if np.isfinite(step.gap_mm)}
    gap = f", gap {gaps.pop():g} mm" if with_gap and len(gaps) == 1 else ""
    axes.set_title(f"{np.nanmean(flux):.0f} mT{gap}", fontsize=7.5)


def _draw_pair(axes: Axes, comparison: Comparison, k: int, name: str) -> None:
    line = comparison.frame.centreline if comparison.frame else None
    shape = comparison.solution.centreline if comparison.solution else None
    colour = SERIES[k]
    if shape is not None:
        axes.plot(
            shape.x_mm, shape.y_mm, color=colour, linewidth=0.9,
            gid=f"{name}, simulated",
        )  # fmt: skip
    if line is not None and comparison.ok:
        at = np.linspace(0.0, line.s_mm[-1], 11)[1:]
        x_mm, y_mm = position_at(line, at)
        axes.plot(
            x_mm, y_mm, MARKERS[k], color=colour, markersize=2.8,
            markerfacecolor="white", markeredgewidth=0.7, label=name,
        )  # fmt: skip
