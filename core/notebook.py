"""What results answer in a notebook: a table, a plot, and a look of their own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

_ROWS = 12


class Tabular(ABC):
    """Base of results that are shown as a table by a notebook."""

    __slots__ = ()

    @abstractmethod
    def to_dataframe(self) -> pd.DataFrame:
        """Return the numbers as a tidy table, units in the names of its columns."""

    def _repr_html_(self) -> str:
        table = self.to_dataframe()
        more = f"<p>{len(table)} rows</p>" if len(table) > _ROWS else ""
        shown = table.head(_ROWS).to_html(
            index=False, border=0, float_format="{:.5g}".format
        )
        return f"<p>{escape(type(self).__name__)}</p>{shown}{more}"


def axes_or_new(ax: Axes | None, x_label: str, y_label: str) -> Axes:
    """Return the axes to draw into, labelled: those given, or new ones of pyplot."""
    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.subplots()[1]
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    return ax


def plot_line(ax: Axes, line: Any, **style: Any) -> None:
    """Draw a centreline in mm, x and y to one scale."""
    ax.plot(line.x_mm, line.y_mm, **style)
    ax.set_aspect("equal", adjustable="datalim")
