"""Find the rod among dark things: a long thin one that grows from a fat one.

The clamp may be as black as the rod, so shape tells them apart, not grey value: what
survives an opening with a disc wider than the rod is clamp (or magnet), what it removes
and is long for its width is rod. A geodesic distance from the root orders the
rod's pixels, and the centres of its level sets are the start curve.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from .across import joined, leads_to
from .binarise import Binary
from .candidate import Candidate
from .discs import near_core, places_of
from .trace import traced

Array = NDArray[np.float64]
Mask = NDArray[np.uint8]

LEAST_SLENDERNESS = 6.0
"""Shortest rod, in widths."""

NO_ROD = (
    "nothing in the picture is long and thin like a rod, "
    f"{LEAST_SLENDERNESS:.0f} times as long as wide or more"
)

LEAST_SHARE = 0.2
"""Shortest rod beside another long thin thing, over the length of that."""

_FINE = 3.0
"""Half width under which the commonest width may be that of a hair or a line."""

_HAIR = 0.35
"""Width of what grows from the tip of a rod in a clamp, over the rod's, if a hair."""

_ASLANT = 2.5
"""Widths of a rod that hide a wire beneath it, at most."""

_BIN, _HALVED = 0.09, 8
"""Width of a bin of log width, and bins from one width to half of it."""

_MESHES = 100
"""Holes of a thing above which it is squared paper, and whatever lies on it."""

_SPECKS, _EVERY = 0.15, 4
"""Pixels at which something begins or ends along a row, over all, above which there are
but specks: the lines of squared paper are 0.03 and their most 0.07. One of so many rows
tells."""

_GRAIN = 1.5
"""Half width under which a thing may be noise."""


def find_candidates(binary: Binary) -> list[Candidate]:
    """Return the long thin things of a picture, longest first.

    Parameters
    ----------
    binary : Binary
        The mask.

    Returns
    -------
    list of Candidate
        Possibly empty.
    """
    if _is_noise(binary.mask):
        return []
    contours, tree = cv2.findContours(
        binary.mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE
    )
    if tree is None:
        return []
    links = np.reshape(np.asarray(tree, dtype=np.int32), (-1, 4))
    found: list[Candidate] = []
    least = 0.04 * max(binary.mask.shape)
    for index in np.flatnonzero(links[:, 3] < 0).tolist():
        if len(contours[index]) < least:
            continue  # its points are as many as it is long, at least
        x, y, w, h = cv2.boundingRect(contours[index])
        if max(w, h) < least:
            continue
        holes = _holes(contours, links, index)
        if len(holes) > _MESHES:
            continue
        roi = _fill(contours, index, holes, (x, y, w, h))
        found.extend(_thin_parts(roi, (x, y), binary))
    found = [item for item in joined(found, binary) if not item.is_in_net]
    found.sort(key=lambda item: -item.length_px)
    return found


def _is_noise(mask: Mask) -> bool:
    """Whether a mask is full of specks, among which nothing is long and thin."""
    rows = mask[::_EVERY]
    return (
        cv2.countNonZero(cv2.absdiff(rows[:, 1:], rows[:, :-1])) > _SPECKS * rows.size
    )


def _holes(contours: object, tree: NDArray[np.int32], index: int) -> list[int]:
    """Return the holes of a thing; its slits (glare) are none."""
    found, child = [], int(tree[index, 2])
    while child >= 0:
        hole = contours[child]  # type: ignore[index]
        if 2.0 * cv2.contourArea(hole) > 5.0 * cv2.arcLength(hole, closed=True):
            found.append(child)
        child = int(tree[child, 0])
    return found


def _fill(
    contours: object, index: int, holes: list[int], box: tuple[int, int, int, int]
) -> Mask:
    """Draw one thing, with its holes and a frame of 1 px."""
    x, y, w, h = box
    roi = np.zeros((h + 2, w + 2), np.uint8)
    offset = (1 - x, 1 - y)
    cv2.drawContours(roi, contours, index, 1, cv2.FILLED, offset=offset)  # type: ignore[call-overload]
    for hole in holes:
        cv2.drawContours(roi, contours, hole, 0, cv2.FILLED, offset=offset)  # type: ignore[call-overload]
    return roi


def _thin_parts(roi: Mask, origin: tuple[int, int], binary: Binary) -> list[Candidate]:
    """Return the thin parts of a thing: of the commonest width, or grown from that."""
    depth = _edge_distance(roi, origin, binary)
    places = places_of(roi)
    ridge = _ridge(depth, places)

    def of_width(half: float) -> list[Candidate]:
        return _of_width(roi, depth, places, half, origin, binary) if half else []

    common, thinner, thicker = _half_widths(ridge)
    found = of_width(common)
    if not found and common < _GRAIN:
        # Grains of noise along the edges of something wide may outnumber the rod.
        common, thinner, thicker = _half_widths(ridge[ridge >= _GRAIN])
        found = of_width(common)
    if common < _FINE:
        found = _without_hairs(found, of_width(thicker))
    elif len(found) > 1:
        found = _without_wires(found, of_width(thicker))
    # A bar that reaches far into the picture is long and thin itself, but the clamp of
    # a thinner one that grows from its end.
    longest = max((item.length_px for item in found), default=0.0)
    palest = max((item.ratio for item in found), default=1.0)
    grown = [
        item
        for item in of_width(thinner)
        if item.root == "clamp"
        and item.length_px > LEAST_SHARE * longest
        and item.ratio < palest + 0.1
        and not any(_touches(item, bar) and not _from_end(item, bar) for bar in found)
    ]
    return grown or found


def _without_hairs(found: list[Candidate], thicker: list[Candidate]) -> list[Candidate]:
    """Leave out what grows from the side of a rod: hairs and lines that touch it."""
    rods = [
        rod
        for rod in thicker
        if (rod.root != "free" or any(_touches(item, rod) for item in found))
        and not any(_from_end(item, rod) or _is_end(item, rod) for item in found)
    ]
    return [
        *(item for item in found if not any(_touches(item, rod) for rod in rods)),
        *rods,
    ]


def _without_wires(found: list[Candidate], thicker: list[Candidate]) -> list[Candidate]:
    """Leave out what crosses a thicker rod: it goes on at the other side of that."""
    for rod in thicker:
        beside = [item for item in found if _touches(item, rod)]
        wires = [
            item
            for item in beside
            if any(
                leads_to(item.points_px[::-1], other.points_px, _ASLANT * rod.width_px)
                for other in beside
            )
        ]
        if wires:
            found = [
                rod,
                *(item for item in found if not any(item is wire for wire in wires)),
            ]
    return found


def _from_end(one: Candidate, other: Candidate) -> bool:
    """Whether a thing grows from the free end of another, which is its clamp then."""
    away = np.hypot(*(other.points_px[-1] - one.points_px[0]))
    return (
        bool(away < 1.5 * other.width_px)
        and one.length_px > LEAST_SHARE * other.length_px
        and (other.root == "border" or one.width_px > _HAIR * other.width_px)
    )


def _is_end(one: Candidate, other: Candidate) -> bool:
    """Whether a thing is the outer part of another: a rod with its clamp."""
    return bool(np.hypot(*(other.points_px[-1] - one.points_px[-1])) < other.width_px)


def _touches(one: Candidate, other: Candidate) -> bool:
    """Whether a thing grows from beside another."""
    return other.away(one.points_px[0]) < 1.5 * other.width_px


def _of_width(
    roi: Mask, depth: NDArray[np.float32], places: NDArray[np.intp], half: float,
    origin: tuple[int, int], binary: Binary,
) -> list[Candidate]:  # fmt: skip
    """Return the parts of a thing that are about `half` wide to either side."""
    reach = 1.5 * half + 1.0
    fat = near_core(depth, places, reach, reach + 1.0)
    thin = (roi > fat).view(np.uint8)
    parts, _ = cv2.findContours(thin, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    found = []
    for part in parts:
        if len(part) < 8.0 * half:
            continue
        x, y, w, h = cv2.boundingRect(part)
        # One frame pixel stays around, so that contacts show.
        x0, y0 = max(x - 2, 0), max(y - 2, 0)
        window = (slice(y0, y + h + 2), slice(x0, x + w + 2))
        piece = np.zeros(thin[window].shape, np.uint8)
        cv2.drawContours(piece, [part], 0, 1, cv2.FILLED, offset=(-x0, -y0))
        piece &= thin[window]
        place = (origin[0] - 1 + x0, origin[1] - 1 + y0)
        found.extend(traced(piece, fat[window], place, half, binary))
    return [
        item for item in joined(found, binary) if item.slenderness > LEAST_SLENDERNESS
    ]


def _edge_distance(
    roi: Mask, origin: tuple[int, int], binary: Binary
) -> NDArray[np.float32]:
    """Return the distance to the paper; the border of the picture is no paper."""
    height, width = binary.mask.shape
    (x, y), (h, w) = origin, (roi.shape[0] - 2, roi.shape[1] - 2)
    inside = (
        slice(int(y == 0), h + 2 - int(y + h == height)),
        slice(int(x == 0), w + 2 - int(x + w == width)),
    )
    depth = np.zeros(roi.shape, np.float32)
    cv2.distanceTransform(roi[inside], cv2.DIST_L2, 5, depth[inside])  # in place
    return depth


@njit(cache=True)
def _half_widths(ridge: NDArray[np.float32]) -> tuple[float, float, float]:
    """Return the half widths that long and thin parts of the medial axis share.

    First the commonest for its width, then the commonest of much thinner and of much
    thicker ones; 0 where there is none long enough.
    """
    if ridge.size < 8:
        return 0.0, 0.0, 0.0
    bins = np.floor(np.log(ridge) / _BIN).astype(np.int64)
    lowest = bins.min()
    bins -= lowest
    count = np.zeros(bins.max() + 1)
    for k in bins:
        count[max(k - 2, 0) : k + 3] += 1.0
    width = np.exp(_BIN * (lowest + np.arange(count.size)))
    score = count / np.sqrt(width)
    best = np.argmax(score)
    apart = np.abs(np.arange(count.size) - best) > _HALVED
    score[~apart | (count < 2.0 * LEAST_SLENDERNESS * width)] = 0.0
    found = np.zeros(3)
    found[0] = np.median(ridge[np.abs(bins - best) <= 2])
    for k in range(1, 3):
        side = score[:best] if k == 1 else score[best:]
        if side.size and side.max() > 0.0:
            other = np.argmax(side) + (0 if k == 1 else best)
            found[k] = np.median(ridge[np.abs(bins - other) <= 2])
    return found[0], found[1], found[2]


@njit(cache=True)
def _ridge(depth: NDArray[np.float32], places: NDArray[np.intp]) -> NDArray[np.float32]:
    """Return the depths that no neighbour exceeds by more than 0.6.

    It is 0 but at places, given by flat indices; the outermost pixels are a frame.
    """
    deep, width = depth.ravel(), depth.shape[1]
    found = np.empty(places.size, np.float32)
    count = 0
    for p in places:
        most = deep[p] + np.float32(0.6)
        # One of the first four exceeds nearly every pixel that is none.
        if (
            deep[p - 1] <= most and deep[p + 1] <= most
            and deep[p - width] <= most and deep[p + width] <= most
            and deep[p - width - 1] <= most and deep[p - width + 1] <= most
            and deep[p + width - 1] <= most and deep[p + width + 1] <= most
        ):  # fmt: skip
            found[count] = deep[p]
            count += 1
    return found[:count]
