"""The end at which a clamp holds what seems to float, whatever the clamp's colour.

A clamp as light as the paper, or light where the rod is dark, is in no mask that shows
the rod. In logarithms of light a shade adds the same to a rod and to the paper beside
it, so that the step from one to the other stays the same along the rod, in each colour,
until the rod ends. Where it ends in a clamp, what lies on both sides of it changes
there, alike; at a free end paper goes on, or the rod's shade on one side.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..curve.curve import arc_lengths, on_polyline
from ..edge.state import LostError
from ..picture.photo import Photo
from .candidate import Candidate
from .track import predict, resample

Array = NDArray[np.float64]

_LEAST_LIGHT = 0.006
"""Light that is added before logarithms are taken: less is noise."""

_ON = np.linspace(-0.3, 0.3, 5)
"""Lanes on a rod, in widths from its axis."""

_CLEAR, _CLEAR_PX, _OUT, _OUT_PX, _LANES = 0.15, 2.5, 1.2, 8.0, 7
"""How far from a rod's edges lanes beside it begin, in widths or px at least; how far
they reach; and how many there are."""

_KNOWN, _STATIONS = ((1.2, 0.3), (4.0, 0.6)), 40
"""From where to where a rod is known, in widths from its end and as parts of its length
at most; and at so many places."""

_FURTHER, _BEYOND = 10.0, 2.0
"""How far it is followed from there at most, and how far beyond where it is lost a body
is looked at, in widths."""

_STEP, _RECENT, _ASIDE = 0.25, 12, np.linspace(-0.25, 0.25, 11)
"""Distance of centres, so many of which tell where the next one is, and how far aside
of that it is sought, in widths."""

_SEEN, _GONE, _GONE_PX = 0.5, 0.4, 3.0
"""Share of the rod's own step across by which it is seen; and how far on it is not seen
where it has ended, in widths or px at least."""

_NEAR, _NEAR_PX, _FAR, _FAR_PX = 0.3, 2.0, 1.2, 3.0
"""How far from a front what lies before and behind it is looked at, widths and px."""

_AGAIN, _AGAIN_STEP, _ASTRAY, _RUN = (1.0, 6.0), 0.125, 1.5, 13
"""From where to where, and in which steps, a rod is sought behind its root, and how far
aside, in widths; and steps in a row over which it is seen there."""

_DEEPEST, _COLOURLESS = 1.5, 0.3
"""Darkest shade, as a logarithm, and how far the steps of its colours may lie apart, as
a share of their mean."""

_FRONT, _SURE, _NOISE, _CLEARER = 0.15, 1.4, 0.01, 2.0
"""Change beside the rod at a front, as a logarithm, over the scatter of what is before
it, which is so much at least, and over the change at the other end."""

_ALIKE, _APART = 0.7, 0.3
"""Cosine of the changes on both sides, as steps of blue, green and red; or how far what
lies behind may be apart there, as a share of the lesser change."""


_NO_CLAMP = (
    "no clamp is seen at either end of the rod, nor a border of the picture: give the "
    "clamp another colour than the ground; for a rod that floats freely say --free "
    "(from Python: clamp='none')"
)


def as_held(photo: Photo, rod: Candidate) -> Candidate:
    """Return a rod that seems to float as `held` does.

    Raises
    ------
    LostError
        If it is held nowhere.
    """
    found = held(photo, rod)
    if found is None:
        raise LostError("no_clamp", _NO_CLAMP)
    return found


def held(photo: Photo, rod: Candidate) -> Candidate | None:
    """Return a rod that seems to float as held at that end at which a front is seen.

    What changes at its free end is little beside that, even where grain and the lines
    of squared paper scatter both.

    Parameters
    ----------
    photo : Photo
        The photograph.
    rod : Candidate
        What touches nothing as far as its own light shows.

    Returns
    -------
    Candidate or None
        From the front to its free end; None where a front is seen at neither end, or
        at both.
    """
    _, points, _ = resample(rod.points_px, 0.6 * rod.width_px)
    root, tip = (_end_at(photo, way, rod.width_px) for way in (points, points[::-1]))
    if root.is_front == tip.is_front:
        return None
    front, free = (root, tip) if root.is_front else (tip, root)
    if front.change < _CLEARER * free.change:
        return None
    points = front.points
    return replace(
        rod, points_px=points, length_px=float(arc_lengths(points)[-1]),
        root="clamp", contacts=1, leaves=False, from_front=True,
        rivalled=rod.rivalled or front.is_shade,
    )  # fmt: skip


class _End(NamedTuple):
    """What is seen where a rod is lost: its points from there on, and what changes.

    The change beside it as a logarithm, and over the scatter of what is before, each of
    the lesser side; whether it is one body that begins there; and whether what ends may
    be a shade.
    """

    points: Array
    change: float = 0.0
    sure: float = 0.0
    one_body: bool = False
    is_shade: bool = False

    @property
    def is_front(self) -> bool:
        """Whether it is the front of a clamp."""
        clear = self.change > _FRONT and self.sure > _SURE
        return clear and self.one_body


def _end_at(photo: Photo, points: Array, width: float) -> _End:
    """Return what is seen where a rod is lost, from the end that is looked at on."""
    s = arc_lengths(points)
    step = _own_step(photo, points, s, width)
    if not step.any():
        return _End(points)
    low = _known(s, width)[0]
    recent = np.linspace(low, low + _STEP * width * _RECENT, _RECENT, endpoint=False)
    way = _followed(photo, on_polyline(recent, s, points), step, width)
    end = _lost(photo, way, step, width)
    return end._replace(
        points=np.vstack([end.points, points[s > recent[-1]]]),
        is_shade=_may_be_shade(step),
    )


def seen_behind(photo: Photo, points: Array, width: float) -> bool:
    """Whether a rod of the same colours is seen behind the place where one begins.

    Parameters
    ----------
    photo : Photo
        The photograph.
    points : ndarray, shape (n, 2)
        Points on the axis, px, from there on.
    width : float
        Width of the rod, px.
    """
    s = arc_lengths(points)
    step = _own_step(photo, points, s, width)
    if not step.any():
        return False
    back = points[0] - on_polyline(np.array([width]), s, points)[0]
    back /= np.hypot(*back)
    far = width * np.arange(*_AGAIN, _AGAIN_STEP)
    seen = np.zeros(len(far), np.bool_)
    for aside in width * np.arange(-_ASTRAY, _ASTRAY + 0.1, 0.25):
        spots = points[0] + far[:, None] * back + aside * np.array([-back[1], back[0]])
        seen |= (_shares(_across(photo, spots, width), step) > _SEEN).all(axis=0)
    lost = [k for k, here in enumerate([*seen, False]) if not here]
    return bool(max(np.diff([-1, *lost])) > _RUN)


def _known(s: Array, width: float) -> tuple[float, float]:
    """Return from where to where a rod is known, as arc lengths."""
    low, high = (min(far * width, share * float(s[-1])) for far, share in _KNOWN)
    return low, high


def _own_step(photo: Photo, points: Array, s: Array, width: float) -> Array:
    """Return the step from the paper to a rod, in logarithms of light, (c,).

    Its own shade, on one side, makes a light rod's step higher, and may end before.
    """
    known = on_polyline(np.linspace(*_known(s, width), _STATIONS), s, points)
    on, *sides = _across(photo, known, width)
    steps = [np.median(on - side, axis=0) for side in sides]
    return np.asarray(min(steps, key=lambda each: float(np.linalg.norm(each))))


def _may_be_shade(step: Array) -> bool:
    """Whether a step is that of a shade, which begins at the clamp's front too."""
    grey = -float(step.mean())
    aside = float(np.linalg.norm(step + grey)) if len(step) > 1 else 0.0
    return bool(0.0 < grey < _DEEPEST and aside < _COLOURLESS * grey)


def _followed(photo: Photo, way: Array, rise: Array, width: float) -> Array:
    """Carry points on outwards as long as a rod is seen, and straight on beyond."""
    step, unseen = _STEP * width, 0.0
    most = _FURTHER * width / step
    head = len(way)
    while unseen < _GONE * width and len(way) - head < most:
        x, y, u, v = predict(np.ascontiguousarray(way[:_RECENT]), step)
        spots = np.array([x, y]) + width * _ASIDE[:, None] * [-v, u]
        along = np.tile([u, v], (len(spots), 1))
        share = _shares(_across(photo, spots, width, along), rise).min(axis=0)
        aside = 0.0
        if share.max() > _SEEN:
            weight = share > 0.9 * share.max()
            aside, unseen = 0.5 * width * float(_ASIDE[weight].mean()), 0.0
        else:
            unseen += step
        way = np.vstack([[x - aside * v, y + aside * u], way])
    ahead = way[0] - way[2]
    ahead /= np.hypot(*ahead)
    far = np.arange(_BEYOND * width + _CLEAR_PX, 0.0, -1.0)
    return np.vstack([way[0] + far[:, None] * ahead, way])


def _lost(photo: Photo, way: Array, rise: Array, width: float) -> _End:
    """Return what is seen where a rod is lost on its way."""
    s = arc_lengths(way)
    u = np.arange(s[-1], 0.0, -1.0)  # outwards
    way = on_polyline(u, s, way)
    light = _across(photo, way, width)
    lost = max(_GONE * width, _GONE_PX)
    ends = [_lost_at(share > _SEEN, round(lost)) for share in _shares(light, rise)]
    points = way[: round(0.5 * (ends[0] + ends[1])) + 1][::-1]
    near, far = _NEAR * width + _NEAR_PX, _FAR * width + _FAR_PX
    papers, bodies, scatter = np.empty((3, 2, light.shape[2]))
    for k, (end, side) in enumerate(zip(ends, light[1:], strict=True)):
        before = side[max(round(end - far), 0) : max(round(end - near), 0)]
        behind = side[round(end + near) : round(end + far)]
        if min(len(before), len(behind)) < 2:
            return _End(points)
        papers[k], bodies[k] = np.median(before, axis=0), np.median(behind, axis=0)
        scatter[k] = 1.4826 * np.median(np.abs(before - papers[k]), axis=0) + _NOISE
    changes = np.linalg.norm(bodies - papers, axis=1)
    sure = changes / np.linalg.norm(scatter, axis=1)
    one_body = _is_one_body(papers, bodies)
    return _End(points, float(changes.min()), float(sure.min()), one_body)


def _is_one_body(papers: Array, bodies: Array) -> bool:
    """Whether what lies behind a front is alike on both sides, or changes alike.

    One side of the paper may lie in shade; or one of the front.
    """
    changes = bodies - papers
    sizes = np.linalg.norm(changes, axis=1)
    apart = float(np.linalg.norm(bodies[1] - bodies[0]))
    return bool(
        changes[0] @ changes[1] > _ALIKE * sizes.prod() or apart < _APART * sizes.min()
    )


def _lost_at(seen: NDArray[np.bool_], least: int) -> int:
    """Return after how many stations nothing is seen for so many, else all."""
    run = 0
    for k, here in enumerate(seen):
        run = 0 if here else run + 1
        if run >= least:
            return k + 1 - run
    return len(seen)


def _shares(light: Array, rise: Array) -> Array:
    """Return what of its own step is seen at either side of a rod, (2, n)."""
    on, *sides = light
    return np.array([(on - side) @ rise / (rise @ rise) for side in sides])


def _across(
    photo: Photo, points: Array, width: float, along: Array | None = None
) -> Array:
    """Return logarithms of light, (3, n, c): on an axis, and at its left and right."""
    if along is None:
        along = np.gradient(points, axis=0)
        along /= np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    normals = np.column_stack([-along[:, 1], along[:, 0]])
    first = 0.5 * width + max(_CLEAR * width, _CLEAR_PX)
    beside = np.linspace(first, first + max(_OUT * width, _OUT_PX), _LANES)
    return np.array(
        [
            np.median(
                _log_light(photo, points[:, None] + lanes[:, None] * normals[:, None]),
                axis=1,
            )
            for lanes in (_ON * width, -beside, beside)
        ]
    )


def _log_light(photo: Photo, spots: Array) -> Array:
    """Return logarithms of light at places, (..., c)."""
    return np.asarray(np.log(photo.light_at(spots) + _LEAST_LIGHT))
