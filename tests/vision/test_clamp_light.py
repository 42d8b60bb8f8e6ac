"""A clamp is seen in a light of its own, whatever shows the rod."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from magbend.vision import as_photo
from magbend.vision.curve.curve import Curve
from magbend.vision.edge.clamp_light import STEP, clamp_light
from magbend.vision.extraction.refine import refine
from magbend.vision.find.track import Start

HEIGHT, WIDE, WIDTH = 300, 560, 24.0
ROOT, TIP, Y = 150.0, 450.0, 150.0
PAPER, BOARD = (0.7, 0.7, 0.7), (0.03, 0.03, 0.035)
RED, CREAM, BLUE = (0.05, 0.04, 0.45), (0.5, 0.62, 0.66), (0.3, 0.05, 0.02)
GREY = (0.35, 0.35, 0.35)
AXIS = Curve(
    s=np.linspace(0.0, TIP - ROOT, 61),
    points=np.column_stack([np.linspace(ROOT, TIP, 61), np.full(61, Y)]),
    theta=np.zeros(61), kappa=np.zeros(61),
)  # fmt: skip


def photograph(*, ground, rod, clamp, shaded_px=0.0, top=None):
    """Return a straight rod in a clamp, its first `shaded_px` in hard shade.

    The clamp may have another colour at its top, behind a chamfer 14 px long.
    """
    y, x = np.mgrid[:HEIGHT, :WIDE].astype(float)
    light = np.ones((HEIGHT, WIDE, 3)) * ground
    body = np.clip(0.5 * WIDTH + 0.5 - np.abs(y - Y), 0.0, 1.0)
    body *= np.clip(TIP - x + 0.5, 0.0, 1.0)
    light += (np.array(rod) - light) * body[..., None]
    light *= 1.0 - 0.75 * np.clip(ROOT + shaded_px - x + 0.5, 0.0, 1.0)[..., None]
    held = np.clip(ROOT - x + 0.5, 0.0, 1.0) * (np.abs(y - Y) < 110.0) * (x > 30.0)
    light += (np.array(clamp) - light) * held[..., None]
    if top is not None:
        held *= np.clip(ROOT - 14.0 - x + 0.5, 0.0, 1.0)
        light += (np.array(top) - light) * held[..., None]
    light = cv2.GaussianBlur(light, (0, 0), 1.0)
    light += np.random.default_rng(5).normal(0.0, 0.003, light.shape)
    pixels = 255.0 * (1.055 * np.clip(light, 0.004, 1.0) ** (1 / 2.4) - 0.055)
    return as_photo(np.rint(pixels).astype(np.uint8))


def at(image, x):
    return float(np.nanmedian(image[int(Y) - 3 : int(Y) + 4, int(x) - 3 : int(x) + 4]))


@pytest.mark.parametrize(
    ("ground", "rod", "clamp"),
    [(PAPER, RED, BLUE), (BOARD, CREAM, BLUE), (PAPER, RED, CREAM)],
)
def test_no_shade_on_the_rod_is_taken_for_its_clamp(ground, rod, clamp):
    photo = photograph(ground=ground, rod=rod, clamp=clamp, shaded_px=60.0)
    seen = clamp_light(photo, AXIS, 70.0, WIDTH)
    assert seen is not None
    assert seen.root == pytest.approx(0.0, abs=0.25 * WIDTH)
    lit = at(seen.rod, ROOT + 90.0)
    assert at(seen.rod, ROOT - 30.0) - lit == pytest.approx(STEP, rel=0.2)
    assert abs(at(seen.rod, ROOT + 30.0) - lit) < 0.3 * STEP


@pytest.mark.parametrize("clamp", [PAPER, GREY])
def test_nor_is_paper_behind_a_rod_its_clamp_lit_or_shaded(clamp):
    photo = photograph(ground=PAPER, rod=RED, clamp=clamp)
    assert clamp_light(photo, AXIS, 10.0, WIDTH) is None


@pytest.mark.parametrize("coloured", [False, True])
def test_a_clamp_is_found_far_behind_the_root_of_a_rough_curve(coloured):
    """Three widths, as where mask and profiles lost the rod in the clamp's shade."""
    photo = photograph(ground=PAPER, rod=RED, clamp=BLUE)
    rough = AXIS.s > 75.0
    cut = Curve(
        s=AXIS.s[rough] - AXIS.s[rough][0], points=AXIS.points[rough],
        theta=AXIS.theta[rough], kappa=AXIS.kappa[rough],
    )  # fmt: skip
    start = Start(curve=cut, width=WIDTH, rough=False, blur=1.0)
    colours = photo if coloured else None
    found = refine(photo.grey, start, root="clamp", sign=1.0, photo=colours)
    begin, _ = found.fit.curve.at(np.zeros(1))
    assert begin[0] == pytest.approx((ROOT, Y), abs=0.3)


def test_a_rod_as_light_as_a_chamfer_does_not_end_at_its_upper_edge():
    """Grey light shows no end of the rod, and the upper edge is the steepest one."""
    orange, lilac, white = (0.02, 0.2, 0.4), (0.6, 0.2, 0.25), (0.95, 0.95, 0.95)
    photo = photograph(ground=BOARD, rod=orange, clamp=lilac, top=white)
    start = Start(curve=AXIS, width=WIDTH, rough=False, blur=1.0)
    found = refine(photo.grey, start, root="clamp", sign=-1.0, photo=photo)
    begin, _ = found.fit.curve.at(np.zeros(1))
    assert begin[0] == pytest.approx((ROOT, Y), abs=0.5)
