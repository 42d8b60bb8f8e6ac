"""The figure of all equilibria: their shapes, and their tips over the load."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..equilibria.folds import Branch
from ..equilibria.uniform import Equilibrium
from .figures import save


def draw_equilibria(
    path: Path,
    equilibria: Sequence[Equilibrium],
    branches: Sequence[Branch],
    *,
    title: str,
) -> None:
    """Draw the shapes at the full field and the branches that lead to them.

    Parameters
    ----------
    path : Path
        Where; its suffix (.svg, .pdf or .png) tells the format.
    equilibria : sequence of Equilibrium
        Stable ones are drawn solid, unstable ones dashed.
    branches : sequence of Branch
        From `trace_branches`; folds are marked.
    title : str
        The rod and the field.

    Raises
    ------
    InputError
        If the suffix is none of these.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 4.0), layout="constrained")
    shapes, loads = figure.subplots(1, 2)
    for k, one in enumerate(equilibria):
        line = one.centreline
        style = "-" if one.morse_index == 0 else "--"
        label = f"{np.degrees(one.theta_tip_rad):.1f} deg, index {one.morse_index}"
        shapes.plot(line.x_mm, line.y_mm, style, color=f"C{k}", label=label)
        loads.plot(_flux(branches), np.degrees(one.theta_tip_rad), "s", color=f"C{k}")
    shapes.plot([0.0], [0.0], "s", color="0.2", markersize=6)
    shapes.set_aspect("equal", adjustable="datalim")
    shapes.set_xlabel("x in mm")
    shapes.set_ylabel("y in mm")
    shapes.legend(fontsize=7, frameon=False, title="tip angle", title_fontsize=7)
    for branch in branches:
        degrees = np.degrees(branch.theta_tip_rad)
        for stable, style in ((True, "-"), (False, "--")):
            kept = np.where((branch.morse_index == 0) == stable, degrees, np.nan)
            loads.plot(branch.flux_mT, kept, style, color="0.3", linewidth=1.2)
        for fold in branch.folds:
            loads.plot(fold.flux_mT, np.degrees(fold.theta_tip_rad), "o", color="k")
    loads.set_xlabel("flux density in mT")
    loads.set_ylabel("tip angle in deg")
    for axes in (shapes, loads):
        axes.grid(visible=True, linewidth=0.3)
    figure.suptitle(f"{title}: solid stable, dashed unstable, dots folds", fontsize=9)
    save(figure, path)


def _flux(branches: Sequence[Branch]) -> float:
    """Return the full flux density, where every branch begins."""
    return float(branches[0].flux_mT[0]) if branches else 0.0
