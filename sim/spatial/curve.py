"""The curve of a march: kept at the ends of its steps, known everywhere between.

Of each pair of steps three states and slopes are kept, shape (3, 36); the polynomial of
degree 5 through them is as exact as the steps. The field along such a curve is treated
alike: jets at the ends of steps give, by their own slopes, the jets that the stages of
the next march ask for. Where that march leaves the curve, they are developed to second
order (`spatial.across`): exact in the end, as Newton's marches close in on the curve.
"""

from __future__ import annotations

import numpy as np

from ...core.jit import njit
from ..magnet.flux import is_uniform
from ..magnet.jet import JET, bend, jet_at
from .across import NEAR, PLACE, PLACES
from .march import (
    C1,
    FAST,
    K1,
    MARCH,
    MU1,
    MU2,
    SLOPE,
    STATE,
    WIDTH,
    H,
    Y,
    begin,
    cross,
    loaded,
    pairs_of,
    slope,
    step,
)
from .sure import is_sure

KEPT = 2 * STATE
"""Numbers kept at the end of a step: state and slope."""


def _basis(t: float) -> list[float]:
    """Return what values and slopes at 0, 1, 2 weigh at `t` (Hermite), in steps."""
    a, b, c = 0.5 * (t - 1.0) * (t - 2.0), t * (2.0 - t), 0.5 * t * (t - 1.0)
    return [
        (1.0 + 3.0 * t) * a * a, b * b, (7.0 - 3.0 * t) * c * c,
        t * a * a, (t - 1.0) * b * b, (t - 2.0) * c * c,
    ]  # fmt: skip


_PLACES = np.array([0, 1, 2, 4, 5, 6, 7, 8, 10, 11, 12]) / 6.0
_WEIGHTS = np.array([_basis(float(t)) for t in _PLACES])
_PARABOLA = np.array(
    [[(t - 1) * (t - 2) / 2, t * (2 - t), t * (t - 1) / 2] for t in _PLACES]
)


@njit(**FAST)
def runs_along(rod, field):  # type: ignore[no-untyped-def]
    """Tell whether the field acts all along the rod, and not everywhere alike."""
    if is_uniform(field):
        return False
    return bool(np.any(rod[:, MU1 : MU2 + 1]))


@njit(**MARCH)
def march(rod, field, load, n, R, r, blocks, table, curve, w, jet, b, c):  # type: ignore[no-untyped-def]
    """March from the tip (R, r) to the root; state and columns end in `w`.

    Keeps its curve unless that has the shape (0, 3, 36); returns whether the columns
    say for sure that no direction is unstable (`spatial.sure`).
    """
    solid = rod.shape[1] > WIDTH
    sure = blocks > 0
    pair = 0
    begin(rod, field, load, R, r, blocks, w, b)
    for i in range(rod.shape[0]):
        loaded(rod, i, load, w)
        count = pairs_of(rod, i, n)
        h = rod[i, H] / (2 * count)
        for _ in range(count):
            for half in range(2):
                if curve.shape[0] > 0:
                    for k in range(STATE):
                        curve[pair, half, k] = w[Y + k]
                step(h, field, solid, table, pair, half, blocks, w, jet, b, c)
                if curve.shape[0] > 0:
                    for k in range(STATE):
                        curve[pair, half, STATE + k] = w[SLOPE + k]
            if curve.shape[0] > 0:
                slope(field, solid, table, pair, w, jet, b, c)
                for k in range(STATE):
                    curve[pair, 2, k] = w[Y + k]
                    curve[pair, 2, STATE + k] = w[SLOPE + k]
            sure = sure and is_sure(is_uniform(field), R, r, w)
            pair += 1
        if i + 1 < rod.shape[0]:
            cross(rod, field, load, i, blocks, w, b)
    return sure


@njit(**FAST)
def _weights(t, w):  # type: ignore[no-untyped-def]
    """Write `_basis` at `t` into `w`."""
    a, b, c = 0.5 * (t - 1.0) * (t - 2.0), t * (2.0 - t), 0.5 * t * (t - 1.0)
    w[0] = (1.0 + 3.0 * t) * a * a
    w[1] = b * b
    w[2] = (7.0 - 3.0 * t) * c * c
    w[3] = t * a * a
    w[4] = (t - 1.0) * b * b
    w[5] = (t - 2.0) * c * c


@njit(**FAST)
def between(curve, pair, t, h, w, out):  # type: ignore[no-untyped-def]
    """Write the state at `t` steps of length `h` into a pair of steps into `out`."""
    _weights(t, w)
    for k in range(STATE):
        value = 0.0
        rise = 0.0
        for j in range(3):
            value += w[j] * curve[pair, j, k]
            rise += w[3 + j] * curve[pair, j, STATE + k]
        out[k] = value + h * rise


@njit(**FAST)
def _node(field, curve, pair, t, h, w, jet, b, c):  # type: ignore[no-untyped-def]
    """Write jet, place and tangent at `t` steps into a pair into `jet`, shape (21,)."""
    _weights(t, w)
    for i in range(6):
        k = 12 + i if i < 3 else 3 * i - 7
        value = rise = 0.0
        for j in range(3):
            value += w[j] * curve[pair, j, k]
            rise += w[3 + j] * curve[pair, j, STATE + k]
        jet[PLACE + i] = value + h * rise
    jet_at(field, jet[PLACE], jet[PLACE + 1], jet[PLACE + 2], jet, b, c)


@njit(**FAST)
def _rises(nodes, h, slopes):  # type: ignore[no-untyped-def]
    """Write the slopes of flux, gradient and place at three nodes, times a step."""
    for j in range(3):
        x, y, z = -h * nodes[j, NEAR], -h * nodes[j, NEAR + 1], -h * nodes[j, NEAR + 2]
        xx, xy, xz = nodes[j, 3], nodes[j, 4], nodes[j, 5]
        yy, yz = nodes[j, 6], nodes[j, 7]
        slopes[j, 0] = xx * x + xy * y + xz * z
        slopes[j, 1] = xy * x + yy * y + yz * z
        slopes[j, 2] = xz * x + yz * y - (xx + yy) * z
        turned = bend(nodes[j], 8, x, y, z)
        for k in range(5):
            slopes[j, 3 + k] = turned[k]
        slopes[j, PLACE], slopes[j, PLACE + 1], slopes[j, PLACE + 2] = x, y, z


@njit(**FAST)
def _rows(nodes, slopes, table, pair):  # type: ignore[no-untyped-def]
    """Fill the table of a pair of steps from jets and slopes at its three nodes."""
    for m in range(PLACES):
        a, b, c = _WEIGHTS[m, 0], _WEIGHTS[m, 1], _WEIGHTS[m, 2]
        p, q, r = _WEIGHTS[m, 3], _WEIGHTS[m, 4], _WEIGHTS[m, 5]
        for k in range(NEAR):
            table[pair, m, k] = (
                a * nodes[0, k] + b * nodes[1, k] + c * nodes[2, k]
                + p * slopes[0, k] + q * slopes[1, k] + r * slopes[2, k]
            )  # fmt: skip
        a, b, c = _PARABOLA[m, 0], _PARABOLA[m, 1], _PARABOLA[m, 2]
        for k in range(8, JET):
            table[pair, m, k] = a * nodes[0, k] + b * nodes[1, k] + c * nodes[2, k]


@njit(**MARCH)
def tabulate(rod, field, known, curve, n, table):  # type: ignore[no-untyped-def]
    """Fill the table of a march of n steps with the field along a curve of `known`."""
    nodes, slopes = np.empty((3, NEAR + 3)), np.zeros((3, NEAR))
    w, b, c = np.empty(6), np.empty(12), np.empty(12)
    pair = first = 0
    for i in range(rod.shape[0]):
        count, held = pairs_of(rod, i, n), pairs_of(rod, i, known)
        h, length = rod[i, H] / (2 * count), rod[i, H] / (2 * held)
        for k in range(count):
            for j in range(3):
                if j == 0 and pair > 0:
                    nodes[0] = nodes[2]
                    continue
                at = (2 * k + j) * held / count
                q = min(int(0.5 * at), held - 1)
                t = at - 2 * q
                _node(field, curve, first + q, t, length, w, nodes[j], b, c)
            _rises(nodes, h, slopes)
            _rows(nodes, slopes, table, pair)
            pair += 1
        first += held


@njit(**MARCH)
def shape(rod, n, curve, s, out):  # type: ignore[no-untyped-def]
    """Fill `out` (m, 21) with states and curvatures at the ascending stations `s`.

    At a joint the curvature is that of the section toward the tip.
    """
    w = np.empty(6)
    k = s.shape[0] - 1
    first, here = 0, 0.0
    for i in range(rod.shape[0]):
        count = pairs_of(rod, i, n)
        h = rod[i, H] / (2 * count)
        end = 2.0 if i + 1 == rod.shape[0] else here + rod[i, H] + 1e-14
        while k >= 0 and 1.0 - s[k] <= end:
            at = max(0.0, (1.0 - s[k] - here) / h)
            q = min(int(0.5 * at), count - 1)
            between(curve, first + q, min(at - 2 * q, 2.0), h, w, out[k])
            for j in range(3):
                out[k, STATE + j] = rod[i, C1 + j] * out[k, 9 + j] + rod[i, K1 + j]
            k -= 1
        first += count
        here += rod[i, H]
