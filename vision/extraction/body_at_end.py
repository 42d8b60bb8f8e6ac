"""Whether a rod ends at a body: its root must, and its tip must not.

A bar that lies across a rod, or a clamp too pale to be seen at the level at which the
rod was found, leaves only a part of the rod, or turns it round.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..curve.robust import median, quantile
from ..edge.edges import clear_of
from ..edge.state import LostError
from ..edge.step_line import lanes
from ..find.ground import View
from ..picture.photo import Photo
from .beyond_tip import goes_on_after_gap
from .refine import Refined

Array = NDArray[np.float64]

_BEHIND = np.array([0.6, 1.5])
"""How far beyond an end a body is looked for, in widths."""

_FORE = np.array([1.0, 3.0])
"""Where along the rod, from its end, there is paper beside it, in widths."""

_WIDE = 1.3
"""A body reaches so far to either side of the axis, in widths."""

_OTHER = 0.12
"""Its light differs from the paper's by more than this share of the rod's contrast."""

_THROUGH = 6.0
"""A rod that is seen again so close behind its root, in widths, is crossed there."""

_AS_DARK, _EVEN = 0.3, 0.2
"""A body at a tip is darker than the paper by more than this share, all across."""


def check_ends(photo: Photo, view: View, refined: Refined) -> None:
    """Refuse a rod in a clamp whose root is on bare paper, or whose tip meets a body.

    A clamp may be as light as the paper in the light that tells the rod best, but
    hardly in all colours.

    Raises
    ------
    LostError
        With flag and reason.
    """
    if refined.clamp is None or refined.rough:
        return
    if _on_paper([view], refined) and _on_paper(_colours(photo, view), refined):
        raise LostError(
            "no_clamp",
            "what looks like a rod begins on bare paper: no clamp is seen there",
        )
    back, width = refined.fit.curve.reversed(), refined.typical_width
    if goes_on_after_gap(view, back, width, far=_THROUGH):
        raise LostError(
            "touches_object",
            "what looks like a rod goes on behind what it grows from: something "
            "crosses it, or is crossed by it",
        )
    if _tip_at_body(view, refined):
        raise LostError(
            "touches_object", "the rod touches another object besides its root"
        )


def _colours(photo: Photo, view: View) -> list[View]:
    """Return the light of each colour, or the grey of a picture that has none."""
    colour = photo.colour()
    light = [photo.grey] if colour is None else np.moveaxis(colour, 2, 0)
    return [replace(view, grey=np.ascontiguousarray(each)) for each in light]


def _on_paper(views: list[View], refined: Refined) -> bool:
    """Whether there is paper, in no shade, on both sides behind a root.

    What is seen in several colours is as far from the paper as all of them tell.
    """
    all_along = np.array([0.0, refined.tip.s])
    behind = -_BEHIND * refined.typical_width
    off, rod = [], []
    for view in views:
        paper, contrast = _paper_beside(view, refined, all_along, 0.8)
        off.append(np.median(_beside(view, refined, behind), axis=1) - paper)
        rod.append(contrast)
    away = np.linalg.norm(off, axis=0)
    return bool(np.all(away < _OTHER * np.linalg.norm(rod)))


def _tip_at_body(view: View, refined: Refined) -> bool:
    """Whether all is dark right beyond a tip, from one side to the other."""
    width, curve = refined.typical_width, refined.fit.curve
    end = refined.tip.s
    paper, contrast = _paper_beside(view, refined, end - _FORE * width, 0.5)
    near = clear_of(refined.blur) + 1.0
    across = np.linspace(-_WIDE, _WIDE, 7) * width
    beyond = lanes(view.grey, curve, end + near + np.arange(4.0), across, view.sign)
    level = np.median(beyond, axis=1)
    darker = paper - level
    return bool(
        np.all(darker > _AS_DARK * contrast) and np.ptp(level) < _EVEN * contrast
    )


def _paper_beside(
    view: View, refined: Refined, s: Array, part: float
) -> tuple[float, float]:
    """Return a quantile of the light beside a stretch of the rod, and the contrast."""
    paper = quantile(_beside(view, refined, s).ravel(), part)
    inside = lanes(
        view.grey,
        refined.fit.curve,
        np.linspace(s[0], s[-1], 15),
        np.zeros(1),
        view.sign,
    )
    return paper, paper - median(inside.ravel())


def _beside(view: View, refined: Refined, s: Array) -> Array:
    """Return samples of the light at both sides of a stretch of the axis, (2, n)."""
    away = 0.5 * refined.typical_width + clear_of(refined.blur) + 2.0
    far = max(away + 2.0, _WIDE * refined.typical_width)
    across = np.concatenate([np.linspace(-far, -away, 3), np.linspace(away, far, 3)])
    curve = refined.fit.curve
    light = lanes(view.grey, curve, np.linspace(s[0], s[-1], 15), across, view.sign)
    return light.reshape(2, -1)
