"""Where a rod begins and ends: its clamp, the border or another face, and its tip."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..curve.curve import Curve
from ..curve.robust import median
from ..picture.sample import nearest_pixels
from .clamp import (
    ClampLines,
    between,
    doubt_px,
    find_clamp,
)
from .clamp_light import STEP, clamp_light
from .crossings import EndFace
from .levels import clear_of
from .sides_end import sides_end
from .state import LostError, Root, Seen, State
from .tip import find_tip
from .wall_light import MIRRORED, SKY, Walls, short_of_end, wall_light

Array = NDArray[np.float64]
Image = NDArray[np.float32]

APART_PX = 2.0
"""The two lines at a clamp tell different things if they are farther apart."""

_SURE_PX = 0.5
"""Deviation of where the rod is seen to end above which its own light is asked."""

_SHADED, _LAG_PX = 0.5, 1.5
"""Contrast in the clamp's shade over that on paper; and half of what a rise is taken
over."""


def find_ends(
    grey: Image, state: State, seen: Seen, root: Root, sign: float,
    walls: Walls | None, *, fine: bool,
) -> tuple[EndFace, ClampLines | None, float]:  # fmt: skip
    """Return the tip, the lines at a clamp, and the arc length where the rod begins.

    Those that are not `fine` only tell where to look next.
    """
    curve, width = state.curve, state.width
    outwards = 0.0 if fine else 0.4 * width
    reach = 0.3 * width + 2.0 if fine else 1.3 * width
    edges = seen.edges
    near = seen.good & (seen.s > curve.s[-1] - 3.0 * width)
    middle = median(edges.middle[near]) if near.any() and not fine else 0.0
    end = seen.good & (seen.s > curve.s[-1] - 1.5 * width)
    taper = median(edges.width[end]) if end.sum() > 3 else width
    face = None if walls is None else _face_seen(state, walls)
    blur = state.tip_blur or state.blur
    # The end of a taper may lie farther on, and be sharper than it seemed.
    for far, soft in ((reach, blur), (1.3 * width, blur), (1.3 * width, state.blur)):
        tip = find_tip(
            grey, curve, expected=state.last + outwards, width=min(width, taper),
            blur=soft, reach=far, contrast=seen.edges.contrast, middle=middle,
            face=face, sign=sign, fine=fine,
        )  # fmt: skip
        if tip is not None:
            break
    if tip is None:
        raise LostError(
            "no_tip", "the free end of the rod shows no edge: lay plain paper there"
        )
    state.tip_blur = tip.blur
    if walls is not None and fine:
        tip = _to_end_of_face(tip, state, seen, walls)
    if root == "border":
        return tip, None, _border_crossing(grey, curve)
    if root == "free":
        return tip, None, _other_end(grey, state, seen, sign, outwards, reach)
    lines = ClampLines(face=None, front=None)
    rough = state.from_front and not fine
    if rough or state.clamp_light is None:
        lines = _clamp_lines(grey, state, seen, sign, fine=fine)
    if rough:
        lines = _nearer(lines, _in_own_light(state, fine=fine), state)
    elif not (lines.face and doubt_px(lines.face) < _SURE_PX):
        lines = _with_own(lines, state, fine=fine)
    if not rough and state.clamp_light is None and state.plain is not None:
        lines = _with_front(lines, state.plain, state, seen, fine=fine)
    state.clamp_blur = lines.blur
    return tip, lines, _first(lines, state.face_px)


def _clamp_lines(
    grey: Image, state: State, seen: Seen, sign: float, *, fine: bool
) -> ClampLines:
    """Return the lines at a clamp, in paper's light or that of its shade."""
    end = sides_end(_light_of(grey, state), state.curve, state.first, state.width)
    contrast = seen.edges.contrast
    lines = _lines_near(grey, state, end, contrast, sign, fine=fine)
    if lines.face is not None and lines.front is None and end is not None:
        # One that is askew may need more room; what lies there else is its shade's.
        return _lines_near(grey, state, end, contrast, sign, fine=fine, roomy=True)
    if lines.face is None and lines.front is None:
        return _lines_near(grey, state, end, _SHADED * contrast, sign, fine=fine)
    return lines


def _lines_near(
    grey: Image, state: State, end: float | None, contrast: float, sign: float, *,
    fine: bool, roomy: bool = False,
) -> ClampLines:  # fmt: skip
    """Return the lines near where a rod's sides end, if known: its own lanes' closely.

    Its front may be seen behind its end, as on a chamfer, or as far ahead as its foot.
    """
    expected, reach, ahead = state.first, 0.3 * state.width + 3.0, 0.0
    if end is None and not fine:
        reach = 1.3 * state.width
    on_rod = reach
    if end is not None:
        ahead = state.foot_px
        if fine:
            near = clear_of(max(state.blur, state.clamp_blur)) + _LAG_PX
            on_rod = min(reach, near)
            ahead += 0.0 if roomy else on_rod - reach
        if not fine or abs(end - expected) > on_rod:
            expected = end
    return find_clamp(
        grey, state.curve, expected=expected, width=state.width,
        blur=state.clamp_blur or state.blur, contrast=contrast, reach=reach,
        on_rod=on_rod, ahead=ahead, optics=state.optics, sign=sign, fine=fine,
    )  # fmt: skip


def _light_of(grey: Image, state: State) -> Callable[[Array], Array]:
    """Return what tells the light at places: of a mix, that of all its colours."""
    if state.plain is not None and state.photo is not None:
        return state.photo.light_at
    return lambda places: nearest_pixels(grey, places)[..., None]


def _in_own_light(state: State, *, fine: bool) -> ClampLines:
    """Return the lines at a clamp that the light which shows the rod does not show."""
    light, expected, reach = state.clamp_light, state.first, 0.3 * state.width + 3.0
    if light is None and state.photo is not None:
        light = clamp_light(state.photo, state.curve, state.first, state.width)
        state.clamp_light = light
        if light is not None:
            expected, reach = light.root, 0.8 * state.width + 3.0
    if light is None:
        return ClampLines(face=None, front=None)

    def seen_in(image: Image) -> ClampLines:
        return find_clamp(
            image, state.curve, expected=expected, width=state.width,
            blur=state.clamp_blur or state.blur, contrast=STEP, reach=reach,
            optics=state.optics, fine=fine,
        )  # fmt: skip

    return ClampLines(face=seen_in(light.rod).face, front=seen_in(light.paper).front)


def _with_own(lines: ClampLines, state: State, *, fine: bool) -> ClampLines:
    """Return lines where the rod is not clearly seen to end, or its own light's.

    A front alone may be the upper edge of a chamfer, or the border of a shade; what no
    step fits is no end.
    """
    none = lines.face is None and lines.front is None
    if not (fine or none):
        return lines
    own = _in_own_light(state, fine=fine)
    if none:
        return own
    state.clamp_light = None
    steps = [line for line in (lines.face, lines.front) if line and line.rise > 0.0]
    if not steps and _doubt_px(own) < _doubt_px(lines):
        return own
    if own.face is None or own.face.rise == 0.0:
        return lines
    front = lines.front
    if front and not front.bulge and own.face.s < front.s - APART_PX:
        return lines  # what ends behind a straight front may be of the clamp
    return ClampLines(
        face=min(lines.face, own.face, key=doubt_px),
        front=min(lines.front, own.front, key=doubt_px),
    )


def _doubt_px(lines: ClampLines) -> float:
    return min(doubt_px(lines.face), doubt_px(lines.front))


def _nearer(plain: ClampLines, own: ClampLines, state: State) -> ClampLines:
    """Return the lines that are nearer to a front which is known; keep their light."""

    def away(lines: ClampLines) -> float:
        seen = [line.s for line in (lines.face, lines.front) if line is not None]
        return min((abs(s - state.first) for s in seen), default=np.inf)

    if away(own) < away(plain):
        return own
    state.clamp_light = None
    return plain


def _with_front(
    lines: ClampLines, plain: Image, state: State, seen: Seen, *, fine: bool
) -> ClampLines:
    """Return lines with the front of a clamp that has no colour of its own.

    Its own shade, which is seen in plain light, may lie ahead of it, but not here.
    """
    if lines.face is None or lines.front is not None:
        return lines
    found = find_clamp(
        plain, state.curve, expected=lines.face.s, width=state.width, blur=state.blur,
        contrast=_SHADED * seen.edges.contrast, reach=APART_PX, fine=fine,
    )  # fmt: skip
    front = found.front
    if front is None or abs(front.s - lines.face.s) > APART_PX:
        return lines
    return replace(lines, front=front)


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
    if is_face(apart, face_px):
        return lines.front.s  # what has edges between them is no rod
    return line.s if abs(apart) > APART_PX else between(line.s, lines.front.s, lines)


def is_face(apart: float, face_px: float) -> bool:
    """Whether what lies between the two lines at a clamp is its face, seen obliquely.

    It may be as dark as the rod, which then seems to end at the face's top edge.
    """
    return APART_PX < apart < APART_PX + face_px


def _other_end(
    grey: Image, state: State, seen: Seen, sign: float, outwards: float, reach: float
) -> float:
    back = state.curve.reversed()
    end = find_tip(
        grey, back, expected=outwards - state.first, width=state.width,
        blur=state.blur, reach=reach, contrast=seen.edges.contrast, sign=sign,
    )  # fmt: skip
    if end is None:
        raise LostError("no_tip", "an end of the rod has no edge")
    return -end.s


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
