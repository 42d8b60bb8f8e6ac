"""Whether another long thin thing of a picture could as well be its rod."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..edge.state import LostError
from .candidate import Candidate
from .rod import LEAST_SLENDERNESS
from .sought import Sought
from .things import Thing

Array = NDArray[np.float64]

TOLD, _HINTED = 0.2, 0.1
"""By how much better, as a logarithm, a rod of known size must fit than another: so
that there is no doubt, and so that it is measured in doubt."""

_AS_CLEAR = 0.6
"""Share of the levels, and of the worth, at which another thing is as likely."""

_AS_LONG = 0.6
"""Length over the rod's from which another thing cannot be told from it; a shorter one
is a doubt."""

_STROKE, _THINNER = 0.4, 0.5
"""Length and width over another's below which a thing is no rod beside that."""

_SHADE, _BESIDE = 0.65, 8.0
"""Contrast of a shade over that of its rod, at most; and how far it may lie from the
rod, in widths of the thinner."""

_HALVES = 2.5
"""Distance between the axes of two halves of a rod that a streak of gloss parts, at
most, in widths of the wider, as far as that is known yet."""

_EVEN, _FLUSH, _RIM_LIGHT = 0.2, 1.15, 0.15
"""How much the distance of two rims wanders along their rod, in itself; how far their
ends are from each other, in it; and how much lighter one is, of the paper's light."""

_RIM_PX = 5.0
"""Width of a half that may be too thin to be seen as dark as it is."""

_PALER = 0.25
"""How much lighter than the rod, of the paper's light, a thing is that is no rod."""


_PATTERN = 3
"""Things as likely as the rod that are a pattern, be their ends free or not."""

_SHOWN = 6
"""Things that are drawn on the overlay of a refusal."""


def standing_out(things: list[Thing], sought: Sought) -> Candidate:
    """Return the rod among the things of a picture, the likeliest first.

    Of those as likely it is the longest that is free at one end, as a rod's tip is.

    Raises
    ------
    LostError
        If another one is as likely, and about as long.
    """
    own = [
        thing
        for thing in things
        if not thing.is_shade
        and not any(is_shade(thing.best, other.best) for other in things)
    ]
    held = [thing for thing in own if thing.best.root != "free"]
    first = own[0]
    if held and sought.clamp != "none" and held[0].worth > _AS_CLEAR * first.worth:
        first = held[0]
    longer = [thing for thing in own if _outdoes(thing, first)]
    first = max(longer, key=lambda item: item.best.length_px, default=first)
    first = min(
        [first, *_all_rivals(first, own)],
        key=lambda item: (
            sought.misfit(item.best), bound(item.best), -item.best.length_px
        ),
    )  # fmt: skip
    rivals = [
        other
        for other in _all_rivals(first, things)
        if not sought.tells(first.best, other.best, TOLD)
    ]
    halved = any(are_halves(first.best, other.best) for other in things)
    rivalled = first.best.rivalled or bool(rivals or longer)
    rod = replace(first.best, rivalled=rivalled, halved=halved)
    as_likely = [
        other.best
        for other in rivals
        if not other.is_shade
        and other.best.length_px > _AS_LONG * rod.length_px
        and not sought.tells(rod, other.best, _HINTED)
    ]
    tips = [other for other in as_likely if bound(other) <= bound(rod)]
    if tips or len(as_likely) >= _PATTERN:
        raise too_many([rod, *as_likely], sought)
    return rod


def _outdoes(thing: Thing, first: Thing) -> bool:
    """Whether beside a thing another, as clear and held as well, is but a stroke."""
    one, two = first.best, thing.best
    return (
        thing.worth > _AS_CLEAR * first.worth
        and two.root == one.root
        and two.contacts == one.contacts
        and one.length_px < _STROKE * two.length_px
        and one.width_px < _THINNER * two.width_px
    )


def is_shade(one: Candidate, rod: Candidate) -> bool:
    """Whether a thing lies along another, paler than it: its shade on the paper."""
    if (1.0 - one.ratio) > _SHADE * (1.0 - rod.ratio):
        return False
    alike = 0.4 < one.length_px / rod.length_px < 2.0
    away = [rod.away(point) for point in one.points_px[:: len(one.points_px) // 8 + 1]]
    return alike and max(away) < _BESIDE * min(one.width_px, rod.width_px)


def are_halves(one: Candidate, other: Candidate) -> bool:
    """Whether two things lie so close along each other as halves of one rod do."""
    alike = 0.8 < one.length_px / other.length_px < 1.25
    if not alike or one.points_px is other.points_px or one.lies_on(other):
        return False
    rim = min(one.width_px, other.width_px) < _RIM_PX
    if not rim and (is_shade(one, other) or is_shade(other, one)):
        return False  # halves are equally dark, as far as they are resolved
    away = np.array([one.away(point) for point in other.points_px])
    close = _HALVES * max(one.width_px, other.width_px)
    return bool(np.quantile(away, 0.9) < close) or _are_rims(one, other, away)


def _are_rims(one: Candidate, other: Candidate, away: Array) -> bool:
    """Whether two things, so far apart, are both sides of one wide and bright rod.

    They leave one clamp side by side, as far apart all along, and end together.
    """
    gap = float(np.median(away))
    ends = np.hypot(*(one.points_px[[0, -1]] - other.points_px[[0, -1]]).T)
    return bool(
        one.root == other.root == "clamp"
        and one.contacts == other.contacts == 1
        and abs(one.ratio - other.ratio) < _RIM_LIGHT
        and np.ptp(np.quantile(away, [0.1, 0.9])) < _EVEN * gap
        and ends.max() < _FLUSH * gap
        and one.length_px > LEAST_SLENDERNESS * (gap + one.width_px)
    )


def too_many(rods: list[Candidate], sought: Sought) -> LostError:
    """Return what is said where several things may be the rod."""
    seen = [rod.points_px for rod in rods[:_SHOWN]]
    told = [
        name
        for name, known in (
            ("colour", sought.colour),
            ("width", sought.width_px),
            ("length", sought.length_px),
        )
        if known
    ]
    way_out = ", or say --specimen"
    if told:
        way_out = (
            f"; what you told of the rod (its {' and '.join(told)}) does not tell which"
        )
    if len(rods) == 2:
        return LostError(
            "two_rods",
            "there are two things like a rod in the picture, "
            f"{rods[0].length_px:.0f} and {rods[1].length_px:.0f} px long; cover one "
            f"of them{way_out}",
            seen,
        )
    return LostError(
        "no_rod",
        f"there are {len(rods)} long and thin things in the picture and none that "
        f"stands out as the rod; cover the others{way_out}",
        seen,
    )


def _all_rivals(first: Thing, things: list[Thing]) -> list[Thing]:
    """Return the things that could as well be the rod, and are not its shade."""
    return [
        other
        for other in things
        if _rivals(first, other) and not is_shade(other.best, first.best)
    ]


def _rivals(first: Thing, other: Thing) -> bool:
    """Whether another thing could as well be the rod: of its size, held as it is."""
    one, two = first.best, other.best
    return (
        not two.lies_on(one)
        and not are_halves(one, two)
        and _THINNER < two.width_px / one.width_px < 1.0 / _THINNER
        and two.length_px > _STROKE * one.length_px
        and (one.root != "clamp" or two.root == "clamp")
        and len(other.seen) > _AS_CLEAR * len(first.seen)
        and other.worth > _AS_CLEAR * first.worth
    )


def alike(first: Candidate, rods: list[Candidate]) -> list[Candidate]:
    """Return what could as well be the rod, by its size and how it is held."""
    return [
        other
        for other in rods
        if other is not first
        and _THINNER < other.width_px / first.width_px < 1.0 / _THINNER
        and other.length_px > _STROKE * first.length_px
        and other.ratio < first.ratio + _PALER
        and (first.root != "clamp" or other.root == "clamp")
        and not are_halves(first, other)
    ]


def bound(thing: Candidate) -> int:
    """Return how much is known against an end of a thing being free, as a tip is.

    0 where one is, 1 where either touches something, and 2 where it leaves the picture.
    """
    if thing.contacts <= 1:
        return 0
    return 2 if thing.leaves or thing.root == "border" else 1
