"""Choose the rod among the long thin things of a picture, or say why none is chosen."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..edge.state import LostError
from ..picture.photo import Photo
from .binarise import Binary, binarise, rebinarise
from .candidate import Candidate
from .ground import (
    FAINT,
    LEVELS,
    View,
    best_view,
    ground_distance,
    other_ground,
)
from .held import as_held, held
from .lines import beyond_lines, without_lines
from .rivals import TOLD, alike, are_halves, bound, standing_out, too_many
from .rod import LEAST_SHARE, NO_ROD, find_candidates
from .rod_colour import distance_from
from .shadeless import shades
from .sought import Sought
from .things import Levels, Thing, find_things, without_strokes
from .two_colours import in_parts

Array = NDArray[np.float64]

_DARK = 0.25
"""Light of a rod, over the paper's, that no mix of colours tells much better."""

_Finder = Callable[[Photo, Sought, Levels], Iterator[Candidate]]

_GROUNDS = 3
"""Grounds that things are told from, one after the other."""

_ASKED = 6
"""Things of which it is asked whether a clamp holds them that their light hides."""

LEAST_LENGTH, LEAST_HELD = 0.08, 0.045
"""Shortest rod, in diagonals of the picture: below that it is dust, hair or print; and
where nothing else is one, shortest that a clamp holds."""


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
        rod = _choose(photo, binary, sought)
    except LostError as lost:
        # Glints make grey paper look like a dark board.
        if lost.flag != "no_rod" or sought.invert is not None or not binary.inverted:
            raise
        dark = binarise(photo.grey, invert=False)
        if dark is None:
            raise
        binary, rod = dark, _choose(photo, dark, sought)
    view = View(grey=photo.grey, sign=-1.0 if binary.inverted else 1.0)
    if rod.ratio < _DARK or binary.inverted:
        return rod, view
    coloured = best_view(photo, rod.points_px, rod.width_px)
    return rod, view if coloured.mix is None else coloured


def likely_rods(photo: Photo, sought: Sought) -> Iterator[Candidate]:
    """Yield what may be the rod as all levels of lightness and colour together show it.

    Each is for the case that those before it could not be measured, and then has them
    as rivals. On squared paper things are looked for without its lines first; and what
    is short last of all, if there are not several that are long.

    Parameters
    ----------
    photo : Photo
        The photograph.
    sought : Sought
        What is known of the rod.

    Raises
    ------
    LostError
        If another one is as likely, with the axes of what was seen.
    """
    several: LostError | None = None
    seen: list[Array] = []
    for find, picture, unlined in _looks(photo):
        if find is _short and several is not None:
            break
        if seen and unlined is not None:  # a line is no rod either
            picture = Levels(beyond_lines(picture.binary, unlined))
        try:
            for rod in find(photo, sought, picture):
                if any(rod.points_px is points for points in seen):
                    continue
                if rod.root == "clamp" or not seen:
                    told = not seen and several is None
                    yield replace(rod, rivalled=rod.rivalled or not told)
                seen.append(rod.points_px)
        except LostError as lost:
            several = several or lost
    if several is not None:
        raise several


def _looks(photo: Photo) -> Iterator[tuple[_Finder, Levels, Binary | None]]:
    """Yield what looks for rods, and where: a ground, and that without its lines."""
    seen: list[tuple[Levels, Binary | None]] = []
    for ground in _grounds(photo):
        unlined = without_lines(ground)
        pictures = [(Levels(ground), unlined)]
        if unlined is not None:
            pictures.insert(0, (Levels(unlined), None))
        for picture in pictures:
            yield _in_picture, *picture
        seen += pictures
    for picture in seen:
        yield _short, *picture


def _grounds(photo: Photo) -> Iterator[Binary]:
    """Yield how far pixels are from the ground, and from others that are as large."""
    known = [ground_distance(photo)]
    yield known[0]
    while len(known) < _GROUNDS:
        other = other_ground(photo, known)
        if other is None:
            return
        yield other
        known.append(other)


def _in_picture(photo: Photo, sought: Sought, picture: Levels) -> Iterator[Candidate]:
    """Yield what may be the rod in one picture; else the next that a clamp holds."""
    things = _things(photo, sought, picture, LEVELS, LEAST_LENGTH) or _things(
        photo, sought, picture, FAINT, LEAST_LENGTH
    )
    if things:
        rod = standing_out(_without_shades(photo, things), sought)
        yield rod
        for other in things:  # the same without its streak, or with its shade
            if not other.covers(rod) and other.best.lies_on(rod):
                yield other.best
        if rod.root == "clamp" and rod.contacts == 1:
            return
    clamped = _held(photo, things)  # what leads through the picture is a cable
    if clamped:
        yield standing_out(_without_shades(photo, clamped), sought)


def _short(photo: Photo, sought: Sought, picture: Levels) -> Iterator[Candidate]:
    """Yield what is short in one picture, and which a clamp holds."""
    things = _things(photo, sought, picture, LEVELS, LEAST_HELD)
    clamped = _held(photo, things)
    if clamped:
        yield standing_out(_without_shades(photo, clamped), sought)


def seen_best(photo: Photo, sought: Sought, rod: Candidate) -> tuple[Candidate, View]:
    """Return a rod that touches nothing, and the light in which it stands out.

    Raises
    ------
    LostError
        If it is not held at one end alone, or not as light as was told.
    """
    if rod.root == "free" and sought.clamp != "none":
        rod = as_held(photo, rod)
    view = best_view(photo, _accept(rod).points_px, rod.width_px)
    rod, view = in_parts(photo, rod, view)
    lighter = view.sign < 0.0
    if sought.invert is not None and view.mix is None and lighter != sought.invert:
        raise LostError(
            "no_rod",
            f"the only thing like a rod is {'lighter' if lighter else 'darker'} than "
            "its ground, and you said the contrary",
        )
    return rod, view


def _things(
    photo: Photo,
    sought: Sought,
    picture: Levels,
    away: tuple[float, ...],
    least: float,
) -> list[Thing]:
    """Return what is long and thin, and about as was told, the likeliest first."""
    binary = picture.binary
    least_px = least * binary.factor * float(np.hypot(*binary.mask.shape))
    things = find_things(picture, [1.0 - level for level in away], least_px)
    things = without_strokes(things)
    if sought.colour:
        _compare_colours(photo, sought.colour, things)
    return [thing for thing in things if sought.fits(thing.best)] or things


def _held(photo: Photo, things: list[Thing]) -> list[Thing]:
    """Return those that a clamp holds at one end, and nothing at the other.

    Else those of the likeliest that one holds which their own light does not show: as
    half of the levels at which they float see them; at the last, shade may join them.
    """
    found = [
        thing
        for thing in things
        if thing.best.root == "clamp" and thing.best.contacts == 1
    ]
    for thing in [] if found else things[:_ASKED]:
        floating = [item for item in thing.seen if not item.contacts]
        whole = held(photo, floating[len(floating) // 2]) if floating else None
        if whole is not None:
            found.append(replace(thing, seen=[whole, *floating]))
    return found


def _without_shades(photo: Photo, things: list[Thing]) -> list[Thing]:
    """Leave out what is known for a shade, and note what may be one."""
    known, likely = shades(photo, [thing.best for thing in things])
    return [
        replace(thing, is_shade=bool(shade))
        for thing, out, shade in zip(things, known, likely, strict=True)
        if not out
    ]


def _compare_colours(photo: Photo, colour: str, things: list[Thing]) -> None:
    """Note how far the colour of each thing, as seen at each level, is from one."""
    distance = distance_from(photo, colour)
    for thing in things:
        thing.seen = [
            replace(item, off_colour=distance(item.points_px)) for item in thing.seen
        ]


def _choose(photo: Photo, binary: Binary, sought: Sought) -> Candidate:
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
        rod = min([rod, *alike(rod, rods)], key=sought.misfit)
        # What shows only where less is dark may be the clamp's shade: seek its root.
        if best is not None and not best.lies_on(rod):
            continue
        others = [
            other
            for other in alike(rod, rods)
            if bound(other) <= bound(rod) and not sought.tells(rod, other, TOLD)
        ]
        if others:
            raise too_many([rod, *others], sought)
        rod = replace(rod, halved=any(are_halves(rod, other) for other in rods))
        if rod.root != "free":
            return _accept(rod)
        best = best or rod
    if best is None:
        raise LostError("no_rod", NO_ROD)
    return best if sought.clamp == "none" else as_held(photo, best)


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
