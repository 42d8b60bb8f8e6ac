"""Figures of training, sensitivity and design: object API, fonts embedded."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.columns import split_unit
from ...core.errors import InputError
from ...core.files import output_file, write_bytes

if TYPE_CHECKING:
    from ..design.goals import Goal
    from ..design.search import Design
    from ..expansion.train import TrainingReport
    from .sobol import Sensitivity

SUFFIXES = (".svg", ".pdf", ".png")
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's colour-blind safe set."""

SPLIT_LABELS = {
    "field": "a random field of each GMC",
    "top_field": "120 mT of each GMC",
    "specimen": "one whole GMC",
}


def new_figure(width_mm: float = 130.0, height_mm: float = 85.0) -> Any:
    """Return an empty figure of a size in mm."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_mm / 25.4, height_mm / 25.4), layout="constrained")


def check_path(path: Path) -> Path:
    """Return the path of a figure to come.

    Raises
    ------
    InputError
        If its suffix is none that can be drawn, or it cannot be written.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"a figure must end in {', '.join(SUFFIXES)}; instead received {path.name}"
        )
    return output_file(path)


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure, whole or not at all, the same bytes for the same data."""
    import io

    import matplotlib as mpl

    check_path(path)
    kind = path.suffix.lower()[1:]
    dates = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}
    settings: Any = {
        "pdf.fonttype": 42,
        "svg.hashsalt": "magbend",
        "svg.fonttype": "none",
    }
    buffer = io.BytesIO()
    with mpl.rc_context(settings):
        figure.savefig(buffer, format=kind, metadata=dates[kind], dpi=200)
    write_bytes(path, buffer.getvalue())


def training_figure(report: TrainingReport, published_per_mm2: float) -> Any:
    """Draw the test error of every seed of every split, with the published one."""
    figure = new_figure()
    axes = figure.add_subplot()
    for row, errors in enumerate(report.test_mse_per_mm2.values()):
        colour = COLOURS[row]
        axes.plot(errors, [row] * len(errors), "o", color=colour, alpha=0.6, ms=5)
        median = float(np.median(errors))
        axes.plot(median, row, "|", color=colour, ms=24, mew=2)
    axes.axvline(published_per_mm2, color="0.3", ls="--", lw=1, label="published")
    axes.legend(fontsize=8, frameon=False)
    axes.set(
        xscale="log",
        xlabel="test mean squared error of a (1/mm²), one dot a seed, bar: median",
        ylim=(-0.8, len(report.test_mse_per_mm2) - 0.3),
        title="What was held out, and how well it was predicted",
    )
    names = [SPLIT_LABELS[split] for split in report.test_mse_per_mm2]
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.title.set_fontsize(9)
    return figure


def design_figure(designs: list[Design], goal: Goal) -> Any:
    """Draw each design's shape with the band that fabrication scatter makes of it."""
    figure = new_figure(150.0, 100.0)
    axes = figure.add_subplot()
    for number, one in enumerate(designs):
        colour = COLOURS[number % len(COLOURS)]
        low, high = np.quantile(one.band_mm, [0.025, 0.975], axis=0)
        x = np.concatenate([low[:, 0], high[::-1, 0]])
        y = np.concatenate([high[:, 1], low[::-1, 1]])
        axes.fill(x, y, color=colour, alpha=0.15, lw=0)
        moduli = "-".join(f"{s.E_MPa:.3g}" for s in one.specimen.sections)
        label = f"{one.specimen.name}: {one.specimen.side_mm:g} mm, {moduli} MPa"
        axes.plot(*one.shape_mm.T, color=colour, lw=1.4, label=label)
    if goal.kind == "tip":
        axes.plot(*goal.wanted, "k+", ms=10, label="wanted")
    if goal.curve_mm is not None:
        axes.plot(*goal.curve_mm.T, "k--", lw=1, label="wanted")
    axes.set(xlabel="x (mm)", ylabel="y (mm)")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(f"{goal.words}; bands: 95 % of what fabrication makes", fontsize=9)
    axes.legend(fontsize=7, frameon=False)
    return figure


def sobol_figure(found: Sensitivity) -> Any:
    """Draw total and first-order indices: one panel an output, one bar a field."""
    from .sobol import OUTPUTS, PARAMETERS

    figure = new_figure(180.0, 130.0)
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    width = 0.8 / len(found.fields_mT)
    place = np.arange(len(PARAMETERS))
    for j, (axes, output) in enumerate(zip(panels, OUTPUTS, strict=True)):
        for i, flux in enumerate(found.fields_mT):
            at = place + (i - 0.5 * (len(found.fields_mT) - 1)) * width
            colour = COLOURS[i % len(COLOURS)]
            bars = {"height": 0.9 * width, "color": colour}
            axes.barh(at, found.total[i, j], alpha=0.35, **bars)
            axes.barh(at, found.first[i, j], label=f"{flux:g} mT", **bars)
        axes.set_title(_words(output), fontsize=9)
        axes.set_yticks(place, [_words(name) for name in PARAMETERS], fontsize=8)
        axes.set_xlim(0.0, 1.0)  # an estimate of a share may fall below by its noise
    panels[0].invert_yaxis()
    panels[0].legend(fontsize=7, frameon=False)
    figure.supxlabel(
        "share of the variance: solid alone, pale with interactions", fontsize=9
    )
    return figure


def _words(name: str) -> str:
    """Return a column's name as a label: ``tip_x_mm`` is "tip x (mm)"."""
    quantity, unit = split_unit(name)
    return quantity.replace("_", " ") + (f" ({unit})" if unit else "")
