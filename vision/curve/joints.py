"""Where the curvature of a rod jumps: the joints of its sections, found in the picture.

A curve smooth enough for the sections is too stiff for the joints, and one supple
enough for the joints follows every shade beside the clamp, where shade turns the
direction of the rod. So joints are looked for first. The measured offsets are linear in
the change of theta(s): a smooth part with a penalty on theta''', and for each joint a
curvature beyond it that is larger or smaller by a factor, as M / EI is for a moment M
that goes on smoothly, with a broad Gaussian prior.
Joints are added one by one while the marginal likelihood (evidence, at its maximum over
the weight of the penalty) grows by more than the choice among places explains.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from .cholesky import factor, inverse

Array = NDArray[np.float64]

_THIN, _MOST_STATIONS, _MOST_PLACES = 4, 200, 55
"""Stations are averaged by fours, or down to so many on a long rod; joints are looked
for at so many places. With more, the linear algebra library would wake its threads."""
_PIECES = 16
_MOST = 4
_LEAST_GAIN = 6.0
"""Gain of twice the log evidence for a joint to be believed, beyond the choice among
the places two widths apart where it might be."""
_ENDS = 3.8
"""Widths next to either end where a jump could not be told from shade."""
_APART = 3.0
_PRIOR = 0.05**2
"""Prior precision of a relative change of curvature, of the order of one, times the
variance of a station: they are good to about a twentieth of a pixel."""


class _Model(NamedTuple):
    """Linear model of the offsets, its smooth part on axes where it is diagonal."""

    s: Array
    angle: Array
    normals: Array
    share: Array
    """Weight of each station."""
    offset: Array
    smooth: Array
    """Columns of the smooth part on unit axes, times share: their squares add to 1."""
    turned: Array
    """The offsets on these axes."""
    stiff: Array
    """The penalty on each of these axes, at unit strength."""
    volume: float
    """Log determinant of the smooth part without penalty."""
    power: float
    """Sum of the squares of the smooth columns."""
    size: float
    total: float


def find_joints(
    s: Array, theta: Array, offset: Array, weights: Array, *, width: float,
    shared: float,
) -> list[float]:  # fmt: skip
    """Find the joints of a rod.

    Parameters
    ----------
    s : ndarray, shape (n,)
        Even grid of arc length, px.
    theta : ndarray, shape (n,)
        Tangent angle of the curve that the offsets were measured from.
    offset : ndarray, shape (n,)
        Normal distance of the measured axis from that curve.
    weights : ndarray, shape (n,)
        0 where nothing was measured.
    width : float
        Width of the rod: joints next to the ends or to each other are not looked for.
    shared : float
        Neighbouring stations that count as one.

    Returns
    -------
    list of float
        Arc lengths of the joints, rising; empty for a smooth rod.
    """
    model = _model(s, theta, offset, weights, shared)
    first, last = s[0] + _ENDS * width, s[-1] - _ENDS * width
    step = max(0.25 * width, (last - first) / _MOST_PLACES)
    places = np.arange(first, last, step)
    joints: list[float] = []
    if len(places) < 3:
        return joints
    choice = 2.0 * np.log(max(0.5 * (last - first) / width, 1.0))
    while len(joints) < _MOST:
        free = _free(places, joints, _APART * width)
        alone, joined = _evidence(model, np.array(joints), free)
        if not free.size or joined.max() - alone < _LEAST_GAIN + choice:
            break
        best = float(free[int(np.argmax(joined))])
        joints = _settled(model, [*joints, best], 0.25 * width)
    # What settles beside an end is shade: nothing else was looked for there.
    near = _APART * width
    return sorted(x for x in joints if s[0] + near < x < s[-1] - near)


def _free(places: Array, joints: list[float], apart: float) -> Array:
    for joint in joints:
        places = places[np.abs(places - joint) > apart]
    return places


def _settled(model: _Model, joints: list[float], step: float) -> list[float]:
    """Move each joint to its likeliest place near by, the others held."""
    reaches = (6.0, 1.0) if len(joints) > 1 else (1.0,)
    for reach in reaches:
        for k in range(len(joints)):
            rest = joints[:k] + joints[k + 1 :]
            near = joints[k] + step * reach * np.linspace(-1.0, 1.0, 13)
            near = near[(near > 4.0 * step) & (near < model.s[-1] - 4.0 * step)]
            _, joined = _evidence(model, np.array(rest), near)
            joints[k] = float(near[int(np.argmax(joined))])
    return joints


@njit(cache=True)
def _model(
    s: Array, theta: Array, offset: Array, weights: Array, shared: float
) -> _Model:
    """Thin the stations and set up the smooth part: quadratic plus hinges in theta."""
    thin = max(_THIN, len(s) // _MOST_STATIONS)
    count = len(s) // thin
    at, angle = np.zeros(count), np.zeros(count)
    data, weight = np.zeros(count), np.zeros(count)
    for i in range(count):
        for k in range(i * thin, (i + 1) * thin):
            at[i] += s[k] / thin
            angle[i] += theta[k] / thin
            if weights[k] > 0.0:
                weight[i] += weights[k]
                data[i] += weights[k] * offset[k]
        if weight[i] > 0.0:
            data[i] /= weight[i]
    normals = np.column_stack((-np.sin(angle), np.cos(angle)))
    # theta as 1, u, u^2 and (u - edge)^3 over each piece: theta''' is constant there.
    angles = np.empty((count, 3 + _PIECES))
    for i in range(count):
        u = (at[i] - s[0]) / (s[-1] - s[0])
        angles[i, 0], angles[i, 1], angles[i, 2] = 1.0, u, u * u
        for k in range(_PIECES):
            angles[i, 3 + k] = max(u - k / _PIECES, 0.0) ** 3
    smooth = np.empty((count, 4 + _PIECES))
    smooth[:, 0] = normals @ normals[0]
    smooth[:, 1:] = _moved(angles, at, normals)
    # Offsets count from a curve that is bent itself: give the model that curve too.
    data += _moved(angle.copy().reshape(-1, 1), at, normals)[:, 0]
    # The third derivative of piece k is 6 times the sum of the first k coefficients.
    bend = np.zeros((4 + _PIECES, 4 + _PIECES))
    for j in range(_PIECES):
        for k in range(_PIECES):
            bend[4 + j, 4 + k] = _PIECES - max(j, k)
    share = weight / shared
    weighed = smooth * share.reshape(-1, 1)
    normal = smooth.T @ weighed
    power = np.trace(normal)
    for j in range(len(normal)):
        normal[j, j] += 1e-13 * power
    # On axes V with V' normal V = 1 and V' bend V = diag(stiff), every strength costs a
    # sum and no solve.
    half = factor(normal)
    unit = inverse(half)
    stiff, turn = np.linalg.eigh(unit.T @ bend @ unit)
    weighed = weighed @ (unit @ turn)
    turned = weighed.T @ data
    total = np.sum(share * data**2)
    volume = 2.0 * np.sum(np.log(np.diag(half)))
    return _Model(
        at, angle, normals, share, data, weighed, turned, np.maximum(stiff, 0.0),
        volume, power, np.sum(share), total,
    )  # fmt: skip


@njit(cache=True)
def _moved(angles: Array, s: Array, normals: Array) -> Array:
    """Return the normal displacement that changes of theta (columns) cause."""
    out = np.empty_like(angles)
    along = np.zeros((2, angles.shape[1]))
    step = s[1] - s[0]
    for i in range(s.size):
        u, v = normals[i]
        for k in range(angles.shape[1]):
            half = 0.5 * step * angles[i, k]
            along[0, k] += half * u
            along[1, k] += half * v
            out[i, k] = along[0, k] * u + along[1, k] * v
            along[0, k] += half * u
            along[1, k] += half * v
    return out


@njit(cache=True)
def _ramps(model: _Model, places: Array) -> Array:
    """Columns of a relative change of curvature beyond each place, (n, m)."""
    at = np.interp(places, model.s, model.angle)
    beyond = np.zeros((model.s.size, places.size))
    for i in range(model.s.size):
        for k in range(places.size):
            if model.s[i] > places[k]:
                beyond[i, k] = model.angle[i] - at[k]
    return np.asarray(_moved(beyond, model.s, model.normals))


@njit(cache=True, fastmath={"reassoc", "contract"})
def _evidence(model: _Model, joints: Array, places: Array) -> tuple[float, Array]:
    """Return twice the log evidence of joints, and of one more at each place, (m,).

    The joints are added to the smooth part one by one, as Cholesky's method does.
    """
    count, axes = joints.size, model.turned.size
    ramps = _ramps(model, np.concatenate((joints, places)))
    cross, gram, own, pull = _products(model, ramps, count)
    alone, joined = -np.inf, np.full(places.size, -np.inf)
    rows, steps, freed = np.zeros((count + 1, count)), np.zeros(count), np.empty(axes)
    scale = model.power + np.sum(own[:count]) - count * _PRIOR
    for strength in scale * 10.0 ** np.arange(-10.0, 2.0, 0.5):
        # What this strength leaves of each axis.
        loosen = 1.0 / (1.0 + strength * model.stiff)
        left = model.total - np.sum(loosen * model.turned**2)
        volume = model.volume - np.sum(np.log(loosen))
        for i in range(count + places.size):
            row = rows[min(i, count)]
            power, step = own[i], pull[i]
            for q in range(axes):
                freed[q] = loosen[q] * cross[i, q]
                power -= freed[q] * cross[i, q]
                step -= freed[q] * model.turned[q]
            for j in range(min(i, count)):
                shared = gram[i, j]
                for q in range(axes):
                    shared -= freed[q] * cross[j, q]
                for m in range(j):
                    shared -= row[m] * rows[j, m]
                row[j] = shared / rows[j, j]
                power -= row[j] ** 2
                step -= row[j] * steps[j]
            gain = step**2 / power
            if i < count:
                row[i], steps[i] = np.sqrt(power), step / np.sqrt(power)
                left -= gain
                volume += np.log(power)
                continue
            more = _likelihood(
                model, strength, left - gain, volume + np.log(power), count + 1
            )
            joined[i - count] = max(joined[i - count], more)
        alone = max(alone, _likelihood(model, strength, left, volume, count))
    return alone, joined


@njit(cache=True)
def _products(
    model: _Model, ramps: Array, count: int
) -> tuple[Array, Array, Array, Array]:
    """Products of ramps with smooth axes, joints, themselves and the offsets."""
    size = ramps.shape[1]
    cross, gram = np.zeros((size, model.turned.size)), np.zeros((size, count))
    own, pull = np.full(size, _PRIOR), np.zeros(size)
    for n in range(len(ramps)):
        for i in range(size):
            if ramps[n, i] != 0.0:
                weighed = model.share[n] * ramps[n, i]
                own[i] += weighed * ramps[n, i]
                pull[i] += weighed * model.offset[n]
                for j in range(count):
                    gram[i, j] += weighed * ramps[n, j]
                for q in range(model.turned.size):
                    cross[i, q] += ramps[n, i] * model.smooth[n, q]
    return cross, gram, own, pull


@njit(cache=True)
def _likelihood(
    model: _Model, strength: float, left: float, volume: float, joints: int
) -> float:
    """Return twice the log evidence at one strength, from misfit and determinant."""
    left = max(left, 1e-12 * model.total + 1e-30)
    prior = _PIECES * np.log(strength) + joints * np.log(_PRIOR)
    return float(prior - (model.size - 4.0) * np.log(left) - volume)
