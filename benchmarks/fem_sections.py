"""Meshes of a rod's section: quadratic quadrilaterals of nine nodes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

GAUSS, WEIGHT = np.polynomial.legendre.leggauss(3)
CORE = 0.55
"""Size of a round section's core, a square with round sides, in radii."""


def line(x):
    """Return quadratic shape functions on [-1, 1] and their slopes."""
    return (
        np.array([x * (x - 1) / 2, 1 - x * x, x * (x + 1) / 2]),
        np.array([x - 0.5, -2 * x, x + 0.5]),
    )


def section_mesh(section, fine):
    """Return places (n, 2) of a section's nodes and its elements (m, 9).

    `fine` is 1 or 2: elements from a rectangle's middle to its sides, or from a round
    one's core (a tube's bore) to its rim.
    """
    w, h = section.width_mm / 2, section.height_mm / 2
    if section.is_round:
        cells = w * _round_cells(section.bore_mm / section.width_mm, fine)
    else:
        cells = _square_cells(w / h, fine) * [w, h]
    flat = cells.reshape(-1, 2)
    _, first, conn = np.unique(
        np.round(flat / w, 7), axis=0, return_index=True, return_inverse=True
    )
    places, conn = flat[first], conn.reshape(-1, 9)
    # Parabolas for arcs: of such a size that moments and forces bend it as the circle.
    N, _, W = plane_slopes(places, conn)
    y2 = np.einsum("gn,en->eg", N, places[conn, 0]) ** 2
    size = np.sum(W * y2) / np.sum(W) / (section.in_plane_mm4 / section.area_mm2)
    return places / np.sqrt(size), conn


def plane_slopes(places, conn):
    """Return N (9, 9) at the Gauss points, and each element's slopes and weights."""
    N, D, W = [], [], []
    for x in range(3):
        for y in range(3):
            (a, da), (b, db) = line(GAUSS[x]), line(GAUSS[y])
            N.append(np.outer(a, b).ravel())
            D.append(np.stack([np.outer(da, b).ravel(), np.outer(a, db).ravel()], -1))
            W.append(WEIGHT[x] * WEIGHT[y])
    N, D, W = np.array(N), np.array(D), np.array(W)
    jac = np.einsum("enx,gnk->egxk", places[conn], D)
    slopes = np.einsum("gnk,egkx->egnx", D, np.linalg.inv(jac))
    return N, slopes, np.abs(np.linalg.det(jac)) * W


def _cells(place, along, across):
    """Return nodes (m, 3, 3, 2) of the quadrilaterals of a map on a grid."""
    found = []
    for a, b in pairwise(along):
        for c, d in pairwise(across):
            rows = [
                [place(u, v) for v in (c, (c + d) / 2, d)] for u in (a, (a + b) / 2, b)
            ]
            found.append(rows)
    return np.array(found)


def _square_cells(ratio, fine):
    """Cells of [-1, 1]^2, smaller toward the sides; more along a much longer side."""
    grids = []
    for longer in (ratio, 1 / ratio):
        ticks = [0.0, 1.0] if fine == 1 else [0.0, 0.62, 1.0]
        pieces = (2 if longer > 2.2 else 1) * (len(ticks) - 1)
        at = np.linspace(0, len(ticks) - 1, pieces + 1)
        half = np.interp(at, np.arange(len(ticks)), ticks)
        grids.append(np.concatenate([-half[:0:-1], half]))
    return _cells(lambda x, y: np.array([x, y]), *grids)


def _round_cells(bore, fine):
    """Cells of a ring, or of a circle: rings about a core of four."""
    inner = bore or CORE
    rings = [inner, 1.0] if fine == 1 else [inner, 0.4 * inner + 0.6, 1.0]

    def place(r, turn):
        bulge = 1 / max(abs(np.cos(turn)), abs(np.sin(turn)))
        rim = inner if bore else inner * (0.6 + 0.288 * bulge)
        q = rim + (r - inner) / (1 - inner) * (1 - rim)
        return q * np.array([np.cos(turn), np.sin(turn)])

    def core(u, v):
        """Blend the four sides of the core (Coons)."""

        def side(k, t):
            return place(inner, np.pi / 2 * (k + t) - np.pi / 4)

        blend = u * side(0, v) + (1 - u) * side(2, 1 - v)
        blend += v * side(1, 1 - u) + (1 - v) * side(3, u)
        low = (1 - u) * side(3, 0) + u * side(3, 1)
        return blend - (1 - v) * low - v * (u * side(1, 0) + (1 - u) * side(1, 1))

    found = _cells(place, rings, np.linspace(-np.pi / 4, 7 * np.pi / 4, 9))
    if bore:
        return found
    return np.concatenate([found, _cells(core, (0, 0.5, 1), (0, 0.5, 1))])
