"""A rod of two colours, each part of it in the light in which that stands out.

No one mix of colours may tell both of a white and a black half from grey paper. But
along a rod it is known where the one ends and the other begins, and the paper beside
both is one: so each part of the picture is mixed for what is nearest to it of the rod,
and both parts are then as dark on the same light ground.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..curve.curve import arc_lengths
from ..picture.photo import Photo
from ..picture.sample import nearest_pixels
from .candidate import Candidate
from .ground import STANDS_OUT, View, about, beside, box_about
from .shadeless import lanes_beside, nearest_band
from .track import resample

Array = NDArray[np.float64]
Labels = NDArray[np.intp]

_PAPER = 0.75
"""Light of the paper in all parts."""

_APART, _STEEP = 0.15, 4.0
"""Distance between two colours, in shares of the lighter of rod and paper, at least;
and over the scatter of each: one that fades along the rod is one."""

_CLEAR = 0.08
"""How far each is from the paper's, at least."""

_ALIKE = 0.7
"""Contrast of the paler part over the other's at which one light is enough."""

_RUN, _CHANGES = 2.0, 4
"""Length of a part, in widths, at least; and how often the colour changes, at most."""

_AWAY = 1.5
"""How wide a rod may be, over what is known of it: beyond is paper."""

_WINDOW = 2
"""Stations before and after one whose median tells its colour."""

_UNEVEN = 0.3
"""How much wider or thinner than all of the rod a part may be."""

_ROUNDS = 6

_LAMP, _NOISE = 0.15, 0.045
"""Share of the light of a rod and of paper that varies, and noise, as deviations."""


def in_parts(photo: Photo, rod: Candidate, view: View) -> tuple[Candidate, View]:
    """Return a rod of two colours in the light of each.

    Parameters
    ----------
    photo : Photo
        The photograph.
    rod : Candidate
        The rod, all of it, but perhaps not in its middle.
    view : View
        The one light in which it stands out best.

    Returns
    -------
    rod : Candidate
        The rod as wide as its parts are. Both are the same for a rod of one colour.
    view : View
        The picture in two lights.
    """
    _, points, _ = resample(rod.points_px, 0.6 * rod.width_px)
    spots = beside(points, _AWAY * rod.width_px, photo.grey.shape)
    light = photo.light_at(np.stack(spots))
    inside, paper = light[0].clip(1e-3), 0.5 * (light[1] + light[2])
    share = (paper - inside) / np.maximum(paper, inside)
    part = _parts(share, spots[0], rod.width_px)
    if part is None or _are_alike(view, spots, part):
        return rod, view
    ground = [np.median(paper[part == k], axis=0) for k in range(2)]
    mixes = [_mix(np.median(inside[part == k], axis=0), ground[k]) for k in range(2)]
    box = box_about(about(rod.points_px, rod.width_px))
    colour = photo.colour(box)
    near = photo.grey[box][..., None] if colour is None else colour
    nearest = _nearest_part(near.shape[:2], spots[0], box, part)
    grey = np.full(photo.grey.shape, _PAPER, np.float32)
    for k in range(2):
        mixed = _PAPER + (near[nearest == k] - ground[k]) @ mixes[k]
        grey[box][nearest == k] = mixed
    b, g, r = np.broadcast_to(mixes[part[0]], 3).tolist()
    parts = View(grey=grey, sign=1.0, mix=(b, g, r), in_parts=True)
    whole = _centred(rod, parts, spots[0], part)
    return (rod, view) if whole is None else (whole, parts)


def _centred(
    rod: Candidate, view: View, places: Array, part: Labels
) -> Candidate | None:
    """Return a rod on the middle of what is dark along it, and as wide.

    None where its parts are not of one width: one of them may be a shade.
    """
    points, normals, across = lanes_beside(rod)
    spots = points[:, None] + across[:, None] * normals[:, None]
    light = nearest_pixels(view.grey, spots).astype(np.float64)
    sides = nearest_band(light < _PAPER - 0.5 * STANDS_OUT, across)
    wide = np.ptp(sides, axis=1)
    nearest = np.hypot(*np.moveaxis(points[:, None] - places, -1, 0)).argmin(axis=1)
    of_part = [np.nanmedian(wide[part[nearest] == k]) for k in range(2)]
    typical = float(np.nanmedian(wide))
    if not abs(of_part[0] - of_part[1]) < _UNEVEN * typical:
        return None
    seen = np.flatnonzero(np.abs(wide - typical) < _UNEVEN * typical)
    middle = _smooth(sides[seen].mean(axis=1, keepdims=True))[:, 0]
    aside = np.interp(np.arange(len(points)), seen, middle)
    return replace(rod, points_px=points + aside[:, None] * normals, width_px=typical)


def _mix(rod: Array, paper: Array) -> Array:
    """Return weights of colours in which paper is lighter than a rod, and shade is not.

    A lamp takes a share of the light of either.
    """
    within = _NOISE**2 * np.eye(len(rod))
    within += _LAMP**2 * (np.outer(rod, rod) + np.outer(paper, paper))
    mix = np.linalg.solve(within, paper - rod)
    return np.asarray(STANDS_OUT * mix / (mix @ (paper - rod)))


def _parts(share: Array, points: Array, width: float) -> Labels | None:
    """Return which of two colours each station has; None of a rod of one colour."""
    if len(share) < 4 * _WINDOW:
        return None
    smooth = _smooth(share)
    first = smooth[np.argmax(_size(smooth - np.median(smooth, axis=0)))]
    centres = np.stack([first, smooth[np.argmax(_size(smooth - first))]])
    part = np.zeros(len(share), np.intp)
    for _ in range(_ROUNDS):
        part = np.argmin(_size(smooth - centres[:, None]), axis=0)
        if len(np.unique(part)) < 2:
            return None
        centres = np.stack([np.median(smooth[part == k], axis=0) for k in range(2)])
    apart = float(_size(centres[0] - centres[1]))
    scatter = max(
        float(np.median(_size(smooth[part == k] - centres[k]))) for k in range(2)
    )
    told = apart > max(_APART, _STEEP * scatter) and _size(centres).min() > _CLEAR
    return part if told and _has_long_parts(part, points, width) else None


def _smooth(along: Array) -> Array:
    """Return running medians of what is known at stations, shape (n, k)."""
    padded = np.pad(along, ((_WINDOW, _WINDOW), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _WINDOW + 1, axis=0)
    return np.asarray(np.median(windows, axis=-1))


def _size(vectors: Array) -> Array:
    return np.asarray(np.linalg.norm(vectors, axis=-1))


def _has_long_parts(part: Labels, points: Array, width: float) -> bool:
    """Whether each part is longer than a speck."""
    s = arc_lengths(points)
    change = np.flatnonzero(np.diff(part))
    ends = np.concatenate([[0.0], 0.5 * (s[change] + s[change + 1]), [s[-1]]])
    return len(change) <= _CHANGES and bool(np.diff(ends).min() > _RUN * width)


def _are_alike(view: View, spots: tuple[Array, Array, Array], part: Labels) -> bool:
    """Whether one light tells both parts about as well."""
    light = nearest_pixels(view.grey, np.stack(spots)).astype(np.float64)
    step = view.sign * (0.5 * (light[1] + light[2]) - light[0])
    one, other = (float(np.median(step[part == k])) for k in range(2))
    return min(one, other) > _ALIKE * max(one, other)


def _nearest_part(
    shape: tuple[int, ...], points: Array, box: tuple[slice, slice], part: Labels
) -> Labels:
    """Return which part each pixel of a box is nearest to."""
    places = np.rint(points - [box[1].start, box[0].start]).astype(int)
    x, y = places.clip(0, [shape[1] - 1, shape[0] - 1]).T
    away = np.ones(shape[:2], np.uint8)
    away[y, x] = 0
    _, label = cv2.distanceTransformWithLabels(
        away, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros(label.max() + 1, np.intp)
    of_label[label[y, x]] = part
    return np.asarray(of_label[label])
