"""Choose the rod among the long thin things of a picture, or say why none is chosen."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..edge.state import LostError
from ..picture.photo import Photo
from .binarise import Binary, binarise, rebinarise
from .candidate import Candidate
from .ground import FAINT, LEVELS, View, best_view, ground_distance
from .lines import without_lines
from .rod import LEAST_SHARE, find_candidates
from .rod_colour import ALIKE, distance_from
from .shadeless import shades
from .things import Thing, find_things, without_strokes

Array = NDArray[np.float64]
Clamp = Literal["auto", "none"]

_NO_CLAMP = (
    "no clamp is seen at either end of the rod, nor a border of the picture: give the "
    "clamp another colour than the ground; for a rod that floats freely say --free "
    "(from Python: clamp='none')"
)
_SIZE = 1.6
"""Factor by which a thing may be larger or smaller than the rod that is sought."""

_TOLD, _HINTED = 0.2, 0.1
"""By how much better, as a logarithm, a rod of known size must fit than another: so
that there is no doubt, and so that it is measured in doubt."""

_AS_CLEAR = 0.6
"""Share of the levels, and of the worth, at which another thing is as likely."""

_AS_LONG = 0.6
"""Length over the rod's from which another thing cannot be told from it; a shorter one
is a doubt."""

_DARK = 0.25
"""Light of a rod, over the paper's, that no mix of colours tells much better."""

_SHADE, _BESIDE = 0.65, 8.0
"""Contrast of a shade over that of its rod, at most; and how far it may lie from the
rod, in widths."""

_HALVES = 2.5
"""Distance between the axes of two halves of a rod that a streak of gloss parts, at
most, in widths of the wider, as far as that is known yet."""

_RIM_PX = 5.0
"""Width of a half that may be too thin to be seen as dark as it is."""

_SHOWN = 6
"""Things that are drawn on the overlay of a refusal."""

_PALER = 0.25
"""How much lighter than the rod, of the paper's light, a thing is that is no rod."""

LEAST_LENGTH = 0.08
"""Shortest rod, in diagonals of the picture: below that it is dust, hair or print."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sought:
    """What is known of a rod before its picture is looked at.

    Parameters
    ----------
    invert : bool or None
        Whether it is lighter than the ground; None looks for itself.
    clamp : {"auto", "none"}
        ``none`` takes a rod that floats freely too.
    width_px, length_px : float
        About how wide and long it is seen; 0 where that is not known.
    colour : str or None
        Its colour on white paper, ``#rrggbb``.
    """

    invert: bool | None = None
    clamp: Clamp = "auto"
    width_px: float = 0.0
    length_px: float = 0.0
    colour: str | None = None

    def fits(self, rod: Candidate) -> bool:
        """Whether a candidate has about the size and colour of the rod."""
        if rod.off_colour > ALIKE:
            return False
        width, length = rod.width_px, rod.length_px
        return (not self.width_px or 1 / _SIZE < width / self.width_px < _SIZE) and (
            not self.length_px or 1 / _SIZE < length / self.length_px < _SIZE
        )

    def misfit(self, rod: Candidate) -> float:
        """How far a candidate's size is from the rod's, as logarithms; 0 if unknown."""
        pairs = ((rod.width_px, self.width_px), (rod.length_px, self.length_px))
        return sum(abs(math.log(seen / known)) for seen, known in pairs if known)

    def tells(self, rod: Candidate, other: Candidate, by: float) -> bool:
        """Whether it is this candidate and not another, by so much of its size."""
        return self.misfit(rod) + by < self.misfit(other)


def find_rod(photo: Photo, sought: Sought) -> tuple[Candidate, View]:
    """Return the rod as one level of lightness shows it: quick, and enough for most.

    Raises
    ------
    LostError
        If no rod is seen there, or none that stands out.
    """
    binary = binarise(photo.grey, invert=sought.invert)
    if binary is None:
        raise LostError("no_rod", "nothing stands out from the background")
    try:
        rod = _choose(binary, sought)
    except LostError as lost:
        # Glints make grey paper look like a dark board.
        if lost.flag != "no_rod" or sought.invert is not None or not binary.inverted:
            raise
        dark = binarise(photo.grey, invert=False)
        if dark is None:
            raise
        binary, rod = dark, _choose(dark, sought)
    view = View(grey=photo.grey, sign=-1.0 if binary.inverted else 1.0)
    if rod.ratio < _DARK or binary.inverted:
        return rod, view
    coloured = best_view(photo, rod.points_px, rod.width_px)
    return rod, view if coloured.mix is None else coloured


def search_rod(photo: Photo, sought: Sought) -> tuple[Candidate, View]:
    """Return the rod as all levels of lightness and colour together show it.

    On squared paper that is looked for without its lines first.

    Raises
    ------
    LostError
        If there is none, or another as likely, with the axes of what was seen.
    """
    binary = ground_distance(photo)
    unlined = without_lines(binary)
    if unlined is None:
        return _search(photo, sought, binary)
    try:
        return _search(photo, sought, unlined)
    except LostError as lost:
        if lost.flag != "no_rod":
            raise
    return _search(photo, sought, binary)


def _search(photo: Photo, sought: Sought, binary: Binary) -> tuple[Candidate, View]:
    """Return the rod that the levels of one picture show."""
    least = LEAST_LENGTH * binary.factor * float(np.hypot(*binary.mask.shape))
    things = find_things(binary, [1.0 - level for level in LEVELS], least)
    if not things:
        things = find_things(binary, [1.0 - level for level in FAINT], least)
    things = without_strokes(things)
    if sought.colour:
        _compare_colours(photo, sought.colour, things)
    if sought.width_px or sought.length_px or sought.colour:
        things = [thing for thing in things if sought.fits(thing.best)] or things
    if not things:
        raise LostError("no_rod", "nothing in the picture is long and thin like a rod")
    seen = [thing.best.points_px for thing in things[:_SHOWN]]
    things = _without_shades(photo, things)
    rod = _standing_out(things, sought, seen)
    if rod.root == "free" and sought.clamp != "none":
        raise LostError("no_clamp", _NO_CLAMP, seen)
    try:
        _accept(rod)
    except LostError as lost:
        raise LostError(lost.flag, lost.reason, seen) from None
    view = best_view(photo, rod.points_px, rod.width_px)
    lighter = view.sign < 0.0
    if sought.invert is not None and view.mix is None and lighter != sought.invert:
        raise LostError(
            "no_rod",
            f"the only thing like a rod is {'lighter' if lighter else 'darker'} than "
            "its ground, and you said the contrary",
            seen,
        )
    return rod, view


def _without_shades(photo: Photo, things: list[Thing]) -> list[Thing]:
    """Leave out what is known for a shade, and note what may be one."""
    known, likely = shades(photo, [thing.best for thing in things])
    return [
        replace(thing, is_shade=bool(shade))
        for thing, out, shade in zip(things, known, likely, strict=True)
        if not out
    ]


def _standing_out(things: list[Thing], sought: Sought, seen: list[Array]) -> Candidate:
    """Return the rod among the things of a picture, the likeliest first."""
    own = [
        thing
        for thing in things
        if not thing.is_shade
        and not any(_is_shade(thing.best, other.best) for other in things)
    ]
    held = [thing for thing in own if thing.best.root != "free"]
    first = own[0]
    if held and sought.clamp != "none" and held[0].worth > _AS_CLEAR * first.worth:
        first = held[0]
    first = min(
        [first, *_all_rivals(first, own)], key=lambda item: sought.misfit(item.best)
    )
    rivals = [
        other
        for other in _all_rivals(first, things)
        if not sought.tells(first.best, other.best, _TOLD)
    ]
    halved = any(_are_halves(first.best, other.best) for other in things)
    rod = replace(first.best, rivalled=bool(rivals), halved=halved)
    alike = [
        other.best
        for other in rivals
        if not other.is_shade
        and (_leaves(rod) or not _leaves(other.best))
        and other.best.length_px > _AS_LONG * rod.length_px
        and not sought.tells(rod, other.best, _HINTED)
    ]
    if alike:
        raise _too_many([rod, *alike], seen, sought)
    return rod


def _leaves(thing: Candidate) -> bool:
    """Whether a thing is held, or goes on, at one end and leaves the picture there."""
    return thing.contacts > 1 and (thing.leaves or thing.root == "border")


def _compare_colours(photo: Photo, colour: str, things: list[Thing]) -> None:
    """Note how far the colour of each thing, as seen at each level, is from one."""
    distance = distance_from(photo, colour)
    for thing in things:
        thing.seen = [
            replace(item, off_colour=distance(item.points_px)) for item in thing.seen
        ]


def _is_shade(one: Candidate, rod: Candidate) -> bool:
    """Whether a thing lies along another, paler than it: its shade on the paper."""
    if (1.0 - one.ratio) > _SHADE * (1.0 - rod.ratio):
        return False
    alike = 0.4 < one.length_px / rod.length_px < 2.0
    away = [rod.away(point) for point in one.points_px[:: len(one.points_px) // 8 + 1]]
    return alike and max(away) < _BESIDE * rod.width_px


def _are_halves(one: Candidate, other: Candidate) -> bool:
    """Whether two things lie so close along each other as halves of one rod do."""
    alike = 0.8 < one.length_px / other.length_px < 1.25
    if not alike or one.points_px is other.points_px or one.lies_on(other):
        return False
    rim = min(one.width_px, other.width_px) < _RIM_PX
    if not rim and (_is_shade(one, other) or _is_shade(other, one)):
        return False  # halves are equally dark, as far as they are resolved
    away = np.array([one.away(point) for point in other.points_px])
    close = _HALVES * max(one.width_px, other.width_px)
    return bool(np.quantile(away, 0.9) < close)


def _too_many(rods: list[Candidate], seen: list[Array], sought: Sought) -> LostError:
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
        if _rivals(first, other) and not _is_shade(other.best, first.best)
    ]


def _rivals(first: Thing, other: Thing) -> bool:
    """Whether another thing could as well be the rod: of its size, held as it is."""
    one, two = first.best, other.best
    return (
        not two.lies_on(one)
        and not _are_halves(one, two)
        and 0.5 < two.width_px / one.width_px < 2.0
        and two.length_px > 0.4 * one.length_px
        and (one.root != "clamp" or two.root == "clamp")
        and len(other.seen) > _AS_CLEAR * len(first.seen)
        and other.worth > _AS_CLEAR * first.worth
    )


def _choose(binary: Binary, sought: Sought) -> Candidate:
    """Return the rod; a paler clamp shows only at higher levels."""
    best: Candidate | None = None
    least = LEAST_LENGTH * binary.factor * float(np.hypot(*binary.mask.shape))
    for level in _levels(binary):
        at_level = binary if level == binary.threshold else rebinarise(binary, level)
        rods = [item for item in find_candidates(at_level) if item.length_px > least]
        rods = [item for item in rods if sought.fits(item)] or rods
        if not rods:
            continue
        rod = _likeliest(rods)
        rod = min([rod, *_alike(rod, rods)], key=sought.misfit)
        others = [
            other
            for other in _alike(rod, rods)
            if (_leaves(rod) or not _leaves(other))
            and not sought.tells(rod, other, _TOLD)
        ]
        if others:
            seen = [item.points_px for item in [rod, *others][:_SHOWN]]
            raise _too_many([rod, *others], seen, sought)
        rod = replace(rod, halved=any(_are_halves(rod, other) for other in rods))
        # What shows only where less is dark may be the clamp's shade: seek its root.
        alike = best is None or best.lies_on(rod)
        if rod.root != "free" and alike:
            return _accept(rod)
        best = best or rod
    if best is None:
        raise LostError("no_rod", "nothing in the picture is long and thin like a rod")
    if sought.clamp == "none":
        return best
    raise LostError("no_clamp", _NO_CLAMP)


def _levels(binary: Binary) -> list[float]:
    """Return the levels to try: a pale rod on a board is best told from the board."""
    first = binary.threshold
    higher = [level for level in (0.6, 0.75) if level > first + 0.05]
    return [*higher, first] if binary.inverted else [first, *higher]


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


def _alike(first: Candidate, rods: list[Candidate]) -> list[Candidate]:
    """Return what could as well be the rod, by its size and how it is held."""
    return [
        other
        for other in rods
        if other is not first
        and 0.5 < other.width_px / first.width_px < 2.0
        and other.length_px > 0.4 * first.length_px
        and other.ratio < first.ratio + _PALER
        and (first.root != "clamp" or other.root == "clamp")
        and not _are_halves(first, other)
    ]


def _accept(rod: Candidate) -> Candidate:
    if rod.contacts > 1:
        if rod.leaves:
            raise LostError(
                "touches_border",
                "the rod, or what it runs into, meets the picture's border besides its "
                "root: take the whole rod into the picture, and cover what else runs "
                "to the border",
            )
        raise LostError(
            "touches_object",
            "the rod touches another object besides its root: take that away",
        )
    return rod
