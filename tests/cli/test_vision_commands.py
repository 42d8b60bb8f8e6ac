"""``magbend vision``: from a board's photograph to tables, and every wrong turn."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from magbend.vision import read_calibration, write_calibration
from magbend.vision.batch.tables import read_centrelines, read_frames, to_centreline
from magbend.vision.synthetic.scoring import signed_distance

FIXTURES = Path(__file__).parents[2] / "fixtures" / "vision"
RENDERED = Path(__file__).parents[2] / "examples" / "photographs"
BOARD = RENDERED / "calib_D.jpg"
SCALED = ["calibrate", BOARD, "--out", "c.json", "--scale-mm-per-px"]


@pytest.fixture(scope="module")
def calibration(tmp_path_factory) -> Path:
    from magbend.vision.camera.board import Board
    from magbend.vision.camera.calibrate import calibrate
    from magbend.vision.picture.photo import read_photo

    path = tmp_path_factory.mktemp("camera") / "calibration.json"
    write_calibration(calibrate(read_photo(BOARD), board=Board()), path)
    return path


def test_board_is_written(magbend, tmp_path):
    code, out, _ = magbend("vision", "board", "--out", tmp_path / "new" / "board.pdf")
    assert code == 0
    assert "70 x 50 mm" in out
    assert (tmp_path / "new" / "board.pdf").read_bytes().startswith(b"%PDF")


def test_calibrate_tells_and_writes(magbend, tmp_path):
    path = tmp_path / "calibration.json"
    code, out, _ = magbend(
        "vision", "calibrate", BOARD, "--out", path, "--rod-height-mm", 0.9
    )
    assert code == 0
    assert "24 corners" in out
    assert "+-" in out
    camera = read_calibration(path)
    assert camera.rod_height_mm == 0.9
    assert camera.mm_per_px((800.0, 600.0), height_mm=0.0) == pytest.approx(
        0.04879, rel=1e-3
    )


def test_calibrate_as_json(magbend, tmp_path):
    code, out, _ = magbend(
        "vision", "calibrate", BOARD, "--out", tmp_path / "c.json", "--json",
        "--camera-height-mm", 330,
    )  # fmt: skip
    facts = json.loads(out)
    assert code == 0
    assert facts["rod_height_mm"] is None
    assert facts["camera_height_source"] == "given"
    assert facts["views"][0]["used"] is True


def test_calibrate_from_a_known_length(magbend, tmp_path):
    path = tmp_path / "c.json"
    code, out, _ = magbend(
        "vision", "calibrate", RENDERED / "dev_10.jpg", "--out", path,
        "--known-length", "205,900 1438,900 60",
    )  # fmt: skip
    assert code == 0
    assert "no correction for height" in out
    scale = read_calibration(path).mm_per_px((800.0, 600.0), height_mm=0.0)
    assert scale == pytest.approx(60.0 / 1233.0, rel=1e-6)


@pytest.mark.parametrize("stem", ["dev_03", "dev_05", "dev_07", "dev_10", "dev_12"])
def test_rendered_photograph_is_measured_in_mm(magbend, tmp_path, calibration, stem):
    """The promise of the first issue: under 0.10 mm RMS, clamp-aligned, every frame."""
    truth = json.loads((RENDERED / f"{stem}.json").read_text())
    code, _, _ = magbend(
        "vision", "extract", RENDERED / f"{stem}.jpg", "--calibration", calibration,
        "--rod-height-mm", truth["axis_height_mm"], "--out", tmp_path, "--no-overlays",
    )  # fmt: skip
    assert code == 0
    (row,) = read_frames(tmp_path / "frames.csv")
    line = to_centreline(read_centrelines(tmp_path / "centrelines.csv")[row.image])
    distance = signed_distance(line.points_mm, np.array(truth["centreline_mm"]))
    assert np.sqrt(np.mean(distance**2)) < 0.10
    assert row.width_mm == pytest.approx(truth["side_mm"], abs=0.02)
    assert row.length_mm == pytest.approx(truth["length_mm"], abs=0.10)


def test_board_photograph_is_refused_as_a_bench_photograph(
    magbend, tmp_path, calibration
):
    code, _, messages = magbend(
        "vision", "extract", BOARD, "--calibration", calibration, "--out", tmp_path
    )
    assert code == 1
    assert "magbend: calib_D.jpg: " in messages
    (row,) = read_frames(tmp_path / "frames.csv")
    assert row.status == "failed"
    assert row.reason
    assert (tmp_path / "overlays" / "calib_D.png").exists()


def test_one_refusal_among_good_ones_is_no_failure(magbend, tmp_path, calibration):
    code, out, messages = magbend(
        "vision", "extract", BOARD, RENDERED / "dev_12.jpg", "--calibration",
        calibration, "--out", tmp_path, "--no-overlays", "--json",
    )  # fmt: skip
    assert code == 0
    facts = json.loads(out)
    assert (facts["measured"], facts["failed"]) == (1, 1)
    assert [frame["status"] for frame in facts["frames"]] == ["failed", "ok"]
    assert facts["frames"][0]["length_mm"] is None
    assert "photographs" in messages


@pytest.mark.parametrize("name", ["acrylic_20_1.jpg", "acrylic_25_1.jpg"])
def test_yarn_is_measured_light_on_dark(magbend, tmp_path, name):
    code, _, messages = magbend(
        "vision", "extract", FIXTURES / "yarn" / name, "--out", tmp_path
    )
    assert code == 0
    assert "no calibration was given" in messages
    (row,) = read_frames(tmp_path / "frames.csv")
    assert "uncalibrated" in row.flags
    assert row.clamp_px[0] < 60.0  # the yarn leaves the left border ...
    assert row.tip_px[1] > row.clamp_px[1] + 1000.0  # ... and hangs down


def test_figure_and_edges_are_written(magbend, tmp_path, calibration):
    code, _, _ = magbend(
        "vision", "extract", RENDERED / "dev_12.jpg", "--calibration", calibration,
        "--out", tmp_path, "--figure-steps", tmp_path / "f" / "steps.pdf",
        "--edges", tmp_path / "e" / "edges.csv",
    )  # fmt: skip
    assert code == 0
    assert (tmp_path / "f" / "steps.pdf").read_bytes().startswith(b"%PDF")
    assert len((tmp_path / "e" / "edges.csv").read_text().splitlines()) > 100


@pytest.mark.parametrize(
    "words",
    [
        ["calibrate", "photo.png", "--scale-mm-per-px", "0.05", "--out", "photo.png"],
        ["calibrate", "other.png", "--scale-mm-per-px", "0.05", "--out", "photo.png"],
        ["extract", "photo.png", "--edges", "photo.png"],
        ["extract", "photo.png", "--edges", "calibration.json"],
        ["extract", "photo.png", "--edges", "measured/frames.csv"],
        ["extract", "photo.png", "--figure-steps", "photo.png"],
        ["extract", "photo.png", "--bare", "other.png", "--figure-steps", "other.png"],
    ],
)
def test_no_output_takes_the_place_of_what_is_read_or_of_another_result(
    magbend, tmp_path, monkeypatch, calibration, words
):
    monkeypatch.chdir(tmp_path)
    assert magbend("vision", "extract", BOARD, "--no-overlays")[0] == 1
    for name in ("photo.png", "other.png"):
        cv2.imwrite(name, np.full((64, 64, 3), 200, np.uint8))
    Path("calibration.json").write_bytes(calibration.read_bytes())
    before = {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    frames = Path("measured/frames.csv").read_text()
    code, _, messages = magbend("vision", *words)
    assert code == 1
    assert "give another name" in messages
    assert all(path.read_bytes() == data for path, data in before.items())
    assert Path("measured/frames.csv").read_text() == frames


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (["board"], 2, "Missing option"),
        (["board", "--out", "x.doc"], 1, ".pdf or .png"),
        (["board", "--out", "x.pdf", "--board", "seven"], 1, "such as 7x5"),
        (["board", "--out", "x.pdf", "--board", "7x4"], 1, "odd number of rows"),
        (["calibrate", "none.png", "--out", "c.json"], 1, "none.png"),
        (["calibrate", BOARD, "--out", "c.json", "--board", "5x5"], 1, "5 markers"),
        (["calibrate", BOARD, "--out", "c", "--print-scale", "2"], 1, "print_scale"),
        (["calibrate", BOARD, "--out", "c.json", "--focal-px", "-3"], 1, "focal_px"),
        (["calibrate", BOARD, "--out", "c.json", "--known-length", "1 2"], 1, "X1,Y1"),
        (["calibrate", BOARD, "--out", "c.json", "--scale-mm-per-px", "0"], 1, "above"),
        ([*SCALED, "0.05", "--print-scale", "1.01"], 1, "--print-scale: only a"),
        ([*SCALED, "0.05", "--focal-px", "900"], 1, "--focal-px: only a"),
        ([*SCALED, "20"], 1, "in px/mm? then write 0.05"),
        (["extract", "none.png"], 1, "none.png"),
        (["extract", BOARD, "--calibration", "none.json"], 1, "none.json"),
        (["extract", BOARD, "--joints-mm", "a,b"], 1, "--joints-mm"),
        (["extract", BOARD, "--joints-mm", "1e9,10"], 1, "rising"),
        (["extract", BOARD, "--joints-mm", "9,9"], 1, "rising"),
        (["extract", BOARD, "--joints-mm", "9,40", "--length-mm", "30"], 1, "within"),
        (["extract", BOARD, "--joints-mm", "9,20"], 1, "give --calibration"),
        (["extract", BOARD, "--rod-height-mm", "nan"], 1, "--rod-height-mm"),
        (["extract", BOARD, "--length-mm", "-3"], 1, "--length-mm must be above zero"),
        (["extract", BOARD, "--length-mm", "0"], 1, "--length-mm must be above zero"),
        (["extract", BOARD, "--figure-steps", "x.doc"], 1, ".pdf"),
        (["extract", BOARD, "--bare", "none.png"], 1, "none.png"),
        (["extract"], 2, "Missing argument"),
        (["extract", BOARD, "--wrong"], 2, "No such option"),
    ],
)  # fmt: skip
def test_mistakes_end_in_one_sentence(
    magbend, tmp_path, monkeypatch, words, code, sentence
):
    monkeypatch.chdir(tmp_path)
    got, _, messages = magbend("vision", *words)
    assert got == code
    assert sentence in messages
    if code == 1:
        assert len(messages.strip().splitlines()) == 1
    assert not list(tmp_path.glob("*")), "nothing may be left behind"


def test_calibration_of_another_camera_is_named(magbend, tmp_path, calibration):
    yarn = FIXTURES / "yarn" / "acrylic_20_1.jpg"
    code, _, messages = magbend(
        "vision", "extract", yarn, "--calibration", calibration, "--out", tmp_path
    )
    assert code == 1
    assert "1600 x 1200" in messages
    (row,) = read_frames(tmp_path / "frames.csv")
    assert "calibration_mismatch" in row.flags


def test_decoders_of_damaged_files_keep_quiet(calibration, tmp_path):
    cut = tmp_path / "cut.tif"
    cut.write_bytes(b"II*\0" + (8).to_bytes(4, "little") + b"\x09\0" * 20)
    words = ["vision", "extract", str(cut), "--calibration", str(calibration)]
    program = (
        "import sys; from magbend.cli.main import main\n"
        f"sys.argv = ['magbend', *{[*words, '--out', str(tmp_path / 'out')]!r}]\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("magbend: cut.tif: ")
    assert "TIFF_" not in done.stderr


def test_a_rod_above_the_camera_is_refused(magbend, calibration, tmp_path):
    code, _, messages = magbend(
        "vision", "extract", RENDERED / "dev_03.jpg", "--calibration", calibration,
        "--rod-height-mm", 400, "--out", tmp_path / "out",
    )  # fmt: skip
    assert code == 1
    assert "must be below the camera" in messages
    assert not (tmp_path / "out").exists()


def test_a_specimen_is_known_from_its_file_or_from_the_run(
    magbend, calibration, tmp_path
):
    rod = FIXTURES.parent / "specimens" / "gmc2.toml"
    photo = RENDERED / "dev_05.jpg"
    code, _, messages = magbend(
        "vision", "extract", photo, "--calibration", calibration, "--specimen", rod,
        "--out", tmp_path / "given",
    )  # fmt: skip
    assert code == 0
    assert "length_mismatch" in messages  # 28.5 mm long, and 30 by its file
    run = tmp_path / "run"
    (run / "images").mkdir(parents=True)
    picture = cv2.imread(str(photo))
    assert cv2.imwrite(str(run / "images" / "step_000.png"), picture)
    specimen = tomllib.loads(rod.read_text(encoding="utf-8"))
    record = {"schema": 1, "plan": {}, "specimen": specimen}
    (run / "run.json").write_text(json.dumps(record))
    code, _, messages = magbend("vision", "extract", run, "--calibration", calibration)
    assert code == 0
    assert "length_mismatch" in messages
    (row,) = read_frames(run / "frames.csv")
    assert row.width_sd_mm < 0.02
    assert "height_assumed" in row.flags
    assert "--rod-height-mm" in messages
