"""A rod in a tube, drawn: in space, from above, and from the side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..tube.tube import Tube
from .passage import Passage, Step

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

VIEWS = (
    (0, 1, "x in mm", "y in mm, from above"),
    (0, 2, "x in mm", "z in mm, from -y"),
)
"""Which coordinates are seen, and how the axes are called."""
AROUND = 25
"""Points around the wall."""


def _wall(tube: Tube) -> Array:
    """Return points on the wall, shape (3, n, AROUND), in mm."""
    along = np.linspace(0.0, tube.length_mm, 121)
    place, towards, _ = tube.at(along)
    side = np.cross(towards[0], np.eye(3)[np.argmin(np.abs(towards[0]))])
    sides = []
    for t in towards:  # carried along with the least turn
        side = side - (side @ t) / (t @ t) * t
        side /= np.linalg.norm(side)
        sides.append(side)
    first = np.array(sides)
    second = np.cross(towards, first)
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND)
    ring = (
        first[:, None] * np.cos(angle)[:, None]
        + second[:, None] * np.sin(angle)[:, None]
    )
    wall = place[:, None] + tube.radius_at(along)[:, None, None] * ring
    return np.asarray(np.moveaxis(wall, -1, 0))


def _frame(tube: Tube, passage: Passage) -> tuple[Array, Array]:
    """Return the corners of the box in which the rod goes, in mm."""
    shapes = np.concatenate([step.shape[:3].T for step in passage.steps])
    margin = 2.0 * float(np.max(tube.radius_mm))
    return shapes.min(axis=0) - margin, shapes.max(axis=0) + margin


def tube_in_space(axes: Any, tube: Tube, passage: Passage) -> None:
    """Draw the tube as a shade, and the rod on its way and where it presses."""
    low, high = _frame(tube, passage)
    wall = _wall(tube)
    box = low[:, None, None], high[:, None, None]
    beyond = np.any((wall < box[0]) | (wall > box[1]), axis=0).all(axis=1)
    wall[:, beyond] = np.nan
    axes.plot_surface(*wall, color="0.6", alpha=0.18, lw=0, rcount=121, ccount=AROUND)
    shown = passage.steps[:: max(1, len(passage.steps) // 6)]
    for k, step in enumerate(shown):
        axes.plot(*step.shape[:3], color="C0", alpha=0.2 + 0.4 * k / len(shown), lw=1.0)
    last = passage.steps[-1]
    axes.plot(*last.shape[:3], color="C0", lw=2.2)
    if last.contacts:
        spots = np.array([[c.x_mm, c.y_mm, c.z_mm] for c in last.contacts])  # type: ignore[attr-defined]
        axes.scatter(*spots.T, s=_sizes(last), color="C3", depthshade=False)
    axes.set_box_aspect(high - low)
    for name, a, b in zip("xyz", low, high, strict=True):
        getattr(axes, f"set_{name}lim")(a, b)
        getattr(axes, f"set_{name}label")(f"{name} in mm", fontsize=7)
    axes.tick_params(labelsize=6)


def draw_views(views: Sequence[Axes], tube: Tube, passage: Passage) -> None:
    """Draw the tube from above and from the side, framed by where the rod goes."""
    from matplotlib.collections import EllipseCollection

    low, high = _frame(tube, passage)
    along = np.linspace(0.0, tube.length_mm, 241)
    place, width = tube.at(along)[0], 2.0 * tube.radius_at(along)
    for axes, (i, j, xlabel, ylabel) in zip(views, VIEWS, strict=True):
        # What is seen of a tube is what spheres along its curve would cover.
        discs = EllipseCollection(
            width, width, np.zeros(len(width)), units="xy", color="0.87", lw=0,
            offsets=place[:, [i, j]], offset_transform=axes.transData,
        )  # fmt: skip
        axes.add_collection(discs)
        axes.plot(*place.T[[i, j]], color="0.6", lw=0.7, ls=":")
        axes.set_xlim(low[i], high[i])
        axes.set_ylim(low[j], high[j])
        axes.set_aspect("equal")
        axes.set_xlabel(xlabel, fontsize=7)
        axes.set_ylabel(ylabel, fontsize=7)
        axes.tick_params(labelsize=6)


def rod_in_views(views: Sequence[Axes], step: Step, side_mm: float) -> list[Any]:
    """Draw the rod with its thickness, and where it is pressed; return all that."""
    drawn: list[Any] = []
    for axes, (i, j, _, _) in zip(views, VIEWS, strict=True):
        a, b = step.shape[i], step.shape[j]
        across = np.array([-np.gradient(b), np.gradient(a)])
        across *= 0.5 * side_mm / np.maximum(np.hypot(*across), 1e-9)
        drawn += axes.fill(
            np.concatenate([a + across[0], (a - across[0])[::-1]]),
            np.concatenate([b + across[1], (b - across[1])[::-1]]),
            color="C0", alpha=0.75, lw=0,
        )  # fmt: skip
        if step.contacts:
            spots = np.array([[c.x_mm, c.y_mm, c.z_mm] for c in step.contacts])  # type: ignore[attr-defined]
            drawn.append(
                axes.scatter(
                    spots[:, i], spots[:, j], s=_sizes(step), color="C3", zorder=3, lw=0
                )
            )
    return drawn


def _sizes(step: Step) -> Array:
    force = np.array([contact.force_N for contact in step.contacts])
    return np.asarray(4.0 + 30.0 * force / force.max())
