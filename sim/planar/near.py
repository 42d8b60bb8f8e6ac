"""The planar equilibrium next to a given one, of whatever branch, with its shape."""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import in_reach
from .contact import touches_in_plane
from .follow import move, newton
from .march import MAX_ORDER, STATE, march
from .solver import place

LOST, TOUCHING = -1, -2
NEAREST = 0.1
"""Largest first correction, in lengths of the rod and rad."""


@njit(cache=True, error_model="numpy")
def settle(rod, field, clamp, margin, s, order, step, u, out):  # type: ignore[no-untyped-def]
    """Find the equilibrium next to the unknowns u, and its shape.

    Parameters
    ----------
    rod, field, clamp, margin, order, step
        As of `planar.solver.solve_rows`, of one rod.
    s : ndarray, shape (n,)
        Stations.
    u : ndarray, shape (4,)
        Where to begin; receives the unknowns of the equilibrium.
    out : ndarray, shape (4, n)
        Receives x, y, theta, curvature.

    Returns
    -------
    int
        Morse index; `LOST`, if Newton would have to jump; or `TOUCHING`.
    """
    X = np.empty(STATE)
    D = np.empty((STATE, 4))
    T = np.empty((4, MAX_ORDER + 1))
    C = np.empty((MAX_ORDER + 1, 4, 4))
    # The field may be another than where u was found. Where its direction is nearly the
    # same the tip keeps its angle from the load, which may be exponentially small.
    ahead = u.copy()
    move(rod, field, 0.0, np.zeros(4), ahead)
    if abs(ahead[3] - u[3]) < NEAREST:
        u[:] = ahead
    index = newton(rod, field, 1.0, clamp, u, order, step, NEAREST, X, D, T, C)
    if index < 0:
        return LOST
    march(
        rod, field, 1.0, u, order, step, 0, math.inf, s, s.shape[0], X, D, T, C, out
    )  # fmt: skip
    if not place(u, X, out):
        return LOST
    if in_reach(field, margin) and touches_in_plane(field, margin, s, out):
        return TOUCHING
    return index
