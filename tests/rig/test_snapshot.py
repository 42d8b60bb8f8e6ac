"""A picture with the bench camera, as a run takes it; and what is said beside a run."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from magbend.cli.main import app
from magbend.core.errors import ConfigError, StoreError
from magbend.rig.bench.template import write_templates
from magbend.rig.camera.config import CameraConfig
from magbend.rig.camera.lock import lock
from magbend.rig.camera.protocol import sharpness

from .conftest import render


@pytest.fixture(autouse=True)
def bench_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MAGBEND_RUNTIME_DIR", str(tmp_path))
    monkeypatch.chdir(tmp_path)


def _files(tmp_path, **keys: str) -> None:
    write_templates(tmp_path)
    (tmp_path / "photos").mkdir()
    for number in range(4):
        cv2.imwrite(str(tmp_path / f"photos/{number}.png"), render(60.0, number))
    rig = tmp_path / "rig.toml"
    text = rig.read_text().replace('backend = "auto"', 'backend = "folder"')
    rig.write_text(text.replace("source = 0", 'source = "photos"'))


def _invoke(*words: str):
    return CliRunner().invoke(app, ["rig", "snapshot", *words])


def test_the_bench_camera_takes_a_picture_and_says_how_it_is(tmp_path):
    _files(tmp_path)
    result = _invoke("--out", "board.png", "--frames", "1", "--json")
    assert result.exit_code == 0, result.output
    data = json.loads(result.stdout)
    image = cv2.imread("board.png", cv2.IMREAD_UNCHANGED)
    assert (data["width_px"], data["height_px"]) == image.shape[1::-1]
    assert data["flags"] == []
    assert 0.5 < data["brightness"] < 1.0
    again = _invoke("--out", "board.png")
    assert isinstance(again.exception, StoreError)


def test_the_computed_bench_has_no_camera_of_its_own(tmp_path):
    write_templates(tmp_path, twin=True)
    assert isinstance(_invoke("--out", "x.png").exception, ConfigError)


def test_sharpness_peaks_in_focus():
    sharp = render(60.0, 1.0)
    blurred = cv2.GaussianBlur(sharp, (0, 0), 2.0)
    assert sharpness(sharp) > 1.5 * sharpness(blurred)
    assert sharpness(np.full((8, 8, 3), 7, np.uint8)) == 0.0


def test_focus_is_locked_with_autofocus_off():
    asked: list[tuple[int, float]] = []

    class Camera:
        def set(self, prop: int, value: float) -> bool:
            asked.append((prop, value))
            return True

        def get(self, prop: int) -> float:
            return next((v for p, v in reversed(asked) if p == prop), 0.0)

    settings = lock(Camera(), CameraConfig(focus=30.0))
    assert asked == [(cv2.CAP_PROP_AUTOFOCUS, 0.0), (cv2.CAP_PROP_FOCUS, 30.0)]
    assert settings["focus"]["read_back"] == 30.0
    assert lock(Camera(), CameraConfig()) == {}


def test_every_line_of_the_computed_bench_says_that_it_is_one(tmp_path):
    write_templates(tmp_path, twin=True)
    plan = tmp_path / "plan.toml"
    plan.write_text(plan.read_text().replace("[70.0, 60.0, 50.0]", "[70.0]"))
    result = CliRunner().invoke(app, ["rig", "run", "plan.toml", "--out", "run"])
    assert result.exit_code == 0, result.output
    lines = [line for line in result.stderr.splitlines() if "step " in line]
    assert lines
    assert all(line.startswith("twin: ") for line in lines)
    assert "twin: this is the computed bench" in result.stderr
