"""From a specimen, and how much of it is inserted, to the kernels' `Rod`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ...core.specimen import Specimen
from ..fields import Support
from ..scaling import rod_array
from ..tube.mesh import elements_of
from .rod import Bent, Rod, bend, station

Array = NDArray[np.float64]
ELEMENTS = 24
"""Elements of a whole rod: the free rod is then exact to about 1e-9 of its length."""


def sections_of(specimen: Specimen, support: Support) -> Array:
    """Return the sections, root first, shape (k, 6).

    Length, stiffness, m, weight (x, y), natural curvature.
    """
    rows = rod_array(specimen, support)[::-1].copy()
    rows[:, 1] = 1.0 / rows[:, 1]
    natural = np.array(specimen.natural_curvatures_per_mm) * specimen.length_mm
    return np.column_stack([rows, natural])


def mesh(
    sections: Array, length: float, root: Array, grip: Array, elements: int
) -> Rod:
    """Return the last `length` of a rod, in elements of about equal size.

    Parameters
    ----------
    sections : ndarray, shape (k, 6)
        See `sections_of`.
    length : float
        What is inserted, over the rod's length.
    root, grip : ndarray, shapes (3,), (4,)
        See `Rod`.
    elements : int
        How many a whole rod has, at least.
    """
    nodes, table = elements_of(sections, sections[:, 0], length, elements)
    m = np.ascontiguousarray(table[:, 2])
    pole = np.concatenate([[0.0], m[:-1] - m[1:], m[-1:]])
    beyond = np.zeros((len(nodes), 2))
    if table[:, 3:5].any():
        weights = table[:, 3:5] * np.diff(nodes)[:, None]
        beyond[:-1] = np.cumsum(weights[::-1], axis=0)[::-1]
    stiff = np.ascontiguousarray(table[:, 1])
    natural = np.ascontiguousarray(table[:, 5])
    return Rod(nodes, stiff, natural, m, pole, beyond, root, grip)


@njit(cache=True, error_model="numpy")
def trace(rod, u, s):  # type: ignore[no-untyped-def]
    """Return x, y, angle and curvature of a rod at arc lengths, shape (4, m).

    Before the clamp it is straight.
    """
    n = rod.stiff.shape[0]
    bent = Bent(
        np.empty((n, 5)), np.empty((n, 5)), np.empty(n + 1), np.empty(n + 1),
        np.empty((n, 4)), np.empty((n, 4)),
    )  # fmt: skip
    bend(rod, u, bent)
    out = np.empty((4, s.shape[0]))
    for k in range(s.shape[0]):
        if s[k] < 0.0:
            out[0, k] = rod.root[0] + s[k] * np.cos(rod.root[2])
            out[1, k] = rod.root[1] + s[k] * np.sin(rod.root[2])
            out[2, k] = rod.root[2]
            out[3, k] = 0.0
            continue
        at = station(rod, u, bent, min(s[k], rod.s[-1]))
        out[0, k] = at.x
        out[1, k] = at.y
        out[2, k] = at.theta
        out[3, k] = at.kappa
    return out


def unknowns(rod: Rod, angles: Array) -> Array:
    """Return the unknowns of a rod whose angles are known.

    Parameters
    ----------
    rod : Rod
        Its mesh.
    angles : ndarray, shape (n, 4)
        At the ends and thirds of the elements (see `thirds`), in rad.
    """
    a, b, c, d = angles.T
    u = np.empty(3 * len(rod.stiff) + 1)
    u[0], u[3::3] = rod.root[2], d
    even = 0.5 * ((b - (2.0 * a + d) / 3.0) + (c - (a + 2.0 * d) / 3.0))
    odd = 0.5 * ((b - (2.0 * a + d) / 3.0) - (c - (a + 2.0 * d) / 3.0))
    # At a third, xi^2 - xi is -2/9 and the cubic 2/27; at two thirds -2/9 and -2/27.
    u[1::3] = -4.5 * even
    u[2::3] = 13.5 * odd
    return u


def thirds(rod: Rod) -> Array:
    """Return the arc lengths of the ends and thirds of each element, shape (n, 4)."""
    share = np.array([0.0, 1.0, 2.0, 3.0]) / 3.0
    return rod.s[:-1, None] + np.diff(rod.s)[:, None] * share
