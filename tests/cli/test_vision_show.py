"""What is printed of photographs and films."""

from __future__ import annotations

from pathlib import Path

from magbend.cli.vision_show import tell_frames
from magbend.vision import BatchResult, FrameRow


def told(frames, capsys):
    tell_frames(BatchResult(out=Path("out"), frames=tuple(frames)), json_output=False)
    return capsys.readouterr().err.splitlines()


def test_frames_in_a_row_with_one_doubt_are_told_in_one_line(capsys):
    frames = [
        FrameRow(image=f"film_{k:06}", status="ok", flags=("shadow",) if k != 5 else ())
        for k in range(8)
    ]
    frames += [FrameRow(image="film_000008", status="failed", reason="no rod")]
    assert told(frames, capsys) == [
        "film_000000 to film_000004 (5): shadow",
        "film_000006: shadow",
        "film_000007: shadow",
        "film_000008: failed: no rod",
    ]
