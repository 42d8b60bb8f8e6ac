"""A file of JSON is called JSON."""

from __future__ import annotations

from pathlib import Path

import pytest

from magbend.core.errors import ConfigError
from magbend.core.specimen_file import read_specimen


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[1, 2]", "one JSON object"),
        ('["a"]', "one JSON object"),
        ("[1,", "valid JSON"),
    ],
)
def test_a_list_is_called_json(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "rod.json"
    path.write_text(text)
    with pytest.raises(ConfigError, match=sentence):
        read_specimen(path)
