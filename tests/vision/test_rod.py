"""The rod among dark things: by shape alone."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from magbend.vision.find.binarise import Binary
from magbend.vision.find.discs import places_of
from magbend.vision.find.level_sets import LevelSets
from magbend.vision.find.rod import find_candidates
from magbend.vision.find.straight_on import straight_on


def things(*boxes: tuple[int, int, int, int]) -> np.ndarray:
    """A mask of boxes: x, y, width, height."""
    mask = np.zeros((400, 600), np.uint8)
    for x, y, width, height in boxes:
        mask[y : y + height, x : x + width] = 1
    return mask


def candidates(mask: np.ndarray):
    ratio = np.where(mask, 0.1, 1.0).astype(np.float32)
    return find_candidates(
        Binary(
            ratio=ratio, mask=mask, factor=1, inverted=False, dark=0.1, threshold=0.5
        )
    )


CLAMP, ROD = (0, 150, 160, 80), (160, 185, 250, 10)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5])
def test_rod_is_found_beside_a_clamp_with_noise_along_its_edges(share):
    mask = things(CLAMP, ROD)
    rng = np.random.default_rng(0)
    for row in (148, 149, 230, 231):
        mask[row, :160] |= rng.random(160) < share
    for row in (183, 184, 195):
        mask[row, 160:410] |= rng.random(250) < share
    (rod,) = candidates(mask)
    assert rod.root == "clamp"
    assert rod.contacts == 1
    assert rod.width_px == pytest.approx(10.0, abs=2.0)
    assert rod.length_px == pytest.approx(250.0, abs=20.0)


def test_among_specks_nothing_is_sought(monkeypatch):
    """Their outlines, a hundred thousand in a photograph, took half a minute."""
    mask = (np.random.default_rng(0).random((400, 600)) < 0.3).astype(np.uint8)
    monkeypatch.setattr(cv2, "findContours", None)
    assert candidates(mask) == []


def test_rod_between_two_things_touches_both():
    (rod,) = candidates(things(CLAMP, ROD, (410, 150, 100, 100)))
    assert rod.root == "clamp"
    assert rod.contacts == 2
    assert rod.length_px == pytest.approx(250.0, abs=30.0)


def test_arm_is_the_clamp_of_the_thinner_thing_that_grows_from_it():
    (rod,) = candidates(things((0, 180, 420, 40), (420, 196, 120, 5)))
    assert rod.root == "clamp"
    assert rod.width_px == pytest.approx(5.0, abs=1.0)


def test_bar_alone_is_a_rod_from_the_border():
    (bar,) = candidates(things((0, 180, 420, 40)))
    assert bar.root == "border"
    assert bar.width_px == pytest.approx(40.0, abs=3.0)


@pytest.mark.parametrize("at", [230, 300, 395])
def test_hair_across_a_rod_is_no_rod(at):
    mask = things(CLAMP, ROD)
    cv2.line(mask, (at - 60, 110), (at + 60, 270), 1, 2)
    rod = candidates(mask)[0]
    assert rod.root == "clamp"
    assert rod.contacts == 1
    assert rod.width_px == pytest.approx(10.0, abs=2.0)
    assert rod.length_px == pytest.approx(250.0, abs=20.0)


def test_line_longer_than_the_rod_that_it_crosses_is_no_rod():
    mask = things(CLAMP, ROD)
    cv2.line(mask, (320, 20), (300, 390), 1, 4)
    assert candidates(mask)[0].width_px == pytest.approx(10.0, abs=2.0)


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_a_wide_bar_that_leaves_the_picture_is_seen_to_leave_it(rows):
    mask = np.zeros((400 + rows, 600), np.uint8)
    mask[20:80, 200:400] = 1  # what it grows from
    mask[80:, 280:320] = 1
    (bar,) = candidates(mask)
    assert bar.contacts == 2
    assert bar.leaves


def test_a_web_at_a_root_leads_nowhere():
    arms, levels = 9, 12
    count = 1 + arms * levels
    level = np.append(0, np.tile(np.arange(1, levels + 1), arms))
    before = np.arange(-1, count - 1)
    before[1::levels] = 0
    angle = np.append(0.0, np.repeat(np.linspace(0.0, 3.0, arms), levels))
    web = LevelSets(
        part=np.full((4, 4), -1, np.int32), every=1, size=np.ones(count), step=4.0,
        centres=4.0 * level[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]),
        level=level, before=before,
    )  # fmt: skip
    assert straight_on(web, np.zeros(count), set()).barred


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (4, 8), (9, 7)])
def test_places_of_a_thing_are_found_in_any_shape(shape):
    mask = (np.random.default_rng(1).random(shape) < 0.3).astype(np.uint8)
    mask[-1, -1] = 1
    np.testing.assert_array_equal(places_of(mask), np.flatnonzero(mask))
