"""Something long and thin in a picture, that may be the rod."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..curve.curve import arc_lengths, on_polyline
from ..edge.state import Root

Array = NDArray[np.float64]


_NET, _NET_WIDTHS = 3, 10.0
"""Crossings from which a thing is a thread of a net, if they are no farther apart than
so many widths."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """Something long and thin, in pixels of the photograph.

    Parameters
    ----------
    points_px : ndarray, shape (n, 2)
        Start curve (x, y) from root to tip.
    width_px, length_px : float
        Rough width and length.
    root : {"clamp", "border", "free"}
        What it grows from.
    contacts : int
        Separate places where it touches something fat or the border.
    leaves : bool
        Whether one of them, besides its root, is the border of the picture.
    ratio : float
        Light on it relative to the background.
    rivalled : bool
        Whether another thing in the picture may be the rod as well.
    halved : bool
        Whether another thing lies so close along it that both may be one rod.
    off_colour : float
        Distance of its colour from the rod's, CIELAB; 0 where that is not known.
    from_front : bool
        Whether it begins at the front of a clamp that its own light does not show.
    hidden_px : ndarray, shape (k, 3)
        Places (x, y, radius) where something lies across it.
    """

    points_px: Array
    width_px: float
    length_px: float
    root: Root
    contacts: int
    ratio: float
    leaves: bool = False
    rivalled: bool = False
    halved: bool = False
    off_colour: float = 0.0
    from_front: bool = False
    hidden_px: Array = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def slenderness(self) -> float:
        """Length over width."""
        return self.length_px / self.width_px

    @property
    def is_held_at_end(self) -> bool:
        """Whether it touches something besides what it grows from."""
        return self.contacts > (self.root != "free")

    @property
    def is_in_net(self) -> bool:
        """Whether it is crossed all along, as the squares of a board are."""
        crossed = len(self.hidden_px)
        return crossed >= _NET and self.slenderness < _NET_WIDTHS * crossed

    def reversed(self) -> Candidate:
        """Return it from its other end on."""
        held: Root = "border" if self.leaves else "clamp"
        return replace(
            self,
            points_px=self.points_px[::-1],
            root=held if self.is_held_at_end else "free",
            leaves=self.root == "border",
        )

    def is_held_as(self, other: Candidate) -> bool:
        """Whether it begins at that end of another at which that begins."""
        first, last = (
            math.dist(self.points_px[0], other.points_px[k]) for k in (0, -1)
        )
        return first < last

    def away(self, point: Array) -> float:
        """Distance of a point (x, y) from the start curve, px."""
        return float(np.hypot(*(self.points_px - point).T).min())

    def from_tip(self, along: Array) -> Array:
        """Return points at distances from its tip along it, px, shape (n, 2)."""
        points = self.points_px[::-1]
        return on_polyline(along, arc_lengths(points), points)

    def lies_on(self, other: Candidate) -> bool:
        """Whether its middle lies on another: a part of it, or the same thing."""
        middle = self.points_px[len(self.points_px) // 2]
        return other.away(middle) < max(self.width_px, other.width_px)
