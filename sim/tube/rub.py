"""Coulomb friction in a tube: against the slip of the rod's points along the wall.

As in the plane (`navigate.touch`) the friction that a contact allows, mu times the
force of the round before, acts at the place where the contact was, against the way its
point has come since the last step, in the wall's tangent plane. Its potential is
grip |w|, rounded off below a slip of `ease`: it is mobilised by 1/1000 of a step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .mesh import trace, trace_at
from .rod import Rod, Turn
from .touch import Seen, Touches

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Past:
    """The rod at the step before.

    Parameters
    ----------
    rod, turn : Rod, Turn
        As it was.
    direction : ndarray, shape (3,)
        Of the guide, in which the rest of it was straight.
    shift : float
        How much further out of the guide it is now.
    ease : float
        Slip that mobilises friction.
    """

    rod: Rod
    turn: Turn
    direction: Array
    shift: float
    ease: float

    def places(self, s: Array) -> Array:
        """Return where the points were that are now at `s`, shape (k, 3)."""
        at = s - self.shift
        inside = trace(self.rod, self.turn, np.clip(at, 0.0, self.rod.s[-1]))[:, :3]
        return np.asarray(inside + np.minimum(at, 0.0)[:, None] * self.direction)


@dataclass(frozen=True, slots=True)
class Rubs:
    """Where the rod rubs in one round of contacts.

    Parameters
    ----------
    s, element, xi, grip : ndarray, shape (k,)
        Places of the rod, and the friction allowed.
    origin, normal : ndarray, shape (k, 3)
        Where its points come from, and the wall's normal.
    ease : float
        See `Past`.
    """

    s: Array
    element: Ints
    xi: Array
    grip: Array
    origin: Array
    normal: Array
    ease: float

    def slip(self, rod: Rod, turn: Turn, X: Array) -> Array:
        """Return how far the points came along the wall, shape (k, 3)."""
        out = np.empty((len(self.s), 9))
        trace_at(rod, turn, X, self.s, out)
        way = out[:, :3] - self.origin
        across = (way * self.normal).sum(axis=1)[:, None] * self.normal
        return np.asarray(way - across)

    def energy(self, slip: Array) -> float:
        """Return the friction's potential."""
        far = np.linalg.norm(slip, axis=1)
        eased = 0.5 * (far**2 / self.ease + self.ease)
        return float(self.grip @ np.where(far > self.ease, far, eased))

    def forces(self, slip: Array) -> tuple[Array, Array]:
        """Return friction on the rod, (k, 3), and how it grows with the slip."""
        far = np.maximum(np.linalg.norm(slip, axis=1), self.ease)
        growth = self.grip / far
        flat = np.eye(3) - self.normal[:, :, None] * self.normal[:, None, :]
        way = slip / far[:, None]
        straight = np.where(far > self.ease, growth, 0.0)
        turns = straight[:, None, None] * way[:, :, None] * way[:, None, :]
        return -growth[:, None] * slip, growth[:, None, None] * flat - turns

    def work(self, slip: Array) -> float:
        """Return what friction takes."""
        return float(-(self.forces(slip)[0] * slip).sum())


def no_rubs() -> Rubs:
    """Return friction nowhere."""
    none, three = np.zeros(0), np.zeros((0, 3))
    return Rubs(none, np.zeros(0, np.int64), none, none, three, three, 1.0)


def rubs_of(past: Past, friction: float, rod: Rod, t: Touches, seen: Seen) -> Rubs:
    """Return where contacts that bear a force rub, with that coefficient."""
    on = np.flatnonzero(t.force > 0.0)
    s = t.s[on].copy()
    element = np.clip(np.searchsorted(rod.s, s, side="right") - 1, 0, len(rod.m) - 1)
    steep = np.linalg.norm(seen.grad[on], axis=1)
    return Rubs(
        s=s,
        element=element,
        xi=(s - rod.s[element]) / np.diff(rod.s)[element],
        grip=friction * t.force[on] * steep,
        origin=past.places(s),
        normal=seen.grad[on] / steep[:, None],
        ease=past.ease,
    )
