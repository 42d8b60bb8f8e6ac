"""The committed drawings say what ``docs/drawings.py`` draws."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"


def words(drawing: Path) -> list[str]:
    return re.findall(r"<!-- (.*?) -->", drawing.read_text(encoding="utf-8"))


def test_the_committed_drawings_are_those_of_the_script(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("drawings", DOCS / "drawings.py")
    assert spec is not None
    assert spec.loader is not None
    drawings = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(drawings)
    for made in drawings.all_drawings(tmp_path):
        kept = DOCS / "pictures" / made.name
        assert len(words(made)) > 5
        assert words(kept) == words(made), "run make docs and commit docs/pictures"
