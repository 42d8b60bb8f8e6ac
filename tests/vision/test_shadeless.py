"""Physics of shades: they keep the paper's colour, and are their rod once more."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from magbend.vision import extract
from magbend.vision.find.candidate import Candidate
from magbend.vision.find.ground import LUMINANCE, View
from magbend.vision.find.shadeless import in_its_colour, shades
from magbend.vision.picture.photo import as_photo

TAN, RED, BLACK = (0.26, 0.43, 0.58), (0.04, 0.04, 0.45), (0.03, 0.03, 0.03)
BLUE, BROWN = (0.35, 0.1, 0.05), (0.03, 0.06, 0.14)
PAPER, WIDTH, AT = np.array([0.70, 0.75, 0.74]), 20.0, 100.0
X = np.arange(60.0, 340.0)


def bent(aside, bend=30.0):
    """Return an axis across the picture, `aside` px below where a rod is drawn."""
    return np.column_stack([X, AT + aside + bend * ((X - 60.0) / 280.0) ** 2])


def covered(axis, width=WIDTH):
    fine = np.zeros((800, 1600), np.uint8)
    side = np.array([0.0, 0.5 * width])
    corners = np.vstack([axis - side, (axis + side)[::-1]])
    fixed = np.round((4.0 * (corners + 0.5) - 0.5) * 16).astype(np.int32)
    cv2.fillPoly(fine, [fixed.reshape(-1, 1, 2)], 255, shift=4)
    return cv2.resize(fine, (400, 200), interpolation=cv2.INTER_AREA)[..., None] / 255.0


def drawn(rod, *, kept, aside, coarse=False, other=None, gloss=0.0):
    """Return a photograph of a rod whose shade keeps a share of each colour."""
    light = PAPER * (1.0 - (1.0 - np.array(kept)) * covered(bent(aside)))
    for colour, axis in ((rod, bent(0.0)), *([] if other is None else [other])):
        light = light + (np.array(colour) - light) * covered(axis)
    light = light + gloss * covered(bent(0.2 * WIDTH), 0.2 * WIDTH)
    light = cv2.GaussianBlur(light, (0, 0), 0.8)
    light += np.random.default_rng(0).normal(0.0, 0.003, light.shape)
    code = 255.0 * (1.055 * np.clip(light, 0.004, 1.0) ** (1 / 2.4) - 0.055)
    pixels = np.rint(code).astype(np.uint8)
    if coarse:
        pixels = cv2.imdecode(cv2.imencode(".jpg", pixels, [1, 90])[1], 1)
    return as_photo(pixels)


def candidate(aside):
    return Candidate(
        points_px=bent(aside), width_px=WIDTH, length_px=290.0, root="clamp",
        contacts=1, ratio=0.4,
    )  # fmt: skip


def seen(photo, aside=0.0):
    """Return a rod and its light, as told from a candidate beside it."""
    plain = View(grey=photo.grey, sign=1.0)
    return in_its_colour(photo, candidate(aside), plain)


@pytest.mark.parametrize("aside", [14.0, 45.0])
def test_paper_and_shade_are_equally_light_and_the_rod_is_not(aside):
    """Found was the shade, which is darker than the rod; what is left of it is blue."""
    photo = drawn(TAN, kept=(0.33, 0.3, 0.29), aside=aside)
    rod, view = seen(photo, aside)
    middle = np.interp(X, *rod.points_px.T)
    assert abs(middle - bent(0.0)[:, 1])[20:-20].max() < 1.5
    assert rod.width_px == pytest.approx(WIDTH, abs=1.5)
    paper, shade, inside = (
        np.median(view.grey[int(y) - 1 : int(y) + 2, 80:120])
        for y in (30.0, AT + aside + 4.0, AT)
    )
    assert shade == pytest.approx(paper, abs=0.03)
    assert paper - inside == pytest.approx(0.65, abs=0.03)


@pytest.mark.parametrize(
    ("rod", "kept", "mix"), [(TAN, 1.0, LUMINANCE), (BLACK, 0.4, None)]
)
def test_without_a_shade_or_a_colour_there_is_nothing_to_discount(rod, kept, mix):
    photo = drawn(rod, kept=(kept,) * 3, aside=14.0)
    assert seen(photo)[1].mix == mix


def test_what_is_no_copy_of_a_rod_is_not_taken_for_it():
    wire = RED, bent(48.0, bend=-10.0)
    photo = drawn((0.2, 0.2, 0.2), kept=(0.5, 0.5, 0.5), aside=16.0, other=wire)
    assert seen(photo)[1].mix is None


@pytest.mark.parametrize(("kept", "plain"), [(0.4, False), (0.7, True)])
def test_colour_is_asked_only_where_half_level_may_be_the_shade_s(kept, plain):
    """A red rod keeps 0.25 of the paper's light: half way to paper is 0.62."""
    photo = drawn(RED, kept=(kept,) * 3, aside=14.0, coarse=True)
    assert seen(photo)[1].plain is plain


def test_it_is_the_paper_beside_the_rod_that_has_no_colour():
    """A black rod on a yellow sheet, which is a small part of a grey picture."""
    photo = drawn(BLACK, kept=(0.4,) * 3, aside=14.0)
    assert seen(photo, 0.0)[1].mix is None
    desk = np.full((600, 1200, 3), 150, np.uint8)
    code = cv2.multiply(photo.decode(), (0.6, 1.0, 1.0, 0.0))
    desk[:200, :400] = code
    assert seen(as_photo(desk))[1].mix is None


@pytest.mark.parametrize("rod", [BLUE, BROWN])
def test_dark_is_a_flank_beside_a_streak_of_gloss_only_in_the_rod_s_colour(rod):
    """Paper between a rod and its shade is no streak, nor the shade the rod's rim."""
    photo = drawn(rod, kept=(0.35,) * 3, aside=22.0, gloss=0.9)
    found = extract(photo, None, clamp="none")
    axis = np.interp(found.points["x_px"], *bent(0.0).T)
    assert abs(found.points["y_px"] - axis)[3:-3].max() < 0.15
    assert "other_rod" not in found.flags


def told(photo, things):
    return [list(each) for each in shades(photo, things)]


def test_of_two_things_alike_the_one_without_colour_is_the_shade():
    """It is darker than a tan rod; a grey rod beside a wire is no copy of it."""
    photo = drawn(TAN, kept=(0.33, 0.3, 0.29), aside=45.0)
    rod, shade = candidate(0.0), candidate(45.0)
    assert told(photo, [shade, rod])[0] == [True, False]
    wire = bent(48.0, bend=-20.0)
    photo = drawn((0.2, 0.2, 0.2), kept=(1.0, 1.0, 1.0), aside=0.0, other=(RED, wire))
    both = [rod, replace(rod, points_px=wire)]
    assert told(photo, both) == [[False, False], [False, False]]


def test_beside_a_black_rod_what_is_paler_may_be_its_shade_but_no_coloured_rod():
    rod, other = candidate(0.0), candidate(45.0)
    photo = drawn(BLACK, kept=(0.4, 0.4, 0.4), aside=45.0)
    assert told(photo, [other, rod]) == [[False, False], [True, False]]
    photo = drawn(BLACK, kept=(1.0, 1.0, 1.0), aside=0.0, other=(RED, bent(45.0)))
    assert told(photo, [other, rod]) == [[False, False], [False, False]]


@pytest.mark.parametrize("aside", [26.0, 40.0])
def test_halves_of_a_rod_are_equally_dark_and_its_shade_is_paler(aside):
    """Two black things side by side may be one that a streak of gloss parts."""
    shaded = drawn(BLACK, kept=(0.4,) * 3, aside=aside)
    assert "other_rod" not in extract(shaded, None, clamp="none").flags
    parted = drawn(BLACK, kept=(1.0,) * 3, aside=0.0, other=(BLACK, bent(26.0)))
    assert "other_rod" in extract(parted, None, clamp="none").flags
