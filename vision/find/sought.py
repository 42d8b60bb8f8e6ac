"""What is known of a rod before its picture is looked at."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from .candidate import Candidate
from .rod_colour import ALIKE

Clamp = Literal["auto", "none"]

_SIZE = 1.6
"""Factor by which a thing may be larger or smaller than the rod that is sought."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sought:
    """What is known of a rod before its picture is looked at.

    Parameters
    ----------
    invert : bool or None
        Whether it is lighter than the ground; None looks for itself.
    clamp : {"auto", "none"}
        ``none`` takes a rod that floats freely too.
    width_px, length_px : float
        About how wide and long it is seen; 0 where that is not known.
    colour : str or None
        Its colour on white paper, ``#rrggbb``.
    """

    invert: bool | None = None
    clamp: Clamp = "auto"
    width_px: float = 0.0
    length_px: float = 0.0
    colour: str | None = None

    def fits(self, rod: Candidate) -> bool:
        """Whether a candidate has about the size and colour of the rod."""
        if rod.off_colour > ALIKE:
            return False
        width, length = rod.width_px, rod.length_px
        return (not self.width_px or 1 / _SIZE < width / self.width_px < _SIZE) and (
            not self.length_px or 1 / _SIZE < length / self.length_px < _SIZE
        )

    def misfit(self, rod: Candidate) -> float:
        """How far a candidate's size is from the rod's, as logarithms; 0 if unknown."""
        pairs = ((rod.width_px, self.width_px), (rod.length_px, self.length_px))
        return sum(abs(math.log(seen / known)) for seen, known in pairs if known)

    def tells(self, rod: Candidate, other: Candidate, by: float) -> bool:
        """Whether it is this candidate and not another, by so much of its size."""
        return self.misfit(rod) + by < self.misfit(other)
