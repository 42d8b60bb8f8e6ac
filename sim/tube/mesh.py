"""From a rod in space, and how much of it is inserted, to the kernels' `Rod`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..spatial.march import AXIAL, C1, C3, K1, K3, WX, WZ, H
from .rod import Rod, Turn, blend, element_at, fill_inner, own_energy, station

Array = NDArray[np.float64]


def elements_of(
    sections: Array, share: Array, length: float, elements: int
) -> tuple[Array, Array]:
    """Return the nodes of the last `length` of a rod, and the section of each element.

    Parameters
    ----------
    sections : ndarray, shape (k, m)
        Rows, root first.
    share : ndarray, shape (k,)
        Their lengths, over the rod's.
    length : float
        What is inserted, over the rod's length.
    elements : int
        How many a whole rod has, at least.
    """
    before = 1.0 - length
    s, rows = [0.0], []
    for row, own in zip(sections, share, strict=True):
        inside = min(own, own - before)
        before -= own
        if inside <= 1e-12:
            continue
        pieces = max(1, math.ceil(inside * elements - 1e-9))
        start = s[-1]
        s += [start + inside * (k + 1) / pieces for k in range(pieces)]
        rows += [row] * pieces
    return np.array(s), np.array(rows)


def mesh(table: Array, length: float, root: Array, elements: int) -> Rod:
    """Return the last `length` of a rod, in elements of about equal size.

    Parameters
    ----------
    table : ndarray, shape (k, 13)
        Its sections, tip first (`spatial.rod.rod_table`).
    length : float
        What is inserted, over the rod's length.
    root : ndarray, shape (3,)
        Where the clamp is.
    elements : int
        How many a whole rod has, at least.
    """
    nodes, made = elements_of(table[::-1], table[::-1, H], length, elements)
    m = np.ascontiguousarray(made[:, AXIAL])
    beyond = np.zeros((len(nodes), 3))
    weights = made[:, WX : WZ + 1] * np.diff(nodes)[:, None]
    beyond[:-1] = np.cumsum(weights[::-1], axis=0)[::-1]
    return Rod(
        s=nodes,
        stiff=1.0 / made[:, C1 : C3 + 1],
        rest=np.ascontiguousarray(made[:, K1 : K3 + 1]),
        m=m,
        pole=np.concatenate([[0.0], m[:-1] - m[1:], m[-1:]]),
        beyond=beyond,
        root=np.asarray(root, dtype=float),
    )


def clamp(direction: Array) -> Array:
    """Return the quaternion of a clamp: d3 along a direction, d1 and d2 turned least.

    Along x it is that of `spatial.march`: d1, d2, d3 along y, z, x.
    """
    a, b, c = direction / np.linalg.norm(direction)
    along_x = np.array([0.5, 0.5, 0.5, 0.5])
    if a < -1.0 + 1e-12:
        least = np.array([0.0, 0.0, 0.0, 1.0])
    else:
        least = np.array([1.0 + a, 0.0, -c, b]) / math.sqrt(2.0 + 2.0 * a)
    return product(least, along_x)


def product(p: Array, q: Array) -> Array:
    """Return the product of two quaternions."""
    w = p[0] * q[0] - p[1:] @ q[1:]
    return np.array([w, *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def straight(rod: Rod, start: Array) -> Turn:
    """Return a rod that goes straight on from its clamp."""
    n = len(rod.m)
    return Turn(np.tile(start, (n + 1, 1)), np.zeros((n, 2, 3)), np.zeros((n, 2, 4)))


def interpolated(old: Rod, turn: Turn, new: Rod, start: Array, ahead: float) -> Turn:
    """Return the rotation of a new mesh; at s it is the old one's at s + `ahead`.

    Inner quaternions are chosen to have nothing along the mean of the nodes.
    """
    h = np.diff(new.s)[:, None]
    s = new.s[:-1, None] + h * np.array([0.0, 1.0, 2.0, 3.0]) / 3.0
    at = np.clip(s + ahead, 0.0, old.s[-1]).ravel()
    d = np.empty((len(at), 4))
    _quaternions(old, turn, at, d)
    d = d.reshape(*s.shape, 4)
    q = np.concatenate([d[:1, 0], d[:, 3]])
    q /= np.linalg.norm(q, axis=1)[:, None]
    q[0] = start if q[0] @ start > 0.0 else -start
    for k in range(1, len(q)):  # one sign all along
        q[k] *= math.copysign(1.0, float(q[k] @ q[k - 1]))
    mean = q[:-1] + q[1:]
    off = []
    for share, part in ((1.0 / 3.0, d[:, 1]), (2.0 / 3.0, d[:, 2])):
        line = (1.0 - share) * q[:-1] + share * q[1:]
        scale = (line * mean).sum(axis=1) / (part * mean).sum(axis=1)
        off.append(scale[:, None] * part - line)
    # At a third xi^2 - xi is -2/9 and the cubic 2/27; at two thirds -2/9 and -2/27.
    even, odd = 0.5 * (off[0] + off[1]), 0.5 * (off[0] - off[1])
    inner = np.stack([-4.5 * even, 13.5 * odd], axis=1)
    # As c = mean / 2 (0, v / 2), v is the vector of 4 conj(mean) c / mean.mean.
    w, u = mean[:, None, :1], mean[:, None, 1:]
    v = w * inner[..., 1:] - inner[..., :1] * u - np.cross(u, inner[..., 1:])
    v *= 4.0 / (mean**2).sum(axis=1)[:, None, None]
    turn = Turn(q, v, np.empty((len(v), 2, 4)))
    fill_inner(turn)
    return turn


@njit(cache=True, nogil=True, error_model="numpy")
def _quaternions(rod, turn, s, out):  # type: ignore[no-untyped-def]
    """Fill quaternions of a rod at arc lengths, shape (m, 4), of any length."""
    v = np.empty(4)
    for k in range(s.shape[0]):
        e, xi = element_at(rod, s[k])
        blend(turn, e, xi, out[k], v)


@njit(cache=True, nogil=True, error_model="numpy")
def trace_at(rod, turn, X, s, out):  # type: ignore[no-untyped-def]
    """Fill places, tangents and their derivatives, shape (m, 9)."""
    d, v = np.empty(4), np.empty(4)
    for k in range(s.shape[0]):
        station(rod, turn, X, s[k], out[k, :3], out[k, 3:6], out[k, 6:], d, v)


def trace(rod: Rod, turn: Turn, s: Array) -> Array:
    """Return place, tangent and its derivative at arc lengths, shape (m, 9)."""
    X, out = np.empty((len(rod.s), 3)), np.empty((len(s), 9))
    own_energy(rod, np.zeros(4), turn, X)
    trace_at(rod, turn, X, s, out)
    return out


def root_strain(rod: Rod, turn: Turn) -> Array:
    """Return turn and twist at the clamp, shape (3,), about the rod's own axes."""
    q, c = turn.q[0], turn.c[0]
    v = (turn.q[1] - q - c[0] + c[1]) / rod.s[1]
    return np.asarray(2.0 * (q[0] * v[1:] - v[0] * q[1:] - np.cross(q[1:], v[1:])))
