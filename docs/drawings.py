"""Drawings of the site: the house, and the bench seen from above and from the side.

They lie in ``docs/pictures`` and are committed, so that the pages show them unbuilt;
``make docs`` draws them anew.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.patches import FancyBboxPatch, Polygon, Rectangle

INK, FAINT = "#1b1f24", "#6a737d"
BLUE, ORANGE, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "#e9edf1"

FLOORS = (
    (("cli", "the command `magbend`"), ("panel", "the bench on one local page")),
    (
        (
            "analysis",
            "compare, fit, report, import,\ntrain, search, design; the twin bench",
        ),
    ),
    (
        ("rig", "stage, camera, meter,\nruns, virtual devices"),
        ("vision", "photographs to\ncentrelines in mm"),
        ("sim", "rods, fields, equilibria,\npaths, navigation"),
    ),
    (("core", "errors, units, specimen, centreline, tables, files, kernels"),),
)


def all_drawings(folder: Path) -> list[Path]:
    """Draw each one into a folder; return the files."""
    files = [folder / "architecture.svg", folder / "bench.svg"]
    for file, draw in zip(files, (architecture, bench), strict=True):
        draw(file)
    return files


def architecture(out: Path) -> None:
    """Draw the packages on their floors; arrows say which imports which."""
    figure, axes = plt.subplots(figsize=(7.2, 4.4), layout="constrained")
    for level, rooms in enumerate(FLOORS):
        y = 3.0 - level
        width = 9.6 / len(rooms)
        for i, (name, what) in enumerate(rooms):
            x = 0.2 + i * width
            box = FancyBboxPatch(
                (x, y), width - 0.2, 0.62, boxstyle="round,pad=0.02,rounding_size=0.06",
                facecolor=GREY, edgecolor=FAINT, linewidth=0.8,
            )  # fmt: skip
            axes.add_patch(box)
            middle = x + 0.5 * (width - 0.2)
            axes.text(middle, y + 0.44, name, ha="center", va="center", weight="bold",
                      color=INK, fontsize=10)  # fmt: skip
            axes.text(middle, y + 0.19, what, ha="center", va="center", color=INK,
                      fontsize=7.5)  # fmt: skip
        if level:
            for x in (2.0, 5.0, 8.0):
                axes.annotate("", (x, y + 0.68), (x, y + 0.96), arrowprops=_ARROW)
    axes.text(5.0, -0.17, "arrows: imports, downward only; rig, vision and sim never "
              "import each other", ha="center", fontsize=7.5, color=FAINT)  # fmt: skip
    axes.set(xlim=(0, 10), ylim=(-0.3, 3.8))
    axes.axis("off")
    _save(figure, out)


_ARROW = {"arrowstyle": "-|>", "color": FAINT, "linewidth": 0.9}


def bench(out: Path) -> None:
    """Draw the bench from above, with its frames, and from the side."""
    figure, (top, side) = plt.subplots(
        2, 1, figsize=(7.2, 7.4), layout="constrained", height_ratios=(1.5, 1.0)
    )
    _from_above(top)
    _from_the_side(side)
    _save(figure, out)


def _from_above(axes: Any) -> None:
    axes.set_title("from above, as the camera sees it", loc="left", fontsize=9)
    axes.add_patch(Rectangle((-16, -7), 16, 14, facecolor=GREY, edgecolor=FAINT))
    axes.text(-8, 0, "clamp", ha="center", va="center", fontsize=8)
    axes.add_patch(Rectangle((0, -0.5), 30, 1, facecolor=INK))
    axes.annotate("rod, undeformed (gap and frame refer to it)", (12, 0.6), (4, 9),
                  fontsize=8, arrowprops=_ARROW)  # fmt: skip
    x = [0.0 + 30.0 * t / 60 for t in range(61)]
    axes.plot([v * 0.985 for v in x], [0.0055 * v**2 for v in x], color=BLUE, lw=1.6)
    axes.text(30.4, 5.6, "bent: +y", color=BLUE, fontsize=8)
    axes.add_patch(Rectangle((2.5, -60), 55, 25, facecolor="#f3d9cc", edgecolor=ORANGE))
    axes.text(
        30, -50, "cube magnet on the carriage (drawn short)", ha="center", fontsize=8
    )
    axes.text(30, -38.2, "N", ha="center", color=ORANGE, weight="bold", fontsize=10)
    axes.annotate(
        "", (30, -35), (30, 0), arrowprops={"arrowstyle": "<|-|>", "color": INK}
    )
    axes.text(31, -19, "gap: N face to the tip of the\nundeformed rod, along the\n"
              "magnet's axis", fontsize=8, va="center")  # fmt: skip
    axes.annotate(
        "", (-8, -33), (-8, -58), arrowprops={"arrowstyle": "<|-|>", "color": INK}
    )
    axes.text(
        -9, -46, "leadscrew,\nstage coordinate", ha="right", fontsize=8, va="center"
    )
    axes.annotate(
        "", (8, 0), (0, 0), arrowprops={"arrowstyle": "-|>", "color": GREEN, "lw": 1.6}
    )
    axes.annotate(
        "", (0, 8), (0, 0), arrowprops={"arrowstyle": "-|>", "color": GREEN, "lw": 1.6}
    )
    axes.text(8.3, -2.6, "x", color=GREEN, fontsize=9)
    axes.text(-1.8, 8, "y", color=GREEN, fontsize=9)
    axes.plot([30], [-3.0], "o", color=ORANGE, ms=5)
    axes.annotate("Hall probe: at the undeformed tip\nwhile the rod is away, else "
                  "beside it",
                  (30.4, -3.2), (45, -9), fontsize=8, arrowprops=_ARROW)  # fmt: skip
    axes.set(xlim=(-32, 82), ylim=(-63, 15), aspect="equal")
    axes.axis("off")


def _from_the_side(axes: Any) -> None:
    axes.set_title("from the side", loc="left", fontsize=9)
    axes.add_patch(Rectangle((-20, -2.0), 90, 2, facecolor=GREY, edgecolor=FAINT))
    axes.text(69, -6, "paper; the printed board lay here for the calibration",
              fontsize=8, ha="right", va="center")  # fmt: skip
    axes.add_patch(Rectangle((-20, 0), 18, 10, facecolor=GREY, edgecolor=FAINT))
    axes.text(-11, 5, "clamp", ha="center", va="center", fontsize=8)
    axes.add_patch(Rectangle((-2, 3.5), 30, 1.2, facecolor=INK))
    axes.annotate(
        "", (14, 0), (14, 4.1), arrowprops={"arrowstyle": "<|-|>", "color": BLUE}
    )
    axes.text(15, 1.6, "rod height: paper to the rod's axis", fontsize=8, color=BLUE,
              va="center")  # fmt: skip
    axes.add_patch(Rectangle((6, 38), 16, 9, facecolor=GREY, edgecolor=FAINT))
    axes.add_patch(Polygon([(9, 38), (19, 38), (17, 33), (11, 33)], facecolor=FAINT))
    axes.text(24, 43, "camera: fixed, focus and exposure locked,\n20 px/mm or more, "
              "looking straight down", fontsize=8, va="center")  # fmt: skip
    axes.plot([11, -8], [33, 0], ":", color=FAINT, lw=0.8)
    axes.plot([17, 45], [33, 0], ":", color=FAINT, lw=0.8)
    axes.text(48, 22, "lamp: even and from the side,\nno hard shadow beside the rod",
              fontsize=8, va="center")  # fmt: skip
    axes.set(xlim=(-32, 82), ylim=(-10, 50), aspect="equal")
    axes.axis("off")


def _save(figure: Any, out: Path) -> None:
    with mpl.rc_context({"svg.hashsalt": out.name}):
        figure.savefig(out, metadata={"Date": None, "Creator": None}, facecolor="white")
    plt.close(figure)
