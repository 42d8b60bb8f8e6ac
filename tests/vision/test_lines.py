"""A rod on a cutting mat: its lines are not things, whatever their colour."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from magbend.vision import as_photo
from magbend.vision.find import things
from magbend.vision.find.binarise import binarise
from magbend.vision.find.choose import likely_rods
from magbend.vision.find.ground import ground_distance
from magbend.vision.find.lines import beyond_lines, without_lines
from magbend.vision.find.rod import find_candidates
from magbend.vision.find.sought import Sought

MAT, PALE, WHITE = (0.08, 0.25, 0.09), (0.45, 0.6, 0.45), (0.7, 0.7, 0.7)
SKY, DARK = (0.6, 0.45, 0.25), (0.03, 0.05, 0.04)


def mat(*, rod, line, lines_px=3, pitch_px=33, clamp=WHITE, rod_px=22):
    """Return a mat with squares, turned by 12 degrees, and a bent rod."""
    light = np.empty((500, 800, 3), np.float32)
    light[:] = MAT
    turn = np.radians(12.0)
    across = np.array([-np.sin(turn), np.cos(turn)])
    for normal in (across, np.array([np.cos(turn), np.sin(turn)])):
        along = 2000.0 * np.array([-normal[1], normal[0]])
        for k in range(-60, 60):
            ends = [pitch_px * k * normal + side * along for side in (-1.0, 1.0)]
            (x, y), (u, v) = np.rint(16.0 * np.array(ends)).astype(int).tolist()
            cv2.line(light, (x, y), (u, v), line, lines_px, cv2.LINE_AA, 4)
    theta = np.radians(70.0) * np.linspace(0.0, 1.0, 200)
    steps = 1.9 * np.column_stack([np.cos(theta), np.sin(theta)])
    axis = np.array([200.0, 130.0]) + np.cumsum(steps, axis=0)
    fixed = np.rint(16.0 * axis).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(light, [fixed], False, rod, rod_px, cv2.LINE_AA, 4)
    cv2.rectangle(light, (80, 50), (200, 210), clamp, -1)
    light = cv2.GaussianBlur(light, (0, 0), 0.9)
    light += np.random.default_rng(4).normal(0.0, 0.004, light.shape)
    code = 255.0 * (1.055 * np.clip(light, 0.004, 1.0) ** (1 / 2.4) - 0.055)
    return as_photo(np.rint(code).astype(np.uint8)), axis


@pytest.mark.parametrize("rod", [SKY, DARK], ids=["pale", "dark"])
@pytest.mark.parametrize(
    ("line", "wide", "pitch"), [(PALE, 3, 33), (DARK, 2, 33), (PALE, 6, 60)]
)
def test_a_rod_is_found_on_a_cutting_mat(rod, line, wide, pitch):
    photo, axis = mat(rod=rod, line=line, lines_px=wide, pitch_px=pitch)
    found = next(likely_rods(photo, Sought()))
    aside = [np.hypot(*(axis - point).T).min() for point in found.points_px]
    assert max(aside) < 6.0
    assert found.length_px == pytest.approx(380.0, rel=0.08)
    assert found.root == "clamp"


def test_a_plain_ground_has_no_lines_and_a_scale_is_none():
    photo, _ = mat(rod=SKY, line=MAT)
    assert without_lines(ground_distance(photo)) is None
    ticked = (255.0 * photo.grey).astype(np.uint8)
    ticked[380:400, ::12] = 0
    assert without_lines(ground_distance(as_photo(ticked))) is None


@pytest.mark.parametrize(("pitch", "rod_px"), [(33, 22), (300, 13)])
def test_what_is_wider_than_the_lines_stays_as_wide(pitch, rod_px):
    """Where they are wide apart, tiles without a line do not say how wide a line is."""
    photo, axis = mat(rod=SKY, line=PALE, pitch_px=pitch, rod_px=rod_px)
    before = ground_distance(photo)
    after = without_lines(before)
    x, y = np.rint(axis[20:-20]).astype(int).T
    assert np.abs(after.ratio - before.ratio)[y, x].max() < 0.1
    assert np.mean(after.ratio > 0.93) > max(0.75, np.mean(before.ratio > 0.93) + 0.02)


def test_squared_paper_is_no_rod_nor_is_it_followed_from_mesh_to_mesh():
    photo, _ = mat(rod=SKY, line=DARK)
    binary = binarise(photo.grey, invert=False)
    assert cv2.connectedComponents(1 - binary.mask)[0] > 200
    assert find_candidates(binary) == []


def test_a_rod_as_thin_as_the_lines_is_left_by_what_it_stands_out_more():
    photo, axis = mat(rod=WHITE, line=(0.13, 0.3, 0.14), lines_px=4, rod_px=5)
    before = ground_distance(photo)
    x, y = np.rint(axis[20:-20]).astype(int).T
    unlined = without_lines(before)
    assert np.median(unlined.ratio[y, x]) > 0.9
    after = beyond_lines(before, unlined)
    assert np.array_equal(after.ratio[y, x], before.ratio[y, x])
    assert (after.ratio > 0.99).mean() > 0.9 > (before.ratio > 0.93).mean()


@pytest.mark.parametrize("paler", [100, 40], ids=["white", "nearly-alike"])
def test_a_rod_is_found_on_what_lies_beside_a_larger_sheet(paler):
    """The sheet is the ground at first, and the mat as far from it as the rod."""
    photo, axis = mat(rod=SKY, line=PALE)
    pixels = np.asarray(photo.decode())
    sheet = np.empty((500, 1100, 3), np.uint8)
    sheet[:] = np.median(pixels, axis=(0, 1)) + paler
    photo = as_photo(np.hstack([pixels, sheet]))
    found = list(likely_rods(photo, Sought()))
    away = [
        max(np.hypot(*(axis - point).T).min() for point in rod.points_px)
        for rod in found
    ]
    assert min(away) < 4.0
    best = found[int(np.argmin(away))]
    assert best.length_px == pytest.approx(380.0, rel=0.08)
    assert best.root == "clamp"


def test_what_is_short_is_not_tried_before_a_rod_on_another_ground():
    photo, axis = mat(rod=SKY, line=PALE)
    sheet = np.full((500, 1100, 3), 235, np.uint8)
    sheet[200:300, 500:600] = sheet[245:255, 600:720] = 20
    found = list(likely_rods(as_photo(np.hstack([photo.decode(), sheet])), Sought()))
    is_stub = [rod.points_px[0, 0] > 800.0 for rod in found]
    is_rod = [rod.away(axis[100]) < 6.0 for rod in found]
    assert is_rod.index(True) < is_stub.index(True)


def test_nothing_is_looked_for_or_tried_twice(monkeypatch):
    looked = []

    def counted(binary):
        looked.append(binary)
        return find_candidates(binary)

    monkeypatch.setattr(things, "find_candidates", counted)
    photo, _ = mat(rod=SKY, line=PALE)
    found = list(likely_rods(photo, Sought()))
    assert len({id(rod.points_px) for rod in found}) == len(found) > 0
    levels = {(id(binary.ratio), binary.threshold) for binary in looked}
    assert len(levels) == len(looked) > 0


def test_a_rod_thin_enough_to_go_with_the_lines_does_not_count_as_one():
    """It is in few parts of the picture, the lines are in most."""
    faint = tuple(1.35 * level for level in MAT)
    photo, axis = mat(
        rod=WHITE, line=faint, lines_px=4, pitch_px=90, rod_px=8, clamp=SKY
    )
    ground = ground_distance(photo)
    unlined = without_lines(ground)
    x, y = np.rint((axis[20:] + 0.5) / ground.factor - 0.5).astype(int).T
    assert np.median((unlined.ratio - ground.ratio)[y, x]) > 0.3
    left = beyond_lines(ground, unlined).ratio
    assert left[left < 1.0].max() > 0.8  # lines are less than 0.15 from the mat
