"""What the commands of vision know of a run from its files."""

from __future__ import annotations

from pathlib import Path

import pytest

from magbend.cli.vision_setting import specimen_of
from magbend.panel.setup.steps import MARKS_FILE, marks


@pytest.mark.parametrize("text", ["[" * 100_000, "[]", '{"specimen": 3}', "\udcff"])
def test_a_file_of_others_that_tells_nothing_is_no_crash(
    text: str, tmp_path: Path
) -> None:
    for name in ("run.json", MARKS_FILE):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(text.encode("utf-8", "surrogateescape"))
    assert specimen_of(None, tmp_path) is None
    assert specimen_of(None, tmp_path / "none") is None
    assert marks(tmp_path).get("home") is None
