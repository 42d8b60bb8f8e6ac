"""The filter of a film: where points are expected, how surely, and when lost."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.vision.extraction.motion import GATE, begun, expected, moved_on
from magbend.vision.measurement import Measurement

NOISE_PX = 0.05


def frame(places, seed=0):
    noise = NOISE_PX * np.random.default_rng(seed).standard_normal(places.shape)
    x, y = (places + noise).T
    return Measurement(status="ok", width_px=16.0, points={"x_px": x, "y_px": y})


def line(k, motion):
    """Return eleven points that swing about the first one by an angle."""
    s, angle = np.linspace(0.0, 300.0, 11), motion(k)
    return np.column_stack([s * np.cos(angle), s * np.sin(angle)])


def followed(motion, frames=40):
    """Return the largest innovation of each frame, and its stated deviation."""
    last = begun(frame(line(0, motion)))
    rows = []
    for k in range(1, frames):
        points, sd = expected(last.motion)
        found = frame(line(k, motion), seed=k)
        rows.append([np.hypot(*(found.points_px - points).T).max(), sd])
        last = moved_on(last.motion, found, found) or begun(found)
    return np.array(rows).T


@pytest.mark.parametrize(
    "motion",
    [
        lambda k: 0.3,
        lambda k: 0.3 + 0.02 * k,
        lambda k: 0.3 + 0.1 * np.cos(0.3 * k),
    ],
)
def test_what_is_measured_lies_within_what_was_expected(motion):
    off, sd = followed(motion)
    assert np.all(off < GATE * sd)
    assert np.sqrt(np.mean((off[10:] / sd[10:]) ** 2)) < 1.5


def test_a_rod_at_rest_is_soon_expected_to_a_fraction_of_a_pixel():
    _, sd = followed(lambda k: 0.3)
    assert sd[0] > 3.0
    assert sd[15] < 0.5


def test_a_jump_is_lost_and_a_new_film_begins():
    off, sd = followed(lambda k: 0.3 if k < 20 else 0.8)
    assert np.flatnonzero(off > GATE * sd).tolist() == [19]
    assert sd[20] > 3.0


def test_a_failed_frame_has_no_motion():
    assert begun(Measurement(status="failed")).motion is None


@pytest.mark.parametrize("turn", [0.0, np.pi])
def test_a_rod_that_swings_is_expected_as_well_as_one_at_rest(turn):
    """A tip that runs to and fro along an arc, by up to 22 px a frame."""

    def swing(k):
        return turn + 0.3 * np.cos(0.25 * k)

    off, still = (followed(motion)[0][12:] for motion in (swing, lambda _: turn))
    assert np.median(off) < 1.5 * np.median(still)
