"""Where a rod begins and ends: its clamp, the border or another face, and its tip."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..curve.curve import Curve
from ..curve.robust import median
from .clamp import APART_PX, ClampLines, between
from .clamp_lines import clamp_lines
from .crossings import EndFace
from .state import LostError, Root, Seen, State
from .tip import find_tip
from .wall_light import MIRRORED, SKY, Walls, short_of_end, wall_light

Array = NDArray[np.float64]
Image = NDArray[np.float32]


def find_ends(
    grey: Image, state: State, seen: Seen, root: Root, sign: float,
    walls: Walls | None, *, fine: bool,
) -> tuple[EndFace, ClampLines | None, float]:  # fmt: skip
    """Return the tip, the lines at a clamp, and the arc length where the rod begins.

    Those that are not `fine` only tell where to look next.
    """
    face = None if walls is None else _face_seen(state, walls)
    tip = _free_end(grey, state, seen, sign, face, at_tip=True, fine=fine)
    if tip is None:
        raise LostError(
            "no_tip", "the free end of the rod shows no edge: lay plain paper there"
        )
    state.tip_blur = tip.blur
    if walls is not None and fine:
        tip = _to_end_of_face(tip, state, seen, walls)
    if root == "border":
        return tip, None, _border_crossing(grey, state.curve)
    if root == "free":
        end = _free_end(grey, state, seen, sign, None, at_tip=False, fine=fine)
        if end is None:
            raise LostError("no_tip", "an end of the rod has no edge")
        return tip, None, -end.s
    lines = clamp_lines(grey, state, seen, sign, fine=fine)
    state.clamp_blur = lines.blur
    return tip, lines, _first(lines, state.face_px)


def _free_end(
    grey: Image, state: State, seen: Seen, sign: float, face: float | None, *,
    at_tip: bool, fine: bool,
) -> EndFace | None:  # fmt: skip
    """Return the tip, or the other end of a rod that floats, by `s` towards it."""
    curve, edges, width, towards = state.curve, seen.edges, state.width, seen.s
    expected, blur = state.last, state.tip_blur or state.blur
    if not at_tip:
        curve, towards = curve.reversed(), -seen.s
        expected, blur = -state.first, state.blur
    near = seen.good & (towards > curve.s[-1] - 3.0 * width)
    seeks = at_tip and not fine and near.any()
    middle = median(edges.middle[near]) if seeks else 0.0
    end = seen.good & (towards > curve.s[-1] - 1.5 * width)
    taper = median(edges.width[end]) if at_tip and end.sum() > 3 else width
    outwards, reach = (0.0, 0.3 * width + 2.0) if fine else (0.4 * width, 1.3 * width)
    # The end of a taper may lie farther on, and be sharper than it seemed.
    for far, soft in ((reach, blur), (1.3 * width, blur), (2.0 * width, state.blur)):
        found = find_tip(
            grey, curve, expected=expected + outwards, width=min(width, taper),
            blur=soft, reach=far, contrast=edges.contrast, middle=middle, face=face,
            sign=sign, fine=fine,
        )  # fmt: skip
        if found is not None:
            return found
    return None


def _face_seen(state: State, walls: Walls) -> float:
    """Return how much of the end face is seen: a right angle on, it is a side wall."""
    points, theta = state.curve.at(np.array([state.last]))
    wall, _ = walls(points, theta + 0.5 * np.pi, state.width)
    return max(float(wall[0]), 0.0)


def _to_end_of_face(tip: EndFace, state: State, seen: Seen, walls: Walls) -> EndFace:
    """Move the tip to where the end face ends, which is lighter where it is seen.

    A right angle on, the end face is a side wall. A step fitted to a blurred profile
    takes the half level of what is blurred once more.
    """
    points, theta = state.curve.at(np.array([tip.s]))
    wall, gap = walls(points, theta + 0.5 * np.pi, state.width)
    wall = np.maximum(wall, 0.0)
    top = np.array([median(seen.edges.inner[seen.good])])
    away = 2.0 * np.abs(gap) + 0.5 * wall
    paper, level = top + tip.rise, np.zeros(1)
    light = wall_light(wall, away, state.width, top, paper, level, MIRRORED, SKY)
    blur = math.sqrt(2.0) * (tip.blur or state.blur)
    short = short_of_end(wall, light, blur, float(wall[0]), 1.0)
    return tip._replace(s=tip.s + float(short[0]))


def _first(lines: ClampLines, face_px: float) -> float:
    """Return the arc length where the rod begins, as it is seen."""
    line = lines.face or lines.front
    if line is None:
        raise LostError(
            "no_clamp", "it is not seen where the rod leaves the clamp: light its front"
        )
    if lines.front is None:
        return line.s
    apart = lines.front.s - line.s
    if lines.is_dark_face(apart, face_px):
        return lines.front.s  # what has edges between them is no rod
    return line.s if abs(apart) > APART_PX else between(line.s, lines.front.s, lines)


def _border_crossing(grey: Image, curve: Curve) -> float:
    """Return the arc length at which the axis enters the picture."""
    s = np.arange(-80.0, min(80.0, curve.s[-1]), 0.25)
    points, _ = curve.at(s)
    height, width = grey.shape
    inside = (
        (points[:, 0] >= 0.0) & (points[:, 0] <= width - 1.0)
        & (points[:, 1] >= 0.0) & (points[:, 1] <= height - 1.0)
    )  # fmt: skip
    outside = np.flatnonzero(~inside)
    return (
        float(s[outside[-1] + 1]) if outside.size and outside[-1] + 1 < len(s) else 0.0
    )
