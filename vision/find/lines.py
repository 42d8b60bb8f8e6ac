"""The lines of squared paper and cutting mats, taken out of the picture searched.

They are thinner than the rod, and everywhere: of clutter, even of a scale's ticks, only
a part of the picture is full. A closing by a disc a little wider than they are leaves
what is wider. Edges are measured in the photograph itself, lines and all.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .binarise import Binary

_CODES = 250.0
"""Codes of light, over the paper's, that tell lines: closing goes by them in bytes."""

_DISCS = 3, 5, 7, 9, 13, 17
"""Diameters of discs that lines are thinner than, px of the working picture."""

_SEEN, _TILES = 0.07, 8
"""Distance from the paper of a line that matters; and tiles along either side."""

_FULL, _EVERYWHERE = 0.03, 0.44
"""Part of a tile that lines cover; and share of the tiles that have some."""

_DARKEST, _MORE = 0.9, 0.03
"""Part of the lines that is not farther from the paper than they are said to be; and
how much farther something else is."""

_LEFT = 0.12
"""Part of a tile's lines that a disc may leave: then a larger one is needed."""


def without_lines(binary: Binary) -> Binary | None:
    """Return the picture without the lines of its ground; None where it has none.

    Parameters
    ----------
    binary : Binary
        The picture; its `ratio` is 1 on the ground, and less on lines and things.
    """
    coarse = np.asarray((_CODES * binary.ratio.clip(0.0, 1.0)).astype(np.uint8))
    covered = _covered(coarse, _DISCS[-1])
    full = covered > _FULL
    if float(np.mean(full)) < _EVERYWHERE:
        return None
    for disc in _DISCS:
        taken = _covered(coarse, disc)[full] / covered[full]
        if float(np.median(taken)) > 1.0 - _LEFT:
            break
    return replace(binary, ratio=_closed(binary.ratio, disc + 2))


def beyond_lines(binary: Binary, unlined: Binary) -> Binary:
    """Return the picture with what is farther from the ground than its lines alone.

    A rod as thin as they are is left.

    Parameters
    ----------
    binary, unlined : Binary
        The picture, and the same without its lines.
    """
    taken = np.array_split((unlined.ratio - binary.ratio)[::2, ::2], _TILES)
    tiles = (tile for row in taken for tile in np.array_split(row, _TILES, axis=1))
    darkest = [
        np.quantile(tile[tile > _SEEN], _DARKEST)
        for tile in tiles
        if np.mean(tile > _SEEN) > _FULL
    ]
    lines = np.median(darkest) + _MORE  # a rod is in few of them
    alone = np.where(binary.ratio > 1.0 - lines, np.float32(1.0), binary.ratio)
    return replace(binary, ratio=np.asarray(alone, np.float32))


def _closed(ratio: NDArray[Any], disc: int) -> NDArray[Any]:
    """Return the picture without what is thinner than a disc."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (disc, disc))
    return np.asarray(cv2.morphologyEx(ratio, cv2.MORPH_CLOSE, kernel))


def _covered(coarse: NDArray[np.uint8], disc: int) -> NDArray[np.float64]:
    """Return the part of each tile that is thinner than a disc."""
    thin = (_closed(coarse, disc) - coarse > _SEEN * _CODES).astype(np.float32)
    tiles = cv2.resize(thin, (_TILES, _TILES), interpolation=cv2.INTER_AREA)
    return np.asarray(tiles, np.float64)
