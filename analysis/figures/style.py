"""How the figures look: one palette for screen, dark screen and print.

Figures are drawn once. In the page their colours become CSS variables, so that one SVG
serves light and dark; in the PDF beside it they stay as they are here. Colours are
those of Okabe and Ito, told apart by people with any colour vision, and lines differ in
dash as well, so that a grey print still works.
"""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, cast

from ...core.checks import within

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#1b1f24"
FAINT = "#8a929b"
GRID = "#dfe3e8"
MAGNET = "#0072b2"
UNIFORM = "#d55e00"
GOOD = "#009e73"
BAD = "#cc3311"
IMPORTED = "#aa4499"

_VARIABLES = {
    INK: "var(--ink)",
    FAINT: "var(--faint)",
    GRID: "var(--grid)",
    MAGNET: "var(--magnet)",
    UNIFORM: "var(--uniform)",
    GOOD: "var(--good)",
    BAD: "var(--bad)",
    IMPORTED: "var(--imported)",
}
WIDTH_MM = 181.0
"""Width of a two-column figure."""

NARROW_MM = 130.0
"""Below this width panels stand below each other."""

_LEFT_MM, _RIGHT_MM, _BOTTOM_MM, _TOP_MM = 16.0, 3.0, 11.0, 7.0

SERIES = ("#0072b2", "#d55e00", "#009e73", "#aa4499", "#b8860b", "#1b1f24")
"""Colours that are told apart with any colour vision (Okabe and Ito, Tol)."""

MARKERS = "os^Dv<>"

MODEL_COLOUR = {"uniform": UNIFORM, "magnet": MAGNET, "imported": IMPORTED}
MODEL_DASH = {"uniform": (4.0, 2.0), "magnet": (None, None), "imported": (6.0, 1.5)}
MODEL_LABEL = {
    "uniform": "simulated, uniform field",
    "magnet": "simulated, magnet",
    "imported": "simulated elsewhere",
}

_RC = {
    "font.family": "sans-serif",
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.2,
    "lines.markersize": 2.6,
    "text.color": INK,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    # A true minus lies outside the first 255 characters and would embed the font twice,
    # which is half of the time of a PDF; the page gets it back in `to_svg`.
    "axes.unicode_minus": False,
    # Names of runs and specimens are text, whatever signs they hold.
    "text.parse_math": False,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "svg.fonttype": "none",
    "svg.hashsalt": "magbend",
    "pdf.fonttype": 42,
    "pdf.compression": 9,
}


def drawing() -> AbstractContextManager[None]:
    """Return a context in which figures are drawn in the house style."""
    import matplotlib as mpl

    return mpl.rc_context(cast("Any", _RC))


def new_panels(
    columns: int,
    *,
    height_mm: float,
    width_mm: float = WIDTH_MM,
    gap_mm: float = 20.0,
    ratios: Sequence[float] | None = None,
) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels side by side, or below each other if it is narrow.

    Margins are fixed: labels of one line fit, and laying out automatically would take
    half of the time of a report.

    Parameters
    ----------
    columns : int
        Panels.
    height_mm : float
        Of one row of panels, labels included.
    width_mm : float
        Of the figure: 181 for two columns of a journal, 88 for one.
    gap_mm : float
        Room between panels for tick labels.
    ratios : sequence of float, optional
        Widths of the panels to each other, where they stand side by side.

    Raises
    ------
    InputError
        If the width is not from 60 to 400 mm.
    """
    from matplotlib.figure import Figure

    within(width_mm, 60.0, 400.0, "the width of a figure", "mm")
    is_narrow = width_mm < NARROW_MM and columns > 1
    rows, across = (columns, 1) if is_narrow else (1, columns)
    total_mm = height_mm * rows
    figure = Figure(figsize=(width_mm / 25.4, total_mm / 25.4))
    panel_mm = (width_mm - _LEFT_MM - _RIGHT_MM - (across - 1) * gap_mm) / across
    tall_mm = height_mm - _BOTTOM_MM - _TOP_MM
    figure.subplots_adjust(
        left=_LEFT_MM / width_mm,
        right=1.0 - _RIGHT_MM / width_mm,
        bottom=_BOTTOM_MM / total_mm,
        top=1.0 - _TOP_MM / total_mm,
        wspace=gap_mm / panel_mm,
        hspace=(_BOTTOM_MM + _TOP_MM) / tall_mm,
    )
    kept = None if ratios is None or is_narrow else list(ratios)
    axes = figure.subplots(rows, across, squeeze=False, width_ratios=kept)
    return figure, list(axes.ravel())


def new_grid(
    rows: int, columns: int, *, height_mm: float, width_mm: float = WIDTH_MM
) -> tuple[Figure, list[list[Axes]]]:
    """Return a figure of small multiples that share their axes.

    Parameters
    ----------
    rows, columns : int
        Panels down and across.
    height_mm : float
        Of one row.
    width_mm : float
        Of the figure.
    """
    from matplotlib.figure import Figure

    within(width_mm, 60.0, 400.0, "the width of a figure", "mm")
    total_mm = rows * height_mm + _BOTTOM_MM
    figure = Figure(figsize=(width_mm / 25.4, total_mm / 25.4))
    figure.subplots_adjust(
        left=_LEFT_MM / width_mm, right=1.0 - _RIGHT_MM / width_mm,
        bottom=_BOTTOM_MM / total_mm, top=1.0 - 6.0 / total_mm,
        wspace=0.06, hspace=0.08,
    )  # fmt: skip
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    return figure, [list(row) for row in axes]


def to_pdf(figure: Figure) -> bytes:
    """Return the figure as PDF: fonts embedded, no date, white paper."""
    buffer = io.BytesIO()
    with drawing():
        figure.savefig(
            buffer, format="pdf", facecolor="white", metadata={"CreationDate": None}
        )
    return buffer.getvalue()


def safe_name(name: str) -> str:
    """Return a name fit for ids and files; one that had to change stays unique."""
    plain = re.sub(r"[^A-Za-z0-9_-]+", "-", name)
    if plain == name:
        return name
    return f"{plain}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def to_svg(figure: Figure, name: str) -> str:
    """Return the figure as SVG for the page: scalable, in the page's colours.

    Parameters
    ----------
    name : str
        Goes before every id, so that figures do not share any; must be unique. Signs
        that end an attribute of HTML are taken out.
    """
    name = safe_name(name)
    buffer = io.StringIO()
    with drawing():
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", text)
    text = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(<svg[^>]*?) width="[^"]*"', r'\1 class="figure"', text, count=1)
    text = re.sub(r"font: ([\d.]+)px [^;\"]+", r"font-size: \1px", text)
    text = re.sub(r">-(?=[\d.])", ">\u2212", text)
    for colour, variable in _VARIABLES.items():
        text = text.replace(colour, variable)
    return text
