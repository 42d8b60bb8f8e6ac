"""Only at the front of a clamp do both sides of a rod end."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from magbend.vision.curve.curve import Curve
from magbend.vision.edge.sides_end import sides_end
from magbend.vision.extraction.refine import refine
from magbend.vision.find.track import Start
from magbend.vision.picture.sample import nearest_pixels

HEIGHT, WIDE, WIDTH = 240, 480, 20.0
ROOT, TIP, Y = 140.0, 420.0, 120.0


def picture(*, rod=0.1, paper=0.7, clamp=0.3, **marks):
    """Return a straight rod that leaves a clamp, with what else lies across it.

    A `line` on the paper at x, a `shade` of the clamp as far as x, `top` of another
    light than its front, which begins 12 px behind it, and a `screw` at x on it.
    """
    y, x = np.mgrid[:HEIGHT, :WIDE].astype(float)
    light = np.full((HEIGHT, WIDE), paper)
    if "line" in marks:
        light[np.abs(x - marks["line"]) < 4.0] *= 0.4
    body = (np.abs(y - Y) < 0.5 * WIDTH) & (x < TIP)
    light[body] = rod
    if "shade" in marks:
        light[x < marks["shade"]] *= 0.35
    light[x < ROOT] = clamp
    if "top" in marks:
        light[x < ROOT - 12.0] = marks["top"]
    if "screw" in marks:
        light[(np.abs(y - Y) < 0.5 * WIDTH) & (np.abs(x - marks["screw"]) < 22.0)] = rod
    light = cv2.GaussianBlur(light, (0, 0), 1.2)
    return (light + np.random.default_rng(3).normal(0.0, 0.004, light.shape)).astype(
        np.float32
    )


def axis(first):
    """Return the axis from `first` px ahead of the root."""
    x = np.arange(ROOT + first, TIP, 4.0)
    return Curve(
        s=x - x[0], points=np.column_stack([x, np.full(len(x), Y)]),
        theta=np.zeros(len(x)), kappa=np.zeros(len(x)),
    )  # fmt: skip


def light_of(grey):
    return lambda places: nearest_pixels(grey, places)[..., None]


KINDS = [
    {}, {"line": ROOT + 45.0}, {"shade": ROOT + 60.0}, {"top": 0.9}, {"top": 0.12},
    {"clamp": 0.12}, {"screw": ROOT - 60.0}, {"rod": 0.6, "paper": 0.05},
    {"rod": 0.6, "paper": 0.05, "top": 0.9},
]  # fmt: skip


@pytest.mark.parametrize("first", [-15.0, 0.0, 55.0])
@pytest.mark.parametrize("kind", KINDS)
def test_sides_end_at_the_front_alone(kind, first):
    end = sides_end(light_of(picture(**kind)), axis(first), 0.0, WIDTH)
    assert end.s == pytest.approx(-first, abs=0.2 * WIDTH)
    assert end.is_clear


def test_a_rod_that_goes_on_as_a_shade_on_a_dark_face_is_not_clear_up_to_there():
    grey = picture(clamp=0.19, top=0.5)
    y, x = np.mgrid[:HEIGHT, :WIDE]
    face = (x > ROOT - 12.0) & (x < ROOT)
    grey[face & (np.abs(y - Y) < 0.5 * WIDTH)] = 0.1
    end = sides_end(light_of(grey), axis(0.0), 0.0, WIDTH)
    assert end.s == pytest.approx(-12.0, abs=0.2 * WIDTH)
    assert not end.is_clear


@pytest.mark.parametrize("kind", KINDS)
def test_a_rod_begins_there_whatever_line_lies_nearer_to_a_rough_curve(kind):
    grey = picture(**kind)
    start = Start(curve=axis(50.0), width=WIDTH, rough=False, blur=1.0)
    sign = -1.0 if "rod" in kind else 1.0
    found = refine(grey, start, root="clamp", sign=sign)
    begin, _ = found.fit.curve.at(np.zeros(1))
    assert begin[0] == pytest.approx((ROOT - 0.5, Y - 0.0), abs=0.5)


def test_without_two_sides_there_is_no_end():
    grey = picture()
    grey[int(Y) :] = 0.1
    assert sides_end(light_of(grey), axis(0.0), 0.0, WIDTH) is None
