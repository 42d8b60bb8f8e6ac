"""A field over the plane on patches: quick where its sources are not.

A field without curl is the gradient of a potential. Sources that move alike with the
rods of a batch (with the length, as the undeformed tip does, with the gap, or not at
all) are a group, which in a frame that moves with it is one field of two coordinates;
on each square of a grid over the places that tips can reach a polynomial is fitted to
its flux and gradient at 4 x 4 nodes. B and the gradient belong together, as they are
derivatives of one polynomial, whatever the sources and however many they are.

The error of each patch is measured at four places, and its bound is `DOUBT` times that.
Patches nearer to a source than their side are not used, so what is fitted is analytic
well beyond them. Places without a patch, or with one that is not exact enough
(`ENOUGH`), ask the sources themselves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...core.jit import njit
from ..fields import Field
from ..magnet.flux import FIRST, INLINE, PART, SUM, WIDTH, clearance, field_at
from ..scaling import may_meet, template

Array = NDArray[np.float64]

TERMS = 8
"""Powers of each coordinate."""
DEGREE = 9
"""Largest sum of two powers."""
ROUGH = 6
"""Powers of each coordinate that the gradient takes into account."""
PATCH = TERMS * TERMS
"""Numbers of a patch: the bound of its error in T (infinite: not to be used) where the
constant of the potential would be, then coefficients, powers of y running fastest."""
GROUP = 9
"""Numbers of a group: how it moves along x with the length, and along x and y with the
gap; corner of its grid in mm; patches per mm, along x, along y, and where they begin.
"""
HEAD = 2
"""Numbers before the sources: width of a field (`magnet.flux`), and how many groups."""
ENOUGH = 1e-9
"""Largest error of a patch, relative to the flux, to take it for the sources."""
DOUBT = 8.0
FINE = 10.0
"""Sides of a patch between the straight tips and the nearest source."""
LEAST = 512
"""Patches below which a batch is not worth making any."""
MOST = 2048
"""Patches, a megabyte: more would not stay at hand."""
SAMPLE = 20
"""Rods that are looked at to find how near to the sources tips are."""
SHARE = 8
"""Designs that a patch must serve: it takes 13 looks at the sources, they take 5."""
REACH = np.array([[-0.25, 1.01], [-0.95, 0.95]])
"""Of tips of rods that run in lanes, along x and y, in lengths of the rod."""

_NODES = np.linspace(-1.0, 1.0, 4)
_BETWEEN = np.array([-1.0 / 3.0, 0.5])
"""Of 1200 random fields none had more than 4.4 times the error of these four places
anywhere in a patch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Before:
    """What a batch of rods stands before, as the lanes take it, in mm and T.

    Parameters
    ----------
    numbers : ndarray
        Width and groups (`HEAD`); the field (`magnet.flux`) before a rod of no length
        at no gap, and how it changes with both; groups and patches (`GROUP`, `PATCH`).
    may_meet : bool
        Whether sources might overlap before a rod.
    """

    numbers: Array
    may_meet: bool

    def rows(self, length_mm: Array, gap_mm: Array) -> Array:
        """Return the sources before rods, shape (n, width)."""
        return _rows_of(_sources(self.numbers), length_mm, gap_mm)


def _sources(numbers: Array) -> Array:
    width = int(numbers[0])
    return numbers[HEAD : HEAD + 3 * width].reshape(3, width)


def _rows_of(sources: Array, length_mm: Array, gap_mm: Array) -> Array:
    given = np.stack([np.ones(len(length_mm)), length_mm, gap_mm], axis=1)
    rows: Array = np.einsum("nk,kw->nw", given, sources)
    return rows


@njit(**PART, fastmath={"contract"})
def _moved_alike(before, group, x, y, length, gap):  # type: ignore[no-untyped-def]
    """Return what `on_patches` does, of the group whose numbers begin at `group`."""
    scale = before[group + 5]
    nx, ny = before[group + 6], before[group + 7]
    u = x - before[group] * length - before[group + 1] * gap - before[group + 3]
    w = y - before[group + 2] * gap - before[group + 4]
    u *= scale
    w *= scale
    if not (0.0 <= u < nx and 0.0 <= w < ny):
        return math.inf, 0.0, 0.0, 0.0, 0.0, 0.0
    i = math.floor(u)
    j = math.floor(w)
    patch = int(before[group + 8]) + PATCH * (i * int(ny) + j)
    p = 2.0 * (u - i) - 1.0
    q = 2.0 * (w - j) - 1.0
    z = zy = zyy = zx = zxy = zxx = 0.0
    for n in range(TERMS - 1, -1, -1):
        a = ax = 0.0
        at = patch + n
        for m in range(min(TERMS - 1, DEGREE - n), -1, -1):
            ax = ax * p + a
            a = a * p + before[at + TERMS * m]
        zy = zy * q + z
        z = z * q + a
        zxy = zxy * q + zx
        zx = zx * q + ax
        if n < ROUGH:
            # Newton's method asks no more of the gradient.
            axx = 0.0
            for m in range(ROUGH - 1, 1, -1):
                axx = axx * p + 0.5 * m * (m - 1) * before[at + TERMS * m]
            zxx = zxx * q + axx
            if n > 1:
                zyy = zyy * q + 0.5 * n * (n - 1) * a
    f = 2.0 * scale
    off = before[patch]
    return off, f * zx, f * zy, 2.0 * f * f * zxx, f * f * zxy, 2.0 * f * f * zyy


@njit(**INLINE)
def on_patches(before, x, y, length, gap):  # type: ignore[no-untyped-def]
    """Return a bound of the error, in T, then Bx, By, Gxx, Gxy, Gyy at a tip.

    Infinite where there is no patch. Lengths are in mm.
    """
    groups = int(before[1])
    off = math.inf if groups == 0 else 0.0
    bx = by = gxx = gxy = gyy = 0.0
    for k in range(groups):
        group = HEAD + 3 * int(before[0]) + GROUP * k
        part = _moved_alike(before, group, x, y, length, gap)
        off += part[0]
        bx += part[1]
        by += part[2]
        gxx += part[3]
        gxy += part[4]
        gyy += part[5]
    return off, bx, by, gxx, gxy, gyy


@njit(cache=True, nogil=True, error_model="numpy")
def plane_table(field, x, y, out, apart):  # type: ignore[no-untyped-def]
    """Fill `out`, shape (nx, ny, 5), with B and gradient in the plane z = 0.

    `apart`, shape (nx, ny), receives the clearance of the sources.
    """
    for i in range(x.shape[0]):
        for j in range(y.shape[0]):
            apart[i, j] = clearance(field, x[i], y[j])
            b = field_at(field, x[i], y[j])
            for k in range(5):
                out[i, j, k] = b[k]


def before_rods(field: Field, length_mm: Array, gap_mm: Array) -> Before:
    """Return a field before the rods of a batch, with patches where they are worth it.

    Parameters
    ----------
    field : Field
        In the plane.
    length_mm, gap_mm : ndarray, shape (n,)
        Of the rods; the gaps count for sources that wait for them.
    """
    of = template(field)
    sources = np.stack([of.numbers, of.tip, of.gap])
    for row, values in ((1, length_mm), (2, gap_mm)):
        if len(values) and np.ptp(values) == 0.0:
            sources[0] += values[0] * sources[row]
            sources[row] = 0.0
    groups: list[Array] = []
    meet = False
    if len(length_mm):
        ends = [(np.min(values), np.max(values)) for values in (length_mm, gap_mm)]
        corners = np.array(list(product(*ends))).T
        meet = may_meet(field.sources, _rows_of(sources, *corners))
    most = min(MOST, len(length_mm) // SHARE)
    if most >= LEAST:
        some = slice(None, None, len(length_mm) // SAMPLE)
        rods = np.stack([length_mm[some], gap_mm[some]])
        groups = _patched(sources, corners, rods, most)
    head = np.array([sources.shape[1], len(groups) // 2], dtype=np.float64)
    return Before(
        numbers=np.concatenate([head, sources.ravel(), *groups]), may_meet=meet
    )


def _records(numbers: Array) -> Array:
    """Return the sources among the numbers of a field, shape (k, 17)."""
    many = numbers[0] == SUM
    end = FIRST + WIDTH * int(numbers[1]) if many else WIDTH
    return numbers[FIRST if many else 0 : end].reshape(-1, WIDTH)


def _patched(sources: Array, corners: Array, rods: Array, most: int) -> list[Array]:
    """Return groups, then their patches: about `most`, none if they would be coarse.

    `corners` and `rods`, shape (2, n), are lengths and gaps: the least and the largest,
    and those of some rods.
    """
    motions = _motions(sources)
    kinds, which = np.unique(motions, axis=0, return_inverse=True)
    groups, patches = [], []
    at = HEAD + sources.size + GROUP * len(kinds)
    for k, motion in enumerate(kinds):
        field = _chosen(sources[0], np.flatnonzero(which.ravel() == k))
        grid = _grid(field, motion, corners, rods, most // len(kinds))
        if grid is None:
            return []
        low, side, counts = grid
        groups.append(np.array([*motion, *low, 1.0 / side, *counts, at]))
        patches.append(_fitted(field, low, side, counts).ravel())
        at += patches[-1].size
    return groups + patches


def _motions(sources: Array) -> Array:
    """Return how each source moves, shape (k, 3), as the first numbers of a group."""
    numbers, tip, gap = sources
    at = FIRST if numbers[0] == SUM else 0
    rows = slice(at, at + _records(numbers).size)
    tip, gap = tip[rows].reshape(-1, WIDTH), gap[rows].reshape(-1, WIDTH)
    return np.column_stack([tip[:, 4], gap[:, 4], gap[:, 5]])


def _chosen(field: Array, which: NDArray[np.intp]) -> Array:
    """Return a field with some of its sources.

    What they point to stays in its place.
    """
    own = field.copy()
    if own[0] == SUM:
        rows = _records(field)[which]
        own[1] = len(which)
        own[FIRST : FIRST + rows.size] = rows.ravel()
    return own


def _grid(
    field: Array, motion: Array, corners: Array, rods: Array, most: int
) -> tuple[Array, float, tuple[int, int]] | None:
    """Return corner, side and counts of the patches of one group."""
    moved = np.array([[motion[0], motion[1]], [0.0, motion[2]]])
    shift = np.einsum("ik,kn->in", moved, corners)
    ends = REACH[:, :, None] * corners[0] - shift[:, None]
    low, high = ends.min(axis=(1, 2)), ends.max(axis=(1, 2))
    tips = np.stack([rods[0], 0.0 * rods[0]]) - np.einsum("ik,kn->in", moved, rods)
    apart = np.sort([_table(field, x[None], y[None])[1][0, 0] for x, y in tips.T])
    nearest = float(apart[len(apart) // 10])
    span = high - low
    side = float(span.max()) if nearest == math.inf else nearest / FINE
    side = max(side, math.sqrt(span[0] * span[1] / most))
    if side > nearest / 3.0:
        return None
    nx, ny = (max(1, math.ceil(one / side)) for one in span)
    return low, side, (nx, ny)


def _table(field: Array, x: Array, y: Array) -> tuple[Array, Array]:
    out, apart = np.empty((len(x), len(y), 5)), np.empty((len(x), len(y)))
    plane_table(field, x, y, out, apart)
    return out, apart


def _fitted(field: Array, low: Array, side: float, counts: tuple[int, int]) -> Array:
    """Return the patches of a group, shape (nx ny, 64)."""
    half = side / 2.0
    units = np.array([half, half, half**2, half**2, half**2])

    def at(steps: Array) -> tuple[Array, Array]:
        """Return field, shape (m, 5 k^2), and clearance at k^2 places of a patch."""
        nodes = [np.arange(count)[:, None] + (steps + 1.0) / 2.0 for count in counts]
        x, i = np.unique(nodes[0], return_inverse=True)
        y, j = np.unique(nodes[1], return_inverse=True)
        out, apart = _table(field, low[0] + side * x, low[1] + side * y)
        k = len(steps)
        i, j = i.reshape(-1, 1, k, 1), j.reshape(1, -1, 1, k)
        found = (out * units)[i, j].reshape(-1, k * k, 5)
        flat: Array = found.transpose(0, 2, 1).reshape(len(found), -1)
        return flat, apart[i, j].reshape(-1, k * k)

    with np.errstate(all="ignore"):  # within sources
        fit, check = _matrices()
        # Not by a matrix product: two threads of BLAS would wait for each other.
        coefficients = np.einsum("mk,ck->mc", at(_NODES)[0], fit)
        truth, _ = at(_BETWEEN)
        found = np.einsum("mc,kc->mk", coefficients, check)
        miss = (found - truth[:, : len(check)]) / half
        flux = np.abs(truth[:, : len(check)]).max(axis=1) / half
        error = DOUBT * np.abs(miss).max(axis=1) + 1e-15 * flux
        _, apart = at(np.zeros(1))
        sure = (apart[:, 0] > side) & (error < math.inf)
    error[~sure] = math.inf
    return np.column_stack([error, coefficients])


@lru_cache(maxsize=1)
def _matrices() -> tuple[Array, Array]:
    """Return what makes coefficients of a table, and B between nodes of them."""
    powers = np.arange(TERMS)
    used = np.add.outer(powers, powers).ravel()[1:] <= DEGREE
    fit = np.asarray(np.linalg.pinv(_rows(_NODES) * used), dtype=np.float64)
    return fit, _rows(_BETWEEN)[: 2 * len(_BETWEEN) ** 2]


def _rows(steps: Array) -> Array:
    """Return Bx, By, Gxx, Gxy, Gyy of each power at all pairs of steps."""
    powers = np.eye(TERMS)
    by_order = [
        np.polynomial.polynomial.polyval(
            steps, np.polynomial.polynomial.polyder(powers, d, axis=0) if d else powers
        ).T
        for d in range(3)
    ]
    rows = [
        np.einsum("am,bn->abmn", by_order[d], by_order[e]).reshape(-1, PATCH)[:, 1:]
        for d, e in ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    ]
    return np.concatenate(rows)
