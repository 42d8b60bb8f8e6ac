"""Lines of progress: the time left is judged from the items alone."""

from __future__ import annotations

import pytest

from magbend.cli import console


def test_what_came_before_the_first_item_is_not_in_the_time_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = 0.0
    monkeypatch.setattr(console.time, "monotonic", lambda: now)
    with console.progress("package", plain=True) as tell:
        now = 60.0
        tell(0, 31)
        now = 75.0
        tell(1, 31)
    assert capsys.readouterr().err.splitlines() == [
        "package: 0/31, 60 s",
        "package: 1/31, 75 s, 450 s left",
    ]
