"""The rod comes to rest in its lumen: Newton on an augmented Lagrangian.

Newton's matrix is exact, so that its Cholesky factor exists if and only if the state is
a minimum (walls stiff enough given): stability comes free. Where it does not exist the
stiffness of bending is added until it does, which makes every step a descent, and at a
saddle the way down is found by inverse iteration.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import PART, blocked, is_uniform
from ..tube.linear import factored, substitute
from .exchange import look, prune, sort_kinds, strayed
from .rod import Bent, bend, own_energy, own_gradient, own_stiffness
from .touch import MOST, anchor, locate, touch_energy, touch_gradient

SETTLED, RESTLESS, JAMMED, PULLED = range(4)
"""Outcomes: at rest; no convergence; no room left; pulled onto a magnet."""
SOFT, HARD = 1e6, 1e8
"""Stiffness of the walls at first and at last: it decides how fast the gaps close, not
how far."""
GAP = 3e-10
"""Gaps closed to this count as closed, in lengths of the rod."""
TOO_DEEP = 3e-4
"""A state with a point deeper than this behind a wall is none."""
LOOSE = 1e-8
"""Gaps that are good enough if their contacts are so close that they share their force
only slowly."""
STEPS = 60
"""Newton's steps for one set of contacts."""
ROUNDS = 40
"""Changes of the set of contacts."""
PATIENCE, FROZEN = 6, 20
"""Rounds after which contacts stay where they are and none is dropped; and after which
none is added. So the set cannot cycle."""
FREE = 12
"""Rounds that do not come to rest after which a rod that touches nothing is lost: just
behind a fold the way down begins slowly."""
LONGEST = 0.4
"""Most that an angle may change in one step, in rad."""
PIVOT = 1e-14
"""Share of a diagonal that must be left of it, for a matrix to be positive."""
SMALL = 1e-11
"""Newton's step after which it is at rest."""


@njit(**PART)
def energy(rod, field, walls, half, u, bent, t, stiff, held, before):  # type: ignore[no-untyped-def]
    """Bend the rod, bring the contacts up to date, return the augmented energy."""
    bend(rod, u, bent)
    locate(rod, u, bent, walls, half, t)
    total = own_energy(rod, field, u, bent) + touch_energy(t, stiff, before)
    if rod.grip[0] != 0.0:
        fx = held[0] - stiff * (bent.x[-1] - rod.grip[1])
        fy = held[1] - stiff * (bent.y[-1] - rod.grip[2])
        total += 0.5 * (fx * fx + fy * fy) / stiff
    return total


@njit(**PART)
def add_grip(rod, bent, held, stiff, px, py, ax, ay, g, H):  # type: ignore[no-untyped-def]
    """Add what holds the tip to gradient, Hessian and loads."""
    fx = held[0] - stiff * (bent.x[-1] - rod.grip[1])
    fy = held[1] - stiff * (bent.y[-1] - rod.grip[2])
    ax[:] = 0.0
    ay[:] = 0.0
    for e in range(rod.stiff.shape[0]):
        px[e] += fx
        py[e] += fy
        for a in range(4):
            ax[3 * e + a] += bent.dx[e, a]
            ay[3 * e + a] += bent.dy[e, a]
    n = ax.shape[0]
    for a in range(n):
        g[a] -= fx * ax[a] + fy * ay[a]
        for c in range(a + 1):
            H[a, c] += stiff * (ax[a] * ax[c] + ay[a] * ay[c])


@njit(**PART)
def way_down(H, K, L, last):  # type: ignore[no-untyped-def]
    """Factor H into L; return 0 if H is positive, else how much bending was added."""
    shift = 0.0
    for _ in range(60):
        if shift > 0.0:
            for i in range(1, last):
                H[i, i] += 0.75 * shift * K[i]
        if factored(H, 1, last, PIVOT, L):
            break
        shift = 0.01 if shift == 0.0 else 4.0 * shift
    return shift


@njit(**PART)
def softest(L, K, last, d):  # type: ignore[no-untyped-def]
    """Set d to the softest way out of a saddle, of size 1e-3 rad."""
    for i in range(1, last):
        d[i] = 1.0 + 0.3 * math.sin(1.7 * i) if i % 3 == 0 else 0.0
    for _ in range(8):
        substitute(L, 1, last, d)
        most = 0.0
        for i in range(1, last):
            most = max(most, abs(d[i]))
        for i in range(1, last):
            d[i] *= 1e-3 / most


@njit(**PART, inline="always")
def newton(rod, field, walls, half, u, bent, t, stiff, held, before, work):  # type: ignore[no-untyped-def]
    """Minimise the augmented energy; return steps taken, stability and largest turn.

    Steps are negative if it did not come to rest. Stability: 1 if the last matrix was
    positive, 0 if not.
    """
    g, H, L, K, px, py, ax, ay, row, d, trial, keep = work
    last = u.shape[0] - (1 if rod.grip[0] != 0.0 else 0)
    value = 0.0
    fresh = True
    kicked = False
    unstable = 0
    for step in range(STEPS):
        if fresh:
            value = energy(rod, field, walls, half, u, bent, t, stiff, held, before)
            fresh = False
        own_gradient(rod, field, u, bent, px, py, ax, ay, g, H)
        touch_gradient(rod, u, bent, t, stiff, before, px, py, ax, ay, row, g, H)
        if rod.grip[0] != 0.0:
            add_grip(rod, bent, held, stiff, px, py, ax, ay, g, H)
        own_stiffness(rod, bent, px, py, H, K)
        shift = way_down(H, K, L, last)
        if shift > 0.0:
            unstable += 1
        for i in range(1, last):
            d[i] = -g[i]
        substitute(L, 1, last, d)
        size = 0.0
        fall = 0.0
        for i in range(1, last):
            size = max(size, abs(d[i]))
            fall -= g[i] * d[i]
        if not size < 1e9:
            return -step - 1, 0, unstable
        if size < SMALL:
            if shift == 0.0:
                return step + 1, 1, unstable
            if kicked and step > 40:
                return step + 1, 0, unstable
            softest(L, K, last, d)
            kicked = True
            for i in range(1, last):
                u[i] += d[i]
            fresh = True
            continue
        share = min(1.0, LONGEST / size)
        keep[: t.used[0]] = t.s[: t.used[0]]
        done = False
        for _ in range(40):
            for i in range(u.shape[0]):
                trial[i] = u[i]
            for i in range(1, last):
                trial[i] += share * d[i]
            new = energy(rod, field, walls, half, trial, bent, t, stiff, held, before)
            noise = 1e-13 * (1.0 + abs(value))
            if share > 0.0 and new <= value - 1e-4 * share * fall + noise:
                done = True
                break
            t.s[: t.used[0]] = keep[: t.used[0]]
            if share == 0.0:
                break
            share = 0.5 * share if share > 1e-9 else 0.0
        if not done:
            return (step + 1 if size < 1e-7 else -step - 1), int(shift == 0.0), unstable
        for i in range(1, last):
            u[i] = trial[i]
        value = new
        if share == 1.0 and shift == 0.0 and size < 1e-7:
            return step + 1, 1, unstable
    return -STEPS, 0, unstable


@njit(**PART)
def update_forces(rod, bent, t, stiff, held):  # type: ignore[no-untyped-def]
    """Take the walls' forces over; return the largest gap or overlap left in use."""
    worst = 0.0
    for k in range(t.used[0]):
        force = max(0.0, t.force[k] - stiff * t.gap[k])
        worst = max(worst, abs(force - t.force[k]) / stiff)
        t.force[k] = force
    if rod.grip[0] != 0.0:
        dx = bent.x[-1] - rod.grip[1]
        dy = bent.y[-1] - rod.grip[2]
        worst = max(worst, abs(dx), abs(dy))
        held[0] -= stiff * dx
        held[1] -= stiff * dy
    return worst


@njit(cache=True, nogil=True, error_model="numpy")
def settle(rod, field, walls, half, mu, u, t, held, before, soft):  # type: ignore[no-untyped-def]
    """Bring the rod to rest from the state `u` and the contacts `t`, both updated.

    Parameters
    ----------
    rod, field, walls : Rod, ndarray, Walls
        What rests, in what field (see `planar.march`), in what lumen.
    half : float
        Half the rod's side.
    mu : float
        Coefficient of friction.
    u : ndarray, shape (3 n + 1,)
        Unknowns of the angle (see `rod`).
    t : Touches
        Contacts with their forces.
    held : ndarray, shape (2,)
        Force that holds a held tip.
    before : Before
        The step before, for friction.
    soft : float
        Stiffness of the walls to begin with.

    Returns
    -------
    tuple
        Outcome, stability, Newton steps, steps in which the state was no minimum,
        deepest overlap left, energy without walls.
    """
    n = rod.stiff.shape[0]
    size = 3 * n + 1
    bent = Bent(
        np.empty((n, 5)), np.empty((n, 5)), np.empty(n + 1), np.empty(n + 1),
        np.empty((n, 4)), np.empty((n, 4)),
    )  # fmt: skip
    work = (
        np.empty(size), np.empty((size, size)), np.empty((size, size)), np.empty(size),
        np.empty(n), np.empty(n), np.empty(size), np.empty(size), np.empty(size),
        np.empty(size), np.empty(size), np.empty(MOST),
    )  # fmt: skip
    h = (rod.s[-1] - rod.s[0]) / n
    stiff = soft
    total = 0
    unstable = 0
    stable = 0
    deepest = 0.0
    before_this = 1e9
    failed = 0
    bend(rod, u, bent)
    look(rod, u, bent, walls, half, h, t, True)
    outcome = RESTLESS
    for k in range(ROUNDS):
        sort_kinds(rod, u, bent, walls, half, t, h, k < PATIENCE)
        anchor(t, before)
        steps, stable, off = newton(
            rod, field, walls, half, u, bent, t, stiff, held, before, work
        )
        total += abs(steps)
        unstable += off
        if not is_uniform(field) and within_magnet(rod, field, bent):
            outcome = PULLED
            break
        rubbed = rub(t, mu, stiff)
        worst = max(update_forces(rod, bent, t, stiff, held), rubbed)
        changed = 0
        if worst < 1e-3:
            changed, deepest = look(rod, u, bent, walls, half, h, t, k < PATIENCE)
            if k < PATIENCE:
                changed += strayed(rod, t)
                prune(t, GAP)
            elif k >= FROZEN:
                changed = 0
        if steps > 0 and changed == 0 and worst < (GAP if k < FROZEN else LOOSE):
            outcome = SETTLED if deepest < TOO_DEEP else JAMMED
            break
        failed += 1 if steps < 0 else 0
        if failed > FREE and t.used[0] == 0:
            break
        if k > 8 and worst > 1e-4:
            outcome = JAMMED
        if soft >= SOFT and (failed > 6 or (outcome == JAMMED and k > 14)):
            break
        if worst > 0.1 * before_this:
            stiff = min(HARD, 10.0 * stiff)
        before_this = worst
    return outcome, stable, total, unstable, deepest, own_energy(rod, field, u, bent)


@njit(**PART)
def within_magnet(rod, field, bent):  # type: ignore[no-untyped-def]
    """Tell whether a node of the rod is inside a source of the field."""
    for i in range(1, rod.s.shape[0]):
        if blocked(field, bent.x[i], bent.y[i], 0.0, 0.0):
            return True
    return False


@njit(**PART)
def rub(t, mu, stiff):  # type: ignore[no-untyped-def]
    """Take over the friction that the forces allow; return its change, as a gap."""
    worst = 0.0
    if mu == 0.0:
        return worst
    for k in range(t.used[0]):
        grip = mu * max(0.0, t.force[k] - stiff * t.gap[k])
        worst = max(worst, abs(grip - t.grip[k]) * 1e-3 / (1.0 + grip) * 1e-3)
        t.grip[k] = grip
    return worst
