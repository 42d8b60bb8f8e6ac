"""A rod that a person points at: measured as any other, and said to be pointed at."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from magbend.cli.main import app
from magbend.core.derived import check_derived
from magbend.core.errors import InputError
from magbend.vision import (
    Hints,
    Setting,
    as_photo,
    extract,
    measure_hinted,
    read_frames,
    rescue,
    write_calibration,
)
from magbend.vision.picture.srgb import encode_srgb
from magbend.vision.picture.turn import turned, turned_points
from magbend.vision.synthetic import Light, curve, draw

SIZE = (900, 640)


@pytest.fixture(scope="module")
def frame():
    return draw(
        curve("arc", angle_deg=50.0), np.random.default_rng(4), px_per_mm=15.0,
        size_px=SIZE, light=Light(), clamp_px=(200.0, 420.0), angle_deg=5.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def plain(frame):
    found = extract(as_photo(frame.image), frame.truth.calibration)
    assert found.ok
    return found


def near(point, by):
    return float(point[0] + by[0]), float(point[1] + by[1])


def hints_of(found, **more) -> Hints:
    return Hints(
        clamp_px=near(found.clamp_px, (4, -3)), tip_px=near(found.tip_px, (-3, 4)),
        **more,
    )  # fmt: skip


def test_a_rod_is_measured_as_without_hints(frame, plain):
    setting = Setting(calibration=frame.truth.calibration)
    found = measure_hinted(as_photo(frame.image), setting, hints_of(plain))
    assert found.ok
    assert found.flags[-1] == "hinted"
    assert found.length_mm == pytest.approx(plain.length_mm, abs=0.02)
    assert found.tip_mm == pytest.approx(plain.tip_mm, abs=0.05)


def test_of_two_rods_the_one_that_is_meant(frame, plain):
    photo = as_photo(np.minimum(frame.image, frame.image[::-1]))  # two in two clamps
    setting = Setting(calibration=frame.truth.calibration)
    assert not extract(photo, frame.truth.calibration).ok
    found = measure_hinted(photo, setting, hints_of(plain))
    assert found.tip_mm == pytest.approx(plain.tip_mm, abs=0.05)
    assert "other_rod" in found.flags  # it lies across


def test_a_ruler_gives_the_scale(frame, plain):
    scale = plain.length_px / plain.length_mm
    ruler = ((100.0, 600.0), (100.0 + 20.0 * scale, 600.0), 20.0)
    found = measure_hinted(
        as_photo(frame.image), Setting(), hints_of(plain, ruler=ruler)
    )
    assert found.length_mm == pytest.approx(plain.length_mm, rel=0.005)
    bare = measure_hinted(as_photo(frame.image), Setting(), hints_of(plain))
    assert np.isnan(bare.length_mm)
    assert bare.length_px == pytest.approx(plain.length_px, rel=0.002)


def test_where_no_rod_is_nothing_is_made_up(frame):
    hints = Hints(clamp_px=(60.0, 40.0), tip_px=(400.0, 60.0))
    found = measure_hinted(as_photo(frame.image), Setting(), hints)
    assert not found.ok
    assert found.reason


@pytest.mark.parametrize(
    ("clamp", "tip", "words"),
    [
        ((-1.0, 10.0), (300.0, 300.0), "clamp must lie in the photograph"),
        ((10.0, 10.0), (300.0, 900.0), "tip must lie in the photograph"),
        ((10.0, 10.0), (float("nan"), 20.0), "tip must lie in the photograph"),
        ((10.0, 10.0), (12.0, 12.0), "16 px apart"),
    ],
)
def test_points_that_cannot_be_are_refused(frame, clamp, tip, words):
    with pytest.raises(InputError, match=words):
        measure_hinted(
            as_photo(frame.image), Setting(), Hints(clamp_px=clamp, tip_px=tip)
        )


@pytest.mark.parametrize("orientation", range(1, 9))
def test_points_turn_with_their_photograph(orientation):
    grey = np.zeros((40, 64), np.float32)
    grey[11, 50] = 1.0
    photo = as_photo(grey)
    seen = turned(photo, orientation)
    ((x, y),) = turned_points(np.array([[50.0, 11.0]]), photo, orientation)
    assert seen.grey[int(y), int(x)] == 1.0
    assert turned_points(np.array([[x, y]]), seen, 1)[0].tolist() == [50.0, 11.0]


def test_a_refused_photograph_is_rescued_into_its_tables(frame, plain, tmp_path):
    for name in ("a.png", "b.png"):
        cv2.imwrite(str(tmp_path / name), encode_srgb(as_photo(frame.image).grey))
    write_calibration(frame.truth.calibration, tmp_path / "c.json")
    setting = Setting(calibration=frame.truth.calibration)
    rescue(tmp_path / "a.png", tmp_path / "out", setting, hints_of(plain))
    answer = CliRunner().invoke(
        app,
        ["vision", "points", str(tmp_path / "b.png"), "--clamp",
         f"{plain.clamp_px[0]:.0f},{plain.clamp_px[1]:.0f}", "--tip",
         f"{plain.tip_px[0]:.0f},{plain.tip_px[1]:.0f}", "--calibration",
         str(tmp_path / "c.json"), "--out", str(tmp_path / "out"), "--json"],
    )  # fmt: skip
    assert answer.exit_code == 0, answer.output
    assert json.loads(answer.stdout)["flags"][-1] == "hinted"
    first, second = read_frames(tmp_path / "out" / "frames.csv")
    assert (first.image, second.image) == ("a.png", "b.png")
    assert "hinted" in first.flags
    assert first.hints.startswith("clamp ")
    assert (tmp_path / "out" / "overlays" / "b.png").is_file()
    rescue(tmp_path / "b.png", tmp_path / "out", setting, hints_of(plain))
    assert len(read_frames(tmp_path / "out" / "frames.csv")) == 2
    away = Hints(clamp_px=(700.0, 40.0), tip_px=(860.0, 60.0))
    assert not rescue(tmp_path / "b.png", tmp_path / "out", setting, away).ok
    assert all(row.ok for row in read_frames(tmp_path / "out" / "frames.csv"))
    noted = {one.name: one.status for one in check_derived(tmp_path / "out")}
    assert noted["frames.csv"] == noted["overlays/b.png"] == "good"


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--clamp", "12", "--clamp must be X,Y"),
        ("--clamp", "a,b", "--clamp must be X,Y"),
        ("--ruler", "1,2 3,4", "--ruler must be"),
        ("--ruler", "1,2 3,4 -5", "length in mm"),
    ],
)
def test_bad_options_are_one_sentence(option, value, words, tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), np.full((100, 100), 200, np.uint8))
    given = {"--clamp": "10,10", "--tip": "80,80", option: value}
    options = [part for pair in given.items() for part in pair]
    answer = CliRunner().invoke(
        app, ["vision", "points", str(tmp_path / "a.png"), *options]
    )
    assert isinstance(answer.exception, InputError)
    assert words in str(answer.exception)
