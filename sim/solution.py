"""What solvers return: the equilibrium, or how it ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..core.centreline import COLUMNS, Centreline
from ..core.notebook import Tabular, axes_or_new, plot_line

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


@dataclass(frozen=True, slots=True, kw_only=True)
class Ending:
    """How the branch of equilibria that grows from zero load ends.

    Parameters
    ----------
    kind : str
        ``fold``: it meets another and both are gone; ``contact``: it touches a source.
    load : float
        The last load, as a fraction.
    s_mm : float
        Where along the rod: of the contact; the tip at a fold.
    place_mm : tuple of float
        That point, just before: x and y, or x, y and z of a rod in space.
    turning : tuple of float
        Which way the tip goes as it ends: at a fold, the singular direction; of the
        size of what moves most, taken for 1.
    """

    kind: str
    load: float
    s_mm: float
    place_mm: tuple[float, ...]
    turning: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution(Tabular):
    """The equilibrium that the rod reaches when its load grows from zero.

    Parameters
    ----------
    centreline : Centreline or None
        The shape; None where there is no equilibrium.
    status : str
        ``stable``, ``unstable`` or ``pulled in: no equilibrium``.
    morse_index : int
        Number of directions, within the plane unless the solver is spatial, in which
        the equilibrium is unstable; 0 is stable, -1 where there is none.
    error_mm : float
        Bound of the numerical error of any point of the shape, in mm.
    flux_tip_mT : tuple of float
        Flux density (x, y) at the deformed tip (at the undeformed tip where there is
        no equilibrium), in mT.
    root_moment_Nm : float
        Bending moment at the clamp, in N m, counter-clockwise.
    load_limit : float
        Fraction of the load up to which the rod has an equilibrium continuously
        connected to the unloaded rod: 1 where the full load is reached.
    stable_in_space : bool or None
        Whether the equilibrium also holds against leaving the plane; None where that
        was not looked at (solid model; loads beyond the reach of the march) or
        there is no equilibrium.
    z_mm : ndarray, shape (n,), or None
        Height of the points of the centreline over the plane, as of a rod that sags;
        None where the shape lies in the plane.
    ending : Ending or None
        Where there is no equilibrium, how the branch from zero load ends.
    buckled_tips_mm : tuple of (float, float)
        Where the rod is straight and unstable (a field exactly against it, above
        Euler's load), the tips of the stable shapes to which it buckles within the
        plane. Left free, a rod as stiff in all directions may turn about its axis: they
        are two of a circle.
    """

    centreline: Centreline | None
    status: str
    morse_index: int
    error_mm: float
    flux_tip_mT: tuple[float, float]
    root_moment_Nm: float
    load_limit: float = 1.0
    stable_in_space: bool | None = None
    z_mm: NDArray[np.float64] | None = None
    ending: Ending | None = None
    buckled_tips_mm: tuple[tuple[float, float], ...] = ()

    @property
    def points_mm(self) -> NDArray[np.float64]:
        """Points of the shape in space, shape (n, 3); none where there is no shape."""
        line = self.centreline
        if line is None:
            return np.zeros((0, 3))
        z = np.zeros_like(line.x_mm) if self.z_mm is None else self.z_mm
        return np.column_stack([line.x_mm, line.y_mm, z])

    @property
    def sag_mm(self) -> float:
        """How far the lowest point is below the clamp, in mm; 0 in the plane."""
        return 0.0 if self.z_mm is None else -float(min(self.z_mm.min(), 0.0))

    @property
    def columns(self) -> dict[str, NDArray[np.float64]]:
        """The table of the centreline, and `z_mm` where it leaves the plane, by name.

        Empty where there is no shape.
        """
        if self.centreline is None:
            return {}
        found = {name: getattr(self.centreline, name) for name in COLUMNS}
        return found if self.z_mm is None else found | {"z_mm": self.z_mm}

    def to_dataframe(self) -> pd.DataFrame:
        """Return `columns` as a table, a row a point; empty without a shape."""
        import pandas as pd

        return pd.DataFrame(self.columns)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the shape into `ax`, or into new axes of pyplot; return them."""
        ax = axes_or_new(ax, "x (mm)", "y (mm)")
        if self.centreline is not None:
            plot_line(ax, self.centreline, label=self.status)
        return ax
