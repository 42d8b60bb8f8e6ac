"""What is printed of photographs and films."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from magbend.cli.vision_show import (
    tell_calibration,
    tell_frames,
    tell_ringing,
    tell_tag,
)
from magbend.vision import BatchResult, FrameRow, scale_calibration
from magbend.vision.batch.tag_place import TagPlace
from magbend.vision.camera.clamp_tag import ClampTag
from magbend.vision.extraction.ring import Ringing

DOUBTS = [
    "direction_doubtful", "clamp_doubtful", "rough_edges", "ragged_tip", "overexposed",
    "root_hidden", "clamp_at_border", "height_doubtful", "tip_goes_on",
    "clamp_lines_differ", "other_rod", "width_mismatch", "colour_mismatch",
    "width_uneven",
]  # fmt: skip


def told(frames, capsys):
    tell_frames(BatchResult(out=Path("out"), frames=tuple(frames)), json_output=False)
    return capsys.readouterr().err.splitlines()


def test_frames_in_a_row_with_one_doubt_are_told_in_one_line(capsys):
    frames = [
        FrameRow(image=f"film_{k:06}", status="ok", flags=("shadow",) if k != 5 else ())
        for k in range(8)
    ]
    frames += [FrameRow(image="film_000008", status="failed", reason="no rod")]
    assert told(frames, capsys)[:-1] == [
        "film_000000 to film_000004 (5): shadow",
        "film_000006: shadow",
        "film_000007: shadow",
        "film_000008: failed: no rod",
    ]


def test_a_refusal_names_the_way_to_measure_it_all_the_same(capsys):
    lost = FrameRow(image="a", status="failed", reason="no rod")
    assert "magbend vision points" in told([lost], capsys)[-1]
    assert not told([FrameRow(image="a", status="ok")], capsys)


@pytest.mark.parametrize("flag", DOUBTS)
def test_every_doubt_is_explained_on_the_terminal(flag, capsys):
    first, *rest = told([FrameRow(image="a", status="ok", flags=(flag,))], capsys)
    assert first == f"a: {flag}"
    assert rest[0].startswith(f"{flag} (1 photograph): ")


def test_pixels_without_a_calibration_are_explained_once(capsys):
    frames = [FrameRow(image=k, status="ok", flags=("uncalibrated",)) for k in "ab"]
    (line,) = told(frames, capsys)
    assert line.startswith("uncalibrated (2 photographs): ")
    assert "--calibration" in line


def test_nothing_is_told_to_be_known_without_a_doubt(capsys):
    camera = scale_calibration(
        mm_per_px=0.05, image_size_px=(900, 600), camera_height_mm=330.0
    )
    camera = replace(camera, camera_height_sd_mm=0.3)  # as by nine views of a board
    tell_calibration(camera, {"mm_per_px": 0.05}, Path("c.json"))
    assert "camera 330.00 +- 0.30 mm" in capsys.readouterr().out
    found = Ringing(
        frequency_Hz=9.0, frequency_sd_Hz=0.00031, damping_ratio=0.03,
        damping_ratio_sd=2e-5, amplitude_mm=7.0, settle_s=2.9612, settle_sd_s=0.0041,
        rest_mm=0.0, residual_mm=0.001, first_s=0.275, frames=207,
    )  # fmt: skip
    tell_ringing(found, 0.05)
    words = capsys.readouterr().out
    assert "9.00000 +- 0.00031 Hz, damping ratio 0.030000 +- 0.000020" in words
    assert "2.9612 +- 0.0041 s later" in words


def test_a_rod_below_and_right_of_its_tag_is_told_so(capsys):
    tag = ClampTag(
        root_x_mm=-4.3, root_y_mm=-5.7, angle_deg=-115.0, place_sd_mm=0.01,
        angle_sd_deg=0.03,
    )  # fmt: skip
    tell_tag(TagPlace(tag=tag, used=("a.png",), left_out={}), Path("c.json"))
    words = capsys.readouterr().out
    assert "4.300 mm below and 5.700 mm right of its middle" in words
    assert "(1 photograph)" in words
