"""Tables, figures and animations of paths."""

from __future__ import annotations

import csv
import io
from pathlib import Path as File

import numpy as np
from numpy.typing import NDArray

from ...core.checks import shown
from ...core.errors import InputError
from ..study.figures import save
from ..study.outlines import draw_sources, outlines_mm
from .pull_in import PullIn
from .records import Path, PathPoint

COLUMNS = (
    "status", "morse_index", "tip_x_mm", "tip_y_mm", "tip_angle_deg", "energy_uJ",
    "work_uJ", "snapped",
)  # fmt: skip


def path_csv(path: Path) -> str:
    """Return a path as CSV: a row a point, empty where there is no shape."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([path.quantity, *COLUMNS])
    for one in path.points:
        row: list[object] = [f"{one.value:.15g}", one.status, one.morse_index]
        if one.centreline is None:
            row += [""] * 5
        else:
            x, y = one.centreline.tip_mm
            angle_deg = one.centreline.tip_angle_deg
            numbers = (x, y, angle_deg, one.energy_uJ, one.work_uJ)
            row += [f"{number:.15g}" for number in numbers]
        writer.writerow([*row, int(one.snapped)])
    return buffer.getvalue()


def draw_path(file: File, path: Path, *, title: str) -> None:
    """Draw the shapes along the path, and the tip over what changes.

    The sources are drawn where they are at the turn, farthest from the first value.

    Raises
    ------
    InputError
        If the suffix is none of .svg, .pdf and .png.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 4.0), layout="constrained")
    shapes, tips = figure.subplots(1, 2)
    every = max(1, len(path.points) // 24)
    for k, one in enumerate(path.points):
        if one.centreline is not None and k % every == 0:
            shade = (0.15, 0.3 + 0.5 * k / len(path.points), 0.6)
            line = one.centreline
            shapes.plot(line.x_mm, line.y_mm, color=shade, linewidth=1.0)
    turn = _turn(path)
    draw_sources(shapes, path.points[turn].field, path.points[turn].length_mm)
    values = [one.value for one in path.points]
    y = [one.centreline.tip_mm[1] if one.centreline else np.nan for one in path.points]
    there, back = slice(0, turn + 1), slice(turn, None)
    tips.plot(values[there], y[there], "-", color="C0", label="there")
    tips.plot(values[back], y[back], "--", color="C1", label="back")
    for fold in path.folds:
        tips.plot(fold.value, fold.tip_mm[1], "ko", markersize=4)
        tips.annotate(
            f" {fold.kind}, {fold.direction}", (fold.value, fold.tip_mm[1]), fontsize=7
        )
    shapes.set_aspect("equal", adjustable="datalim")
    shapes.set_xlabel("x in mm")
    shapes.set_ylabel("y in mm")
    name, unit = path.quantity.rsplit("_", 1)
    tips.set_xlabel(f"{name} in {unit}")
    tips.set_ylabel("tip y in mm")
    tips.legend(fontsize=8, frameon=False)
    for axes in (shapes, tips):
        axes.grid(visible=True, linewidth=0.3)
    ends = ": dots are where the followed equilibrium ends" if path.folds else ""
    figure.suptitle(title + ends, fontsize=9)
    save(figure, file)


def _turn(path: Path) -> int:
    """Return the number of the point that is farthest from the first value."""
    values = np.array([one.value for one in path.points])
    return int(np.argmax(np.abs(values - values[0])))


def animate_path(file: File, path: Path, *, title: str) -> None:
    """Draw shapes and sources one after the other as an animated GIF.

    Raises
    ------
    InputError
        If the suffix is not .gif, or no point has a shape.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    from ...core.files import write_bytes

    lines = [one.centreline for one in path.points if one.centreline is not None]
    if file.suffix.lower() != ".gif" or not lines:
        raise InputError(
            "an animation must be a .gif file of a path that has shapes; instead "
            f"received {shown(str(file))} and {len(lines)} shapes"
        )
    low, high = _view(path)
    name, unit = path.quantity.rsplit("_", 1)
    frames = []
    figure = Figure(figsize=(4.8, 4.0), dpi=90, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.subplots()
    for one in path.points:
        axes.clear()
        if one.centreline is not None:
            colour = "C0" if one.status == "stable" else "C3"
            line = one.centreline
            axes.plot(line.x_mm, line.y_mm, color=colour, linewidth=2.5)
        draw_sources(axes, one.field, one.length_mm)
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_aspect("equal")
        axes.set_xlabel("x in mm")
        axes.set_ylabel("y in mm")
        axes.set_title(
            f"{title}: {name} {one.value:.4g} {unit}, {one.status}", fontsize=8
        )
        canvas.draw()  # type: ignore[no-untyped-call]
        pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        frames.append(Image.fromarray(pixels).convert("P"))
    buffer = io.BytesIO()
    frames[0].save(
        buffer, "GIF", save_all=True, append_images=frames[1:], duration=80, loop=0
    )
    write_bytes(file, buffer.getvalue())


def _view(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return corners of a view, in mm, of all shapes and of the sources at the turn."""
    there: PathPoint = path.points[_turn(path)]
    lines = [one.centreline for one in path.points if one.centreline is not None]
    seen = np.vstack(
        [line.points_mm for line in lines] + outlines_mm(there.field, there.length_mm)
    )
    return seen.min(axis=0) - 2.0, seen.max(axis=0) + 2.0


def pull_in_csv(found: PullIn) -> str:
    """Return a map of pull-in as CSV: a row a design; empty where there is none."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([*found.names, "pull_in_gap_mm"])
    for y, row in zip(found.y.tolist(), found.gap_mm.tolist(), strict=True):
        for x, gap in zip(found.x.tolist(), row, strict=True):
            last = "" if np.isnan(gap) else f"{gap:.9g}"
            writer.writerow([f"{x:.15g}", f"{y:.15g}", last])
    return buffer.getvalue()


def draw_pull_in(file: File, found: PullIn, *, title: str) -> None:
    """Draw the gap at which rods are pulled in, over their two properties.

    Raises
    ------
    InputError
        If the suffix is none of .svg, .pdf and .png, or a property has one value only.
    """
    from matplotlib.figure import Figure

    if min(found.gap_mm.shape) < 2:
        raise InputError(
            "a figure of pull-in gaps must have at least two values of each property; "
            f"instead received {len(found.x)} and {len(found.y)}"
        )
    figure = Figure(figsize=(6.0, 4.6), layout="constrained")
    axes = figure.subplots()
    low, high = found.range_mm
    gap = np.where(np.isinf(found.gap_mm), high, found.gap_mm)
    axes.set_facecolor("0.85")
    mesh = axes.pcolormesh(found.x, found.y, gap, shading="nearest", cmap="viridis")
    if np.nanmax(gap, initial=0.0) > np.nanmin(gap, initial=high):
        lines = axes.contour(found.x, found.y, gap, colors="white", linewidths=0.8)
        axes.clabel(lines, fontsize=7, fmt="%g")
    figure.colorbar(mesh, ax=axes, label="pull-in gap in mm")
    x, y = (" in ".join(name.rsplit("_", 1)) for name in found.names)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(f"{title} (grey: not pulled in down to {low:g} mm)", fontsize=9)
    save(figure, file)
