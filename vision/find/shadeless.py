"""The light in which a coloured rod is seen, and its shade on the paper is not.

A shade takes a share of the paper's light, about the same of each colour; what has
another colour is no shade. So there are weights of blue, green and red in which paper
and shade are equally light, and the rod is not: the linear discriminant (R. A. Fisher,
1936) between what is coloured along a rod and what is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..curve.curve import normals_of
from ..curve.robust import median
from ..picture.photo import Photo
from .candidate import Candidate
from .ground import LUMINANCE, View, about, mixed
from .track import resample

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Mix = tuple[float, float, float]

_BESIDE, _BESIDE_PX = 3.2, 8.0
"""How far beside an axis the light is looked at: in widths, and beyond that."""

_STATIONS = 60
"""About so many stations are looked at, on lanes a pixel apart."""

_FEW, _EVERY = 4, 16
"""One of so many stations tells whether there is any colour; and of so many pixels
along and across, one tells the paper's."""

_COLOURED, _CLEAR, _LIGHT = 0.05, 8.0, 1.6
"""How far a rod's colour is from the paper's, in shares of the light of each: at least,
and over the noise of one pixel; and light of a rod, over the paper's, that tells it
from any shade."""

_PAPER = 0.75
"""Part of what lies beside a rod that is no lighter than the paper: rod and shade."""

_UNEVEN = 0.1
"""How much a rod may vary in a mix of colours, in which it is 0.65 from the paper."""

_ALL_ALONG = 0.6
"""Part of the stations at which something coloured is seen."""

_DEEPEST, _COPY, _SHIFT = 0.1, 0.3, 0.05
"""Light that the deepest shade keeps of the paper's; by how much what lies beside a
shade may wander from where its rod must be, in widths; and the part of a shift that
must be seen across a rod, for what lies along it is not."""

_SHIFTED, _ASTRAY, _AS_WIDE = 6.0, 0.7, 0.6
"""How far a copy may be shifted, and wander from there, in widths; and its width over
the rod's, or the rod's over that, at least."""

_PALER = 0.04
"""How much paler than a rod without colour, of the paper's light, its shade is."""

_CLOSE, _MOST = (0.55, 1.5), 0.3
"""Where a shade is seen right beside its rod, in widths from the axis; and the part
of the stations at which it may seem darker than it is: a clamp's is there, too."""

_NOISE, _DEPTH = 0.003, 0.1
"""Least noise of the light of a pixel; and what a shade takes of it."""


class _Band(NamedTuple):
    """What has a colour of its own along a candidate, on lanes beside its axis.

    Stations with normals; lanes; light of each colour, (n, m, 3), and of paper; light
    over the paper's, (n, m), and how much of it is the band's; and of the band the
    stations that see it, its middle off the axis, and its width, px.
    """

    points: Array
    normals: Array
    across: Array
    light: Array
    paper: Array
    share: Array
    tint: Array
    seen: slice
    middle: Array
    width: float

    def axis(self) -> Array:
        """Return points on its midline, where it is seen."""
        return (self.points + self.middle[:, None] * self.normals)[self.seen]


def in_its_colour(photo: Photo, rod: Candidate, view: View) -> tuple[Candidate, View]:
    """Return a coloured rod in the light that tells it, but not its shade.

    Parameters
    ----------
    photo : Photo
        The photograph.
    rod : Candidate
        A rod, or its shade, or both as one.
    view : View
        The light in which that was found.

    Returns
    -------
    rod : Candidate
        The rod alone. Both are the same where there is no colour that tells it.
    view : View
        Without a shade it is the lightness that the colours have together.
    """
    band = _coloured_band(photo, rod)
    if band is None:
        return rod, view
    within = float(np.mean(np.abs(band.middle) < 0.5 * band.width)) > _ALL_ALONG
    is_light = median(band.share[band.tint > 0.8]) > _LIGHT
    if not within and (is_light or not _is_its_shade(band)):
        return rod, view
    whole = within and _AS_WIDE < band.width / rod.width_px < 1.0 / _AS_WIDE
    if whole and (is_light or _is_pale(band)):
        return rod, in_lightness(photo, rod, view)
    if is_light:
        return rod, view
    mix = _discriminant(band)
    if np.std(band.light[band.tint > 0.8] @ mix) > _UNEVEN:
        return rod, view
    near = about(rod.points_px, rod.width_px)
    rod = replace(rod, points_px=band.axis(), width_px=band.width)
    return rod, mixed(photo, mix, 1.0, near)


def in_lightness(photo: Photo, rod: Candidate | None, view: View) -> View:
    """Return the lightness that the colours about a rod have together.

    Parameters
    ----------
    photo : Photo
        The photograph.
    rod : Candidate or None
        The rod; None for the whole picture.
    view : View
        The light in which it was found; the same if that was mixed, or has no colour.
    """
    if view.mix is not None:
        return view
    near = None if rod is None else about(rod.points_px, rod.width_px)
    return mixed(photo, LUMINANCE, view.sign, near)


def shades(photo: Photo, things: Sequence[Candidate]) -> tuple[Mask, Mask]:
    """Return which things are known for shades of others, and which may be; (n,) each.

    A shade is its rod once more, without colour and with some of the paper's light.
    That of a coloured rod is known by this; beside another it is the paler of two, as a
    second rod may be too.

    Parameters
    ----------
    photo : Photo
        The photograph.
    things : sequence of Candidate
        What is long and thin in it.
    """
    hue, light = _hue_and_light(photo, things)
    grey = (hue < _COLOURED) & (light > _DEEPEST) & (light < 1.0)
    known, likely = np.zeros((2, len(things)), np.bool_)
    for k, thing in enumerate(things):
        rods = [i for i, rod in enumerate(things) if grey[k] and _is_copy(thing, rod)]
        known[k] = any(hue[i] > _COLOURED + hue[k] for i in rods)
        likely[k] = any(light[i] < light[k] - _PALER for i in rods)
    return known, likely


def _hue_and_light(photo: Photo, things: Sequence[Candidate]) -> tuple[Array, Array]:
    """Return how far things are from grey and how light, over the paper's; (n,)."""
    paper = _paper_colour(photo)
    if paper is None or len(things) < 2:
        return np.zeros(len(things)), np.array([thing.ratio for thing in things])
    colours = [np.asarray(photo.colour_at(thing.points_px)) for thing in things]
    share = np.array([np.median(each, axis=0) / paper for each in colours])
    light = share.mean(axis=1)
    return np.linalg.norm(share - light[:, None], axis=1), light


def _is_copy(one: Candidate, other: Candidate) -> bool:
    """Whether two things are alike but for a shift, as far as both are seen."""
    length = min(one.length_px, other.length_px)
    if length < _ALL_ALONG * max(one.length_px, other.length_px):
        return False
    if not _AS_WIDE < one.width_px / other.width_px < 1.0 / _AS_WIDE:
        return False
    # From the tips on: the root of a shade may lie in that of the clamp.
    from_tip = np.linspace(0.0, 0.9 * length, 10)
    shift = one.from_tip(from_tip) - other.from_tip(from_tip)
    near = float(np.hypot(*np.median(shift, axis=0))) < _SHIFTED * other.width_px
    astray = np.hypot(*(shift - np.median(shift, axis=0)).T)
    return near and float(astray.max()) < _ASTRAY * other.width_px


def _paper_colour(photo: Photo) -> Array | None:
    """Return the commonest light of each colour, (3,); None for a grey picture."""
    few = slice(None, None, _EVERY)
    colour = photo.colour((few, few))
    return None if colour is None else np.median(colour, axis=(0, 1)).astype(float)


def _coloured_band(photo: Photo, rod: Candidate) -> _Band | None:
    """Return what has a colour of its own along a candidate; None if nothing has."""
    if photo.colour_at(rod.points_px[:1]) is None:
        return None
    points, normals, across = lanes_beside(rod)
    spots = points[:, None] + across[:, None] * normals[:, None]
    glance = np.asarray(photo.colour_at(spots[::_FEW, ::2]))
    paper = np.quantile(glance, _PAPER, axis=(0, 1)).astype(float)
    if not _tinted(glance / paper).any():
        return None  # as along most rods, at little cost
    light = np.asarray(photo.colour_at(spots))
    share = light / paper
    tint = _tinted(share)
    sides = nearest_band(tint > 0.5, across)
    seen = np.flatnonzero(np.isfinite(sides[:, 0]))
    if len(seen) < _ALL_ALONG * len(points):
        return None
    return _Band(
        points=points, normals=normals, across=across, light=light, paper=paper,
        share=share.mean(axis=2), tint=tint, seen=slice(seen[0], seen[-1] + 1),
        middle=np.interp(np.arange(len(points)), seen, sides[seen].mean(axis=1)),
        width=median(np.ptp(sides[seen], axis=1)),
    )  # fmt: skip


def lanes_beside(rod: Candidate) -> tuple[Array, Array, Array]:
    """Return points along a rod, their normals, and offsets of lanes beside it."""
    _, points, theta = resample(rod.points_px, 0.6 * rod.width_px)
    every = max(1, len(points) // _STATIONS)
    normals = normals_of(theta)
    reach = _BESIDE * rod.width_px + _BESIDE_PX
    side = np.arange(1.0, reach)
    return points[::every], normals[::every], np.concatenate([-side[::-1], [0.0], side])


def nearest_band(on: Mask, across: Array) -> Array:
    """Return where what is on, next to the axis, begins and ends; (n, 2), or NaN."""
    lane = np.arange(len(across))
    nearest = np.argmin(np.where(on, np.abs(across), np.inf), axis=1)[:, None]
    low = np.where(on | (lane > nearest), -1, lane).max(axis=1) + 1
    high = np.where(on | (lane < nearest), len(lane), lane).min(axis=1) - 1
    band = np.column_stack([across[low % len(lane)] - 0.5, across[high] + 0.5])
    band[~on.any(axis=1)] = np.nan
    return band


def _is_its_shade(band: _Band) -> bool:
    """Whether what lies along an axis may be the shade of a coloured rod beside it.

    A shade is the rod once more, shifted by one vector.
    """
    middle, normals, across = band.middle, band.normals, band.across
    inside = np.abs(middle) < 0.5 * band.width
    axis = band.share[:, len(across) // 2]
    ridge = len(normals) * _SHIFT**2 * np.eye(2)
    shift = np.linalg.solve(normals.T @ normals + ridge, normals.T @ middle)
    astray = median(np.abs(middle - normals @ shift))
    near = float(np.hypot(*shift)) < across[-1] and astray < _COPY * band.width
    return near and median(axis[~inside]) > _DEEPEST


def _tinted(share: Array) -> Array:
    """Return how much of its light is the rod's, 0 to 1, by its colour; (n, m)."""
    brightness = share.mean(axis=2, keepdims=True)
    hue = share - brightness
    away = np.linalg.norm(hue, axis=2)
    most = float(np.quantile(away, 0.97))
    noise = 0.7 * median(np.abs(np.diff(hue, axis=0)).max(axis=2).ravel())
    strong = away > 0.6 * most
    if most < max(_COLOURED, _CLEAR * noise):
        return np.zeros(away.shape)
    direction = np.median(hue[strong], axis=0)
    direction /= np.linalg.norm(direction)
    return np.asarray(hue @ direction / np.median(hue[strong] @ direction))


def _is_pale(band: _Band) -> bool:
    """Whether a shade right beside its rod is lighter than half way from that to paper.

    Half level is then the rod's own edge, which colours would tell less well: most
    sensors guess two of three at a pixel, JPEG keeps every other pixel's, and a mix of
    them has several times their noise.
    """
    away = np.abs(band.across - band.middle[:, None]) / band.width
    beside = (away > _CLOSE[0]) & (away < _CLOSE[1]) & (np.abs(band.tint) < 0.2)
    shade = np.quantile(np.where(beside, band.share, 1.0).min(axis=1), _MOST)
    return bool(shade > 0.5 * (1.0 + median(band.share[band.tint > 0.8])))


def _discriminant(band: _Band) -> Mix:
    """Return weights in which the paper is 0.65 lighter than the rod."""
    rod, ground = band.light[band.tint > 0.8], band.light[np.abs(band.tint) < 0.2]
    shade = _DEPTH * band.paper
    within = np.cov(ground.T) + np.outer(shade, shade) + _NOISE**2 * np.eye(3)
    step = np.median(ground, axis=0) - np.median(rod, axis=0)
    mix = np.linalg.solve(within, step)
    b, g, r = (float(part) for part in 0.65 * mix / (mix @ step))
    return b, g, r
