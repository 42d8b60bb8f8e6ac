"""Bodies of a field that stand in each other.

Points in one body, and on the winding of a coil, are looked for in the other. Of many
rods before one field only those places are looked at that differ.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.sources import Coil, Cuboid, Cylinder, Dipole, Source
from ..magnet import flux
from ..magnet.flux import FIRST, WIDTH

Array = NDArray[np.float64]

_STEPS = np.linspace(-0.999, 0.999, 9)
_CUBE = np.stack(np.meshgrid(_STEPS, _STEPS, _STEPS), axis=-1).reshape(-1, 3)
_TURN = np.linspace(0.0, 2.0 * np.pi, 97)[:-1]
_RING = np.column_stack([np.cos(_TURN), np.sin(_TURN)])
_WINDING = np.column_stack([np.tile(_RING, (9, 1)), np.repeat(_STEPS, len(_RING))])


Body = tuple[int, Any, int]
"""Number, source, and where its numbers begin."""


def _pairs(sources: Sequence[Source]) -> Iterator[tuple[Body, Body]]:
    """Return all pairs of bodies."""
    bodies = [
        (i, one, FIRST + WIDTH * i)
        for i, one in enumerate(sources)
        if isinstance(one, (Cuboid, Cylinder, Dipole, Coil))
    ]
    return combinations(bodies, 2)


def may_meet(sources: Sequence[Source], corners: Array) -> bool:
    """Tell whether bodies may overlap before any rod of a batch.

    They do not if along one axis of theirs one is ahead of the other before all rods.
    Where it is depends linearly on length and gap, so the ends of both decide.

    Parameters
    ----------
    sources : sequence of Source
        Of one field.
    corners : ndarray, shape (4, width)
        That field, in mm, before rods of the least and largest length at the least and
        largest gap.
    """
    for (_, _, a), (_, _, b) in _pairs(sources):
        ahead, sizes = _ahead(corners, a, b)
        if not np.any(np.all(ahead > sizes, axis=0) | np.all(-ahead > sizes, axis=0)):
            return True
    return False


def refuse_overlap(sources: Sequence[Source], rows: Array, length_mm: Array) -> None:
    """Refuse bodies that stand in each other.

    Parameters
    ----------
    sources : sequence of Source
        Of one field.
    rows : ndarray, shape (n, width)
        That field before n rods, as the kernels take it.
    length_mm : ndarray, shape (n,)
        Of the rods.

    Raises
    ------
    InputError
        That names the two and a point in both.
    """
    for (i, one, a), (j, other, b) in _pairs(sources):
        for row in _close(rows, length_mm, a, b):
            point = _shared(rows[row, a : a + WIDTH], rows[row, b : b + WIDTH])
            if point is not None:
                x_mm, y_mm, z_mm = point * length_mm[row]
                raise InputError(
                    f"sources {i} ({one.kind}) and {j} ({other.kind}) of a field must "
                    "not overlap; instead received two that share the point "
                    f"({x_mm:.4g}, {y_mm:.4g}, {z_mm:.4g}) mm: move centre_mm, gap_mm "
                    "or offset_mm"
                )


def _close(rows: Array, length_mm: Array, a: int, b: int) -> NDArray[np.intp]:
    """Return one row of each distance at which the boxes around two bodies meet."""
    ahead, sizes = _ahead(rows, a, b)
    near = np.flatnonzero(np.all(np.abs(ahead) < sizes, axis=1))
    apart = rows[near, a + 4 : a + 7] - rows[near, b + 4 : b + 7]
    places = np.round(apart * length_mm[near, None], 6)
    _, first = np.unique(places, axis=0, return_index=True)
    return near[first]


def _ahead(rows: Array, a: int, b: int) -> tuple[Array, Array]:
    """Return how far one body is ahead of another, and the sum of their half sizes.

    Both of shape (n, 6): along the three axes of each.
    """
    own = [rows[0, at + 7 : at + 16].reshape(3, 3) for at in (a, b)]
    axes = np.concatenate(own)
    apart = rows[:, a + 4 : a + 7] - rows[:, b + 4 : b + 7]
    sizes = sum(
        np.einsum("nj,jk->nk", _extent(rows[:, at:]), np.abs(turned @ axes.T))
        for at, turned in zip((a, b), own, strict=True)
    )
    return np.einsum("ni,ki->nk", apart, axes), np.asarray(sizes)


def _extent(bodies: Array) -> Array:
    """Return how far one body before n rods extends along its axes, shape (n, 3)."""
    kind, size = bodies[0, 0], bodies[:, 1:4]
    if kind == flux.DIPOLE:
        return np.repeat(size[:, :1], 3, axis=1)
    if kind == flux.COIL:
        around = size[:, 0] + size[:, 1]
        return np.stack([around, around, size[:, 2] + size[:, 1]], axis=1)
    return size


def _shared(a: Array, b: Array) -> Array | None:
    """Return a point in both of two bodies, or None."""
    for body in (a, b):
        points = body[4:7] + _points(body) @ body[7:16].reshape(3, 3)
        shared = _within(a, points) & _within(b, points)
        if np.any(shared):
            point: Array = points[np.argmax(shared)]
            return point
    return None


def _points(body: Array) -> Array:
    """Return points of a body in its own frame, shape (n, 3)."""
    points: Array = _CUBE * body[1:4]
    if body[0] == flux.COIL:
        points = _WINDING * np.array([body[1], body[1], body[3]])
    elif body[0] == flux.DIPOLE:
        points = _CUBE * body[1]
    return points


def _within(body: Array, points: Array) -> NDArray[np.bool_]:
    """Tell of points whether they are in a body."""
    p = (points - body[4:7]) @ body[7:16].reshape(3, 3).T
    across: Array = np.hypot(p[:, 0], p[:, 1])
    if body[0] == flux.DIPOLE:
        inside: NDArray[np.bool_] = np.hypot(across, p[:, 2]) <= body[1]
    elif body[0] == flux.CYLINDER:
        inside = (across <= body[1]) & (np.abs(p[:, 2]) <= body[3])
    elif body[0] == flux.COIL:
        beyond = np.maximum(0.0, np.abs(p[:, 2]) - body[3])
        inside = np.hypot(across - body[1], beyond) <= body[2] + 1e-9
    else:
        inside = np.all(np.abs(p) <= body[1:4], axis=1)
    return inside
