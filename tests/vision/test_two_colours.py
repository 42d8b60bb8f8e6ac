"""A rod of two colours is one rod, whichever of them the paper is like."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from magbend.vision import as_photo, extract
from magbend.vision.synthetic import signed_distance

WHITE, BLACK, TAN = (0.75, 0.75, 0.75), (0.03, 0.03, 0.03), (0.30, 0.55, 0.75)
RED, GREY = (0.02, 0.02, 0.36), (0.46, 0.46, 0.47)
PAPER, CLAMP = (0.42, 0.35, 0.30), (0.03, 0.10, 0.25)
WIDTH, FINE = 18, 4


def arc(length=420.0, turn_deg=60.0):
    theta = np.radians(turn_deg) * np.linspace(0.0, 1.0, 400)
    steps = length / 400 * np.column_stack([np.cos(theta), np.sin(theta)])
    return np.array([220.0, 130.0]) + np.cumsum(steps, axis=0)


def drawn(*colours, clamp=CLAMP, paper=PAPER):
    """Return a photograph of a rod of parts, as long each, in a clamp."""
    light = np.empty((500 * FINE, 800 * FINE, 3), np.float32)
    light[:] = paper
    axis = arc()
    theta = np.arctan2(*np.gradient(axis, axis=0).T[::-1])
    side = 0.5 * WIDTH * np.column_stack([-np.sin(theta), np.cos(theta)])
    cut = np.linspace(0, len(axis) - 1, len(colours) + 1).astype(int)
    for colour, first, last in zip(colours, cut, cut[1:], strict=False):
        part = slice(first, last + 1)
        outline = np.vstack([(axis + side)[part], (axis - side)[part][::-1]])
        fixed = np.rint(16.0 * (FINE * (outline + 0.5) - 0.5)).astype(int)
        cv2.fillPoly(light, [fixed.reshape(-1, 1, 2)], colour, cv2.LINE_8, 4)
    light[60 * FINE : 200 * FINE, 120 * FINE : 220 * FINE] = clamp
    light = cv2.resize(light, (800, 500), interpolation=cv2.INTER_AREA)
    light = cv2.GaussianBlur(light, (0, 0), 0.9)
    light += np.random.default_rng(3).normal(0.0, 0.004, light.shape)
    code = 255.0 * (1.055 * np.clip(light, 0.004, 1.0) ** (1 / 2.4) - 0.055)
    return as_photo(np.rint(code).astype(np.uint8))


@pytest.mark.parametrize(
    "colours",
    [(WHITE, BLACK), (BLACK, WHITE), (TAN, BLACK), (WHITE, BLACK, WHITE)],
    ids=["white-black", "black-white", "tan-black", "white-black-white"],
)
def test_both_parts_are_measured_as_one_rod(colours):
    """The tip is where both edges end, not where a colour does."""
    found = extract(drawn(*colours), None)
    assert found.ok, found.reason
    truth = arc()
    away = signed_distance(found.points_px, truth)
    assert np.sqrt(np.mean(np.square(away))) < 0.3
    assert np.hypot(*(np.array(found.tip_px) - truth[-1])) < 1.5
    assert found.width_px == pytest.approx(WIDTH, abs=1.0)


@pytest.mark.parametrize("first", [BLACK, RED], ids=["black", "red"])
def test_a_white_half_beyond_a_dark_one_is_not_lost_on_grey_paper(first):
    """Lighter than paper, it is no shade, though a mix of colours may not see it."""
    found = extract(drawn(first, WHITE, paper=GREY, clamp=(0.1, 0.1, 0.1)), None)
    assert found.ok, found.reason
    assert np.hypot(*(np.array(found.tip_px) - arc()[-1])) < 1.5
