"""Which lines are the clamp's: those where the rod's sides end, in whatever light.

A line at a clamp is sought in the light that shows the rod, in the colours that tell
the clamp from rod and paper (`clamp_light`), and for a front without a colour in plain
light. Other things have lines too: a shade's border, a chamfer, the clamp's top. Only
at the clamp do both sides of the rod end (`sides_end`); so each line is as doubtful as
it says itself and as far as it lies from there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..picture.sample import nearest_pixels
from .clamp import (
    APART_PX,
    ClampLines,
    doubt_px,
    find_clamp,
    find_face,
    find_front,
    squared,
)
from .clamp_light import STEP, clamp_light
from .crossings import EndFace
from .levels import clear_of
from .sides_end import sides_end
from .state import Seen, State

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_SURE_PX = 0.5
"""Deviation of where the rod is seen to end above which its own light is asked."""

_SHADED, _LAG_PX = 0.5, 1.5
"""Contrast in the clamp's shade over that on paper; and half of what a rise is taken
over."""


def clamp_lines(
    grey: Image, state: State, seen: Seen, sign: float, *, fine: bool
) -> ClampLines:
    """Return the lines at a clamp, each in the light that tells it best.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        The light that shows the rod.
    state : State
        The rod as it is known, and the clamp's light where all colours show its front.
    seen : Seen
        The rod's edges.
    sign : float
        -1 for a light rod.
    fine : bool
        Whether to fit lines; else they only tell where to look next.
    """
    sides = sides_end(_light_of(grey, state), state.curve, state.first, state.width)
    end = None if sides is None else sides.s
    lines = _in_rods_light(grey, state, end, seen.edges.contrast, sign, fine=fine)
    if state.clamp_light is not None or not _is_sure(lines, fine=fine):
        near = state.first if state.from_front and not fine else end
        own = _in_own_light(state, fine=fine)
        lines = nearest(lines, own, near, state.foot_px, fine=fine)
    if lines.face is not None and lines.front is None and state.plain is not None:
        lines = _with_plain_front(lines.face, state.plain, state, seen, fine=fine)
    return replace(lines, end=end if sides is not None and sides.is_clear else None)


def _is_sure(lines: ClampLines, *, fine: bool) -> bool:
    """Whether the rod is clearly seen to end; a front alone may be a shade's border."""
    if fine:
        return doubt_px(lines.face) < _SURE_PX
    return lines.face is not None or lines.front is not None


def nearest(
    lines: ClampLines, own: ClampLines, end: float | None, ahead: float, *, fine: bool
) -> ClampLines:
    """Return of each line the one that is least in doubt, and far from the end.

    Its front may be seen so far ahead of that. What no step fits is no end.
    """
    face = _least((lines.face, own.face), end, 0.0, fine=fine)
    front = _least((lines.front, own.front), end, ahead, fine=fine)
    if face is not None and front is not None and not front.bulge:
        behind = front.s - face.s
        if end is not None:
            behind = _away(face, end, 0.0) - _away(front, end, ahead)
        if behind > APART_PX:  # what ends behind a straight front may be of the clamp
            face = None
    return squared(face, front, fine=fine)


def _least(
    lines: Sequence[EndFace | None], end: float | None, ahead: float, *, fine: bool
) -> EndFace | None:
    """Return the line that is least in doubt and away from the end."""

    def off(line: EndFace) -> tuple[bool, float]:
        away = 0.0 if end is None else _away(line, end, ahead)
        return fine and line.rise <= 0.0, math.hypot(doubt_px(line), away)

    return min((one for one in lines if one is not None), key=off, default=None)


def _away(line: EndFace, end: float, ahead: float) -> float:
    """Return how far a line is from the end, or from as far ahead as it may be, px."""
    return max(end - line.s, line.s - end - ahead, 0.0)


def _in_rods_light(
    grey: Image, state: State, end: float | None, contrast: float, sign: float, *,
    fine: bool,
) -> ClampLines:  # fmt: skip
    """Return the lines near where a rod's sides end, if known: its own lanes' closely.

    Its front may be seen behind its end, as on a chamfer, or as far ahead as its foot.
    Without a line in paper's light there may be one in the clamp's shade.
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
        if not fine or abs(end - expected) > on_rod:
            expected = end
    close = ahead + on_rod - reach
    known: dict[str, Any] = {
        "width": state.width, "blur": state.clamp_blur or state.blur, "sign": sign,
        "expected": expected, "reach": reach, "fine": fine,
    }  # fmt: skip
    lines = ClampLines(face=None, front=None)
    for light in (contrast, _SHADED * contrast):
        lines = find_clamp(
            grey, state.curve, contrast=light, on_rod=on_rod, ahead=close,
            optics=state.optics, **known,
        )  # fmt: skip
        if lines.face is not None or lines.front is not None:
            break
    if lines.face is not None and lines.front is None and close < ahead:
        # One that is askew may need more room; what lies there else is its shade's.
        front = find_front(grey, state.curve, contrast=contrast, ahead=ahead, **known)
        return squared(lines.face, front, fine=fine)
    return lines


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
        if light is not None:
            expected, reach = light.root, 0.8 * state.width + 3.0
    if light is None:
        return ClampLines(face=None, front=None)
    known: dict[str, Any] = {
        "width": state.width, "blur": state.clamp_blur or state.blur, "contrast": STEP,
        "expected": expected, "reach": reach, "fine": fine,
    }  # fmt: skip
    front = find_front(light.paper, state.curve, **known)
    face = find_face(light.rod, state.curve, front=front, optics=state.optics, **known)
    return squared(face, front, fine=fine)


def _with_plain_front(
    face: EndFace, plain: Image, state: State, seen: Seen, *, fine: bool
) -> ClampLines:
    """Return lines with the front of a clamp that has no colour of its own.

    Its own shade, which is seen in plain light, may lie ahead of it, but not here.
    """
    front = find_front(
        plain, state.curve, expected=face.s, width=state.width, blur=state.blur,
        contrast=_SHADED * seen.edges.contrast, reach=APART_PX, fine=fine,
    )  # fmt: skip
    if front is None or abs(front.s - face.s) > APART_PX:
        return ClampLines(face=face, front=None)
    return ClampLines(face=face, front=front)
