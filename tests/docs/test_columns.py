"""Every column of the tables that photographs become is told in the docs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from magbend.vision.batch.tables import CENTRELINE_HEADER, FRAME_HEADER

TEXT = (Path(__file__).parents[2] / "docs" / "vision.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("header", [CENTRELINE_HEADER, FRAME_HEADER])
def test_every_column_is_told(header):
    assert set(header) <= set(re.findall(r"`(\w+)`", TEXT))
