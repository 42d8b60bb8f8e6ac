"""Many photographs: a row for each, whole tables, refusals with reasons, resuming."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from magbend.core.errors import VisionError
from magbend.vision import Setting, read_bare
from magbend.vision.batch.overlay import draw_overlay
from magbend.vision.batch.run import _single_threaded_children, extract_files
from magbend.vision.batch.tables import read_centrelines, read_frames, to_centreline
from magbend.vision.camera.calibration import scale_calibration
from magbend.vision.measurement import DEVIATION_COLUMNS, POINT_COLUMNS, failure
from magbend.vision.picture.photo import Photo, read_photo
from magbend.vision.synthetic.scoring import signed_distance
from magbend.vision.synthetic.square_view import CLEAN, curve, draw

SIZE = (900, 640)
SCALE = 16.0
CALIBRATION = scale_calibration(mm_per_px=1.0 / SCALE, image_size_px=SIZE)
SETTINGS = Setting(calibration=CALIBRATION)


def frame(seed=0, angle=40.0, **options):
    return draw(
        curve("arc", angle_deg=angle), np.random.default_rng(seed), px_per_mm=SCALE,
        size_px=SIZE, light=CLEAN, **options,
    )  # fmt: skip


def save(path: Path, image) -> Path:
    assert cv2.imwrite(str(path), image)
    return path


@pytest.fixture(scope="module")
def good():
    return frame(clamp_px=(200.0, 420.0), angle_deg=5.0)


@pytest.fixture
def folder(tmp_path, good):
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    save(pictures / "b.png", good.image)
    save(pictures / "a.png", np.full_like(good.image, 230))
    save(pictures / "c.png", good.image[::-1])
    (pictures / "notes.txt").write_text("not a picture")
    return pictures


def test_tables_hold_what_was_measured(tmp_path, folder, good):
    out = tmp_path / "out"
    result = extract_files([folder], out, setting=SETTINGS)
    assert [row.image for row in result.frames] == ["a.png", "b.png", "c.png"]
    assert [row.status for row in result.frames] == ["failed", "ok", "ok"]
    assert result.measured == 2
    refused, ok, mirrored = read_frames(out / "frames.csv")
    assert refused.flags
    assert refused.reason
    assert np.isnan(refused.length_mm)
    assert ok.length_mm == pytest.approx(30.0, abs=0.1)
    np.testing.assert_allclose(ok.tip_mm, good.truth.centreline.tip_mm, atol=0.1)
    assert mirrored.tip_mm[1] == pytest.approx(-ok.tip_mm[1], abs=0.02)
    assert ok.pose is not None
    lines = read_centrelines(out / "centrelines.csv")
    assert set(lines) == {"b.png", "c.png"}  # a refusal has no centreline
    assert tuple(lines["b.png"]) == (*POINT_COLUMNS, *DEVIATION_COLUMNS)
    line = to_centreline(lines["b.png"])
    distance = signed_distance(line.points_mm, good.truth.centreline.points_mm)
    assert np.abs(distance).max() < 0.05
    assert np.abs(np.diff(lines["b.png"]["good"])).max() <= 1.0
    for name in "abc":
        picture = cv2.imread(str(out / "overlays" / f"{name}.png"))
        assert picture.shape[1] == SIZE[0]
        assert picture.shape[0] > SIZE[1]  # its words stand below


def test_tables_without_the_deviations_are_read_as_before(tmp_path, folder):
    out = tmp_path / "out"
    extract_files([folder], out, setting=SETTINGS, overlays=False)
    new = read_centrelines(out / "centrelines.csv")
    old = tmp_path / "old.csv"
    lines = (out / "centrelines.csv").read_text().splitlines()
    old.write_text("".join(line.rsplit(",", 3)[0] + "\n" for line in lines))
    read = read_centrelines(old)["b.png"]
    for name in POINT_COLUMNS:
        np.testing.assert_equal(read[name], new["b.png"][name])
    for name in DEVIATION_COLUMNS:
        assert np.all(np.isnan(read[name]))


def test_header_is_the_contract(tmp_path, folder):
    out = tmp_path / "out"
    extract_files([folder], out, setting=SETTINGS, overlays=False)
    assert (out / "centrelines.csv").read_text().splitlines()[0] == (
        "image,s_mm,x_mm,y_mm,theta_rad,kappa_per_mm,width_mm,sigma_mm,x_px,y_px,good,"
        "sigma_theta_rad,sigma_kappa_per_mm,sigma_width_mm"
    )
    assert (out / "frames.csv").read_text().splitlines()[0].startswith(
        "image,status,flags,length_mm,tip_x_mm,tip_y_mm,tip_angle_deg,width_mm,"
        "clamp_x_px,clamp_y_px,tip_x_px,tip_y_px"
    )  # fmt: skip
    assert not (out / "overlays").exists()


def test_without_calibration_there_are_pixels_only(tmp_path, folder, good):
    out = tmp_path / "out"
    extract_files([folder / "b.png"], out, setting=Setting(), overlays=False)
    (row,) = read_frames(out / "frames.csv")
    assert row.ok
    assert "uncalibrated" in row.flags
    assert row.pose is None
    assert np.isnan(row.length_mm)
    np.testing.assert_allclose(row.tip_px, good.truth.tip_px, atol=1.0)
    columns = read_centrelines(out / "centrelines.csv")["b.png"]
    assert np.all(np.isnan(columns["x_mm"]))
    assert np.all(np.isfinite(columns["x_px"]))


def broken_files(folder: Path, image) -> dict[str, Path]:
    _, data = cv2.imencode(".png", image)
    png = data.tobytes()
    _, data = cv2.imencode(".jpg", image)
    jpeg = data.tobytes()
    contents = {
        "empty.png": b"",
        "cut.png": png[: len(png) // 2],
        "cut.jpg": jpeg[: len(jpeg) // 2],
        "text.png": b"this is no picture, whatever its name says" * 20,
        "paper.png": b"%PDF-1.4\n1 0 obj\n<< /Type /Catalog >>\nendobj\n%%EOF\n",
    }
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    height, width = image.shape
    pictures = {
        "dot.png": image[:1, :1],
        "huge.png": np.zeros((10_000, 10_000), dtype=np.uint8),
        "black.png": np.zeros_like(image),
        "white.png": np.full_like(image, 255),
        "small.png": image[: height // 2, : width // 2],
    }
    for name, picture in pictures.items():
        save(folder / name, picture)
    return {path.name: path for path in folder.iterdir()}


def test_every_bad_picture_has_a_row_that_says_why(tmp_path, good):
    bad = tmp_path / "bad"
    bad.mkdir()
    files = broken_files(bad, good.image)
    os.mkfifo(bad / "pipe.png")
    (bad / "gone.png").symlink_to(tmp_path / "nowhere.png")
    (bad / "folder.png").mkdir()
    save(bad / "zz_good.png", good.image)
    out = tmp_path / "out"
    result = extract_files([bad], out, setting=SETTINGS)
    rows = {row.image: row for row in result.frames}
    assert rows.pop("zz_good.png").ok
    assert set(rows) == {*files, "pipe.png", "gone.png"}
    for row in rows.values():
        assert row.status == "failed"
        assert row.flags
        assert len(row.reason) > 15
        assert "Errno" not in row.reason
    for name in (
        "empty.png",
        "cut.png",
        "cut.jpg",
        "text.png",
        "paper.png",
        "pipe.png",
    ):
        assert rows[name].flags == ("unreadable",), name
    assert "calibration_mismatch" in rows["small.png"].flags
    assert set(read_centrelines(out / "centrelines.csv")) == {"zz_good.png"}


def test_kinds_of_files_that_cameras_write_are_measured(tmp_path, good):
    image = good.image
    colour = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    transparent = cv2.cvtColor(image, cv2.COLOR_GRAY2BGRA)
    save(tmp_path / "deep.png", image.astype(np.uint16) * 257)
    save(tmp_path / "colour.tiff", colour)
    save(tmp_path / "alpha.png", transparent)
    save(tmp_path / "plain.bmp", image)
    Image.fromarray(colour[..., ::-1]).convert("CMYK").save(tmp_path / "cmyk.jpg")
    files = sorted(path for path in tmp_path.iterdir())
    result = extract_files(files, tmp_path / "out", setting=SETTINGS, overlays=False)
    for row in result.frames:
        assert row.ok, (row.image, row.reason)
        assert row.length_mm == pytest.approx(30.0, abs=0.15), row.image


def two_rods(good):
    image = good.image.copy()
    other = frame(clamp_px=(200.0, 220.0), angle_deg=5.0).image
    return np.minimum(image, other)


@pytest.mark.parametrize("case", ["two rods", "no clamp", "empty clamp"])
def test_scenes_that_cannot_be_told_are_refused(tmp_path, good, case):
    place = {"clamp_px": (200.0, 420.0), "angle_deg": 5.0}
    image = {
        "two rods": lambda: two_rods(good),
        "no clamp": lambda: frame(**place, clamp_height_mm=0.0).image,
        "empty clamp": lambda: frame(
            **place, side_mm=0.001, clamp_height_mm=8.0
        ).image,
    }[case]()  # fmt: skip
    save(tmp_path / "x.png", image)
    out = tmp_path / "out"
    with pytest.raises(VisionError, match=r"^x\.png: "):
        extract_files([tmp_path / "x.png"], out, setting=SETTINGS)
    (row,) = read_frames(out / "frames.csv")
    assert row.status == "failed"
    assert row.reason
    assert not read_centrelines(out / "centrelines.csv")


@pytest.mark.parametrize("name", ["missing.png", "empty_folder"])
def test_nothing_to_read_is_one_sentence_and_no_output(tmp_path, name):
    (tmp_path / "empty_folder").mkdir()
    out = tmp_path / "out"
    with pytest.raises(VisionError, match=name):
        extract_files([tmp_path / name], out, setting=SETTINGS)
    assert not out.exists()


def test_resuming_measures_only_what_is_new(tmp_path, folder, good):
    out = tmp_path / "out"
    extract_files([folder], out, setting=SETTINGS, overlays=False)
    before = (out / "centrelines.csv").read_text()
    save(folder / "d.png", good.image)
    seen = []
    extract_files(
        [folder], out, setting=SETTINGS, overlays=False, resume=True,
        progress=lambda done, total: seen.append((done, total)),
    )  # fmt: skip
    assert seen == [(3, 4), (4, 4)]
    after = (out / "centrelines.csv").read_text()
    assert after.startswith(before)
    assert len(read_frames(out / "frames.csv")) == 4


def test_changed_file_or_setting_is_measured_again(tmp_path, folder, good):
    out = tmp_path / "out"

    def run(settings):
        seen = []
        extract_files(
            [folder], out, setting=settings, overlays=False, resume=True,
            progress=lambda done, _total: seen.append(done),
        )  # fmt: skip
        return len(seen) - 1

    assert run(SETTINGS) == 3
    assert run(SETTINGS) == 0
    save(folder / "b.png", good.image[:, ::-1])
    assert run(SETTINGS) == 1
    assert run(Setting(calibration=CALIBRATION, length_mm=30.0)) == 3
    (out / "extract.json").write_text('{"torn')
    assert run(SETTINGS) == 3


def test_interruption_leaves_whole_tables_to_resume(tmp_path, folder):
    out = tmp_path / "out"

    def stop(done, _total):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        extract_files([folder], out, setting=SETTINGS, overlays=False, progress=stop)
    assert [row.image for row in read_frames(out / "frames.csv")] == ["a.png", "b.png"]
    seen = []
    result = extract_files(
        [folder], out, setting=SETTINGS, overlays=False, resume=True,
        progress=lambda done, total: seen.append((done, total)),
    )  # fmt: skip
    assert seen == [(2, 3), (3, 3)]
    assert len(result.frames) == 3


def test_run_folder_means_its_images(tmp_path, good):
    run = tmp_path / "run"
    (run / "images").mkdir(parents=True)
    (run / "run.json").write_text('{"schema": 1, "plan": {}}')
    save(run / "images" / "step_000.png", good.image)
    save(run / "calib.png", good.image)
    result = extract_files([run], run, setting=SETTINGS)
    assert [row.image for row in result.frames] == ["step_000.png"]
    assert (run / "overlays" / "step_000.png").exists()


def test_same_names_in_two_folders_stay_apart(tmp_path, good):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        save(tmp_path / name / "x.png", good.image)
    result = extract_files(
        [tmp_path / "one", tmp_path / "two"], tmp_path / "out", setting=SETTINGS
    )
    assert [row.image for row in result.frames] == ["one_x.png", "two_x.png"]
    assert len(list((tmp_path / "out" / "overlays").iterdir())) == 2


def test_video_frames_are_numbered_and_measured(tmp_path):
    path = tmp_path / "bend.avi"
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, SIZE)
    angles = (20.0, 45.0, 70.0)
    for angle in angles:
        image = frame(angle=angle, clamp_px=(200.0, 520.0), angle_deg=0.0).image
        video.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    video.write(np.full((*SIZE[::-1], 3), 230, np.uint8))
    video.release()
    result = extract_files([path], tmp_path / "out", setting=SETTINGS)
    assert [row.image for row in result.frames] == [f"bend_{i:06d}" for i in range(4)]
    found = [row.tip_angle_deg for row in result.frames if row.ok]
    np.testing.assert_allclose(found, angles, atol=1.0)
    # Of a film every thirtieth frame is drawn, and what was refused.
    drawn = sorted(path.name for path in (tmp_path / "out" / "overlays").iterdir())
    assert drawn == ["bend_000000.png", "bend_000003.png"]


def test_file_that_is_no_video_is_refused(tmp_path):
    path = tmp_path / "x.avi"
    path.write_bytes(b"RIFF" + b"0" * 400)
    with pytest.raises(VisionError, match="cannot be opened"):
        extract_files([path], tmp_path / "out", setting=SETTINGS)


def test_a_broken_video_costs_its_row_and_not_the_batch(tmp_path, good):
    broken = tmp_path / "cut.mp4"
    broken.write_bytes(b"\0\0\0\x18ftypisom" + b"0" * 400)
    picture = save(tmp_path / "a.png", good.image)
    files = [broken, picture]
    result = extract_files(files, tmp_path / "out", setting=SETTINGS)
    first, second = result.frames
    assert (first.image, first.status) == ("cut.mp4", "failed")
    assert "cannot be opened" in first.reason
    assert second.ok


def test_bare_frame_divides_the_light_out(tmp_path, good):
    x = np.linspace(1.0, 0.25, SIZE[0])[None, :]
    stained = np.clip(good.image * x ** (1 / 2.2), 0, 255).astype(np.uint8)
    paper = np.clip(225.0 * np.ones_like(good.image) * x ** (1 / 2.2), 0, 255)
    save(tmp_path / "x.png", stained)
    bare = read_bare(save(tmp_path / "bare.png", paper.astype(np.uint8)))
    settings = Setting(calibration=CALIBRATION, bare=bare)
    result = extract_files([tmp_path / "x.png"], tmp_path / "out", setting=settings)
    np.testing.assert_allclose(
        result.frames[0].tip_mm, good.truth.centreline.tip_mm, atol=0.1
    )
    with pytest.raises(VisionError, match="dark"):
        read_bare(save(tmp_path / "dark.png", np.zeros_like(good.image)))
    other = Setting(
        bare=read_bare(save(tmp_path / "o.png", np.full((99, 99), 200, np.uint8)))
    )
    with pytest.raises(VisionError, match="differ in size"):
        extract_files([tmp_path / "x.png"], tmp_path / "out", setting=other)


@pytest.mark.parametrize(
    ("camera_height_mm", "rod_height_mm", "doubtful"),
    [(None, 0.0, False), (None, 0.9, True), (330.0, 6.0, False), (45.0, 2.0, True)],
)
def test_height_that_cannot_be_corrected_is_flagged(
    tmp_path, folder, camera_height_mm, rod_height_mm, doubtful
):
    calibration = scale_calibration(
        mm_per_px=1.0 / SCALE, image_size_px=SIZE, camera_height_mm=camera_height_mm
    )
    settings = Setting(calibration=calibration, rod_height_mm=rod_height_mm)
    (row,) = extract_files(
        [folder / "b.png"], tmp_path / "out", setting=settings, overlays=False
    ).frames
    assert ("height_doubtful" in row.flags) is doubtful


def test_edge_points_lie_half_a_width_from_the_axis(tmp_path, folder, good):
    path = tmp_path / "edges.csv"
    extract_files(
        [folder / "b.png"], tmp_path / "out", setting=SETTINGS, overlays=False,
        edges=path,
    )  # fmt: skip
    header, *rows = path.read_text().splitlines()
    assert header == "image,side,point,x_px,y_px,x_mm,y_mm"
    sides = {"left": 1.0, "right": -1.0}
    inside = []
    for row in rows:
        _, side, _, _, _, x, y = row.split(",")
        distance = signed_distance(
            np.array([[float(x), float(y)]]), good.truth.centreline.points_mm
        )
        inside.append(abs(distance[0] - 0.5 * sides[side]) < 0.03)
    assert len(rows) > 100
    assert np.mean(inside) > 0.95


def test_two_processes_give_the_same_tables(tmp_path, folder):
    extract_files([folder], tmp_path / "one", setting=SETTINGS)
    extract_files([folder], tmp_path / "two", setting=SETTINGS, workers=2)
    for name in ("frames.csv", "centrelines.csv", "extract.json"):
        one, two = ((tmp_path / d / name).read_text() for d in ("one", "two"))
        assert one == two
    state = json.loads((tmp_path / "two" / "extract.json").read_text())
    assert set(state["images"]) == {"a.png", "b.png", "c.png"}


def test_a_dying_worker_does_not_lose_the_batch(tmp_path, folder, monkeypatch):
    class Dying:
        def __init__(self, *_args, **_options):
            pass

        def map(self, work, todo, chunksize):
            raise BrokenProcessPool("a worker was killed")

        def shutdown(self, **_options):
            pass

    monkeypatch.setattr("magbend.vision.batch.run.ProcessPoolExecutor", Dying)
    result = extract_files([folder], tmp_path / "out", setting=SETTINGS, workers=2)
    assert [row.status for row in result.frames] == ["failed", "ok", "ok"]


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGKILL")
def test_workers_end_with_a_batch_that_is_killed() -> None:
    script = Path(__file__).with_name("batch_alone.py")
    with subprocess.Popen(
        [sys.executable, str(script)], text=True, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert [process.stdout.readline() for _ in "ab"] == ["busy\n"] * 2
        process.kill()
        # Until nobody is left who could write:
        process.communicate(timeout=20.0)


def test_overlay_of_a_large_photograph_is_made_smaller():
    large = Photo(grey=np.full((2000, 4800), 0.7, dtype=np.float32))
    shown = draw_overlay(large, failure("no_rod", "nothing is long and thin"))
    assert shown.shape[1:] == (2400, 3)
    assert 1000 < shown.shape[0] < 1200


def test_the_words_of_an_overlay_hide_nothing_of_the_photograph():
    grey = np.full((900, 1200), 0.7, dtype=np.float32)
    grey[::7] = 0.1  # a rod may lie anywhere, the border of the picture included
    photo = Photo(grey=grey)
    silent, told = (
        draw_overlay(photo, failure("no_rod", why)) for why in ("", "lay plain paper")
    )
    np.testing.assert_array_equal(silent[:900], told[:900])
    assert told[:, 600][:899:7].max() < 100


def test_caption_of_a_tiny_picture_is_whole(monkeypatch):
    written = []
    monkeypatch.setattr(cv2, "putText", lambda *at: written.append(at))
    reason = "the measured axis is 12 px long, but the dark thing it belongs to 300 px"
    tiny = Photo(grey=np.full((90, 120), 0.7, dtype=np.float32))
    shown = draw_overlay(tiny, failure("inconsistent", reason))
    assert reason in " ".join(text for _, text, *_ in written)
    for _, text, (x, y), font, size, _, thickness, _ in written:
        (width, _), _ = cv2.getTextSize(text, font, size, thickness)
        assert x + width <= shown.shape[1]
        assert y <= shown.shape[0]


def test_overlay_draws_the_axis_where_the_rod_is(tmp_path, good):
    from magbend.vision.extraction.extract import extract

    photo = read_photo(save(tmp_path / "x.png", good.image))
    found = extract(photo, CALIBRATION)
    picture = draw_overlay(photo, found).astype(int)
    orange = (picture[..., 2] - picture[..., 0]) > 120
    y, x = np.nonzero(orange)
    distance = signed_distance(
        np.column_stack([x, y]).astype(float), good.truth.points_px
    )
    assert len(x) > 300
    assert np.abs(distance).max() < 3.0


def test_workers_keep_to_one_core_and_this_process_to_its_own_settings(monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "7")
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    with _single_threaded_children():
        assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
        assert os.environ["OMP_NUM_THREADS"] == "1"
    assert os.environ["OPENBLAS_NUM_THREADS"] == "7"
    assert "OMP_NUM_THREADS" not in os.environ
