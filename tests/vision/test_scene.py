"""The photograph-like scene: same seed same picture, and its truth is where it says."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from magbend.vision.camera.calibration import specimen_to_px
from magbend.vision.measurement import Pose
from magbend.vision.picture.photo import as_photo
from magbend.vision.picture.raster import coverage
from magbend.vision.synthetic import (
    BLACK,
    BLUE,
    GREY,
    Block,
    Scene,
    SceneLight,
    drawing,
    render_scene,
    scene_camera,
)
from magbend.vision.synthetic.square_view import curve

CLAMP = Block(pose=Pose(x_mm=15.0, y_mm=-24.0, angle_deg=3.0, height_mm=0.9))
QUIET = SceneLight(noise=0.0, blur_px=0.3)
SMALL = scene_camera(size_px=(800, 600), focal_px=3400.0)


def photograph(scene, camera=None, seed=0):
    return render_scene(scene, camera or SMALL, np.random.default_rng(seed))


def test_picture_is_colour_of_the_camera_s_size():
    picture = photograph(Scene(clamp=CLAMP))
    assert picture.shape == (600, 800, 3)
    assert picture.dtype == np.uint8
    assert 150 < np.median(picture) < 240


def test_seeds_rule_noise_and_paper():
    scene = Scene(clamp=CLAMP, centreline=curve("arc", angle_deg=40.0))
    one = photograph(scene)
    np.testing.assert_array_equal(one, photograph(scene))
    assert np.any(one != photograph(scene, seed=1))
    quiet = replace(scene, light=QUIET)
    other = replace(quiet, paper_seed=1)
    assert np.any(photograph(quiet) != photograph(other))
    # Without noise the generator is not used at all.
    np.testing.assert_array_equal(photograph(quiet), photograph(quiet, seed=9))


@pytest.mark.parametrize("tilt", [0.0, 8.0])
def test_axis_lies_in_the_middle_of_the_dark_silhouette(monkeypatch, tilt):
    monkeypatch.setattr(drawing, "SHEEN", 0.0)
    camera = scene_camera(tilt_deg=tilt)
    line = curve("graded", angle_deg=-70.0)
    light = replace(QUIET, shadow_depth=0.0)
    grey = as_photo(
        photograph(Scene(clamp=CLAMP, centreline=line, light=light), camera)
    ).grey
    axis = specimen_to_px(camera, CLAMP.pose, line.points_mm)
    offsets, step = [], 0.25
    for i in range(150, len(axis) - 100, 50):
        tangent = axis[i + 5] - axis[i - 5]
        normal = np.array([tangent[1], -tangent[0]]) / np.hypot(*tangent)
        reach = np.arange(-18.0, 18.0 + step, step)
        x, y = (axis[i] + reach[:, None] * normal).T
        dark = 0.69 - bilinear(grey, x, y)
        dark[dark < 0.1] = 0.0
        offsets.append((dark * reach).sum() / dark.sum())
    # The side face is a little darker than the top.
    assert np.abs(offsets).max() < 0.1
    assert abs(np.mean(offsets)) < 0.05


def bilinear(grey, x, y):
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    v, u = y - i, x - j
    return (
        (1 - v) * ((1 - u) * grey[i, j] + u * grey[i, j + 1])
        + v * ((1 - u) * grey[i + 1, j] + u * grey[i + 1, j + 1])
    )  # fmt: skip


def test_empty_clamp_has_no_rod():
    line = curve("straight")
    scene = Scene(clamp=CLAMP, centreline=line, light=QUIET)
    with_rod = as_photo(photograph(scene)).grey
    without = as_photo(photograph(replace(scene, centreline=None))).grey
    axis = specimen_to_px(SMALL, CLAMP.pose, line.points_mm[100:-20])
    x, y = axis.T
    assert bilinear(with_rod, x, y).max() < 0.12
    assert bilinear(without, x, y).min() > 0.3


@pytest.mark.parametrize("colour", [GREY, BLUE, BLACK])
def test_clamp_has_its_colour(colour):
    block = replace(CLAMP, colour=colour, screws_mm=())
    picture = photograph(Scene(clamp=block, light=replace(QUIET, shadow_depth=0.0)))
    inside = block.pose.to_board(np.array([[-4.0, 2.0]]))
    ((x, y),) = SMALL.to_px(inside, height_mm=block.height_mm).astype(int)
    value = picture[y, x] / 255.0
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(linear, colour, atol=0.04)


def test_a_clamp_that_is_not_square_is_turned_about_the_middle_of_its_front():
    block = replace(CLAMP, skew_deg=90.0, screws_mm=())
    picture = photograph(Scene(clamp=block, light=replace(QUIET, shadow_depth=0.0)))
    seen = block.pose.to_board(np.array([[3.0, -8.0], [-8.0, 0.0]]))
    (in_it, beside) = SMALL.to_px(seen, height_mm=block.height_mm).astype(int)
    assert picture[in_it[1], in_it[0]].max() < 160 < picture[beside[1], beside[0]].min()
    np.testing.assert_allclose(
        block.to_board(np.zeros((1, 2))), block.pose.to_board(np.zeros((1, 2)))
    )


def test_gloss_and_other_blocks_show():
    magnet = Block(
        pose=Pose(x_mm=40.0, y_mm=-52.0, angle_deg=90.0), length_mm=20.0, width_mm=55.0
    )
    scene = Scene(clamp=CLAMP, centreline=curve("straight"), light=QUIET)
    plain = photograph(scene).astype(int)
    glossy = photograph(replace(scene, light=replace(QUIET, gloss=0.3))).astype(int)
    assert (glossy - plain).max() > 60
    blocked = photograph(replace(scene, blocks=(magnet,))).astype(int)
    assert (plain - blocked).max() > 60


@pytest.mark.parametrize("tilt", [0.0, 0.2, 5.0])
def test_a_pixel_shows_as_much_paper_as_the_block_leaves(tilt):
    """Walls and top together cover a pixel once, however little of a wall is seen."""
    camera = scene_camera(size_px=(800, 600), focal_px=3400.0, tilt_deg=tilt)
    pose = Pose(x_mm=0.0, y_mm=0.0, angle_deg=11.0)
    block = Block(pose=pose, width_mm=6.0, length_mm=9.0, height_mm=3.0)
    corners = pose.to_board(np.array([[0, 3], [0, -3], [-9, -3], [-9, 3]], float))
    size = camera.image_size_px
    top = coverage(camera.to_px(corners, height_mm=3.0), *size)
    walls = drawing.block_walls(block, camera)
    covered = 1.0 - (1.0 - walls) * (1.0 - top)
    pixels = [camera.to_px(corners, height_mm=height) for height in (0.0, 3.0)]
    hull = cv2.convexHull(np.vstack(pixels).astype(np.float32))[:, 0]
    whole = coverage(hull.astype(np.float64), *size)
    np.testing.assert_allclose(covered, whole, atol=2e-3)


def test_a_lens_bends_the_foot_of_a_block_as_it_bends_a_line_there():
    camera = scene_camera(
        size_px=(900, 700), focal_px=1200.0, height_mm=60.0, target_mm=(0.0, 0.0),
        distortion=(-0.12, 0.0, 0.0, 0.0, 0.0),
    )  # fmt: skip
    pose = Pose(x_mm=13.0, y_mm=0.0, angle_deg=180.0)
    foot = pose.to_board(np.column_stack([np.zeros(81), np.linspace(-5.0, 5.0, 81)]))
    x, y = camera.to_px(foot)[:: -1 if camera.to_px(foot)[0, 1] > 350 else 1].T
    assert np.ptp(x - np.linspace(x[0], x[-1], len(x))) > 0.15
    walls = drawing.block_walls(Block(pose=pose, width_mm=12.0, height_mm=3.0), camera)
    for row in range(int(y[0]) + 1, int(y[-1])):
        begins = float(np.interp(row, y, x))
        first, last = int(begins) - 4, int(begins) + 4
        covered = walls[row, first : last + 1].sum()
        assert abs(last + 0.5 - covered - begins) < 0.03
