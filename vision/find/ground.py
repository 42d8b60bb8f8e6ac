"""How far every pixel is from the paper, in lightness and in colour.

What a person calls the paper is most of the picture, whatever its colour; the light on
it falls off smoothly. So the light is fitted in each of the three channels, and the
distance is that of CIELAB (1976), in which equal steps look equally large: a red rod
on a green board of the same lightness is as far from it as a grey one from white.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..curve.robust import median, quantile
from ..edge.flank import WHITE
from ..picture.photo import Photo
from ..picture.sample import nearest_pixels
from .binarise import WORK_PX, Binary, quadric, shrunk

Array = NDArray[np.float64]
Image = NDArray[np.float32]

LEVELS = (0.62, 0.5, 0.4, 0.32, 0.25, 0.19, 0.14, 0.1, 0.07)
"""Distances from the paper at which things are looked at: black on white is 0.7 to 0.9,
deep shade 0.3, and the fibres of paper 0.02."""

FAINT = (0.1, 0.085, 0.07, 0.055, 0.045)
"""The same for what is nearly as light as the paper, where nothing else is seen."""

_SAMPLE, _EVERY = 1500, 8
_FALLS_OFF, _GRAIN = 0.4, 0.006
"""Pixels that tell the paper's light, and of it, once fitted, one of so many along and
across; by how much it may fall off across the picture,
as a logarithm; and how far noise scatters dark ones."""

_OTHER, _LARGE, _BLACK = 0.12, 0.1, 1e-3
"""Distance from the first ground of what may be another, the least part of the picture
that is one, and light that is told from none."""

_SEEDS, _LEAST_SAMPLE = 5, 60
"""One of so many pixels may be of the commonest colour; and fewer tell none."""

LUMINANCE = (0.114, 0.587, 0.299)
"""Weights of blue, green and red in lightness: of their light here, but of their values
in a picture that was made grey (ITU-R BT.601), which is another light where a coloured
rod blurs into the paper."""

_BETTER = 1.5
"""So much more must a mix of colours tell rod from paper than lightness does."""

STANDS_OUT = 0.65
"""How much darker than the paper a rod is in a mix of colours."""

_ROOM = 11.0
"""How far about a rod its picture is looked at later, in widths."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """A picture in the light that tells its rod best.

    Parameters
    ----------
    grey : ndarray, shape (h, w), float32
        Linear light, or a mix of it.
    sign : float
        -1 where the rod is lighter than the paper.
    mix : tuple of float or None
        Weights of blue, green and red; None is the photograph's own grey.
    in_parts : bool
        Whether its rod has two colours, each seen in a mix of its own: `mix` is that at
        the root.
    """

    grey: Image
    sign: float
    mix: tuple[float, float, float] | None = None
    in_parts: bool = False

    @property
    def plain(self) -> bool:
        """Whether it shows how light things are, not their colour."""
        return self.mix in (None, LUMINANCE)


def ground_distance(photo: Photo) -> Binary:
    """Return a picture whose `ratio` is 1 less the distance from the paper.

    Its mask is empty; `rebinarise` makes one at a level.
    """
    small, factor = _small(photo)
    return _distance(small, factor, np.ones(small.shape[:2], np.bool_))


def other_ground(photo: Photo, known: Sequence[Binary]) -> Binary | None:
    """Return the same for another ground, as a mat half under a sheet is.

    Parameters
    ----------
    photo : Photo
        The photograph.
    known : sequence of Binary
        How far from its other grounds the pixels are.

    Returns
    -------
    Binary or None
        None where nothing else is large.
    """
    small, factor = _small(photo)
    nearest = np.max([binary.ratio for binary in known], axis=0)
    rest = nearest < 1.0 - _OTHER
    logs = np.log(np.maximum(small, _BLACK))
    sample = logs[rest]
    sample = sample[:: max(1, len(sample) // _SAMPLE)]
    if len(sample) < _LEAST_SAMPLE:
        return None
    seeds = sample[::_SEEDS]
    near = np.abs(sample - seeds[:, None]).max(axis=2) < 0.5 * _FALLS_OFF
    middle = np.median(sample[near[np.argmax(near.sum(axis=1))]], axis=0)
    ground = rest & (np.abs(logs - middle).max(axis=2) < _FALLS_OFF)
    return _distance(small, factor, ground) if ground.mean() > _LARGE else None


def _small(photo: Photo) -> tuple[Image, int]:
    """Return the working picture, (h, w, 1 or 3), and its factor."""
    factor = max(1, round(max(photo.grey.shape) / WORK_PX))
    colour = photo.colour()
    light = photo.grey[..., None] if colour is None else colour
    small = shrunk(light, factor)
    return small.reshape(*small.shape[:2], -1), factor


def _distance(small: Image, factor: int, ground: NDArray[np.bool_]) -> Binary:
    """Return the distance from the commonest light of what may be the ground."""
    height, width = small.shape[:2]
    bare = [_paper_light(small[..., k], ground) for k in range(small.shape[2])]
    typical = np.array([np.median(each[::_EVERY, ::_EVERY]) for each in bare])
    shade = [each / light for each, light in zip(bare, typical, strict=True)]
    level = np.clip(small / cv2.merge(shade).reshape(small.shape), 0.0, 1.5)
    if level.shape[2] == 1:
        level, typical = np.repeat(level, 3, axis=2), np.repeat(typical, 3)
    brightest = np.quantile(level[::4, ::4].max(axis=2), 0.998)
    white = np.float32(max(1e-3, float(typical.max()), float(brightest)))
    level /= white
    lab = cv2.cvtColor(level, cv2.COLOR_LBGR2Lab)
    paper = cv2.cvtColor((typical / white).reshape(1, 1, 3), cv2.COLOR_LBGR2Lab)
    apart = cv2.absdiff(lab, np.append(paper.astype(np.float64), 0.0))
    away = np.sqrt(np.square(apart) @ np.ones(3, np.float32))
    return Binary(
        ratio=np.asarray(1.0 - away / np.float32(100.0), np.float32),
        mask=np.zeros((height, width), np.uint8), factor=factor, inverted=False,
        dark=0.0, threshold=0.0,
    )  # fmt: skip


def best_view(photo: Photo, points_px: Array, width_px: float) -> View:
    """Return the light in which a rod stands out best all along.

    Parameters
    ----------
    photo : Photo
        The photograph.
    points_px : ndarray, shape (n, 2)
        Points inside the rod, one after the other.
    width_px : float
        Its width.
    """
    rod, left, right = beside(points_px, width_px, photo.grey.shape)
    grey = nearest_pixels(photo.grey, rod).astype(np.float64)
    paper = nearest_pixels(photo.grey, np.stack([left, right])).mean(
        axis=0, dtype=np.float64
    )
    own = View(grey=photo.grey, sign=1.0 if median(paper - grey) > 0.0 else -1.0)
    colours = photo.colour_at(np.stack([left, right, rod]))
    if colours is None:
        return own
    step = 0.5 * (colours[0] + colours[1]) - colours[2]
    towards = np.median(step, axis=0)
    mixes = [np.eye(3)[k] * np.sign(towards[k] or 1.0) for k in range(3)]
    mixes.append(towards / max(float(np.abs(towards).sum()), 1e-9))
    contrast = [quantile(step @ mix, 0.1) for mix in mixes]
    best = int(np.argmax(contrast))
    if contrast[best] < _BETTER * quantile(own.sign * (paper - grey), 0.1):
        return own
    mix = mixes[best]
    if best == 3 or median(colours[2][:, best]) < WHITE or towards[best] > 0.0:
        mix = STANDS_OUT * mix / max(median(step @ mix), 1e-6)
    sign = -1.0 if np.all(mix <= 0.0) else 1.0
    b, g, r = (float(part) for part in sign * mix)
    return mixed(photo, (b, g, r), sign, about(points_px, width_px))


def about(points_px: Array, width_px: float) -> Array:
    """Return places about which the picture of a rod is looked at later, (n, 2)."""
    reach = _ROOM * width_px
    return np.vstack([points_px - reach, points_px + reach])


def mixed(
    photo: Photo, mix: tuple[float, float, float] | None, sign: float,
    near: Array | None = None,
) -> View:  # fmt: skip
    """Return the view of a photograph in a mix of its colours.

    Parameters
    ----------
    photo : Photo
        The photograph.
    mix : tuple of float or None
        Weights of blue, green and red; None is its own grey.
    sign : float
        -1 where the rod is lighter than the paper.
    near : ndarray, shape (n, 2), optional
        Places (x, y) about which the picture is wanted; elsewhere it is bare paper.
    """
    box = (slice(None), slice(None)) if near is None else box_about(near)
    colour = None if mix is None else photo.colour(box)
    if colour is None:
        return View(grey=photo.grey, sign=sign)
    light = np.asarray(cv2.transform(colour, np.array([mix], np.float32)), np.float32)
    if near is None:
        return View(grey=light, sign=sign, mix=mix)
    paper = float(np.median(light[::8, ::8]))
    grey = np.full(photo.grey.shape, paper, np.float32)
    grey[box] = light
    return View(grey=grey, sign=sign, mix=mix)


def box_about(points: Array) -> tuple[slice, slice]:
    """Return the rows and columns that hold places."""
    (left, top), (right, bottom) = (
        np.maximum(ends(points, axis=0), 0.0).astype(int) for ends in (np.min, np.max)
    )
    return slice(top, bottom + 1), slice(left, right + 1)


def _paper_light(work: Image, ground: NDArray[np.bool_]) -> Image:
    """Return the light on the bare paper in one channel: a quadric through its mode.

    The commonest light is the paper's, give or take what it falls off; what is not
    near the quadric is something else.
    """
    height, width = work.shape
    step = max(1, int((height * width / _SAMPLE) ** 0.5))
    sample, among = work[::step, ::step], ground[::step, ::step].ravel()
    basis, value = quadric(*sample.shape), np.maximum(sample, 1e-4).ravel()
    basis, value = basis[among], value[among]
    logs = np.sort(np.log(value.astype(np.float64)))
    within = np.searchsorted(logs, logs + _FALLS_OFF) - np.arange(logs.size)
    first = int(np.argmax(within))
    middle = float(np.exp(np.median(logs[first : first + within[first]])))
    light = np.full(value.size, middle)
    coefficients = np.array([middle, 0.0, 0.0, 0.0, 0.0, 0.0])
    for band in (0.45, 0.25, 0.15, 0.1, 0.1):
        inside = np.abs(value - light) < band * light + _GRAIN
        if inside.sum() < 60:
            break
        coefficients = np.linalg.lstsq(basis[inside], value[inside], rcond=None)[0]
        light = np.maximum(basis @ coefficients, 0.2 * middle)
    y, x = (np.linspace(-1.0, 1.0, side, dtype=np.float32) for side in work.shape)
    c, y = coefficients.astype(np.float32), y[:, None]
    fitted = (c[1] + c[4] * y) + c[3] * x
    fitted *= x
    fitted += c[0] + y * (c[2] + c[5] * y)
    return np.asarray(np.maximum(fitted, np.float32(0.2 * middle)))


def beside(
    points: Array, width: float, shape: tuple[int, ...]
) -> tuple[Array, Array, Array]:
    """Return points in a rod, and as many on the paper at its left and right."""
    along = np.gradient(points, axis=0)
    along /= np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    across = np.column_stack([-along[:, 1], along[:, 0]]) * (0.5 * width + 4.0)
    inner = slice(1, -1) if len(points) > 4 else slice(None)
    spots = points[inner], (points - across)[inner], (points + across)[inner]
    limit = np.array([shape[1] - 1, shape[0] - 1])
    low, middle, high = (np.clip(spot, 0, limit) for spot in spots)
    return low, middle, high
