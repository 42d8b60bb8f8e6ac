"""Pictures of a passage: the rod in its lumen, its forces, and a film."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..study.figures import save
from ..tube.tube import Tube
from .curves import outline
from .lumen import Lumen
from .passage import Branch, Passage, Step
from .views import draw_views, rod_in_views, tube_in_space

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FRAMES = 80
"""Most frames of a film."""


def draw_passage(
    path: Path, lumen: Lumen | Tube, passage: Passage, *, side_mm: float
) -> None:
    """Draw shapes on the way, and push force, root curvature and wall force.

    Parameters
    ----------
    path : Path
        Where; its suffix (.svg, .pdf or .png) tells the format.
    lumen, passage : Lumen or Tube, Passage
        What `navigate` was given, and returned.
    side_mm : float
        Of the rod, in mm.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 4.8), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.35, 1.0))
    shown = passage.steps[:: max(1, len(passage.steps) // 6)]
    if isinstance(lumen, Tube):
        left = grid[:, 0].subgridspec(2, 2, height_ratios=(1.5, 1.0))
        solid = figure.add_subplot(left[0, :], projection="3d")
        tube_in_space(solid, lumen, passage)
        views = [figure.add_subplot(left[1, k]) for k in range(2)]
        draw_views(views, lumen, passage)
        rod_in_views(views, passage.steps[-1], side_mm)
    else:
        picture = figure.add_subplot(grid[:, 0])
        _lumen(picture, lumen, passage)
        for k, step in enumerate(shown):
            picture.plot(*step.shape[:2], color="C0", alpha=0.25 + 0.4 * k / len(shown))
        _rod(picture, passage.steps[-1], side_mm)
    _curves(figure, grid, passage)
    figure.suptitle(
        f"{passage.specimen} in {lumen.name}: {passage.outcome}", fontsize=10
    )
    save(figure, path)


def _curves(figure: Figure, grid: Any, passage: Passage) -> None:
    """Draw push, root curvature and wall force over the insertion."""
    at = [step.insertion_mm for step in passage.steps]
    rows = (
        ("push_N", 1e3, "push in mN"),
        ("root_curvature_per_mm", 1.0, "root curvature\nin 1/mm"),
        ("wall_N", 1e3, "on walls in mN"),
    )
    first = None
    for k, (name, factor, label) in enumerate(rows):
        axes = figure.add_subplot(grid[k, 1], sharex=first)
        first = first or axes
        axes.plot(at, [factor * getattr(step, name) for step in passage.steps], lw=1.2)
        for branch in passage.branches:
            _branch(axes, branch, name, factor)
        axes.set_ylabel(label, fontsize=8)
        axes.grid(visible=True, linewidth=0.3)
        for event in passage.events:
            colour = {"snap": "C3", "gate": "C2"}.get(event.kind, "0.6")
            axes.axvline(event.insertion_mm, color=colour, lw=0.8, ls="--")
        axes.tick_params(labelbottom=k == len(rows) - 1)
    key = "(dashed: grey touch, green gate, red snap)"
    if passage.branches:
        key += "\n(orange: what snaps left, dotted where unstable)"
    axes.set_xlabel(f"insertion in mm\n{key}")


def _branch(axes: Axes, branch: Branch, name: str, factor: float) -> None:
    """Draw a branch over the insertion: dotted, with a line where it is stable."""
    at = np.array([step.insertion_mm for step in branch.steps])
    value = np.array([factor * getattr(step, name) for step in branch.steps])
    axes.plot(at, value, color="C1", lw=0.9, ls=":")
    stable = np.where(np.array(branch.indices) == 0, value, np.nan)
    axes.plot(at, stable, color="C1", lw=1.2)


def film(path: Path, lumen: Lumen | Tube, passage: Passage, *, side_mm: float) -> None:
    """Write the passage as an animated GIF, whole or not at all.

    Parameters
    ----------
    path : Path
        Where.
    lumen, passage, side_mm
        As of `draw_passage`.
    """
    import io

    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    from ...core.files import write_bytes

    steps = passage.steps[:: max(1, -(-len(passage.steps) // FRAMES))]
    size = (7.6, 4.0) if isinstance(lumen, Tube) else (5.6, 4.2)
    figure = Figure(figsize=size, dpi=80, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    if isinstance(lumen, Tube):
        views = [figure.add_subplot(1, 2, k + 1) for k in range(2)]
        draw_views(views, lumen, passage)
    else:
        axes = figure.add_subplot()
        _lumen(axes, lumen, passage)
    title = figure.suptitle(" ", fontsize=9)
    canvas.draw()
    figure.set_layout_engine("none")
    frames: list[Any] = []
    for step in (*steps, passage.steps[-1]):
        drawn = (
            rod_in_views(views, step, side_mm)
            if isinstance(lumen, Tube)
            else _rod(axes, step, side_mm)
        )
        title.set_text(
            f"{step.insertion_mm:.1f} mm in, push {1e3 * step.push_N:.2f} mN, "
            f"{len(step.contacts)} contacts"
        )
        canvas.draw()
        frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]))
        for artist in drawn:
            artist.remove()
    buffer = io.BytesIO()
    frames = [frame.quantize(64) for frame in frames]
    frames[0].save(
        buffer, "GIF", save_all=True, append_images=frames[1:], duration=80, loop=0
    )
    write_bytes(path, buffer.getvalue())


def _lumen(axes: Axes, lumen: Lumen, passage: Passage) -> None:
    """Draw walls and gates, and frame the part in which the rod goes."""
    for wall in lumen.walls:
        axes.plot(*outline(wall.arcs).T, color="0.35", lw=1.4)
    for gate in lumen.gates:
        (ax, ay), (bx, by) = gate.from_mm, gate.to_mm
        axes.plot([ax, bx], [ay, by], color="C2", lw=0.8, ls=":")
        axes.annotate(gate.name, (0.5 * (ax + bx), 0.5 * (ay + by)), fontsize=7)
    shapes = np.concatenate([step.shape[:2].T for step in passage.steps])
    low, high = shapes.min(axis=0), shapes.max(axis=0)
    margin = 0.08 * max(high - low) + 2.0
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal")
    axes.set_xlabel("x in mm")
    axes.set_ylabel("y in mm")


def _rod(axes: Axes, step: Step, side_mm: float) -> list[Any]:
    """Draw the rod with its thickness, and where it is pressed, by how much."""
    x, y, theta, _ = step.shape
    nx, ny = -0.5 * side_mm * np.sin(theta), 0.5 * side_mm * np.cos(theta)
    drawn: list[Any] = axes.fill(
        np.concatenate([x + nx, (x - nx)[::-1]]),
        np.concatenate([y + ny, (y - ny)[::-1]]),
        color="C0", alpha=0.75, lw=0,
    )  # fmt: skip
    if step.contacts:
        force = np.array([contact.force_N for contact in step.contacts])
        dots = axes.scatter(
            [contact.x_mm for contact in step.contacts],
            [contact.y_mm for contact in step.contacts],
            s=6.0 + 60.0 * force / force.max(), color="C3", zorder=3, lw=0,
        )  # fmt: skip
        drawn.append(dots)
    return drawn
