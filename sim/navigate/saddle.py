"""What an equilibrium that is no minimum needs: its matrix, and its contacts."""

from __future__ import annotations

import numpy as np

from ...core.jit import njit
from .exchange import look, prune, sort_kinds, strayed
from .rod import Bent, bend, own_energy, own_gradient, own_stiffness
from .settle import GAP, add_grip, energy, update_forces
from .touch import locate, touch_gradient


@njit(cache=True, nogil=True, error_model="numpy")
def linearised(rod, field, walls, half, u, t, stiff, held, before):  # type: ignore[no-untyped-def]
    """Return gradient and Hessian of the augmented energy, and the rod's own energy."""
    n = rod.stiff.shape[0]
    size = 3 * n + 1
    bent = Bent(
        np.empty((n, 5)), np.empty((n, 5)), np.empty(n + 1), np.empty(n + 1),
        np.empty((n, 4)), np.empty((n, 4)),
    )  # fmt: skip
    g, K, ax, ay, row = (
        np.empty(size), np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    )  # fmt: skip
    H = np.empty((size, size))
    px, py = np.empty(n), np.empty(n)
    energy(rod, field, walls, half, u, bent, t, stiff, held, before)
    own_gradient(rod, field, u, bent, px, py, ax, ay, g, H)
    touch_gradient(rod, u, bent, t, stiff, before, px, py, ax, ay, row, g, H)
    if rod.grip[0] != 0.0:
        add_grip(rod, bent, held, stiff, px, py, ax, ay, g, H)
    own_stiffness(rod, bent, px, py, H, K)
    for a in range(size):
        for c in range(a):
            H[c, a] = H[a, c]
    return g, H, own_energy(rod, field, u, bent)


@njit(cache=True, nogil=True, error_model="numpy")
def exchanged(rod, walls, half, u, t, stiff, held, grow):  # type: ignore[no-untyped-def]
    """Take the walls' forces over and bring the contacts up to date.

    Parameters
    ----------
    grow : bool
        Whether contacts may be added.

    Returns
    -------
    tuple of float, int and float
        Largest gap left in use, contacts that changed, how deep the rod is behind a
        wall where contacts were added.
    """
    n = rod.stiff.shape[0]
    bent = Bent(
        np.empty((n, 5)), np.empty((n, 5)), np.empty(n + 1), np.empty(n + 1),
        np.empty((n, 4)), np.empty((n, 4)),
    )  # fmt: skip
    bend(rod, u, bent)
    locate(rod, u, bent, walls, half, t)
    h = rod.s[-1] / n
    worst = update_forces(rod, bent, t, stiff, held)
    changed = prune(t, GAP)
    deepest = 0.0
    if grow:
        added, deep = look(rod, u, bent, walls, half, h, t, False)
        changed += added
        deepest = deep if added > 0 else 0.0
    changed += strayed(rod, t)
    sort_kinds(rod, u, bent, walls, half, t, h, True)
    return worst, changed, deepest
