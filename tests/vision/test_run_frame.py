"""A run in the frame of its one clamp: tables that agree, and lose nothing."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from magbend.vision import Setting
from magbend.vision.batch.run import extract_files
from magbend.vision.batch.tables import read_centrelines, read_frames
from magbend.vision.camera.calibration import scale_calibration
from magbend.vision.synthetic.square_view import CLEAN, curve, draw

SIZE, SCALE, HEADING = (900, 640), 16.0, 5.0
SETTINGS = Setting(
    calibration=scale_calibration(mm_per_px=1.0 / SCALE, image_size_px=SIZE)
)
BENDS = (3.0, 30.0, 60.0, 90.0)
TABLES = ("frames.csv", "centrelines.csv")


def picture(bend_deg, turn_deg=0.0, shift_px=0.0):
    return draw(
        curve("arc", angle_deg=bend_deg), np.random.default_rng(int(bend_deg)),
        px_per_mm=SCALE, size_px=SIZE, light=CLEAN, angle_deg=HEADING + turn_deg,
        clamp_px=(200.0 + shift_px, 520.0 - shift_px),
    )  # fmt: skip


def write(run, images):
    (run / "images").mkdir(parents=True)
    (run / "run.json").write_text("{}")
    for index, image in enumerate(images):
        assert cv2.imwrite(str(run / "images" / f"step_{index:03d}.png"), image)
    return run


@pytest.fixture(scope="module")
def frames():
    return [picture(bend) for bend in BENDS]


@pytest.fixture(scope="module")
def run(frames, tmp_path_factory):
    images = [frame.image for frame in frames]
    images.insert(2, np.full_like(images[0], 230))  # refused: no rod
    return write(tmp_path_factory.mktemp("runs") / "gmc2", images)


def extracted(run, out, **options):
    result = extract_files(
        [run], out, setting=SETTINGS, overlays=False, **options
    )  # fmt: skip
    return result.frames, read_centrelines(out / "centrelines.csv")


@pytest.fixture(scope="module")
def shared(run, tmp_path_factory):
    out = tmp_path_factory.mktemp("shared")
    edges = out / "edges.csv"
    rows, lines = extracted(run, out, edges=edges)
    return out, rows, lines


@pytest.fixture(scope="module")
def own(run, tmp_path_factory):
    out = tmp_path_factory.mktemp("own")
    return extracted(run, out, edges=out / "edges.csv", shared_clamp=False)


def test_a_run_has_one_direction_and_keeps_every_reading(shared, own):
    _, rows, _ = shared
    measured = [row for row in rows if row.ok]
    assert len(measured) == len(BENDS)
    assert {row.shared_clamp for row in measured} == {"gmc2"}
    assert len({row.pose.angle_deg for row in measured}) == 1
    assert len({row.clamp_angle_sd_deg for row in measured}) == 1
    for row, alone in zip(rows, own[0], strict=True):
        if row.ok:
            assert not alone.shared_clamp
            assert row.own_angle_deg == alone.pose.angle_deg
            assert row.own_angle_sd_deg == alone.clamp_angle_sd_deg
            assert (row.pose.x_mm, row.pose.y_mm) == (alone.pose.x_mm, alone.pose.y_mm)
        else:
            assert not row.shared_clamp
            assert math.isnan(row.own_angle_deg)


def test_the_rod_itself_stays_where_it_is(shared, own):
    out, rows, lines = shared
    for row, alone in zip(rows, own[0], strict=True):
        if not row.ok:
            continue
        one, other = lines[row.image], own[1][row.image]
        seen = row.pose.to_board(np.column_stack([one["x_mm"], one["y_mm"]]))
        was = alone.pose.to_board(np.column_stack([other["x_mm"], other["y_mm"]]))
        np.testing.assert_allclose(seen, was, atol=1e-7)
        np.testing.assert_allclose(seen[-1], row.pose.to_board([row.tip_mm])[0])
        for name in ("s_mm", "kappa_per_mm", "width_mm", "sigma_mm", "x_px", "good"):
            np.testing.assert_array_equal(one[name], other[name])
        heading = row.pose.angle_deg + np.degrees(one["theta_rad"])
        np.testing.assert_allclose(
            heading, alone.pose.angle_deg + np.degrees(other["theta_rad"]), atol=1e-6
        )
        assert heading[-1] == pytest.approx(row.pose.angle_deg + row.tip_angle_deg)
    for line in (out / "edges.csv").read_text().splitlines()[1:]:
        image, _, _, x_px, y_px, x_mm, y_mm = line.split(",")
        pose = next(row.pose for row in rows if row.image == image)
        seen = pose.to_board([[float(x_mm), float(y_mm)]])
        where = SETTINGS.calibration.to_mm(np.array([[float(x_px), float(y_px)]]))
        np.testing.assert_allclose(seen, where, atol=1e-6)


def test_resumed_or_in_two_processes_the_tables_say_the_same(run, shared, tmp_path):
    out, _, _ = shared

    def stop(done, _total):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        extracted(run, tmp_path, progress=stop)
    assert len(read_frames(tmp_path / "frames.csv")) == 3
    extracted(run, tmp_path, resume=True)
    for name in TABLES:
        assert_same(tmp_path / name, out / name)
    extracted(run, tmp_path / "two", workers=2)
    for name in TABLES:
        assert (tmp_path / "two" / name).read_text() == (out / name).read_text()


def test_own_clamps_come_back_from_a_shared_table(run, own, tmp_path):
    extracted(run, tmp_path)
    rows, lines = extracted(run, tmp_path, resume=True, shared_clamp=False)
    assert not any(row.shared_clamp for row in rows)
    for row, alone in zip(rows, own[0], strict=True):
        np.testing.assert_allclose(row.tip_mm, alone.tip_mm, atol=1e-8)
        assert set(row.flags) == set(alone.flags)
        if row.ok:
            for name, values in own[1][row.image].items():
                np.testing.assert_allclose(lines[row.image][name], values, atol=1e-8)


def assert_same(one, other):
    """Compare tables cell by cell; numbers of ten digits, turned and turned back.

    Of the tip's deviations the direction's share is taken out and put in again, of
    squares: there half of the digits are left.
    """
    first, second = (path.read_text().splitlines() for path in (one, other))
    names = first[0].split(",")
    for a, b in zip(first, second, strict=True):
        for name, x, y in zip(names, a.split(","), b.split(","), strict=True):
            if x != y:
                rel = 1e-3 if name.startswith("tip_") and "_sd_" in name else 2e-9
                assert float(x) == pytest.approx(float(y), rel=rel, abs=2e-8)


def test_loose_photographs_share_a_clamp_only_when_told(run, tmp_path):
    files = sorted((run / "images").iterdir())
    for told, name in ((None, ""), (True, "photographs")):
        result = extract_files(
            files, tmp_path / str(told), setting=SETTINGS, overlays=False,
            shared_clamp=told,
        )  # fmt: skip
        assert {row.shared_clamp for row in result.frames if row.ok} == {name}


@pytest.mark.parametrize("move", [{"turn_deg": 2.0}, {"shift_px": 3.0}])
def test_a_clamp_that_moves_is_named_and_nothing_is_shared(frames, tmp_path, move):
    images = [frame.image for frame in frames[:2]]
    images += [picture(bend, **move).image for bend in BENDS[2:]]
    rows, _ = extracted(write(tmp_path / "run", images), tmp_path / "out")
    for row in rows:
        assert "clamp_moved" in row.flags
        assert not row.shared_clamp
        assert row.own_angle_deg == row.pose.angle_deg
        assert row.own_angle_sd_deg == row.clamp_angle_sd_deg


def test_pixels_have_no_frame_to_share(run, tmp_path):
    result = extract_files([run], tmp_path, setting=Setting(), overlays=False)
    assert result.measured == len(BENDS)
    assert not any(row.shared_clamp for row in result.frames)


def test_a_photograph_in_which_the_rod_has_another_length_is_named(frames, tmp_path):
    images = [frame.image for frame in frames]
    nearer = draw(
        curve("arc", angle_deg=45.0), np.random.default_rng(9),
        px_per_mm=1.01 * SCALE, size_px=SIZE, light=CLEAN, angle_deg=HEADING,
        clamp_px=(200.0, 520.0),
    )  # fmt: skip
    run = write(tmp_path / "raised", [*images, nearer.image])
    rows, _ = extracted(run, tmp_path / "out")
    assert ["length_differs" in row.flags for row in rows] == 4 * [False] + [True]
    again, _ = extracted(run, tmp_path / "out", resume=True, shared_clamp=False)
    assert not any("length_differs" in row.flags for row in again)
