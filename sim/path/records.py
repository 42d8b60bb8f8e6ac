"""What a path is: its points, and where equilibria end or meet on the way."""

from __future__ import annotations

from dataclasses import dataclass

from ...core.centreline import Centreline
from ..fields import Field


@dataclass(frozen=True, slots=True, kw_only=True)
class PathPoint:
    """One point of a path.

    Parameters
    ----------
    value : float
        Of what changes.
    status : str
        ``stable``, ``unstable`` or ``pulled in: no equilibrium``.
    centreline : Centreline or None
        The shape; None where there is no equilibrium.
    morse_index : int
        Unstable directions in the plane; -1 where there is no equilibrium.
    energy_uJ : float
        Elastic, magnetic and of the weight, in microjoules; NaN without a shape.
    work_uJ : float
        What it took to come here from the first point, done on the rod by what changes
        (the hand that moves the magnet, the field that turns); NaN from where the rod
        had no shape.
    snapped : bool
        Whether the rod has jumped here from the point before.
    field : Field
        The sources at this point.
    length_mm : float
        Of the rod, to whose undeformed tip gaps count.
    """

    value: float
    status: str
    centreline: Centreline | None
    morse_index: int
    energy_uJ: float
    work_uJ: float = 0.0
    snapped: bool = False
    field: Field
    length_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PathFold:
    """A place where the followed equilibrium ends, or another meets it.

    Parameters
    ----------
    value : float
        Of what changes.
    direction : str
        ``rising`` or ``falling``: how it changed there.
    kind : str
        ``fold``; ``contact``, where the rod meets a magnet; ``bifurcation``, where
        two mirrored shapes leave the straight rod, which is followed on; or ``index``,
        where another equilibrium goes on but loses or gains a stable direction.
    tip_mm : tuple of float
        The tip just before.
    turning : tuple of float
        The singular direction: dx, dy of the tip, of unit length, in which the
        equilibrium gives way.
    branches_mm : tuple of (float, float)
        Of a bifurcation: the tips of the stable shapes beside the straight rod, at the
        point of the path next to it at which that is unstable.
    """

    value: float
    direction: str
    kind: str
    tip_mm: tuple[float, float]
    turning: tuple[float, float]
    branches_mm: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """What `follow_path` found.

    Parameters
    ----------
    quantity : str
        What changes, with its unit.
    points : tuple of PathPoint
    folds : tuple of PathFold
    dissipated_uJ : float
        What the rod loses in all its snaps from shape to shape, in microjoules.
    """

    quantity: str
    points: tuple[PathPoint, ...]
    folds: tuple[PathFold, ...]
    dissipated_uJ: float
