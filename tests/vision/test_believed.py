"""Of two measurements of one photograph, the one that there is less against."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.vision.extraction.believed import better
from magbend.vision.measurement import Measurement

SMOOTH, ROUGH = ("shadow",), ("shadow", "rough_edges", "direction_doubtful")


def line(length_px, flags):
    """Return what was measured of a rod, 20 px wide, along one line."""
    x = np.linspace(100.0, 100.0 + length_px, 50)
    return Measurement(
        status="ok", flags=flags, points={"x_px": x, "y_px": np.full(50, 80.0)},
        length_px=length_px, width_px=20.0,
    )  # fmt: skip


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(
    ("longer_px", "flags"), [(1.0, SMOOTH), (40.0, ROUGH)], ids=["ends", "end missed"]
)
def test_a_rod_with_less_doubt_is_believed_unless_an_end_of_it_is_missed(
    longer_px, flags, swapped
):
    both = line(400.0, SMOOTH), line(400.0 + longer_px, ROUGH)
    assert better(*both[:: -1 if swapped else 1]).flags == flags
