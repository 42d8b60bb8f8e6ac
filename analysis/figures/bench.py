"""The bench drawn to scale: clamp, rod, magnet and gap, and the field about them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...core.magnet import Magnet
from ...core.specimen import Specimen
from ...sim import magnet_flux_mT
from ..compare.compare import RunComparison
from .style import FAINT, INK, MAGNET, UNIFORM, WIDTH_MM, drawing, new_panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NORTH, _SOUTH = "#cc6677", "#88aacc"
_CLAMP_MM = (14.0, 10.0)


def bench_figure(run: RunComparison, *, width_mm: float = WIDTH_MM) -> Figure | None:
    """Return the set-up and the field map of the strongest step; None without a magnet.

    Parameters
    ----------
    run : RunComparison
        Its magnet must stand in the plane, and a step must have a gap.
    width_mm : float
        Of the figure.
    """
    magnet = run.magnet
    gaps = [s.gap_mm for s in run.run.steps if math.isfinite(s.gap_mm)]
    if magnet is None or not gaps:
        return None
    with drawing():
        height_mm = 90.0 if width_mm > 130.0 else 88.0
        figure, (left, right) = new_panels(2, height_mm=height_mm, width_mm=width_mm)
        draw_setup(left, run.run.specimen, magnet, min(gaps))
        left.set_title("a  the bench from above, to scale")
        draw_field_map(right, run, min(gaps))
        right.set_title("b  flux density in the plane of the rod")
    return figure


def draw_setup(axes: Axes, specimen: Specimen, magnet: Magnet, gap_mm: float) -> None:
    """Draw clamp, undeformed rod, magnet, gap and axes, as the camera sees them."""
    from matplotlib.patches import Rectangle

    length = specimen.length_mm
    width, height = _CLAMP_MM
    axes.add_patch(
        Rectangle((-width, -height / 2.0), width, height, facecolor="#555b63")
    )
    axes.annotate("clamp", (-width, -height / 2.0 - 5.0), fontsize=6.5)
    start = 0.0
    for section in specimen.sections:
        axes.plot(
            [start, start + section.length_mm], [0.0, 0.0], color=INK, linewidth=2.2,
            solid_capstyle="butt",
        )  # fmt: skip
        start += section.length_mm
        axes.plot([start] * 2, [-1.2, 1.2], color=INK, linewidth=0.6)
    moduli = "-".join(f"{section.E_MPa:g}" for section in specimen.sections)
    axes.annotate(f"rod, {moduli} MPa", (2.0, 2.5), fontsize=6.5)
    _draw_magnet(axes, length, magnet, gap_mm)
    face = _face(length, magnet, gap_mm)
    _draw_length(axes, (length, 0.0), face, f"gap {gap_mm:g} mm")
    _draw_frame(axes)
    _plain(axes, length, magnet, gap_mm)


def _direction(magnet: Magnet) -> tuple[float, float]:
    angle = math.radians(magnet.axis_angle_deg)
    return math.cos(angle), math.sin(angle)


def _face(length: float, magnet: Magnet, gap_mm: float) -> tuple[float, float]:
    """Return the centre of the N face: a gap before the tip, against the axis."""
    x, y = _direction(magnet)
    return length - gap_mm * x, -gap_mm * y


def _draw_magnet(axes: Axes, length: float, magnet: Magnet, gap_mm: float) -> None:
    from matplotlib.patches import Polygon

    x, y = _direction(magnet)
    across, along = magnet.sides_mm[0] / 2.0, magnet.sides_mm[2]
    fx, fy = _face(length, magnet, gap_mm)
    for colour, near, far, name in (
        (_NORTH, 0.0, 0.5, "N"),
        (_SOUTH, 0.5, 1.0, "S"),
    ):
        corners = [
            (fx - share * along * x - sign * across * y,
             fy - share * along * y + sign * across * x)
            for share, sign in ((near, -1), (near, 1), (far, 1), (far, -1))
        ]  # fmt: skip
        axes.add_patch(Polygon(corners, facecolor=colour, edgecolor=INK, linewidth=0.6))
        centre = np.mean(corners, axis=0)
        axes.annotate(name, tuple(centre), ha="center", va="center", fontsize=9)


def _draw_length(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], text: str
) -> None:
    axes.annotate(
        "", xy=end, xytext=start,
        arrowprops={"arrowstyle": "<->", "color": UNIFORM, "linewidth": 0.9,
                    "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip
    middle = 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
    axes.annotate(
        text, middle, xytext=(4, 0), textcoords="offset points", fontsize=7,
        color=UNIFORM, va="center",
    )  # fmt: skip


def _draw_frame(axes: Axes) -> None:
    for name, end in (("x", (12.0, 0.0)), ("y", (0.0, 12.0))):
        axes.annotate(
            "", xy=(end[0], end[1] + 14.0), xytext=(0.0, 14.0),
            arrowprops={"arrowstyle": "->", "color": MAGNET, "shrinkA": 0,
                        "shrinkB": 0},
        )  # fmt: skip
        axes.annotate(name, (1.15 * end[0], 1.15 * end[1] + 14.0), fontsize=7,
                      color=MAGNET, ha="center", va="center")  # fmt: skip


def _plain(axes: Axes, length: float, magnet: Magnet, gap_mm: float) -> None:
    """Scale bar instead of ticks; everything in view."""
    fx, fy = _face(length, magnet, gap_mm)
    x, y = _direction(magnet)
    along, across = magnet.sides_mm[2], magnet.sides_mm[0] / 2.0
    ends = np.array([
        [-_CLAMP_MM[0] - 4.0, 32.0], [length + 8.0, 32.0],
        [fx - along * x - across, fy - along * y - 4.0],
        [fx - along * x + across, fy - along * y - 4.0],
    ])  # fmt: skip
    low, high = ends.min(axis=0), ends.max(axis=0)
    axes.set_xlim(low[0] - 4.0, high[0] + 4.0)
    axes.set_ylim(low[1] - 10.0, high[1])
    axes.set_aspect("equal", adjustable="box")
    axes.plot([low[0], low[0] + 20.0], [low[1] - 6.0] * 2, color=INK, linewidth=1.6)
    axes.annotate("20 mm", (low[0] + 10.0, low[1] - 5.0), ha="center", fontsize=7)
    axes.set_axis_off()


def draw_field_map(axes: Axes, run: RunComparison, gap_mm: float) -> None:
    """Draw lines of the field and contours of its size, and the rod as it bends.

    The magnet's own body is left out: the formula holds outside it.
    """
    magnet, length = run.magnet, run.run.specimen.length_mm
    if magnet is None:
        return
    x = np.linspace(-6.0, length + 16.0, 41)
    y = np.linspace(-min(gap_mm - 4.0, 34.0), 22.0, 43)
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid, np.zeros(len(grid))])
    flux = magnet_flux_mT(magnet, points, length_mm=length, gap_mm=gap_mm)
    bx, by = (flux[:, i].reshape(len(y), len(x)) for i in (0, 1))
    size = np.hypot(bx, by)
    axes.streamplot(
        x, y, bx, by, color=FAINT, density=0.7, linewidth=0.5, arrowsize=0.6
    )
    lines = axes.contour(x, y, size, levels=6, colors=MAGNET, linewidths=0.8)
    axes.clabel(lines, fmt="%g mT", fontsize=6.0)
    for comparison in run.of("magnet"):
        shape = comparison.solution.centreline if comparison.solution else None
        if shape is not None and comparison.step.gap_mm == gap_mm:
            axes.plot(
                shape.x_mm, shape.y_mm, color=INK, linewidth=1.8,
                gid=f"rod at {gap_mm:g} mm",
            )  # fmt: skip
            axes.annotate(
                f"rod at {gap_mm:g} mm", shape.tip_mm, xytext=(0, 6),
                textcoords="offset points", ha="right", fontsize=7,
                bbox={"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 1},
            )  # fmt: skip
    axes.plot([0.0, length], [0.0, 0.0], color=INK, linewidth=0.8, dashes=(1, 2))
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)")
