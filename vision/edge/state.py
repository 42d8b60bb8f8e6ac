"""What one edge pass sees and hands to the next, and that a rod can get lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ..curve.curve import Curve
from ..picture.photo import Photo
from .clamp_light import ClampLight
from .edges import Edges
from .flank import Flanks

Array = NDArray[np.float64]
Root = Literal["clamp", "border", "free"]
"""What a rod grows from."""


class LostError(Exception):
    """The edges or an end of the rod got lost; private to this package.

    Parameters
    ----------
    flag, reason : str
        As in `Measurement`.
    seen_px : sequence of ndarray, shape (n, 2)
        Axes of the things in the picture that might be the rod.
    """

    def __init__(self, flag: str, reason: str, seen_px: Sequence[Array] = ()) -> None:
        super().__init__(reason)
        self.flag = flag
        self.reason = reason
        self.seen_px = tuple(seen_px)


BROKEN = (
    np.linalg.LinAlgError, ArithmeticError, ValueError, IndexError, cv2.error
)  # fmt: skip
"""What numerics raise on pictures that hold no rod after all."""


@dataclass(slots=True)
class State:
    """What a pass hands to the next: the curve, half widths along it, and the ends.

    The blur of the ends, along the rod, is 0 as long as none was fitted; `blurs` is
    that of parts of its sides where it is uneven, as motion makes it on a bent rod.
    `plain` is the picture's own light where the rod is seen in a mix of colours.
    `photo` has its colours, and `clamp_light` those that show a clamp where the light
    that shows the rod does not.
    `from_front` tells that the curve begins at the front of a clamp, which was seen in
    all colours. At the places `hidden` (x, y, radius) something lies across it.
    """

    curve: Curve
    half: Array
    width: float
    first: float
    last: float
    face_px: float
    rough: bool
    blur: float = 1.0
    hidden: Array | None = None
    scatter: float = 0.0
    fuzz: float = 0.0
    blurs: Array | None = None
    tip_blur: float = 0.0
    clamp_blur: float = 0.0
    flanks: Flanks | None = None
    plain: NDArray[np.float32] | None = None
    photo: Photo | None = None
    clamp_light: ClampLight | None = None
    from_front: bool = False
    foot_px: float = 0.0

    @property
    def optics(self) -> tuple[float, ...]:
        """What sides and tip, as far as it was fitted, tell of the blur, px."""
        return (self.blur, self.tip_blur) if self.tip_blur else (self.blur,)


@dataclass(frozen=True, slots=True)
class Seen:
    """Edges at stations along a curve, and which of them are to be trusted."""

    s: Array
    theta: Array
    edges: Edges
    good: NDArray[np.bool_]
