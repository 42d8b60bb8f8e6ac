"""The rod at one rotation: its energy with walls and friction, and its derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..magnet.flux import UNIFORM, flux_at
from .linear import add_dyads, add_points
from .rod import STEP, Rod, Turn, own_energy
from .rub import Past, Rubs
from .slopes import assemble, places, press
from .touch import FLAT, FLOATS, Touches, seen_of
from .wall import Bore

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A rod in a tube and a field.

    Parameters
    ----------
    rod, field, tube : Rod, ndarray, Bore
        See there.
    half : float
        Radius of the rod with its edges.
    start : float
        Where the feet on the centre curve begin.
    friction : float
        Coefficient.
    past : Past, optional
        The step before, for friction.
    """

    rod: Rod
    field: Array
    tube: Bore
    half: float
    start: float
    friction: float = 0.0
    past: Past | None = None

    @property
    def narrow(self) -> float:
        """Radius where the tube is narrowest.

        Behind the wall by less, a point of the rod has its foot where it belongs.
        """
        return float(np.min(self.tube.spans[:, 3, 0]))

    @property
    def is_uniform(self) -> bool:
        """Whether the field is the same everywhere."""
        return bool(self.field[0] == UNIFORM)


@dataclass(frozen=True, slots=True)
class Round:
    """What stays over Newton's steps: contacts, the walls' stiffness, friction.

    Floating contacts move along the rod meanwhile.
    """

    touches: Touches
    stiff: float
    rubs: Rubs


class Look:
    """The rod at one rotation: places, contacts, augmented energy."""

    def __init__(self, scene: Scene, turn: Turn, round_: Round) -> None:
        rod, touches, rubs = scene.rod, round_.touches, round_.rubs
        self.X = np.empty((len(rod.s), 3))
        self.turn = turn
        self.energy = own_energy(rod, scene.field, turn, self.X)
        self.seen = seen_of(rod, turn, self.X, scene.tube, scene.half, touches)
        self.force = np.maximum(0.0, touches.force - round_.stiff * self.seen.gap)
        walls = self.force @ self.force - touches.force @ touches.force
        self.total = self.energy + 0.5 * walls / round_.stiff
        self.slip = rubs.slip(rod, turn, self.X) if len(rubs.s) else rubs.origin
        if len(rubs.s):
            self.total += rubs.energy(self.slip)


@dataclass(frozen=True, slots=True)
class Slopes:
    """Derivatives of the augmented energy.

    Parameters
    ----------
    g, H, K : ndarray, shapes (n,), (n, n), (n,)
        Gradient, lower triangle of the Hessian, diagonal of bending's part of it.
    load : ndarray, shape (3,)
        All loads beyond the clamp, but the root's pole.
    """

    g: Array
    H: Array
    K: Array
    load: Array


def slopes_of(scene: Scene, look: Look, round_: Round) -> Slopes:
    """Return the derivatives at a rotation."""
    rod = scene.rod
    n = len(rod.m)
    size = STEP * n + 3
    bears = np.flatnonzero(look.force > 0.0)
    element, xi, force, weight = _points(scene, look, round_, bears)
    beyond = np.zeros((n + 1, 3))
    np.add.at(beyond, element, force)
    beyond = np.cumsum(beyond[::-1], axis=0)[::-1]
    g, H, K = np.empty(size), np.empty((size, size)), np.empty(size)
    assemble(rod, look.turn, beyond[1:], g, H, K)
    press(rod, look.turn, element, xi, force, g, H)
    if weight.any():
        A, T = np.empty((2, len(element), 3, size))
        places(rod, look.turn, element, xi, A, T)
        add_points(H, A, weight, STEP * (element + 1) + 3)
        _add_slides(H, look, round_.touches, bears, A, T)
    return Slopes(g, H, K, beyond[0] + rod.beyond[0])


def _points(
    scene: Scene, look: Look, round_: Round, bears: Ints
) -> tuple[Ints, Array, Array, Array]:
    """Return element, xi, force and its fall with the place, of all that is loaded.

    First the contacts that bear a force, then what rubs, then the poles.
    """
    rod, seen, rubs = scene.rod, look.seen, round_.rubs
    grad, force = seen.grad[bears], look.force[bears]
    steep = round_.stiff * grad[:, :, None] * grad[:, None, :]
    rubbing, growth = rubs.forces(look.slip)
    at = np.flatnonzero(rod.pole)
    flux = np.zeros((len(at), 12))
    for b, x in zip(flux, look.X[at], strict=True):
        flux_at(scene.field, *x, b)
    flux *= rod.pole[at, None]
    return (
        np.concatenate([seen.element[bears], rubs.element, at - 1]),
        np.concatenate([seen.xi[bears], rubs.xi, np.ones(len(at))]),
        np.concatenate([force[:, None] * grad, rubbing, flux[:, :3]]),
        np.concatenate(
            [
                steep - force[:, None, None] * seen.hess[bears],
                growth,
                -flux[:, 3:].reshape(-1, 3, 3),
            ]
        ),
    )


def _add_slides(
    H: Array, look: Look, touches: Touches, bears: Ints, A: Array, T: Array
) -> None:
    """Add to H what floating contacts gain by moving along the rod."""
    seen = look.seen
    floats = (touches.kind == FLOATS) & ~held(touches)
    rows = np.flatnonzero(floats[bears])
    if not len(rows):
        return
    k = bears[rows]
    turns = np.einsum("ki,kij->kj", seen.t[k], seen.hess[k])
    v = (turns[:, :, None] * A[rows]).sum(axis=1)
    v += (seen.grad[k, :, None] * T[rows]).sum(axis=1)
    second = np.maximum(seen.second[k], FLAT)
    add_dyads(H, v, look.force[k] / second, STEP * (seen.element[k] + 1) + 3)


def held(touches: Touches) -> NDArray[np.bool_]:
    """Tell which contacts are as far from home as they may be."""
    return np.asarray(abs(touches.s - touches.home) > 0.999 * touches.room)
