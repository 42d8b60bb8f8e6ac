"""Figures of shapes and fields: matplotlib without its global state."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.errors import InputError
from ...core.files import write_bytes
from ...core.magnet import Magnet
from ..magnet.field import magnet_flux_mT
from .sweep import STUDIES, Shape

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".svg", ".pdf", ".png")


def draw_study(path: Path, name: str, shapes: Sequence[Shape], *, title: str) -> None:
    """Draw the shapes of a study over each other.

    Parameters
    ----------
    path : Path
        Where; its suffix (.svg, .pdf or .png) tells the format.
    name : str
        The study (`sweep.STUDIES`).
    shapes : sequence of Shape
        What `sweep.sweep` returned; values without a shape are named in the legend.
    title : str
        What stays the same.
    """
    figure = _figure(6.0, 4.2)
    axes = figure.add_subplot()
    study = STUDIES[name]
    colours = _colours(len(shapes))
    for shape, colour in zip(shapes, colours, strict=True):
        line = shape.solution.centreline
        label = f"{shape.value} {study.unit}"
        if line is None or shape.solution.morse_index > 0:
            label += f" ({shape.solution.status})"
        points = np.empty((0, 2)) if line is None else line.points_mm
        axes.plot(*points.T, color=colour, label=label, linewidth=1.8)
    axes.plot([0.0], [0.0], "s", color="0.2", markersize=6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x in mm")
    axes.set_ylabel("y in mm")
    axes.set_title(f"{study.title}: {title}", fontsize=10)
    axes.legend(fontsize=8, frameon=False)
    axes.grid(visible=True, linewidth=0.3)
    save(figure, path)


def draw_field_map(
    path: Path,
    *,
    sides_mm: tuple[float, float, float],
    remanence_T: float,
    reach_mm: float | None = None,
) -> None:
    """Draw the flux density in the magnet's plane of symmetry, the N face upward.

    Parameters
    ----------
    path : Path
        Where; its suffix (.svg, .pdf or .png) tells the format.
    sides_mm : tuple of float
        Sides of the magnet, the last along the polarisation.
    remanence_T : float
        Its remanence.
    reach_mm : float, optional
        How far from the centre the map goes; 2.5 largest sides by default.
    """
    from matplotlib.colors import LogNorm
    from matplotlib.patches import Rectangle

    reach = 2.5 * max(sides_mm) if reach_mm is None else reach_mm
    grid = np.linspace(-reach, reach, 161)
    x, z = np.meshgrid(grid, grid)
    within = (np.abs(x) <= sides_mm[0] / 2) & (np.abs(z) <= sides_mm[2] / 2)
    magnet = Magnet(sides_mm=sides_mm, remanence_T=remanence_T)
    # In the default pose, tip at the N face: own x is the frame's x, own z its y.
    points = np.stack([x, z - sides_mm[2] / 2, np.zeros_like(x)], axis=-1)
    points[within] = (0.0, 10.0 * reach, 0.0)
    flux = magnet_flux_mT(magnet, points, length_mm=0.0, gap_mm=0.0)
    flux[within] = np.nan
    size = np.linalg.norm(flux, axis=-1)
    top = float(np.nanpercentile(size, 99.0))
    figure = _figure(6.0, 5.2)
    axes = figure.add_subplot()
    shown = size[np.isfinite(size)]
    steps = np.outer(10.0 ** np.arange(-6, 6), (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)).ravel()
    inner = (steps > float(shown.min())) & (steps < top)
    levels = steps[max(int(np.argmax(inner)) - 1, 0) :][: int(inner.sum()) + 2]
    filled = axes.contourf(
        grid, grid, size, levels=levels, norm=LogNorm(), cmap="viridis", extend="both"
    )
    axes.streamplot(
        grid, grid, flux[..., 0], flux[..., 1], color="white", linewidth=0.5,
        density=1.2, arrowsize=0.7,
    )  # fmt: skip
    corner = (-sides_mm[0] / 2, -sides_mm[2] / 2)
    axes.add_patch(
        Rectangle(corner, sides_mm[0], sides_mm[2], facecolor="0.75", edgecolor="0.2")
    )
    axes.text(0.0, sides_mm[2] * 0.3, "N", ha="center", va="center")
    axes.text(0.0, -sides_mm[2] * 0.3, "S", ha="center", va="center")
    axes.set_aspect("equal")
    axes.set_xlabel("across the axis in mm")
    axes.set_ylabel("along the axis in mm")
    axes.set_title(f"flux density, remanence {remanence_T:.4g} T", fontsize=10)
    bar = figure.colorbar(filled, label="mT", format="%g", ticks=levels)
    bar.ax.tick_params(labelsize=8)
    save(figure, path)


def save(figure: Figure, path: Path) -> None:
    """Write a figure, whole or not at all, the same bytes for the same figure.

    Raises
    ------
    InputError
        If the suffix is none of .svg, .pdf and .png.
    """
    import matplotlib

    if path.suffix.lower() not in FORMATS:
        raise InputError(
            f"figure file must end in .svg, .pdf or .png; instead received {path.name}"
        )
    buffer = io.BytesIO()
    undated: dict[str, Any] = {
        ".svg": {"Date": None}, ".pdf": {"CreationDate": None}, ".png": {},
    }[path.suffix.lower()]  # fmt: skip
    with matplotlib.rc_context({"svg.hashsalt": "magbend", "svg.fonttype": "none"}):
        figure.savefig(buffer, format=path.suffix.lower()[1:], metadata=undated)
    write_bytes(path, buffer.getvalue())


def _figure(width_in: float, height_in: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained")


def _colours(count: int) -> list[Any]:
    from matplotlib import colormaps

    return [colormaps["viridis"](k) for k in np.linspace(0.0, 0.9, max(count, 1))]
