"""What is printed of photographs and films."""

from __future__ import annotations

from pathlib import Path

import pytest

from magbend.cli.vision_show import tell_frames
from magbend.vision import BatchResult, FrameRow

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
