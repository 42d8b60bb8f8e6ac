"""Choose the rod among the long thin things of a picture, or say why none is chosen."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..edge.state import LostError
from ..picture.photo import Photo
from .binarise import Binary, binarise, rebinarise
from .rod import LEAST_SHARE, Candidate, find_candidates

Clamp = Literal["auto", "none"]

_PALER = 0.25
"""How much lighter than the rod, of the paper's light, a thing is that is no rod."""

LEAST_LENGTH = 0.08
"""Shortest rod, in diagonals of the picture: below that it is dust, hair or print."""


def find_rod(
    photo: Photo, binary: Binary, invert: bool | None, clamp: Clamp
) -> tuple[Binary, Candidate]:
    """Return the rod and its mask; glints make grey paper look like a dark board."""
    try:
        return binary, _choose(binary, clamp)
    except LostError as lost:
        if lost.flag != "no_rod" or invert is not None or not binary.inverted:
            raise
        dark = binarise(photo.grey, invert=False)
        if dark is None:
            raise
        return dark, _choose(dark, clamp)


def _choose(binary: Binary, clamp: Clamp) -> Candidate:
    """Return the rod; a paler clamp shows only at higher levels."""
    best: Candidate | None = None
    least = LEAST_LENGTH * binary.factor * float(np.hypot(*binary.mask.shape))
    for level in _levels(binary):
        at_level = binary if level == binary.threshold else rebinarise(binary, level)
        rods = [item for item in find_candidates(at_level) if item.length_px > least]
        if not rods:
            continue
        rod = _likeliest(rods)
        _refuse_second(rod, rods)
        # What shows only where less is dark may be the clamp's shade: seek its root.
        alike = best is None or _is_part(best, rod)
        if rod.root != "free" and alike:
            return _accept(rod)
        best = best or rod
    if best is None:
        raise LostError("no_rod", "nothing in the picture is long and thin like a rod")
    if clamp == "none":
        return best
    raise LostError(
        "no_clamp",
        "the rod grows from no clamp and from no border of the picture; "
        "for a rod that floats freely say so with clamp none",
    )


def _levels(binary: Binary) -> list[float]:
    """Return the levels to try: a pale rod on a board is best told from the board."""
    first = binary.threshold
    higher = [level for level in (0.6, 0.75) if level > first + 0.05]
    return [*higher, first] if binary.inverted else [first, *higher]


def _is_part(one: Candidate, other: Candidate) -> bool:
    """Whether a candidate's middle lies on another."""
    middle = one.points_px[len(one.points_px) // 2]
    return other.away(middle) < max(one.width_px, other.width_px)


def _likeliest(rods: list[Candidate]) -> Candidate:
    """Return the longest that is no hair, but rather one in a clamp than another."""
    thick = [
        rod
        for rod in rods
        if not any(
            rod.width_px < 0.5 * other.width_px
            and rod.root != "clamp"
            and other.length_px > LEAST_SHARE * rod.length_px
            and other.ratio < rod.ratio + 0.1
            for other in rods
        )
    ]
    clamped = [
        rod
        for rod in thick
        if rod.root == "clamp" and rod.length_px > LEAST_SHARE * thick[0].length_px
    ]
    return clamped[0] if clamped else thick[0]


def _refuse_second(first: Candidate, rods: list[Candidate]) -> None:
    alike = [
        other
        for other in rods
        if other is not first
        and 0.5 < other.width_px / first.width_px < 2.0
        and other.length_px > 0.4 * first.length_px
        and other.ratio < first.ratio + _PALER
    ]
    if len(alike) == 1:
        raise LostError(
            "two_rods",
            "there are two things like a rod in the picture; cover one of them",
        )
    if alike:
        raise LostError(
            "no_rod",
            f"there are {len(alike) + 1} long and thin things in the picture and none "
            "that stands out as the rod",
        )


def _accept(rod: Candidate) -> Candidate:
    if rod.contacts > 1:
        flag = "touches_border" if rod.root == "border" else "touches_object"
        what = "the border of the picture" if rod.root == "border" else "another object"
        raise LostError(flag, f"the rod touches {what} besides its root")
    return rod
