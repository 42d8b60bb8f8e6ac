"""Of a rod and the hard shade along it, the rod is told by its own level."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.vision.edge.levels import clear_of
from magbend.vision.extraction.strip import PARTS, Strip
from magbend.vision.extraction.two_levels import rod_alone
from magbend.vision.find.candidate import Candidate

ROD, SHADE, STATIONS = 20.0, 10.0, 100


def strip(hidden=0):
    """Return a rod from -15 to 5 px with its shade up to 15 px; parts are not seen."""
    both = ROD + SHADE
    across = np.arange(-3.0 * both, 3.0 * both, 0.5)
    profile = np.select([np.abs(across) > 0.5 * both, across > 5.0], [0.8, 0.25], 0.1)
    light = np.repeat(profile[:, None], STATIONS, axis=1)
    light[across < -18.0, : hidden * STATIONS // PARTS] = np.nan
    s = np.arange(0.0, 4.0 * STATIONS, 4.0)
    points = np.column_stack([s, np.zeros_like(s)])
    return Strip(
        width=both, s=s, points=points, theta=np.zeros_like(s), across=across / both,
        light=light,
    )  # fmt: skip


@pytest.mark.parametrize("hidden", [0, 4])
def test_a_rod_is_found_beside_its_shade_also_at_the_border_of_the_picture(hidden):
    seen = strip(hidden)
    both = Candidate(
        points_px=seen.points, width_px=seen.width, length_px=400.0, root="clamp",
        contacts=1, leaves=False, ratio=0.2,
    )  # fmt: skip
    rod = rod_alone(seen, both, seen.width)
    unsure = clear_of(1.0)  # so near to the step nothing is looked at
    assert rod.width_px == pytest.approx(ROD, abs=unsure)
    assert rod.points_px[:, 1] == pytest.approx(np.full(STATIONS, -5.0), abs=unsure)


def test_what_lies_beyond_the_picture_is_no_rod():
    seen = strip(PARTS)
    both = Candidate(
        points_px=seen.points, width_px=seen.width, length_px=400.0, root="clamp",
        contacts=1, leaves=False, ratio=0.2,
    )  # fmt: skip
    assert rod_alone(seen, both, seen.width) is None
