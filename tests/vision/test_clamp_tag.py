"""A tag on the clamp: printed at true scale, found, placed, used, and not believed."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from magbend.core.errors import ConfigError, InputError, VisionError
from magbend.vision import (
    Board,
    ClampTag,
    Pose,
    Setting,
    as_photo,
    extract,
    find_tag,
    read_calibration,
    scale_calibration,
    tag_number,
    tag_place,
    write_board,
    write_calibration,
)
from magbend.vision.synthetic import (
    Block,
    Label,
    Scene,
    SceneLight,
    curve,
    render_scene,
    scene_camera,
)

SIZE, FOCAL, HEIGHT = (1100, 800), 4200.0, 0.9
LABEL = Label(tag=ClampTag(height_mm=4.0), x_mm=-8.0, y_mm=0.6, angle_deg=75.0)
POSE = Pose(x_mm=20.0, y_mm=-20.0, angle_deg=10.0, height_mm=HEIGHT)


def camera_at(tilt_deg=4.0, height_mm=330.0, **options):
    return scene_camera(
        size_px=SIZE, focal_px=FOCAL, tilt_deg=tilt_deg, height_mm=height_mm, **options
    )


def taken(camera, bend_deg, *, pose=POSE, label=LABEL, seed=0, **light):
    scene = Scene(
        clamp=Block(pose=pose, width_mm=11.0, screws_mm=(), label=label),
        centreline=curve("graded", angle_deg=bend_deg), light=SceneLight(**light),
    )  # fmt: skip
    return render_scene(scene, camera, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def camera():
    return camera_at()


@pytest.fixture(scope="module")
def straight(camera, tmp_path_factory):
    folder = tmp_path_factory.mktemp("straight")
    for k, bend_deg in enumerate((0.0, 12.0)):
        cv2.imwrite(str(folder / f"{k}.png"), taken(camera, bend_deg, seed=k))
    return folder


@pytest.fixture(scope="module")
def tagged(camera, straight):
    placed = tag_place(
        [straight], Setting(calibration=camera, rod_height_mm=HEIGHT), LABEL.tag
    )
    assert len(placed.used) == 2
    return replace(camera, clamp_tag=placed.tag)


def test_the_printed_tag_stands_beside_the_board_and_is_found(tmp_path):
    path, dpi = tmp_path / "board.png", 200
    write_board(Board(), path, dpi=dpi, tag_mm=6.0)
    photo = as_photo(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), linear=True)
    camera = scale_calibration(mm_per_px=25.4 / dpi, image_size_px=photo.size_px)
    number = tag_number(Board())
    seen = find_tag(photo.grey, camera, ClampTag(number=number))
    assert seen.side_mm == pytest.approx(6.0, abs=0.01)
    assert seen.pose.angle_deg == pytest.approx(90.0, abs=0.02)
    assert number >= Board().markers
    write_board(Board(), tmp_path / "board.pdf", tag_mm=6.0)
    write_board(Board(), tmp_path / "plain.pdf")
    assert len((tmp_path / "board.pdf").read_bytes()) > len(
        (tmp_path / "plain.pdf").read_bytes()
    )


@pytest.mark.parametrize(
    ("options", "light"),
    [
        ({"tilt_deg": 0.0}, {}),
        ({"tilt_deg": 12.0, "distortion": (-0.1, 0.0, 0.0, 0.0, 0.0)}, {"noise": 0.02}),
        ({"tilt_deg": 6.0, "turn_deg": 160.0}, {"blur_px": 2.0, "motion_px": (3, 2)}),
    ],
)
def test_a_tag_is_found_in_perspective_blur_and_noise(options, light):
    camera = camera_at(**options)
    grey = as_photo(taken(camera, 30.0, **light)).grey
    seen = find_tag(grey, camera, LABEL.tag)
    (true,) = POSE.to_board(np.array([[LABEL.x_mm, LABEL.y_mm]]))
    assert math.dist(true, (seen.pose.x_mm, seen.pose.y_mm)) < 3.0 * seen.place_sd_mm
    turn = seen.pose.angle_deg - POSE.angle_deg - LABEL.angle_deg
    assert abs((turn + 180.0) % 360.0 - 180.0) < 3.0 * seen.angle_sd_deg
    assert seen.side_mm == pytest.approx(6.0, rel=0.003)
    assert seen.place_sd_mm < 0.01
    assert seen.angle_sd_deg < 0.06


def test_a_tag_is_found_alike_near_where_it_should_be_and_anywhere(camera):
    grey = as_photo(taken(camera, 30.0)).grey
    anywhere = find_tag(grey, camera, LABEL.tag)
    middle = np.array([[anywhere.pose.x_mm, anywhere.pose.y_mm]])
    (near,) = camera.to_px(middle, height_mm=LABEL.tag.height_mm)
    for off_px in ((0.0, 0.0), (15.0, -20.0), (400.0, -300.0), (-1e4, 0.0)):
        seen = find_tag(grey, camera, LABEL.tag, near + off_px)
        assert seen.pose.x_mm == pytest.approx(anywhere.pose.x_mm, abs=1e-3)
        assert seen.pose.y_mm == pytest.approx(anywhere.pose.y_mm, abs=1e-3)
        assert seen.pose.angle_deg == pytest.approx(anywhere.pose.angle_deg, abs=0.01)


def test_another_print_of_the_tag_is_not_taken_for_that_on_the_clamp(tagged):
    picture = taken(tagged, 30.0)
    alone = extract(as_photo(picture), tagged, rod_height_mm=HEIGHT)
    clamp = POSE.to_board(np.array([[LABEL.x_mm, LABEL.y_mm]]))
    x, y = np.rint(tagged.to_px(clamp, height_mm=LABEL.tag.height_mm)[0]).astype(int)
    picture[20:150, -170:-40] = picture[y - 65 : y + 65, x - 65 : x + 65]
    found = extract(as_photo(picture), tagged, rod_height_mm=HEIGHT)
    assert "tag_not_seen" not in found.flags
    assert found.clamp_angle_sd_deg == pytest.approx(alone.clamp_angle_sd_deg, rel=0.1)
    assert found.pose.angle_deg == pytest.approx(alone.pose.angle_deg, abs=0.01)


def test_where_the_root_is_from_the_tag_is_learnt_from_photographs(tagged):
    tag = tagged.clamp_tag
    frame = Pose(x_mm=LABEL.x_mm, y_mm=LABEL.y_mm, angle_deg=LABEL.angle_deg)
    (root,) = frame.from_board(np.zeros((1, 2)))
    assert math.dist(root, (tag.root_x_mm, tag.root_y_mm)) < 3.0 * tag.place_sd_mm
    assert abs(tag.angle_deg + LABEL.angle_deg) < 3.0 * tag.angle_sd_deg
    assert tag.angle_sd_deg < 0.2


def test_the_tag_gives_place_and_direction_of_a_clamp_elsewhere(tagged):
    pose = Pose(x_mm=15.0, y_mm=-30.0, angle_deg=25.0, height_mm=HEIGHT)
    tag = replace(tagged.clamp_tag, board_angle_deg=25.0 + LABEL.angle_deg)
    tagged = replace(tagged, clamp_tag=tag)
    photo = as_photo(taken(tagged, 100.0, pose=pose, seed=5, shadow_depth=0.5))
    own = extract(photo, replace(tagged, clamp_tag=None), rod_height_mm=HEIGHT)
    found = extract(photo, tagged, rod_height_mm=HEIGHT)
    assert found.clamp_angle_sd_deg < own.clamp_angle_sd_deg
    assert abs(found.pose.angle_deg - 25.0) < 3.0 * found.clamp_angle_sd_deg
    assert abs(found.pose.angle_deg - 25.0) < 0.05
    place = found.pose.from_board(np.array([[15.0, -30.0]]))[0]
    assert abs(place[0]) < 3.0 * found.clamp_sd_mm
    np.testing.assert_allclose(
        found.tip_mm, curve("graded", angle_deg=100.0).tip_mm, atol=0.05
    )
    wrong = {"tag_differs", "tag_not_seen", "camera_moved", "clamp_turned"}
    assert not wrong & set(found.flags)


def test_a_tag_that_came_loose_or_is_gone_is_named(tagged):
    photo = as_photo(taken(tagged, 40.0))
    tag = replace(tagged.clamp_tag, angle_deg=tagged.clamp_tag.angle_deg + 4.0)
    loose = extract(photo, replace(tagged, clamp_tag=tag), rod_height_mm=HEIGHT)
    assert "tag_differs" in loose.flags
    assert loose.clamp_angle_sd_deg > 1.5
    bare = as_photo(taken(tagged, 40.0, label=None))
    gone = extract(bare, tagged, rod_height_mm=HEIGHT)
    assert "tag_not_seen" in gone.flags
    assert gone.length_mm == pytest.approx(30.0, abs=0.05)


def test_a_camera_that_was_raised_since_is_named(tagged):
    for height_mm in (324.0, 336.0):
        raised = as_photo(taken(camera_at(height_mm=height_mm), 40.0))
        assert "camera_moved" in extract(raised, tagged, rod_height_mm=HEIGHT).flags
    aside = camera_at(target_mm=(37.0, -24.0), turn_deg=2.0)
    shifted = extract(as_photo(taken(aside, 40.0)), tagged, rod_height_mm=HEIGHT)
    assert "clamp_turned" in shifted.flags
    assert "camera_moved" not in shifted.flags  # and no length is wrong for it
    assert shifted.length_mm == pytest.approx(30.0, abs=0.05)


def test_pixels_turned_by_half_a_turn_are_named_or_do_no_harm(tagged):
    turned = np.ascontiguousarray(taken(tagged, 40.0)[::-1, ::-1])
    found = extract(as_photo(turned), tagged, rod_height_mm=HEIGHT)
    assert abs(found.length_mm - 30.0) > 0.1
    assert "clamp_turned" in found.flags
    squarely = camera_at(tilt_deg=0.0)
    turned = np.ascontiguousarray(taken(squarely, 40.0)[::-1, ::-1])
    found = extract(as_photo(turned), squarely, rod_height_mm=HEIGHT)
    assert found.length_mm == pytest.approx(30.0, abs=0.05)
    np.testing.assert_allclose(
        found.tip_mm, curve("graded", angle_deg=40.0).tip_mm, atol=0.1
    )


def test_a_calibration_keeps_its_tag(tagged, tmp_path):
    path = tmp_path / "calibration.json"
    write_calibration(tagged, path)
    assert read_calibration(path).clamp_tag == tagged.clamp_tag
    path.write_text(path.read_text().replace('"number": 49', '"number": 50'))
    with pytest.raises(ConfigError, match="from 0 to 49"):
        read_calibration(path)


def test_a_tag_that_cannot_be_is_refused(camera, straight, tmp_path):
    setting = Setting(calibration=camera, rod_height_mm=HEIGHT)
    with pytest.raises(VisionError, match=r"seen 6\.\d+ mm wide, not 7 mm"):
        tag_place([straight], setting, replace(LABEL.tag, side_mm=7.0))
    with pytest.raises(VisionError, match="marker 3 of DICT_4X4_50 is not seen"):
        tag_place([straight], setting, replace(LABEL.tag, number=3))
    with pytest.raises(VisionError, match="give a calibration"):
        tag_place([straight], Setting(), LABEL.tag)
    with pytest.raises(InputError, match="from 2 to 100 mm"):
        write_board(Board(), tmp_path / "board.pdf", tag_mm=0.5)
    with pytest.raises(InputError, match="uses all 50"):
        tag_number(Board(columns=10, rows=10))


def test_photographs_between_which_the_tag_was_turned_disagree(camera, tmp_path):
    for k, turn_deg in enumerate((0.0, 0.0, 5.0)):
        label = replace(LABEL, angle_deg=LABEL.angle_deg + turn_deg)
        image = taken(camera, 5.0 * k, label=label, seed=k)
        cv2.imwrite(str(tmp_path / f"{k}.png"), image)
    with pytest.raises(VisionError, match="disagree on where the rod leaves"):
        tag_place([tmp_path], Setting(calibration=camera), LABEL.tag)
