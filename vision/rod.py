"""Find the rod among dark things: a long thin one that grows from a fat one.

The clamp may be as black as the rod, so shape tells them apart, not grey value: what
survives an opening with a disc wider than the rod is clamp (or magnet), what it removes
and is long for its width is rod. A geodesic distance from the root orders the
rod's pixels, and the centres of its level sets are the start curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ..core.jit import njit
from .binarise import Binary
from .robust import median

Array = NDArray[np.float64]
Mask = NDArray[np.uint8]
Root = Literal["clamp", "border", "free"]

LEAST_SLENDERNESS = 6.0
"""Shortest rod, in widths."""

LEAST_SHARE = 0.2
"""Shortest rod beside another long thin thing, over the length of that."""

_HALVED = 8
"""Bins of log width from one width to half of it."""

_GRAIN = 1.5
"""Half width under which a thing may be noise."""

_PAD = 40
"""How far things are carried past the border of the picture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """Something long and thin, in pixels of the photograph.

    Parameters
    ----------
    points_px : ndarray, shape (n, 2)
        Start curve (x, y) from root to tip.
    width_px, length_px : float
        Rough width and length.
    root : {"clamp", "border", "free"}
        What it grows from.
    contacts : int
        Separate places where it touches something fat or the border.
    ratio : float
        Light on it relative to the background.
    """

    points_px: Array
    width_px: float
    length_px: float
    root: Root
    contacts: int
    ratio: float

    @property
    def slenderness(self) -> float:
        """Length over width."""
        return self.length_px / self.width_px


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
    contours, tree = cv2.findContours(
        binary.mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE
    )
    if tree is None:
        return []
    links = np.reshape(np.asarray(tree, dtype=np.int32), (-1, 4))
    found: list[Candidate] = []
    least = 0.04 * max(binary.mask.shape)
    for index in range(len(contours)):
        if links[index, 3] >= 0:
            continue
        x, y, w, h = cv2.boundingRect(contours[index])
        if max(w, h) < least:
            continue
        roi = _fill(contours, links, index, (x, y, w, h))
        found.extend(_thin_parts(roi, (x, y), binary))
    found.sort(key=lambda item: -item.length_px)
    return found


def _fill(
    contours: object,
    tree: NDArray[np.int32],
    index: int,
    box: tuple[int, int, int, int],
) -> Mask:
    """Draw one thing with a frame of 1 px; slits (glare) are closed, holes stay."""
    x, y, w, h = box
    roi = np.zeros((h + 2, w + 2), np.uint8)
    offset = (1 - x, 1 - y)
    cv2.drawContours(roi, contours, index, 1, cv2.FILLED, offset=offset)  # type: ignore[call-overload]
    child = int(tree[index, 2])
    while child >= 0:
        hole = contours[child]  # type: ignore[index]
        area = cv2.contourArea(hole)
        if 2.0 * area > 5.0 * cv2.arcLength(hole, closed=True):
            cv2.drawContours(roi, contours, child, 0, cv2.FILLED, offset=offset)  # type: ignore[call-overload]
        child = int(tree[child, 0])
    return roi


def _thin_parts(roi: Mask, origin: tuple[int, int], binary: Binary) -> list[Candidate]:
    """Return the thin parts of a thing: of the commonest width, or grown from that."""
    depth = _edge_distance(roi, origin, binary)
    ridge = _ridge(np.ascontiguousarray(depth))
    common, thinner = _half_widths(ridge)
    found = _of_width(roi, depth, common, origin, binary) if common else []
    if not found and common < _GRAIN:
        # Grains of noise along the edges of something wide may outnumber the rod.
        common, thinner = _half_widths(ridge[ridge >= _GRAIN])
        found = _of_width(roi, depth, common, origin, binary) if common else []
    if not thinner:
        return found
    # A bar that reaches far into the picture is long and thin itself, but the clamp of
    # a thinner one that grows from it.
    longest = max((item.length_px for item in found), default=0.0)
    palest = max((item.ratio for item in found), default=1.0)
    grown = [
        item
        for item in _of_width(roi, depth, thinner, origin, binary)
        if item.root == "clamp"
        and item.length_px > LEAST_SHARE * longest
        and item.ratio < palest + 0.1
    ]
    return grown or found


def _of_width(
    roi: Mask, depth: NDArray[np.float32], half: float, origin: tuple[int, int],
    binary: Binary,
) -> list[Candidate]:  # fmt: skip
    """Return the parts of a thing that are about `half` wide to either side."""
    reach = 1.5 * half + 1.0
    fat = _near((depth > reach).view(np.uint8), reach + 1.0)
    thin = roi & ~fat & 1
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
        candidate = _trace(piece, fat[window], depth[window], place, half, binary)
        if candidate is not None:
            found.append(candidate)
    return found


def _edge_distance(
    roi: Mask, origin: tuple[int, int], binary: Binary
) -> NDArray[np.float32]:
    """Return the distance to the paper; the border of the picture is no paper."""
    height, width = binary.mask.shape
    x, y = origin
    h, w = roi.shape[0] - 2, roi.shape[1] - 2
    padded = roi.copy()
    if x == 0:
        padded[:, 0] = padded[:, 1]
    if y == 0:
        padded[0] = padded[1]
    if x + w == width:
        padded[:, -1] = padded[:, -2]
    if y + h == height:
        padded[-1] = padded[-2]
    before_x, before_y = _PAD * (x == 0), _PAD * (y == 0)
    after_x, after_y = _PAD * (x + w == width), _PAD * (y + h == height)
    grown = cv2.copyMakeBorder(
        padded, before_y, after_y, before_x, after_x, cv2.BORDER_REPLICATE
    )
    depth = np.asarray(cv2.distanceTransform(grown, cv2.DIST_L2, 5))
    height, width = roi.shape
    inside = depth[before_y : before_y + height, before_x : before_x + width]
    inside[[0, -1]] = 0.0
    inside[:, [0, -1]] = 0.0
    return np.asarray(inside, dtype=np.float32)


def _near(core: Mask, reach: float) -> Mask:
    """Mark what is within `reach` of a mask."""
    near = np.zeros_like(core)
    x, y, w, h = cv2.boundingRect(core)
    if w == 0:
        return near
    margin = int(reach) + 2
    x0, y0 = max(x - margin, 0), max(y - margin, 0)
    window = (slice(y0, y + h + margin), slice(x0, x + w + margin))
    away = cv2.distanceTransform(1 - core[window], cv2.DIST_L2, 5)
    near[window] = away <= reach
    return near


def _half_widths(ridge: NDArray[np.float32]) -> tuple[float, float]:
    """Return the half widths that long and thin parts of the medial axis share.

    First the commonest for its width, then the commonest of much thinner ones; 0 where
    there is none long enough.
    """
    if ridge.size < 8:
        return 0.0, 0.0
    bins = np.floor(np.log(ridge) / 0.09).astype(int)
    lowest = int(bins.min())
    bins -= lowest
    near = np.convolve(np.bincount(bins), [1, 1, 1, 1, 1], mode="same")
    width = np.exp(0.09 * (lowest + np.arange(len(near))))
    score = near / np.sqrt(width)
    best = int(np.argmax(score))
    common = median(ridge[np.abs(bins - best) <= 2])
    below = best - _HALVED
    if below <= 0:
        return common, 0.0
    second = int(np.argmax(score[:below]))
    if near[second] < 2.0 * LEAST_SLENDERNESS * width[second]:
        return common, 0.0
    return common, median(ridge[np.abs(bins - second) <= 2])


@njit(cache=True)
def _ridge(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the depths that no neighbour exceeds by more than 0.6.

    The outermost pixels are a frame.
    """
    height, width = depth.shape
    found = np.empty(height * width, dtype=np.float32)
    count = 0
    for i in range(1, height - 1):
        above, row, below = depth[i - 1], depth[i], depth[i + 1]
        for j in range(1, width - 1):
            if row[j] < np.float32(0.9):
                continue
            most = row[j] + np.float32(0.6)
            # One of the first four exceeds nearly every pixel that is none.
            if (
                row[j - 1] <= most and row[j + 1] <= most
                and above[j] <= most and below[j] <= most
                and above[j - 1] <= most and above[j + 1] <= most
                and below[j - 1] <= most and below[j + 1] <= most
            ):  # fmt: skip
                found[count] = row[j]
                count += 1
    return found[:count]


def _trace(
    piece: Mask,
    fat: Mask,
    depth: NDArray[np.float32],
    place: tuple[int, int],
    half: float,
    binary: Binary,
) -> Candidate | None:
    area = int(piece.sum())
    if area < 4.0 * LEAST_SLENDERNESS * half * half:
        return None
    touching, contacts = _contact(piece, _grown(fat))
    at_border, border_contacts = _contact(piece, _border(piece.shape, place, binary))
    root: Root = "free"
    seeds = None
    if contacts:
        root, seeds = "clamp", touching
    elif border_contacts:
        root, seeds = "border", at_border
    curve = _level_sets(piece, seeds, half)
    if curve is None:
        return None
    steps = np.hypot(*np.diff(curve, axis=0).T)
    length = float(steps.sum()) + (2.0 if root == "free" else 1.0) * half
    width = max(2.0 * half, 1.0)
    if length < LEAST_SLENDERNESS * width:
        return None
    ridge = piece.astype(bool) & (depth > 0.6 * half)
    y, x = np.nonzero(ridge)
    light = binary.ratio[
        np.clip(y + place[1], 0, binary.ratio.shape[0] - 1),
        np.clip(x + place[0], 0, binary.ratio.shape[1] - 1),
    ]
    f = binary.factor
    return Candidate(
        points_px=(curve + np.array(place) + 0.5) * f - 0.5,
        width_px=width * f,
        length_px=length * f,
        root=root,
        contacts=contacts + border_contacts,
        ratio=median(light) if light.size else 1.0,
    )


def _contact(piece: Mask, other: Mask) -> tuple[Mask, int]:
    """Return the pixels of one place where two masks meet, and how many there are."""
    both = piece & other
    if not both.any():
        return both, 0
    places, labels = cv2.connectedComponents(_grown(both))
    return both & (labels == 1), places - 1


def _grown(mask: Mask) -> Mask:
    """Grow a mask by two pixels."""
    return np.asarray(cv2.dilate(mask, np.ones((5, 5), np.uint8)), dtype=np.uint8)


def _border(shape: tuple[int, ...], place: tuple[int, int], binary: Binary) -> Mask:
    """Mark the outermost pixels of the picture inside a window."""
    height, width = binary.mask.shape
    inside = np.zeros(shape, np.uint8)
    rows = np.arange(shape[0]) + place[1]
    columns = np.arange(shape[1]) + place[0]
    inside[(rows <= 0) | (rows >= height - 1)] = 1
    inside[:, (columns <= 0) | (columns >= width - 1)] = 1
    return inside


def _level_sets(piece: Mask, seeds: Mask | None, half: float) -> Array | None:
    """Return the centres of the geodesic level sets, shape (n, 2), root to tip."""
    smooth = piece
    if half >= 3.0:
        size = 2 * int(0.35 * half) + 1
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
        smooth = np.asarray(cv2.morphologyEx(piece, cv2.MORPH_OPEN, kernel), np.uint8)
        if seeds is not None:
            smooth = smooth | (piece & seeds)
    smooth = np.ascontiguousarray(smooth, dtype=np.uint8)
    if seeds is None:
        first = np.argmax(smooth)
        far = np.zeros_like(smooth)
        far.flat[first] = 1
        distance = _geodesic(smooth, far)
        seeds = np.zeros_like(smooth)
        seeds.flat[int(np.argmax(distance))] = 1
    distance = _geodesic(smooth, np.ascontiguousarray(seeds & smooth))
    step = max(1.0, half)
    top = float(distance.max())
    if top < 4.0 * step:
        return None
    sums = np.zeros((int(top / step) + 1, 3))
    _sum_sets(distance, step, sums)
    count = sums[:, 0]
    if np.any(count == 0):
        return None
    curve = sums[:, 1:] / count[:, None]
    return curve[:-1] if count[-1] < 0.5 * median(count) else curve


@njit(cache=True)
def _sum_sets(distance: NDArray[np.float32], step: float, sums: Array) -> None:
    """Add up number, x and y of the pixels of each level set."""
    height, width = distance.shape
    for i in range(height):
        for j in range(width):
            if distance[i, j] >= 0.0:
                k = int(distance[i, j] / step)
                sums[k, 0] += 1.0
                sums[k, 1] += j
                sums[k, 2] += i


@njit(cache=True)
def _geodesic(mask: Mask, seeds: Mask) -> NDArray[np.float32]:
    """Distance from the seeds inside the mask (8 neighbours); -1 where unreached."""
    height, width = mask.shape
    distance = np.full((height, width), -1.0, dtype=np.float32)
    size = height * width + 1
    queue = np.empty(size, dtype=np.int64)
    waiting = np.zeros(height * width, dtype=np.uint8)
    head, tail = 0, 0
    for i in range(height):
        for j in range(width):
            if seeds[i, j] and mask[i, j]:
                distance[i, j] = 0.0
                queue[tail] = i * width + j
                waiting[i * width + j] = 1
                tail += 1
    while head != tail:
        place = queue[head]
        head = (head + 1) % size
        waiting[place] = 0
        i, j = place // width, place % width
        for di in range(-1, 2):
            for dj in range(-1, 2):
                k, m = i + di, j + dj
                if k < 0 or m < 0 or k >= height or m >= width or mask[k, m] == 0:
                    continue
                step = 1.0 if di == 0 or dj == 0 else 1.41421356
                new = distance[i, j] + np.float32(step)
                old = distance[k, m]
                if old < 0.0 or new < old - 1e-4:
                    distance[k, m] = new
                    spot = k * width + m
                    if waiting[spot] == 0:
                        waiting[spot] = 1
                        queue[tail] = spot
                        tail = (tail + 1) % size
    return distance
