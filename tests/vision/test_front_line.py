"""A clamp's front tells its direction by all of its length."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from magbend.vision.curve.curve import Curve
from magbend.vision.edge.clamp import find_clamp

WIDTH, ROOT, MIDDLE = 8.0, 60.0, 110.0


def front_of(half: float, *, corner: float = 0.0, seed: int | None = None):
    """Return the front of a clamp so wide to either side of a thin rod, px.

    With a `corner` its front goes on beyond, on one side with a slope; all with grain.
    """
    x, y = np.meshgrid(np.arange(200.0), np.arange(2.0 * MIDDLE + 1.0))
    aside = np.abs(y - MIDDLE)
    light = np.where(aside < 0.5 * WIDTH, 0.05, 0.6)
    edge = ROOT - corner * np.maximum(y - MIDDLE - half, 0.0)
    light[(x < edge) & ((aside < half) | (corner > 0.0))] = 0.3
    light = cv2.GaussianBlur(light, (0, 0), 0.8)
    if seed is not None:
        grain = np.random.default_rng(seed).normal(size=light.shape)
        light += cv2.GaussianBlur(grain, (0, 0), 1.5) * 0.15
    s = np.linspace(0.0, 120.0, 121)
    curve = Curve(
        s=s, points=np.column_stack([ROOT + 5.0 + s, np.full(121, MIDDLE)]),
        theta=np.zeros(121), kappa=np.zeros(121),
    )  # fmt: skip
    lines = find_clamp(
        light.astype(np.float32), curve, expected=-5.0, width=WIDTH, blur=0.8,
        contrast=0.55, reach=6.0,
    )  # fmt: skip
    assert lines.front is not None
    return lines.front


def test_a_wide_clamp_tells_its_direction_better_than_a_narrow_one():
    skews = [[front_of(w, seed=k).skew for w in (26.0, 90.0)] for k in range(12)]
    narrow, wide = np.sqrt(np.mean(np.square(skews), axis=0))
    assert wide < 0.4 * narrow


def test_the_direction_of_a_wide_front_is_told_as_surely_as_it_is():
    fronts = [front_of(90.0, seed=k) for k in range(24)]
    off = np.array([front.skew / front.skew_sd for front in fronts])
    assert 0.5 < np.sqrt(np.mean(off**2)) < 2.0


@pytest.mark.parametrize("corner", [0.2, 1.0])
def test_what_goes_on_beyond_a_corner_is_no_front(corner):
    assert front_of(34.0, corner=corner).skew == pytest.approx(0.0, abs=2e-3)
