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

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.jit import njit

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


@dataclass(frozen=True, slots=True)
class _Model:
    """Linear model of the offsets: columns, their prior precision, and the data."""

    s: Array
    angle: Array
    normals: Array
    weight: Array
    offset: Array
    smooth: Array
    bend: Array
    count: float
    shared: float


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
        alone, joined = _evidence(model, joints, free)
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
            _, joined = _evidence(model, rest, near)
            joints[k] = float(near[int(np.argmax(joined))])
    return joints


def _model(
    s: Array, theta: Array, offset: Array, weights: Array, shared: float
) -> _Model:
    """Thin the stations and set up the smooth part: quadratic plus hinges in theta."""
    thin = max(_THIN, len(s) // _MOST_STATIONS)
    count = len(s) // thin * thin
    weight = weights[:count].reshape(-1, thin).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (offset * weights)[:count].reshape(-1, thin).sum(axis=1) / weight
    at = s[:count].reshape(-1, thin).mean(axis=1)
    angle = theta[:count].reshape(-1, thin).mean(axis=1)
    normals = np.column_stack([-np.sin(angle), np.cos(angle)])
    length = s[-1] - s[0]
    u = (at - s[0]) / length
    edges = np.linspace(0.0, 1.0, _PIECES + 1)
    # theta as 1, u, u^2 and (u - edge)^3 over each piece: theta''' is constant there.
    rise = np.clip(u[:, None] - edges[:-1], 0.0, None) ** 3
    angles = np.column_stack([np.ones_like(u), u, u**2, rise])
    smooth = np.column_stack([normals @ normals[0], _moved(angles, at, normals)])
    # The third derivative of piece k is 6 times the sum of the first k coefficients.
    sums = np.tril(np.ones((_PIECES, _PIECES)))
    bend = np.zeros((smooth.shape[1],) * 2)
    bend[4:, 4:] = sums.T @ sums
    data = np.where(weight > 0.0, np.nan_to_num(mean), 0.0)
    # Offsets count from a curve that is bent itself: give the model that curve too.
    data = data + _moved(angle[:, None], at, normals)[:, 0]
    return _Model(
        at, angle, normals, weight, data, smooth, bend, weight.sum() / shared, shared
    )


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


def _ramps(model: _Model, places: Array) -> Array:
    """Columns of a relative change of curvature beyond each place, (n, m)."""
    turned = model.angle[:, None] - np.interp(places, model.s, model.angle)
    beyond = np.where(model.s[:, None] > places, turned, 0.0)
    return np.asarray(_moved(beyond, model.s, model.normals))


def _evidence(model: _Model, joints: list[float], places: Array) -> tuple[float, Array]:
    """Return twice the log evidence of joints, and of one more at each place, (m,)."""
    columns = model.smooth
    if joints:
        columns = np.column_stack([columns, _ramps(model, np.array(joints))])
    weighted = columns * (model.weight / model.shared)[:, None]
    normal, right = weighted.T @ columns, weighted.T @ model.offset
    total = float(np.sum(model.weight * model.offset**2)) / model.shared
    size, smooth = len(right), model.smooth.shape[1]
    bend = np.zeros((size, size))
    bend[:smooth, :smooth] = model.bend
    tight = np.zeros(size)
    tight[smooth:] = _PRIOR
    # normal + tight and bend share eigenvectors V: V' (normal + tight) V = 1 and
    # V' bend V = diag(stiff), so that every strength costs a sum and no solve.
    held = normal + np.diag(tight) + 1e-13 * np.trace(normal) * np.eye(size)
    unit = np.linalg.inv(np.linalg.cholesky(held))
    stiff, turn = np.linalg.eigh(unit @ bend @ unit.T)
    stiff, vectors = np.maximum(stiff, 0.0), unit.T @ turn
    strengths = np.trace(normal) * 10.0 ** np.arange(-10.0, 2.0, 0.5)
    loosen = 1.0 / (1.0 + strengths[:, None] * stiff)
    turned = vectors.T @ right
    left = total - loosen @ turned**2
    volume = np.linalg.slogdet(held)[1] - np.log(loosen).sum(axis=1)
    gain, det = _joined(model, places, weighted, vectors, turned, loosen)

    def score(left: Array, volume: Array, joined: int) -> Array:
        left = np.maximum(left, 1e-12 * total + 1e-30)
        likelihood = -(model.count - 4.0) * np.log(left) - volume
        likelihood += _PIECES * np.log(strengths)[:, None] + joined * np.log(_PRIOR)
        return np.asarray(likelihood.max(axis=0))

    (alone,) = score(left[:, None], volume[:, None], len(joints))
    return float(alone), score(
        left[:, None] - gain, volume[:, None] + np.log(det), len(joints) + 1
    )


def _joined(
    model: _Model, places: Array, weighted: Array, vectors: Array, turned: Array,
    loosen: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Return fall of the misfit and determinant, (strengths, m), of a joint each."""
    ramps = _ramps(model, places)
    share = (model.weight / model.shared)[:, None]
    cross = vectors.T @ (weighted.T @ ramps)
    own = (share * ramps**2).sum(axis=0) + _PRIOR - loosen @ cross**2
    pull = (share * ramps * model.offset[:, None]).sum(axis=0)
    pull = pull - loosen @ (cross * turned[:, None])
    return pull**2 / own, own
