"""Parts of rods on both sides of what hides a stretch of them."""

from __future__ import annotations

import numpy as np

from magbend.vision.find import across
from magbend.vision.find.binarise import Binary
from magbend.vision.find.candidate import Candidate

WIDTH_PX, LENGTH_PX, GAP_PX = 4.0, 40.0, 8.0


def part(x: float, y: float) -> Candidate:
    """Return a straight part of a rod that begins there, in px."""
    points = np.column_stack([x + np.arange(LENGTH_PX + 1.0), np.full(41, y)])
    return Candidate(
        points_px=points, width_px=WIDTH_PX, length_px=LENGTH_PX, root="free",
        contacts=0, ratio=0.2,
    )  # fmt: skip


def test_many_parts_are_joined_with_few_pairs_tried(monkeypatch):
    """Only parts whose ends are near are tried: a mesh of n parts costs no n^3."""
    tried = []
    joined = across._joined
    monkeypatch.setattr(
        across, "_joined", lambda *pair: tried.append(1) or joined(*pair)
    )
    rows = 40.0 * np.arange(20) + 20.0
    parts = [part(x, y) for x in (20.0, 20.0 + LENGTH_PX + GAP_PX, 200.0) for y in rows]
    dark = np.full((900, 300), 0.2, np.float32)
    binary = Binary(
        mask=np.ones(dark.shape, np.uint8), ratio=dark, factor=1, inverted=False,
        dark=0.2, threshold=0.5,
    )  # fmt: skip
    lengths = sorted(item.length_px for item in across.joined(parts, binary))
    assert lengths == [LENGTH_PX] * 20 + [2.0 * LENGTH_PX + GAP_PX] * 20
    assert len(tried) <= len(parts)
