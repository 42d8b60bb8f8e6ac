"""Where the rod touches the tube: points on it, with the force in each.

As in the plane (`navigate.touch`): an isolated contact *floats* to where the rod is
nearest, so that the gap's Hessian gains -g_us g_us / g_ss (Hettich and Kortanek 1993);
contacts that follow each other stay, and sample a line; the tip is a contact of its
own. The gap enters the energy as an augmented Lagrangian, (pi^2 - lambda^2) / 2k with
pi = max(0, lambda - k g) (Rockafellar 1973).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..magnet.flux import PART
from .rod import Rod, Turn, station
from .wall import Bore, gap_at, wall_at

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

FIXED, FLOATS, TIP = 0, 1, 2
"""Kinds of contact."""
OVERLAP = 1e-6
"""A place deeper than this behind the wall becomes a contact, in lengths of the rod."""
APART = 0.25
"""Least distance of contacts, in elements."""
LOOKS = 4
"""Places an element at which the gap is looked at."""
FLAT = 1e-2
"""Curvature of the gap, in 1/L, below which the rod is about to lie on the wall."""
LEAST_S = 1e-9


class Seen(NamedTuple):
    """Contacts as they are on a bent rod.

    Parameters
    ----------
    gap, first, second : ndarray, shape (k,)
        The gap, and its derivatives along the rod.
    element, xi : ndarray, shape (k,)
        Where they are on the mesh.
    r, t, grad : ndarray, shape (k, 3)
        Place and tangent of the rod, gradient of the gap.
    hess : ndarray, shape (k, 3, 3)
        Of the gap.
    """

    gap: Array
    first: Array
    second: Array
    element: Ints
    xi: Array
    r: Array
    t: Array
    grad: Array
    hess: Array


def _nothing() -> Array:
    return np.zeros(0)


@dataclass(slots=True)
class Touches:
    """Contacts: arc length, force, kind, place in the tube, where each may float."""

    s: Array = field(default_factory=_nothing)
    force: Array = field(default_factory=_nothing)
    kind: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    p: Array = field(default_factory=_nothing)
    home: Array = field(default_factory=_nothing)
    room: Array = field(default_factory=_nothing)

    def kept(self, which: NDArray[np.bool_] | Ints) -> Touches:
        """Return some of them."""
        return Touches(*(getattr(self, name)[which] for name in self.__slots__))

    def moved(self, s: Array) -> Touches:
        """Return them at other places of the rod."""
        return Touches(
            s, self.force.copy(), self.kind.copy(), self.p.copy(), s.copy(),
            self.room.copy(),
        )  # fmt: skip

    def paired(self, apart: float) -> Touches:
        """Return them with two that stay, so far from it, for each that floats."""
        floats = self.kind == FLOATS
        new = self.kept(np.repeat(np.arange(len(self.s)), np.where(floats, 2, 1)))
        pairs = new.kind == FLOATS
        new.s[pairs] += np.tile([-apart, apart], int(floats.sum()))
        new.force[pairs] *= 0.5
        new.kind[pairs] = FIXED
        return new

    def add(self, s: float, kind: int, p: float) -> None:
        """Add one without force."""
        new = {"s": s, "force": 0.0, "kind": kind, "p": p, "home": s, "room": 0.0}
        for name, value in new.items():
            setattr(self, name, np.append(getattr(self, name), value))
        self.kind = self.kind.astype(np.int64)


@njit(**PART)
def _look(rod, turn, X, tube, half, s, p, r, t, k, d, v, C, grad, hess):  # type: ignore[no-untyped-def]
    """Fill all at s; return gap, two derivatives along the rod, foot, element, xi."""
    e, xi = station(rod, turn, X, s, r, t, k, d, v)
    gap, p = wall_at(tube, r, half, p, C, grad, hess)
    first = second = 0.0
    for i in range(3):
        first += grad[i] * t[i]
        second += grad[i] * k[i]
        for j in range(3):
            second += t[i] * hess[i, j] * t[j]
    return gap, first, second, p, e, xi


@njit(cache=True, nogil=True, error_model="numpy")
def locate(rod, turn, X, tube, half, s, kind, p, home, room, seen):  # type: ignore[no-untyped-def]
    """Bring contacts up to date: floating ones move to where the rod is nearest.

    `s` and `p` change; `seen` (`Seen`) is filled.
    """
    d, v, k, C = np.empty(4), np.empty(4), np.empty(3), np.empty((4, 4))
    length = rod.s[-1]
    for i in range(s.shape[0]):
        r, t, grad, hess = seen.r[i], seen.t[i], seen.grad[i], seen.hess[i]
        if kind[i] == TIP:
            s[i] = length
        low = max(0.0, home[i] - room[i])
        high = min(length, home[i] + room[i])
        for _ in range(20):
            gap, first, second, p[i], e, xi = _look(
                rod, turn, X, tube, half, s[i], p[i], r, t, k, d, v, C, grad, hess
            )
            seen.gap[i] = gap
            seen.first[i] = first
            seen.second[i] = second
            seen.element[i] = e
            seen.xi[i] = xi
            if kind[i] != FLOATS or high - low < 1e-13:
                break
            if first > 0.0:
                high = s[i]
            else:
                low = s[i]
            new = s[i] - first / second if second > 0.0 else low - 1.0
            if not low <= new <= high:
                new = 0.5 * (low + high)
            if abs(new - s[i]) < 1e-13:
                break
            s[i] = new


def seen_of(
    rod: Rod, turn: Turn, X: Array, tube: Bore, half: float, touches: Touches
) -> Seen:
    """Return the contacts on a bent rod; floating ones move."""
    k = len(touches.s)
    seen = Seen(
        np.empty(k), np.empty(k), np.empty(k), np.empty(k, np.int64), np.empty(k),
        np.empty((k, 3)), np.empty((k, 3)), np.empty((k, 3)), np.empty((k, 3, 3)),
    )  # fmt: skip
    locate(
        rod, turn, X, tube, half,
        touches.s, touches.kind, touches.p, touches.home, touches.room, seen,
    )  # fmt: skip
    return seen


@njit(cache=True, nogil=True, error_model="numpy")
def survey(rod, turn, X, tube, half, p):  # type: ignore[no-untyped-def]
    """Return arc lengths, gaps and feet all along the rod, shape (3, LOOKS n + 1)."""
    n = rod.m.shape[0]
    out = np.empty((3, LOOKS * n + 1))
    d, v, C = np.empty(4), np.empty(4), np.empty((4, 4))
    r, t, k = np.empty(3), np.empty(3), np.empty(3)
    for i in range(LOOKS * n + 1):
        e = min(i // LOOKS, n - 1)
        s = rod.s[e] + (rod.s[e + 1] - rod.s[e]) * (i - LOOKS * e) / LOOKS
        station(rod, turn, X, s, r, t, k, d, v)
        gap, p = gap_at(tube, r, half, p, C)
        out[0, i] = s
        out[1, i] = gap
        out[2, i] = p
    return out


def exchange(
    rod: Rod, turn: Turn, X: Array, tube: Bore, half: float, touches: Touches,
    start: float,
) -> tuple[int, float]:  # fmt: skip
    """Add contacts where the rod is behind the wall.

    Returns
    -------
    tuple of int and float
        Contacts added, and the deepest overlap seen.
    """
    h = rod.s[-1] / len(rod.m)
    s, gap, p = survey(rod, turn, X, tube, half, start)
    near = gap < h
    near[1:] &= gap[1:] <= gap[:-1]
    near[:-1] &= gap[:-1] < gap[1:]
    near[0] = False
    places = np.flatnonzero(near)
    found = Touches()
    last = len(s) - 1
    for i in places:
        found.add(s[i], TIP if i == last else FLOATS, p[i])
    found.room[:] = 0.3 * h
    found.home = found.s.copy()
    seen = seen_of(rod, turn, X, tube, half, found)
    added = 0
    for i in np.flatnonzero(seen.gap < -OVERLAP):
        alike = (touches.kind == TIP) == (found.kind[i] == TIP)
        apart = abs(touches.s[alike] - found.s[i])
        if found.s[i] > LEAST_S and not np.any(apart < APART * h):
            touches.add(found.s[i], found.kind[i], found.p[i])
            added += 1
    return added, max(0.0, -float(np.min(seen.gap, initial=0.0)))


def sort_kinds(
    rod: Rod, seen: Seen, touches: Touches, *, free: bool, float_too: bool
) -> None:
    """Let isolated contacts float, the others stay; give each its home and room.

    Parameters
    ----------
    free : bool
        Whether one that stays may float again.
    float_too : bool
        Whether any may float.
    """
    h = rod.s[-1] / len(rod.m)
    apart = abs(touches.s[:, None] - touches.s)
    np.fill_diagonal(apart, np.inf)
    # The tip lies apart from what is near to it along the rod.
    alone = np.min(apart, axis=1, initial=np.inf) > APART * h
    floats = alone & (seen.second > 4.0 * OVERLAP / (APART * h) ** 2)
    if not float_too:
        floats[:] = False
    elif not free:
        floats &= touches.kind == FLOATS
    touches.kind[touches.kind != TIP] = FIXED
    touches.kind[floats & (touches.kind != TIP)] = FLOATS
    touches.home = touches.s.copy()
    touches.room = np.where(seen.second > 1.0, 0.5, 0.5 * APART) * h
