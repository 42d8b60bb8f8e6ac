"""Figures as files: SVG and PDF to print, CSV with the numbers that were drawn."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.files import output_folder, write_bytes, write_text
from ...sim import kinds_of
from ..compare.compare import RunComparison
from ..fit.result import FitResult
from .bench import bench_figure
from .fit import fit_figure
from .run import field_figure, residual_figure, shapes_figure
from .several import gmc_numbers, paper_figure, summary_figure
from .style import WIDTH_MM, drawing, to_pdf

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def write_figures(
    runs: Sequence[RunComparison],
    out: Path,
    *,
    fits: Sequence[FitResult | str | None] = (),
    width_mm: float = WIDTH_MM,
) -> list[Path]:
    """Write every figure of runs, each as SVG, PDF and CSV, and the words for methods.

    Parameters
    ----------
    runs : sequence of RunComparison
        From `compare_run`.
    out : Path
        Folder; it is made.
    fits : sequence of FitResult, str or None
        One a run, or none at all.
    width_mm : float
        181 for two columns of a journal, 88 for one.

    Returns
    -------
    list of Path
        What was written.
    """
    output_folder(out)
    written = []
    for index, run in enumerate(runs):
        prefix = "" if len(runs) == 1 else f"{run.run.label}-"
        fit = fits[index] if index < len(fits) else None
        for name, figure in _of_run(run, fit, width_mm).items():
            written += write_figure(figure, out / f"{prefix}{name}")
    if len(runs) > 1:
        written += write_figure(
            summary_figure(runs, width_mm=width_mm), out / "summary"
        )
    by_number = gmc_numbers(runs)
    if by_number:
        figure = paper_figure(by_number, width_mm=width_mm)
        written += write_figure(figure, out / "comparison")
    write_text(out / "methods.txt", methods_text(runs))
    return [*written, out / "methods.txt"]


def _of_run(
    run: RunComparison, fit: FitResult | str | None, width_mm: float
) -> dict[str, Figure]:
    drawn: dict[str, Figure | None] = {
        "bench": bench_figure(run, width_mm=width_mm),
        "shapes": shapes_figure(run, width_mm=width_mm),
        "residuals": residual_figure(run, width_mm=width_mm)
        if any(c.ok for c in run.comparisons)
        else None,
        "field": field_figure(run, width_mm=width_mm),
        "fit": fit_figure(fit, width_mm=width_mm)
        if isinstance(fit, FitResult)
        else None,
    }
    return {name: figure for name, figure in drawn.items() if figure is not None}


def write_figure(figure: Figure, path: Path) -> list[Path]:
    """Write a figure as ``PATH.svg``, ``PATH.pdf`` and ``PATH.csv``."""
    buffer = io.BytesIO()
    with drawing():
        figure.savefig(buffer, format="svg", facecolor="white", metadata={"Date": None})
    contents = {
        ".svg": buffer.getvalue(),
        ".pdf": to_pdf(figure),
        ".csv": figure_csv(figure).encode(),
    }
    written = []
    for ending, data in contents.items():
        written.append(path.with_name(path.name + ending))
        write_bytes(written[-1], data)
    return written


def figure_csv(figure: Figure) -> str:
    """Return the numbers of a figure, one row a point.

    The columns are ``panel`` (title), ``series``, ``x_name``, ``x``, ``y_name``, ``y``,
    ``x_error`` and ``y_error`` (half widths of the bars drawn; empty where none are).
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(
        ("panel", "series", "x_name", "x", "y_name", "y", "x_error", "y_error")
    )
    for number, axes in enumerate(figure.axes, start=1):
        panel = axes.get_title(loc="left") or axes.get_title() or f"panel {number}"
        names = _axis_names(figure, axes)
        for series, x, y, x_error, y_error in _series(axes):
            for i in range(len(x)):
                writer.writerow(
                    (panel, series, names[0], f"{x[i]:.10g}", names[1], f"{y[i]:.10g}",
                     _cell(x_error, i), _cell(y_error, i))
                )  # fmt: skip
    return buffer.getvalue()


def _axis_names(figure: Figure, axes: Axes) -> tuple[str, str]:
    """Return the labels of an axes, or of the shared ones at the rim."""
    x, y = axes.get_xlabel(), axes.get_ylabel()
    shared = figure.axes
    x = x or next((a.get_xlabel() for a in reversed(shared) if a.get_xlabel()), "x")
    y = y or next((a.get_ylabel() for a in shared if a.get_ylabel()), "y")
    return x.replace("\n", ", "), y.replace("\n", ", ")


def _series(axes: Axes) -> list[tuple[str, Any, Any, Any, Any]]:
    """Lines and error bars of an axes that mean something: with a label or a gid."""
    found = []
    within_bars: set[int] = set()
    for bars in axes.containers:
        line = bars[0] if len(bars) else None
        if line is None or not hasattr(line, "get_xdata"):
            continue
        within_bars.update(id(part) for part in (line, *bars[1]))
        x, y = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
        errors = [_reach(part, len(x)) for part in bars[2]]
        x_error = errors[0] if getattr(bars, "has_xerr", False) and errors else None
        y_error = errors[-1] if getattr(bars, "has_yerr", False) and errors else None
        name = str(line.get_gid() or bars.get_label() or "data")
        found.append((name, x, y, x_error, y_error))
    for line in axes.lines:
        label = str(line.get_label())
        name = line.get_gid() or ("" if label.startswith("_") else label)
        if name and id(line) not in within_bars:
            x = np.asarray(line.get_xdata(), float)
            found.append(
                (str(name), x, np.asarray(line.get_ydata(), float), None, None)
            )
    return found


def _reach(lines: Any, count: int) -> Any:
    """Half lengths of a collection of error bars."""
    ends = np.array([np.ptp(np.asarray(part), axis=0) for part in lines.get_segments()])
    return 0.5 * ends.max(axis=1) if len(ends) == count else None


def _cell(values: Any, i: int) -> str:
    return "" if values is None else f"{values[i]:.4g}"


def methods_text(runs: Sequence[RunComparison]) -> str:
    """Return a paragraph on how the numbers came about, and what to cite."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        own = version("magbend")
    except PackageNotFoundError:
        own = "unknown"
    steps = sum(len(run.run.steps) for run in runs)
    kinds = {_kind(run) for run in runs}
    rods = ", ".join(dict.fromkeys(run.run.specimen.name for run in runs))
    given = [kinds_of(run.sources) for run in runs if run.sources is not None]
    magnets = [run.magnet for run in runs if run.magnet is not None]
    field = ""
    if given:
        field = f" The field was that of given sources: {given[0]}."
    if magnets:
        sides = " x ".join(f"{side:g}" for side in magnets[0].sides_mm)
        field = (
            f" The magnet was taken as a cuboid of {sides} mm with one remanence "
            "fitted to the readings of each run, and its field in closed form."
        )
    return (
        f"Centrelines of {rods} ({len(runs)} run(s), {steps} photographs or shapes, "
        f"{' and '.join(sorted(kinds))}) were compared with those of an inextensible "
        "planar rod (Kirchhoff), clamped at the root and free at the tip, under the "
        f"magnetic load of its axial remanence.{field} Distances are taken across the "
        "simulated line at equal arc lengths; intervals are 95 %.\n\n"
        f"Software: magbend {own} (CITATION.cff of its repository says how to cite "
        "it). Each figure's numbers are in the CSV beside it.\n"
    )


def _kind(run: RunComparison) -> str:
    record = run.run.record
    if record.get("imported"):
        return "imported"
    return "simulated bench" if record.get("twin") else "measured on the bench"
