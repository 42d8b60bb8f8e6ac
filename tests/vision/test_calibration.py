"""Pixels to mm and back, and the fit of a camera to photographs of a board."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from magbend.core.errors import ConfigError, InputError, VisionError
from magbend.vision.camera.board import Board
from magbend.vision.camera.bundle import Corners, default_prior, fit_bundle
from magbend.vision.camera.calibrate import calibrate, calibrate_known_length
from magbend.vision.camera.calibration import (
    Calibration,
    scale_calibration,
    specimen_to_px,
)
from magbend.vision.camera.calibration_file import (
    read_calibration,
    write_calibration,
)
from magbend.vision.camera.projection import local_view
from magbend.vision.measurement import Pose
from magbend.vision.picture.photo import Photo, as_photo, read_photo
from magbend.vision.synthetic import render_board, scene_camera

FIXTURES = Path(__file__).parents[2] / "examples" / "photographs"
BOARD = Board()


def grid(size=(1600, 1200), border=60):
    x = np.linspace(border, size[0] - border, 9)
    y = np.linspace(border, size[1] - border, 7)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def shape_error_um(measured_mm, true_mm):
    """Largest distance after the best rigid motion: what bends a measured rod."""
    a, b = measured_mm - measured_mm.mean(axis=0), true_mm - true_mm.mean(axis=0)
    u, _, v = np.linalg.svd(a.T @ b)
    return 1e3 * np.hypot(*(a @ (u @ v) - b).T).max()


def board_photo(camera, seed=0, name="board.png", **kw) -> Photo:
    picture = render_board(BOARD, camera, np.random.default_rng(seed), **kw)
    return as_photo(picture, source=name)


def lens_views(camera_options, tilts):
    return [
        board_photo(
            scene_camera(**(camera_options | {"tilt_deg": tilt, "turn_deg": turn,
                                              "tilt_direction_deg": direction})),
            seed=i, name=f"lens{i}.png",
        )
        for i, (tilt, direction, turn) in enumerate(tilts)
    ]  # fmt: skip


@settings(max_examples=40, deadline=None)
@given(
    tilt=st.floats(0.0, 25.0), direction=st.floats(0.0, 360.0),
    turn=st.floats(-180.0, 180.0), k1=st.floats(-0.3, 0.3), height=st.floats(-5, 20),
)  # fmt: skip
def test_to_px_undoes_to_mm(tilt, direction, turn, k1, height):
    camera = scene_camera(
        tilt_deg=tilt, tilt_direction_deg=direction, turn_deg=turn, focal_px=2500.0,
        height_mm=150.0, distortion=(k1, 0.02, 1e-3, -1e-3, 0.0),
    )  # fmt: skip
    pixels = grid()
    back = camera.to_px(camera.to_mm(pixels, height_mm=height), height_mm=height)
    assert np.abs(back - pixels).max() < 1e-7


def test_agrees_with_opencv_projection():
    camera = scene_camera(
        tilt_deg=7.0, turn_deg=20.0, distortion=(-0.2, 0.05, 1e-3, 2e-3, 0.01),
        focal_px=1800.0, height_mm=90.0,
    )  # fmt: skip
    points = camera.to_mm(grid(), height_mm=2.0)
    space = np.column_stack([points, np.full(len(points), 2.0)])
    matrix = np.array(
        [
            [1800.0, 0.0, camera.centre_px[0]],
            [0.0, 1800.0, camera.centre_px[1]],
            [0, 0, 1],
        ]
    )
    turn, _ = cv2.Rodrigues(camera.rotation)
    theirs, _ = cv2.projectPoints(
        space, turn, camera.translation_mm, matrix, np.array(camera.distortion)
    )
    ours = camera.to_px(points, height_mm=2.0)
    np.testing.assert_allclose(ours, theirs.reshape(-1, 2), atol=1e-8)


def test_a_curve_is_seen_as_its_points_move_by_a_pixel_and_by_a_millimetre():
    camera = scene_camera(
        tilt_deg=18.0, turn_deg=20.0, distortion=(-0.2, 0.05, 1e-3, 2e-3, 0.01),
        focal_px=1800.0, height_mm=90.0,
    )  # fmt: skip
    points, theta = grid()[::7], np.linspace(-3.0, 9.0, len(grid()[::7]))
    seen = local_view(camera.camera, points, theta, 2.0)
    along = np.column_stack([np.cos(theta), np.sin(theta)])
    right = np.column_stack([-along[:, 1], along[:, 0]])
    at = camera.to_mm(points, height_mm=2.0)
    ahead, aside = (
        camera.to_mm(points + 0.5 * by, height_mm=2.0)
        - camera.to_mm(points - 0.5 * by, height_mm=2.0)
        for by in (along, right)
    )
    risen = camera.to_px(at, height_mm=2.5) - camera.to_px(at, height_mm=1.5)
    np.testing.assert_allclose(np.column_stack(seen[:2]), at, atol=1e-10)
    apart = seen.heading - np.arctan2(ahead[:, 1], ahead[:, 0])
    np.testing.assert_allclose(np.sin(apart), 0.0, atol=1e-7)
    np.testing.assert_allclose(seen.along, 1.0 / np.hypot(*ahead.T), rtol=1e-6)
    np.testing.assert_allclose(seen.across, 1.0 / np.hypot(*aside.T), rtol=1e-6)
    np.testing.assert_allclose(seen.rise_along, np.sum(risen * along, axis=1))
    np.testing.assert_allclose(seen.rise_across, np.sum(risen * right, axis=1))


def test_frame_has_y_to_the_left_of_x_in_the_picture():
    camera = scene_camera(turn_deg=37.0)
    origin, along, left = camera.to_px(
        np.array([[35.0, -25.0], [36.0, -25.0], [35.0, -24.0]])
    )
    (a, b), (c, d) = along - origin, left - origin
    assert a * d - b * c < 0.0  # y runs down in pixels, so left is clockwise there


def test_height_shrinks_the_scale_by_the_camera_distance():
    camera = scene_camera(tilt_deg=0.0, height_mm=330.0)
    low, high = (camera.mm_per_px((799.5, 599.5), height_mm=h) for h in (0.0, 3.3))
    assert high / low == pytest.approx(0.99, abs=1e-9)


def test_specimen_frame_lands_where_its_pose_says():
    camera = scene_camera()
    pose = Pose(x_mm=20.0, y_mm=-30.0, angle_deg=90.0, height_mm=0.9)
    (pixel,) = specimen_to_px(camera, pose, np.array([[5.0, 2.0]]))
    expected = camera.to_px(np.array([[18.0, -25.0]]), height_mm=0.9)[0]
    np.testing.assert_allclose(pixel, expected, atol=1e-9)
    points = np.array([[0.0, 0.0], [3.0, -4.0]])
    np.testing.assert_allclose(
        pose.from_board(pose.to_board(points)), points, atol=1e-12
    )


def test_saved_calibration_comes_back(tmp_path):
    camera = scene_camera(distortion=(-0.1, 0.01, 1e-4, 2e-4, 0.0))
    path = tmp_path / "calibration.json"
    write_calibration(camera, path)
    back = read_calibration(path)
    np.testing.assert_array_equal(back.to_mm(grid()), camera.to_mm(grid()))
    flat = scale_calibration(mm_per_px=0.05, image_size_px=(100, 80))
    write_calibration(flat, path)
    assert read_calibration(path).camera_height_sd_mm == np.inf


@pytest.mark.parametrize("told", [None, 0.0, 0.9])
def test_a_rod_height_that_was_told_is_one_that_comes_back(tmp_path, told):
    path = tmp_path / "calibration.json"
    write_calibration(replace(scene_camera(), rod_height_mm=told), str(path))
    assert read_calibration(str(path)).rod_height_mm == told
    # Files of before wrote 0 where nobody had told it.
    before = path.read_text().replace('"schema": 2', '"schema": 1')
    path.write_text(before.replace('"rod_height_mm": null', '"rod_height_mm": 0.0'))
    assert read_calibration(path).rod_height_mm == (told or None)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.pop("focal_px"), "focal_px"),
        (lambda d: d.update(focal=3), "focal"),
        (lambda d: d.update(focal_px=[-1.0, 2500.0]), "focal_px"),
        (lambda d: d.update(board_to_camera_rotation=[[1, 0, 0]] * 3), "rotation"),
    ],
)
def test_damaged_calibration_is_refused_in_a_sentence(tmp_path, change, words):
    path = tmp_path / "calibration.json"
    write_calibration(scene_camera(), path)
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    with pytest.raises(ConfigError, match=words):
        read_calibration(path)


def test_missing_calibration_is_refused(tmp_path):
    path = tmp_path / "calibration.json"
    with pytest.raises(
        ConfigError, match=f"no such file; .* calibrate .* --out {path}"
    ):
        read_calibration(path)


def test_text_in_place_of_a_calibration_is_no_json(tmp_path):
    path = tmp_path / "text.jpg"
    path.write_text("not a camera")
    with pytest.raises(ConfigError, match=r"text\.jpg: it is not valid JSON"):
        read_calibration(path)


def test_photograph_of_another_size_is_refused():
    with pytest.raises(VisionError, match=r"1600 x 1200 px; .* not turned or scaled"):
        scene_camera().check_size(1200, 1600)


def rendered_truth() -> tuple[Calibration, np.ndarray, np.ndarray]:
    truth = json.loads((FIXTURES / "calib_D.json").read_text())
    matrix = np.array(truth["K"])
    u, _, v = np.linalg.svd(np.array(truth["R_world_to_cam"]))
    camera = replace(
        scene_camera(),
        focal_px=(matrix[0, 0], matrix[1, 1]), centre_px=(matrix[0, 2], matrix[1, 2]),
        rotation=u @ v, translation_mm=np.array(truth["t_world_to_cam_mm"]),
    )  # fmt: skip
    turn = np.array(truth["R_board_to_world"]) @ np.diag([1.0, -1.0, -1.0])
    return camera, turn, np.array(truth["t_board_to_world_mm"])


@pytest.mark.parametrize(("height", "limit_um"), [(0.0, 10.0), (0.9, 15.0)])
def test_one_rendered_photograph_gives_the_plane(height, limit_um):
    """Against the path tracer's own camera, over the whole picture."""
    camera, turn, origin = rendered_truth()
    found = calibrate(read_photo(FIXTURES / "calib_D.jpg"), board=BOARD)
    world = camera.to_mm(grid(), height_mm=height)
    space = np.column_stack([world, np.full(len(world), height)])
    board = (space - origin) @ turn
    np.testing.assert_allclose(board[:, 2], height, atol=1e-3)
    measured = found.to_mm(grid(), height_mm=height)
    assert np.hypot(*(measured - board[:, :2]).T).max() < 1e-3 * limit_um
    assert found.rms_px < 0.08
    # The truth lies within two of the standard deviations it claims.
    assert abs(found.camera_height_mm - 329.87) < 2.0 * found.camera_height_sd_mm
    assert found.camera_height_sd_mm < 0.25 * found.camera_height_mm


def test_camera_height_given_by_hand_is_kept():
    found = calibrate(
        read_photo(FIXTURES / "calib_D.jpg"), board=BOARD, camera_height_mm=330.0
    )
    assert found.camera_height_mm == pytest.approx(330.0, rel=0.02)
    assert found.camera_height_sd_mm < 0.025 * 330.0
    assert found.camera_height_source == "given"


def test_a_camera_close_above_the_board_takes_its_height_by_hand():
    """From a distant start the fit steps through poses below the board."""
    truth = scene_camera(focal_px=1500.0, height_mm=46.3, target_mm=(17.5, -12.5))
    board = 5.0 * np.stack(np.meshgrid(np.arange(1, 7), np.arange(1, 5)), axis=-1)
    board_mm = board.reshape(-1, 2)
    noise = np.random.default_rng(1).normal(0.0, 0.03, board_mm.shape)
    corners = Corners(
        board_mm=board_mm, points_px=truth.to_px(board_mm * [1.0, -1.0]) + noise
    )
    prior = default_prior(truth.image_size_px, views=1, distance_mm=46.0)
    found = fit_bundle([corners], truth.image_size_px, prior)
    assert found.focal_px == pytest.approx(1500.0, rel=0.03)


def lean(camera, at_mm):
    return (camera.camera_mm[:2] - at_mm) / camera.camera_height_mm


def test_a_camera_says_how_well_it_knows_how_squarely_it_looks():
    rng = np.random.default_rng(11)
    board = 5.0 * np.stack(np.meshgrid(np.arange(1, 9), np.arange(1, 7)), axis=-1)
    board_mm = board.reshape(-1, 2)
    off = []
    here = np.array([22.0, -17.0])
    for _ in range(3):
        truth = scene_camera(focal_px=5000.0, target_mm=(22.0, -17.0), tilt_deg=2.0)
        centre = truth.centre_px + 0.015 * 1600.0 * rng.standard_normal(2)
        truth = replace(truth, centre_px=(float(centre[0]), float(centre[1])))
        points = truth.to_px(board_mm * [1.0, -1.0])
        points += 0.03 * rng.standard_normal(points.shape)
        corners = Corners(board_mm=board_mm, points_px=points)
        prior = default_prior(
            truth.image_size_px, views=1, distance_mm=truth.camera_height_mm
        )
        fit = fit_bundle([corners], truth.image_size_px, prior)
        found = replace(
            truth, translation_mm=fit.translations[0],
            rotation=fit.rotations[0] @ np.diag([1.0, -1.0, -1.0]),
        )  # fmt: skip
        off.append((lean(found, here) - lean(truth, here)) / fit.tilt_sd)
    assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.5


def test_a_scale_alone_was_taken_by_eye(tmp_path):
    path = tmp_path / "calibration.json"
    write_calibration(scale_calibration(mm_per_px=0.1, image_size_px=(90, 80)), path)
    kept = read_calibration(path).tilt_sd_deg
    assert kept > 0.1
    data = json.loads(path.read_text())
    del data["tilt_sd_deg"]  # as files of before have it
    path.write_text(json.dumps(data))
    assert read_calibration(path).tilt_sd_deg == kept


LENS = {
    "focal_px": 1200.0, "height_mm": 118.0, "size_px": (800, 600),
    "distortion": (-0.18, 0.04, 4e-4, -3e-4, 0.0),
}  # fmt: skip
TILTS = [(25.0, d, t) for d, t in ((0, 0), (90, 5), (180, -5), (270, 10), (45, 90))]


def test_lens_views_recover_a_barrel_lens():
    truth = scene_camera(**LENS, tilt_deg=6.0)
    found = calibrate(board_photo(truth), lens_views(LENS, TILTS), board=BOARD)
    assert all(view.used for view in found.views)
    assert found.focal_px[0] == pytest.approx(1200.0, rel=0.01)
    assert found.distortion[0] == pytest.approx(-0.18, abs=0.02)
    assert found.camera_height_mm == pytest.approx(truth.camera_height_mm, rel=0.01)
    small = grid((800, 600), border=30)
    for height in (0.0, 5.0):
        error = shape_error_um(
            found.to_mm(small, height_mm=height), truth.to_mm(small, height_mm=height)
        )
        assert error < 40.0


def test_two_lens_views_do_not_bend_the_corners_of_a_long_lens():
    """What no corner sees must stay as lenses are: a free k2 was off by 60 to 95 um."""
    lens = {"focal_px": 3750.0, "height_mm": 250.0,
            "distortion": (-0.12, 0.02, 0.0, 0.0, 0.0)}  # fmt: skip
    truth = scene_camera(**lens, tilt_deg=7.0)
    views = lens_views(lens, [(25.0, 20.0, 5.0), (30.0, 200.0, -8.0)])
    found = calibrate(board_photo(truth), views, board=BOARD)
    assert shape_error_um(found.to_mm(grid()), truth.to_mm(grid())) < 30.0


def test_one_view_of_a_wide_lens_leaves_it_its_distortion():
    lens = {"focal_px": 1280.0, "height_mm": 80.0, "tilt_deg": 4.0,
            "distortion": (0.05, -0.05, 0.0, 0.0, 0.0)}  # fmt: skip
    truth = scene_camera(**lens)
    found = calibrate(board_photo(truth), board=BOARD)
    assert found.distortion[1] == pytest.approx(-0.05, abs=0.03)
    assert found.focal_px[0] == pytest.approx(1280.0, rel=0.04)


def test_a_bad_lens_view_is_dropped_and_named():
    truth = scene_camera(**LENS, tilt_deg=6.0)
    views = lens_views(LENS, TILTS)
    bent = views[2].grey.copy()
    bent[:, 400:] = np.roll(bent, 6, axis=0)[:, 400:]  # a board that is not flat
    bad = replace(views[2], grey=bent, source="bent.png")
    blank = Photo(grey=np.full((600, 800), 0.7, dtype=np.float32), source="blank.png")
    small = Photo(grey=np.full((300, 400), 0.7, dtype=np.float32), source="small.png")
    found = calibrate(
        board_photo(truth), [*views[:2], bad, *views[3:], blank, small], board=BOARD
    )
    verdict = {view.name: view for view in found.views}
    assert not verdict["bent.png"].used
    assert "median" in verdict["bent.png"].why_not
    assert "no board" in verdict["blank.png"].why_not
    assert "400 x 300" in verdict["small.png"].why_not
    assert found.focal_px[0] == pytest.approx(1200.0, rel=0.01)


def test_one_view_says_how_little_it_knows_of_the_camera():
    squarely = scene_camera(tilt_deg=0.0)
    found = calibrate(board_photo(squarely), board=BOARD)
    assert found.camera_height_sd_mm > 0.3 * found.camera_height_mm
    assert "hardly" in found.camera_height_source
    # The plane itself is good all the same.
    assert shape_error_um(found.to_mm(grid()), squarely.to_mm(grid())) < 20.0


def test_print_scale_scales_the_millimetres():
    photo = read_photo(FIXTURES / "calib_D.jpg")
    plain = calibrate(photo, board=BOARD)
    scaled = calibrate(photo, board=replace(BOARD, print_scale=1.004))
    point = (800.0, 600.0)
    ratio = scaled.mm_per_px(point, height_mm=0.0) / plain.mm_per_px(
        point, height_mm=0.0
    )
    assert ratio == pytest.approx(1.004, abs=1e-4)


@pytest.mark.parametrize("level", [0.0, 1.0, 0.5])
def test_photograph_without_a_board_is_refused(level):
    photo = Photo(grey=np.full((400, 500), level, dtype=np.float32), source="x.png")
    with pytest.raises(VisionError, match="no board"):
        calibrate(photo, board=BOARD)


def test_board_with_more_rows_than_said_is_refused():
    """Its squares may be of another size, and the scale would be wrong by that."""
    printed = Board(columns=7, rows=7, square_mm=7.0, marker_mm=5.25)
    picture = render_board(printed, scene_camera(), np.random.default_rng(0))
    with pytest.raises(VisionError, match="which board"):
        calibrate(as_photo(picture), board=BOARD)
    assert calibrate(as_photo(picture), board=printed).rms_px < 0.1


def test_board_that_is_not_flat_is_refused():
    photo = board_photo(scene_camera())
    bent = photo.grey.copy()
    bent[:, 800:] = np.roll(bent, 25, axis=0)[:, 800:]
    with pytest.raises(VisionError, match="flat"):
        calibrate(replace(photo, grey=bent), board=BOARD)


def test_mirrored_board_is_refused():
    photo = board_photo(scene_camera())
    with pytest.raises(VisionError):
        calibrate(
            replace(photo, grey=np.ascontiguousarray(photo.grey[:, ::-1])), board=BOARD
        )


def test_known_length_gives_the_scale():
    found = calibrate_known_length(
        (1600, 1200), from_px=(100.0, 100.0), to_px=(400.0, 500.0), length_mm=25.0
    )
    points = found.to_mm(np.array([[100.0, 100.0], [400.0, 500.0]]), height_mm=3.0)
    assert np.hypot(*np.diff(points, axis=0)[0]) == pytest.approx(25.0, rel=1e-8)
    assert found.scale_relative_sd == pytest.approx(np.sqrt(2.0) / 500.0)
    assert "no correction" in found.camera_height_source
    with pytest.raises(InputError, match="at least 10 px"):
        calibrate_known_length((99, 99), from_px=(1, 1), to_px=(2, 2), length_mm=25.0)
    with pytest.raises(InputError, match="99 x 99 px; instead received 1e"):
        calibrate_known_length((99, 99), from_px=(1, 1), to_px=(1e9, 2), length_mm=25.0)


@pytest.mark.parametrize(
    ("camera_mm", "rod_mm", "named"),
    [
        (-5.0, 0.0, "camera_height_mm must be above zero"),
        (0.0, 0.0, "camera_height_mm must be above zero"),
        (math.inf, 0.0, "camera_height_mm must be a finite number"),
        (3.0, 5.0, "less than the height of the camera above the plane, 3 mm"),
        (330.0, math.nan, "rod_height_mm must be a finite number"),
    ],
)
def test_a_scale_needs_a_camera_above_plane_and_rod(camera_mm, rod_mm, named):
    with pytest.raises(InputError, match=named):
        scale_calibration(
            mm_per_px=0.05,
            image_size_px=(900, 600),
            camera_height_mm=camera_mm,
            rod_height_mm=rod_mm,
        )
