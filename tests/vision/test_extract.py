from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from magbend.vision import Pose, as_photo, extract, read_photo, score
from magbend.vision.camera.calibrate import calibrate_known_length
from magbend.vision.camera.calibration import Calibration
from magbend.vision.extraction import refine
from magbend.vision.synthetic import (
    BLACK,
    BLUE,
    Block,
    Scene,
    SceneLight,
    render_scene,
    scene_camera,
)
from magbend.vision.synthetic.scoring import signed_distance
from magbend.vision.synthetic.square_view import HARD, STANDARD, curve, draw

FIXTURES = Path(__file__).parents[2] / "fixtures" / "vision"
RENDERED = Path(__file__).parents[2] / "examples" / "photographs"
SIZE = (1200, 1000)


def frame(kind="arc", angle=60.0, seed=0, light=STANDARD, size=SIZE, **options):
    shape = curve(kind, angle_deg=angle)
    rng = np.random.default_rng(seed)
    return draw(shape, rng, light=light, size_px=size, **options)


@pytest.mark.parametrize(
    ("kind", "angle", "seed"),
    [
        ("straight", 0.0, 1),
        ("arc", 30.0, 2),
        ("arc", -150.0, 3),
        ("arc", 250.0, 4),
        ("s", 45.0, 5),
        ("graded", 90.0, 6),
        ("graded", -130.0, 7),
    ],
)
def test_synthetic_frames_are_measured_to_hundredths_of_a_pixel(kind, angle, seed):
    one = frame(kind, angle, seed)
    result = extract(as_photo(one.image), one.truth.calibration)
    errors = score(result, one.truth)
    assert errors.rms_px < 0.03
    assert abs(errors.length_px) < 0.15
    assert abs(errors.width_px) < 0.03
    assert abs(errors.tip_along_px) < 0.08
    assert abs(errors.tip_across_px) < 0.15
    assert errors.clamp_px < 0.15
    assert "shadow" not in result.flags
    table = result.points
    assert table["s_mm"][-1] == pytest.approx(30.0, abs=0.01)
    assert (
        abs(result.tip_angle_deg - np.degrees(one.truth.centreline.theta_rad[-1])) < 1
    )


def test_a_clear_rod_is_looked_at_twice_and_its_ends_sought_twice(monkeypatch):
    """Once to find them, and once to measure: more would not move them."""
    asked = []
    for name in ("_look", "find_ends"):

        def noted(*args, name=name, asked_for=getattr(refine, name), **options):
            asked.append(name)
            return asked_for(*args, **options)

        monkeypatch.setattr(refine, name, noted)
    drawn = frame("arc", 90.0)
    found = extract(as_photo(drawn.image), drawn.truth.calibration)
    assert score(found, drawn.truth).rms_px < 0.02
    assert asked.count("_look") == asked.count("find_ends") == 2


def test_hard_shadow_is_named_and_mostly_undone():
    one = frame("graded", 60.0, 3, HARD)
    result = extract(as_photo(one.image), one.truth.calibration)
    assert "shadow" in result.flags
    assert score(result, one.truth).rms_px < 0.10


def test_deviations_cover_what_they_claim():
    inside = []
    for seed in range(3):
        for kind, angle in (("arc", 80.0), ("graded", -70.0), ("s", 30.0)):
            for scale, size in ((20.0, SIZE), (40.0, (1900, 1900))):
                one = frame(kind, angle, seed, px_per_mm=scale, size=size)
                result = extract(as_photo(one.image), one.truth.calibration)
                off = signed_distance(result.points_px, one.truth.points_px)
                inside.append(np.abs(off[3:-3]) < result.points["sigma_px"][3:-3])
    assert 0.55 < np.mean(inside) < 0.82


def test_turning_and_mirroring_the_picture_changes_nothing_but_the_sign():
    one = frame("graded", 70.0, 5)
    plain = extract(as_photo(one.image), one.truth.calibration)
    turned = extract(as_photo(np.rot90(one.image, 2).copy()), one.truth.calibration)
    mirrored = extract(as_photo(one.image[:, ::-1].copy()), one.truth.calibration)
    np.testing.assert_allclose(turned.tip_mm, plain.tip_mm, atol=0.01)
    np.testing.assert_allclose(
        mirrored.tip_mm, np.array(plain.tip_mm) * (1, -1), atol=0.01
    )
    assert mirrored.tip_angle_deg == pytest.approx(-plain.tip_angle_deg, abs=0.2)
    assert plain.tip_mm[1] > 0.0


def test_glints_do_not_turn_grey_paper_into_a_dark_board():
    frame = draw(curve("arc", angle_deg=70.0), np.random.default_rng(0))
    light = 0.45 * as_photo(frame.image).grey
    plain = extract(as_photo(light), None)
    width = light.shape[1]
    cv2.circle(light, (width - 100, 100), 60, 0.95, -1)
    glinting = extract(as_photo(light), None)
    assert glinting.ok, glinting.reason
    assert glinting.length_px == pytest.approx(plain.length_px, abs=0.05)
    assert not extract(as_photo(light), None, invert=True).ok


def test_inverted_frames_measure_the_same():
    one = frame("arc", 60.0, 2)
    light = as_photo(one.image).grey
    plain = extract(as_photo(light), None)
    inverted = extract(as_photo(1.0 - light), None)
    assert inverted.ok
    distance = signed_distance(inverted.points_px, plain.points_px)
    assert np.abs(distance).max() < 0.01


def test_theta_and_kappa_are_the_derivatives_of_the_shape():
    one = frame("arc", 120.0, 3)
    found = extract(as_photo(one.image), one.truth.calibration)
    table = found.points
    s = table["s_mm"]
    theta = np.unwrap(
        np.arctan2(np.gradient(table["y_mm"], s), np.gradient(table["x_mm"], s))
    )
    np.testing.assert_allclose(table["theta_rad"][2:-2], theta[2:-2], atol=2e-3)
    np.testing.assert_allclose(
        table["kappa_per_mm"][5:-5], np.radians(120) / 30, rtol=0.05
    )
    assert table["x_mm"][0] == table["y_mm"][0] == 0.0
    # The frame has the clamp's direction, which the rod alone does not tell.
    assert abs(table["theta_rad"][0]) < np.radians(found.clamp_angle_sd_deg)


def test_known_joints_sharpen_the_curvature():
    one = frame("graded", 90.0, 4)
    true = one.truth.centreline
    jumps = {}
    for joints in ((), (10.0, 20.0)):
        table = extract(
            as_photo(one.image), one.truth.calibration, joints_mm=joints
        ).points
        before, after = np.interp([19.4, 20.6], table["s_mm"], table["kappa_per_mm"])
        jumps[joints] = after / before
    before, after = np.interp([19.4, 20.6], true.s_mm, true.kappa_per_mm)
    assert after / before > 1.3
    assert jumps[(10.0, 20.0)] == pytest.approx(after / before, rel=0.12)
    assert jumps[()] < jumps[(10.0, 20.0)]


def camera_of(name: str = "calib_D.json") -> Calibration:
    data = json.loads((RENDERED / name).read_text())
    k = np.array(data["K"])
    u, _, v = np.linalg.svd(np.array(data["R_world_to_cam"]))
    return Calibration(
        image_size_px=(1600, 1200), focal_px=(k[0, 0], k[1, 1]),
        centre_px=(k[0, 2], k[1, 2]), distortion=(0.0, 0.0, 0.0, 0.0, 0.0),
        rotation=u @ v, translation_mm=np.array(data["t_world_to_cam_mm"]),
        camera_height_sd_mm=0.1, camera_height_source="truth",
        scale_relative_sd=0.0, rms_px=0.0,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["dev_03", "dev_05", "dev_07", "dev_10", "dev_12"])
def test_rendered_photographs_are_measured_in_mm(name):
    truth = json.loads((RENDERED / f"{name}.json").read_text())
    result = extract(
        read_photo(RENDERED / f"{name}.jpg"), camera_of(),
        rod_height_mm=truth["axis_height_mm"], length_mm=truth["length_mm"],
    )  # fmt: skip
    assert result.ok
    assert not {"length_mismatch", "no_clamp", "ragged_tip"} & set(result.flags)
    xy = np.column_stack([result.points["x_mm"], result.points["y_mm"]])
    distance = signed_distance(xy, np.array(truth["centreline_mm"]))
    assert np.sqrt(np.mean(distance**2)) < 0.10
    assert np.hypot(*np.subtract(result.tip_mm, truth["tip_mm"])) < 0.20
    assert result.length_mm == pytest.approx(truth["length_mm"], abs=0.05)
    assert result.width_mm == pytest.approx(truth["side_mm"], abs=0.015)
    in_picture = signed_distance(result.points_px, np.array(truth["centreline_px"]))
    assert np.sqrt(np.mean(in_picture**2)) < 0.15


def test_board_is_no_rod():
    result = extract(read_photo(RENDERED / "calib_D.jpg"), camera_of())
    assert result.status == "failed"
    assert "no_rod" in result.flags
    assert not result.points


@pytest.mark.parametrize(
    ("name", "root", "tip"),
    [("acrylic_20_1", (0, 92), (136, 2130)), ("acrylic_25_1", (0, 135), (20, 2385))],
)
def test_yarns_are_measured_from_the_border_to_the_tip(name, root, tip):
    result = extract(read_photo(FIXTURES / "yarn" / f"{name}.jpg"), None)
    assert result.ok
    assert "clamp_at_border" in result.flags
    assert "uncalibrated" in result.flags
    assert np.hypot(*np.subtract(result.clamp_px, root)) < 25.0
    assert np.hypot(*np.subtract(result.tip_px, tip)) < 35.0


@pytest.mark.parametrize("name", ["acrylic_20_1", "acrylic_25_1"])
def test_trifles_do_not_move_what_is_measured_of_a_yarn(name):
    image = cv2.imread(str(FIXTURES / "yarn" / f"{name}.jpg"))
    plain = extract(as_photo(image), None)
    brighter = np.clip(np.rint(1.01 * image), 0, 255).astype(np.uint8)
    _, packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 90])
    again = cv2.imdecode(packed, cv2.IMREAD_COLOR)
    for changed, shift in (
        (image[:, :-1], 0),
        (image[1:], 1),
        (brighter, 0),
        (again, 0),
    ):
        other = extract(as_photo(np.ascontiguousarray(changed)), None)
        assert other.ok
        away = np.subtract(other.tip_px, plain.tip_px) + np.array([0, shift])
        assert np.hypot(*away) < 4.0
        assert other.width_px == pytest.approx(plain.width_px, rel=0.03)
        assert other.length_px == pytest.approx(plain.length_px, rel=0.003)


def scene(colour, heading, angle, **options):
    camera = scene_camera(
        **{"tilt_deg": 5.0, "distortion": (-0.2, 0, 0, 0, 0), **options}
    )
    shape = curve("arc", angle_deg=angle)
    turn = np.radians(heading)
    along = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    points = shape.points_mm @ along
    x, y = np.array([35.0, -25.0]) - 0.5 * (points.min(axis=0) + points.max(axis=0))
    pose = Pose(x_mm=x, y_mm=y, angle_deg=heading, height_mm=0.9)
    what = Scene(
        clamp=Block(pose=pose, colour=colour), centreline=shape,
        light=SceneLight(gloss=0.15),
    )  # fmt: skip
    return what, camera


@pytest.mark.parametrize(
    ("colour", "heading", "angle"),
    [
        (BLACK, 5.0, 100.0),
        (BLUE, 95.0, -60.0),
        (BLACK, 185.0, -140.0),
        (BLUE, -85.0, 40.0),
    ],
)
def test_clamps_of_any_colour_at_any_side(colour, heading, angle):
    what, camera = scene(colour, heading, angle)
    picture = render_scene(what, camera, np.random.default_rng(1))
    data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
    photo = as_photo(cv2.imdecode(data, cv2.IMREAD_COLOR))
    result = extract(photo, camera, rod_height_mm=0.9, clamp_height_mm=4.0)
    assert result.ok, result.reason
    assert what.centreline is not None
    xy = np.column_stack([result.points["x_mm"], result.points["y_mm"]])
    distance = signed_distance(xy, what.centreline.points_mm)
    assert np.sqrt(np.mean(distance**2)) < 0.10
    assert result.length_mm == pytest.approx(30.0, abs=0.08)


@pytest.mark.parametrize("across_mm", [-0.8, 0.6, 0.8])
def test_root_is_found_behind_a_speck(across_mm):
    what, camera = scene(BLUE, 0.0, 40.0)
    picture = render_scene(what, camera, np.random.default_rng(1))
    pose = what.clamp.pose
    place = np.array([[pose.x_mm + 1.6, pose.y_mm + across_mm]])
    (speck,) = np.rint(camera.to_px(place, height_mm=0.9)).astype(int)
    cv2.circle(picture, speck, 6, (40, 40, 40), cv2.FILLED)
    result = extract(as_photo(picture), camera, rod_height_mm=0.9, clamp_height_mm=4.0)
    assert result.ok, result.reason
    assert "clamp_doubtful" not in result.flags
    assert result.length_mm == pytest.approx(30.0, abs=0.08)


def test_arm_that_reaches_far_into_the_picture_is_the_clamp_not_the_rod():
    what, camera = scene(BLACK, 0.0, 0.0, tilt_deg=0.0)
    pose = Pose(x_mm=62.0, y_mm=-15.0, angle_deg=0.0, height_mm=0.9)
    arm = Block(pose=pose, colour=BLACK, width_mm=6.0, length_mm=90.0)
    bent = curve("arc", angle_deg=-170.0, length_mm=20.0)
    bench = replace(what, clamp=arm, centreline=bent, side_mm=0.75)
    picture = render_scene(bench, camera, np.random.default_rng(1))
    result = extract(as_photo(picture), camera, rod_height_mm=0.9, clamp_height_mm=4.0)
    assert result.ok, result.reason
    assert result.length_mm == pytest.approx(20.0, abs=0.05)
    assert result.width_mm == pytest.approx(0.75, abs=0.03)


def test_empty_clamp_is_refused():
    what, camera = scene(BLACK, 0.0, 30.0)
    empty = render_scene(
        replace(what, centreline=None), camera, np.random.default_rng(0)
    )
    result = extract(as_photo(empty), camera)
    assert result.status == "failed"
    assert "no_rod" in result.flags
    assert not result.points
    assert result.reason


def noise(mean: float, sd: float) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.clip(rng.normal(mean, sd, (600, 800)), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("pixels", "flags"),
    [
        (np.zeros((600, 800), np.uint8), {"underexposed"}),
        (np.full((600, 800), 255, np.uint8), {"overexposed"}),
        (noise(210, 4), {"no_rod"}),
        (noise(128, 60), {"no_rod", "no_clamp"}),
    ],
)
def test_pictures_of_nothing_are_refused(pixels, flags):
    result = extract(as_photo(pixels), None)
    assert result.status == "failed"
    assert flags & set(result.flags)
    assert not result.points


def test_rod_without_a_clamp_is_refused_unless_asked_for():
    one = frame("arc", 60.0, 1, clamp_height_mm=0.0)
    photo = as_photo(one.image)
    refused = extract(photo, None)
    assert refused.status == "failed"
    assert "no_clamp" in refused.flags
    asked = extract(photo, None, clamp="none")
    assert asked.ok
    assert asked.length_px == pytest.approx(600.0, abs=0.5)


def test_two_rods_are_refused():
    one, other = (
        frame("arc", angle, 1, size=(1600, 1000), clamp_px=at, angle_deg=0.0)
        for angle, at in ((30.0, (300.0, 300.0)), (-20.0, (300.0, 700.0)))
    )
    both = np.minimum(one.image, other.image)
    result = extract(as_photo(both), None)
    assert result.status == "failed"
    assert "two_rods" in result.flags


def test_rod_that_leaves_the_picture_is_refused():
    one = frame("straight", 0.0, 1, clamp_px=(300.0, 500.0), angle_deg=3.0)
    result = extract(as_photo(one.image[:, :800].copy()), None)
    assert result.status == "failed"
    assert "touches_border" in result.flags or "touches_object" in result.flags


def test_calibration_of_another_size_is_refused():
    one = frame()
    result = extract(as_photo(one.image[:-10]), one.truth.calibration)
    assert result.status == "failed"
    assert result.flags == ("calibration_mismatch",)
    assert "1200 x 1000" in result.reason


def test_wrong_nominal_length_is_flagged():
    one = frame()
    photo = as_photo(one.image)
    right = extract(photo, one.truth.calibration, length_mm=30.0)
    wrong = extract(photo, one.truth.calibration, length_mm=31.0)
    assert "length_mismatch" not in right.flags
    assert "length_mismatch" in wrong.flags


def test_a_rod_much_wider_than_its_specimen_is_flagged():
    one = frame()
    photo = as_photo(one.image)
    wide = extract(photo, one.truth.calibration).width_mm
    for side_mm, is_off in ((0.95 * wide, False), (0.88 * wide, True)):
        found = extract(photo, one.truth.calibration, side_mm=side_mm)
        assert ("width_mismatch" in found.flags) == is_off


def test_so_is_one_under_a_camera_of_unknown_height():
    """Then no finite deviation covers the width."""
    photo = as_photo(frame().image)
    camera = calibrate_known_length(
        (1200, 1000), from_px=(0.0, 0.0), to_px=(600.0, 0.0), length_mm=30.0
    )
    known = {"rod_height_mm": 0.9, "clamp_height_mm": 4.0}
    wide = extract(photo, camera, **known)
    assert not math.isfinite(wide.width_sd_mm)
    for part, is_off in ((1.0, False), (0.5, True)):
        found = extract(photo, camera, side_mm=part * wide.width_mm, **known)
        assert ("width_mismatch" in found.flags) == is_off


@settings(max_examples=40, deadline=None)
@given(arrays(np.uint8, st.tuples(st.integers(16, 60), st.integers(16, 60))))
def test_no_array_makes_it_raise(pixels):
    result = extract(as_photo(pixels), None, clamp="none")
    assert result.status in {"ok", "failed"}
    assert bool(result.points) == result.ok


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
@example(632)
def test_no_scribble_makes_it_raise(seed):
    rng = np.random.default_rng(seed)
    picture = np.full((120, 160), 230, np.uint8)
    for _ in range(rng.integers(1, 8)):
        points = rng.integers(-20, 180, (rng.integers(2, 6), 2)).astype(np.int32)
        thick = int(rng.integers(1, 14))
        cv2.polylines(picture, [points], False, int(rng.integers(0, 200)), thick)
    result = extract(as_photo(picture), None, clamp="none")
    assert bool(result.points) == result.ok
    assert result.ok or result.reason


@pytest.mark.parametrize(("widths", "told"), [(4, True), (9, False)])
def test_a_stub_is_told_how_long_a_rod_is_at_least(widths, told):
    light = np.full((400, 600), 0.7, dtype=np.float32)
    light[120:280, :150] = 0.2
    light[190:210, 150 : 150 + 20 * widths] = 0.02
    grey = 255.0 * cv2.GaussianBlur(light, (0, 0), 1.0) ** (1.0 / 2.2)
    found = extract(as_photo(grey.astype(np.uint8)), None)
    assert found.ok is not told
    assert ("6 times as long as wide" in found.reason) is told
