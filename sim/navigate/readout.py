"""From the kernels' state to a `Step` in mm and N."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ...core.units import deg_from_rad
from ..magnet.flux import field_at
from .mesh import thirds, trace
from .passage import Contact, Step
from .rod import Rod
from .touch import Touches

Array = NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def poles(rod, field, x, y):  # type: ignore[no-untyped-def]
    """Return the sum of the loads on the rod's poles, without the one at the root.

    Parameters
    ----------
    rod, field : Rod, ndarray
        See `rod`.
    x, y : ndarray, shape (n + 1,)
        The nodes.
    """
    fx = fy = 0.0
    for i in range(1, rod.pole.shape[0]):
        if rod.pole[i] != 0.0:
            b = field_at(field, x[i], y[i])
            fx += rod.pole[i] * b[0]
            fy += rod.pole[i] * b[1]
    return fx, fy


@njit(cache=True, error_model="numpy")
def flux_at(field, x, y):  # type: ignore[no-untyped-def]
    """Return the flux density in T at a point."""
    b = field_at(field, x, y)
    return b[0], b[1]


def push_force(rod: Rod, field: Array, u: Array, load: Array, *, slides: bool) -> float:
    """Return the force that holds the rod at its root, along it.

    A rod that slides out of a guide is driven out by EI kappa^2 / 2, the force of a
    sliding sleeve (Bigoni, Dal Corso, Bosi and Misseroni 2015): what it must be pushed
    with is less by that. A clamp also bears the pole of the root.

    Parameters
    ----------
    rod, field, u : Rod, ndarray, ndarray
        See `rod`.
    load : ndarray, shape (2,)
        All loads beyond the clamp but the root's pole.
    slides : bool
        Whether the rod slides out of a guide.
    """
    x, y, angle = rod.root
    c, s = math.cos(angle), math.sin(angle)
    if slides:
        h = rod.s[1]
        kappa = (u[3] - u[0] - u[1] + u[2]) / h
        return float(-load[0] * c - load[1] * s - 0.5 * rod.stiff[0] * kappa**2)
    bx, by = flux_at(field, x, y)
    fx, fy = load[0] - rod.m[0] * bx, load[1] - rod.m[0] * by
    return float(-fx * c - fy * s)


def contacts_of(
    touches: Touches, names: tuple[str, ...], friction: float, unit_N: float, mm: float
) -> tuple[Contact, ...]:
    """Return the contacts that carry a force, root first."""
    found = [
        Contact(
            wall=names[touches.piece[k]],
            s_mm=float(touches.s[k] * mm),
            x_mm=float(touches.x[k] * mm),
            y_mm=float(touches.y[k] * mm),
            force_N=float(touches.force[k] * unit_N),
            friction_N=float(friction * touches.force[k] * unit_N),
        )
        for k in range(touches.used[0])
        if touches.force[k] > 0.0
    ]
    return tuple(sorted(found, key=lambda contact: contact.s_mm))


def loads(
    rod: Rod, field: Array, u: Array, touches: Touches, rubbing: Array, held: Array
) -> Array:
    """Return all loads beyond the clamp but the root's pole, shape (2,)."""
    nodes = trace(rod, u, rod.s)
    total = np.array(poles(rod, field, nodes[0], nodes[1])) + rod.beyond[0] + held
    n = touches.used[0]
    force = touches.force[:n]
    normal = np.array([touches.nx[:n], touches.ny[:n]])
    tangent = np.array([touches.tx[:n], touches.ty[:n]])
    return np.asarray(total + normal @ force - tangent @ rubbing[:n])


def meets_itself(step: Step, side_mm: float) -> bool:
    """Return whether parts of the rod are nearer to each other than its side.

    Parts further along it than half the turn of a circle that wide, which are near by
    being neighbours. A plane curve must turn by more than a right angle and a half
    before it can come back to itself.
    """
    x, y, theta, _ = step.shape
    if np.ptp(theta) < 0.75 * math.pi:
        return False
    apart = np.hypot(x[:, None] - x, y[:, None] - y)
    far = np.abs(step.s_mm[:, None] - step.s_mm) > math.pi * side_mm
    return bool((far & (apart < side_mm)).any())


def read_step(
    insertion_mm: float,
    rod: Rod,
    u: Array,
    touches: Touches,
    names: tuple[str, ...],
    *,
    push: float,
    energy: float,
    rubbed: float,
    overlap: float,
    friction: float,
    length_mm: float,
    unit_N: float,
) -> Step:
    """Return what a user sees of a state.

    Parameters
    ----------
    length_mm, unit_N : float
        Units of the kernels' lengths and forces.
    """
    # Three points an element, and the joints from the side of the root.
    s = np.append(0.0, thirds(rod)[:, 1:])
    shape = trace(rod, u, s)
    shape[:2] *= length_mm
    shape[3] /= length_mm
    contacts = contacts_of(touches, names, friction, unit_N, length_mm)
    forces = [contact.force_N for contact in contacts]
    return Step(
        insertion_mm=insertion_mm,
        push_N=push * unit_N,
        root_curvature_per_mm=float(shape[3, 0]),
        root_moment_Nm=float(shape[3, 0] * length_mm * rod.stiff[0])
        * unit_N
        * length_mm
        * 1e-3,
        most_curvature_per_mm=float(np.abs(shape[3]).max()),
        wall_N=sum(forces),
        most_wall_N=max(forces, default=0.0),
        energy_Nmm=energy * unit_N * length_mm,
        rubbed_Nmm=rubbed * unit_N * length_mm,
        tip_mm=(float(shape[0, -1]), float(shape[1, -1])),
        tip_angle_deg=deg_from_rad(float(shape[2, -1])),
        contacts=contacts,
        overlap_mm=overlap * length_mm,
        s_mm=s * length_mm,
        shape=shape,
    )
