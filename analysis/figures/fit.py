"""The figures of a fit: what it leaves along the rod, and its moduli."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..fit.result import FitResult
from .style import (
    FAINT,
    INK,
    MAGNET,
    MARKERS,
    SERIES,
    WIDTH_MM,
    drawing,
    new_panels,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SHOWN = 12


def fit_figure(fit: FitResult, *, width_mm: float = WIDTH_MM) -> Figure:
    """Return the residuals of the fit along s, and the moduli with their intervals."""
    with drawing():
        figure, (left, right) = new_panels(
            2, height_mm=60.0, width_mm=width_mm, ratios=(3, 2)
        )
        draw_fit_residuals(left, fit)
        left.set_title("a  what the fit leaves, across the rod")
        draw_moduli(right, fit)
        right.set_title("b  moduli, root to tip")
    return figure


def draw_fit_residuals(axes: Axes, fit: FitResult) -> None:
    """Draw what the fit leaves of each photograph, in micrometres."""
    shown = fit.residual_mm[:_SHOWN]
    for k, (label, s_mm, residual_mm, _) in enumerate(shown):
        axes.plot(
            s_mm, 1e3 * residual_mm, linewidth=0.8, marker=MARKERS[k % 7],
            markevery=max(1, len(s_mm) // 8), gid=label,
            label=label if len(fit.residual_mm) <= 6 else None,
            color=SERIES[k % len(SERIES)],
        )  # fmt: skip
    axes.axhline(0.0, color=FAINT, linewidth=0.8)
    axes.set_xlabel("s from the clamp (mm)")
    axes.set_ylabel("residual (µm)")
    if len(fit.residual_mm) <= 6:
        axes.legend(fontsize=6.5)


def draw_moduli(axes: Axes, fit: FitResult) -> None:
    """Draw the fitted moduli with 95 % intervals beside the nominal ones."""
    where = np.arange(len(fit.E_MPa))
    nominal = [section.E_MPa for section in fit.problem.specimen.sections]
    if len(nominal) == len(where):
        axes.plot(
            where, nominal, "_", color=INK, markersize=14, markeredgewidth=1.2,
            label="nominal",
        )  # fmt: skip
    axes.errorbar(
        where, fit.E_MPa, yerr=1.96 * np.array(fit.E_sd_MPa), fmt="o",
        color=MAGNET, capsize=3, label="fitted, 95 %",
    )  # fmt: skip
    axes.set_xticks(where, [f"section {i + 1}" for i in where])
    axes.set_xlim(-0.5, len(where) - 0.5)
    axes.set_ylabel("Young's modulus (MPa)")
    axes.legend()
