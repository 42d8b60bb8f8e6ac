"""How a branch of equilibria ends: in a fold, or at a body that the rod touches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..magnet.flux import distance_at
from ..solution import Ending

Array = NDArray[np.float64]

BELOW = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.5, 1.0)
"""How much below its last load, relatively, a rod is looked at, until twice there is a
shape; without load there is one."""
CLOSE = 2e-3
"""How much nearer than what is seen at stations a rod may be to a body, in lengths."""


def end_of(
    shape_at: Callable[[float], Array | None],
    load: float,
    field: Array,
    margin: float,
    length_mm: float,
) -> Ending:
    """Return how the branch that grows from no load ends.

    Parameters
    ----------
    shape_at : callable
        Takes a fraction of the load and returns points of the rod from clamp to tip,
        shape (2 or 3, n), in lengths of the rod; None where there are none.
    load : float
        The last load it has.
    field, margin : ndarray, float
        As the kernels take them: nearer than the margin it touches.
    length_mm : float
        Of the rod.
    """
    shapes: list[Array] = []
    for below in BELOW:
        shape = shape_at(load * (1.0 - below))
        if shape is not None:
            shapes.append(shape)
        if len(shapes) == 2:
            break
    last, earlier = shapes[0], shapes[-1]
    x, y, z = last if len(last) == 3 else (*last, np.zeros_like(last[0]))
    apart = [distance_at(field, *place) for place in zip(x, y, z, strict=True)]
    nearest = int(np.argmin(apart))
    touches = bool(apart[nearest] <= margin + CLOSE)
    way = last - earlier
    size = float(np.max(np.linalg.norm(way, axis=0)))
    turning = way[:, -1] / size if size > 0.0 else way[:, -1]
    at = nearest if touches else last.shape[1] - 1
    return Ending(
        kind="contact" if touches else "fold",
        load=load,
        s_mm=at / (last.shape[1] - 1) * length_mm,
        place_mm=tuple((last[:, at] * length_mm).tolist()),
        turning=tuple(turning.tolist()),
    )
